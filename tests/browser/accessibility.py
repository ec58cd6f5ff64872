"""What axe finds in a page; on contrast it is asked once for all texts that look the same.

The contrast of a text follows from the styles of its element and of those around it. axe looks at each element anew,
for seconds on a page of some thousand.
"""

from __future__ import annotations

from typing import Any, Final

import pytest

CONTRAST: Final = "color-contrast"
"""Rule of axe."""

NOTE_STYLES: Final = """() => {
  const properties = ["color", "backgroundColor", "backgroundImage", "opacity", "filter", "mixBlendMode", "fontSize",
    "fontWeight", "textShadow", "webkitTextFillColor", "webkitTextStrokeWidth", "display", "visibility", "position",
    "overflow", "clip", "clipPath", "zIndex"];
  window.looks = window.looks || new Map();
  const numbers = new Map();
  const note = (each, around) => {
    const style = getComputedStyle(each);
    const own = [around, each.checkVisibility(), ...properties.map((name) => style[name])].join("|");
    if (!numbers.has(own)) numbers.set(own, numbers.size);
    window.looks.set(each, `${window.looks.get(each)},${numbers.get(own)}`);
    for (const child of each.children) note(child, numbers.get(own));
  };
  note(document.documentElement, "");
}"""
"""Number the looks of every element: its style and the look of what is around it. Schemes follow one another."""

LEAVE_ONE_OF_EACH: Final = """() => {
  const seen = new Set(), others = [];
  for (const [each, look] of window.looks) {
    const texts = Array.from(each.childNodes).filter((one) => one.nodeType === Node.TEXT_NODE && one.data.trim());
    if (!texts.length || !each.checkVisibility()) continue;
    if (seen.has(look)) others.push(...texts);
    seen.add(look);
  }
  others.forEach((one) => { one.data = ""; });
  return seen.size;
}"""
"""Empty all texts that are seen but the first of each look; return the number of those left.

What is seen is asked before the first text is emptied: afterwards the page would be laid out anew for each answer.
"""


def violations(page: Any, options: dict[str, Any], part: str | None = None) -> list[dict[str, Any]]:
    """Return what axe objects to in a page, or in a part of it; axe is loaded unless it is there."""
    sync_playwright = pytest.importorskip("axe_playwright_python.sync_playwright")
    there = page.evaluate("'axe' in window")
    axe = sync_playwright.Axe("undefined") if there else sync_playwright.Axe()
    return list(axe.run(page, part, options=options | {"resultTypes": ["violations"]}).response["violations"])


def faint_texts(page: Any, schemes: tuple[str, ...] = ("light", "dark")) -> list[str]:
    """Return the elements with too little contrast in any colour scheme; other texts of the page are gone then."""
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        page.evaluate(NOTE_STYLES)
    assert page.evaluate(LEAVE_ONE_OF_EACH) > 1
    found = list[str]()
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        found += [node["html"] for each in violations(page, {"runOnly": [CONTRAST]}) for node in each["nodes"]]
    return found
