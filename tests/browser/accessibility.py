"""What axe finds in a page, and what it leaves open; on contrast it is asked once for all texts that look the same.

The contrast of a text follows from the styles of its element and of those around it. axe looks at each element anew,
for seconds on a page of some thousand.

axe leaves contrast open over a gradient, of short texts and in drawings. The only gradient is the shadow at the ends of
tables that scroll, whose ground is that of the page: it is taken away, and short texts are judged as others. Texts of
drawings are judged here.
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


PLAIN: Final = ".scroll { background: none !important; overflow: visible !important; max-height: none !important; }"
"""Style without the shadow at the ends of tables that scroll, and with all of what they hide."""

JUDGE_SHORT: Final = """() => axe.configure({ checks: [{ id: "color-contrast",
  options: { ...axe._audit.checks["color-contrast"].options, ignoreLength: true, ignoreUnicode: false } }] })"""
"""Let axe judge texts of one letter and of signs as well."""

LABELS: Final = r"""() => {
  const parts = (colour) => colour.match(/[\d.]+/g).map(Number);
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const weights = [0.2126, 0.7152, 0.0722];
  const light = (rgb) => rgb.slice(0, 3).reduce((sum, v, k) => sum + weights[k] * linear(v / 255), 0);
  const ground = (each) => {
    const colour = parts(getComputedStyle(each).backgroundColor);
    return colour.length < 4 || colour[3] > 0 ? colour : ground(each.parentElement);
  };
  const grounds = new Map(), faint = [];
  document.querySelectorAll("figure svg text, .what-if svg text").forEach((text) => {
    if (!text.textContent.trim() || !text.checkVisibility()) return;
    const svg = text.closest("svg");
    if (!grounds.has(svg)) grounds.set(svg, ground(svg));
    let below = grounds.get(svg);
    const shape = text.previousElementSibling;
    if (shape?.tagName === "path" && text.closest("g[class^=series]")) { // a text in a bar or a cell
      const { fill, fillOpacity } = getComputedStyle(shape);
      const share = Number(fillOpacity);
      if (fill !== "none") below = parts(fill).slice(0, 3).map((v, k) => share * v + (1 - share) * below[k]);
    }
    const [high, low] = [light(parts(getComputedStyle(text).fill)), light(below)].sort((a, b) => b - a);
    if ((high + 0.05) / (low + 0.05) < 4.5) faint.push(`${text.outerHTML} on ${below}`);
  });
  return faint;
}"""
"""Texts of drawings with a contrast below 4.5 (WCAG 2.2, 1.4.3) on the bar or cell that they stand in, or the page."""

GROUPED: Final = "th-has-data-cells"
"""Rule of axe that is open where a heading stands above rows of a table and spans all columns, as in grouped tables."""


def violations(page: Any, options: dict[str, Any], part: str | None = None) -> list[dict[str, Any]]:
    """Return what axe objects to in a page, or in a part of it; axe is loaded unless it is there."""
    return answers(page, options, part)["violations"]


def answers(page: Any, options: dict[str, Any], part: str | None = None) -> dict[str, list[dict[str, Any]]]:
    """Return ``violations`` and what is ``incomplete``, because axe cannot tell."""
    sync_playwright = pytest.importorskip("axe_playwright_python.sync_playwright")
    there = page.evaluate("'axe' in window")
    axe = sync_playwright.Axe("undefined") if there else sync_playwright.Axe()
    response = axe.run(page, part, options=options | {"resultTypes": ["violations", "incomplete"]}).response
    return {kind: list(response[kind]) for kind in ("violations", "incomplete")}


def unexplained(page: Any, incomplete: list[dict[str, Any]]) -> list[str]:
    """Return what axe left open, but for headings of groups of rows in tables."""
    nodes = [(each["id"], node) for each in incomplete for node in each["nodes"]]
    grouped = "place => !!document.querySelector(place).querySelector(\"th[scope='rowgroup']\")"
    return [
        f"{name}: {node['html']}"
        for name, node in nodes
        if not (name == GROUPED and page.evaluate(grouped, node["target"][0]))
    ]


def faint_labels(page: Any, schemes: tuple[str, ...] = ("light", "dark")) -> list[str]:
    """Return the texts of drawings with too little contrast in any colour scheme."""
    found = list[str]()
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        found += page.evaluate(LABELS)
    return found


def faint_texts(page: Any, schemes: tuple[str, ...] = ("light", "dark")) -> list[str]:
    """Return the elements with too little contrast in any colour scheme, or of which axe cannot tell, drawings apart.

    Other texts of the page are gone then.
    """
    page.add_style_tag(content=PLAIN)
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        page.evaluate(NOTE_STYLES)
    assert page.evaluate(LEAVE_ONE_OF_EACH) > 1
    page.evaluate("document.querySelectorAll('figure svg text, .what-if svg text').forEach((each) => each.remove())")
    found = list[str]()
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        if not page.evaluate("'axe' in window"):
            violations(page, {"runOnly": ["html-has-lang"]})
        page.evaluate(JUDGE_SHORT)
        told = answers(page, {"runOnly": [CONTRAST]})
        found += [node["html"] for each in (*told["violations"], *told["incomplete"]) for node in each["nodes"]]
    return found
