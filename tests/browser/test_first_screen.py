"""The first screen of a run's report answers, within limits on its words and numbers; all else is in closed folds."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import Browser

WORDS, NUMBERS, HEIGHT = 90, 40, 900
"""Most words and numbers that are seen without scrolling at 1280 x 900 pixels, in figures and contents as well."""

SEEN = r"""() => {
  const texts = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const [node, parent] = [walker.currentNode, walker.currentNode.parentElement];
    if (!node.data.trim() || parent.closest("script, style, noscript, .hidden, .skip, select, title, desc")) continue;
    if (!parent.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const tops = Array.from(range.getClientRects()).filter((box) => box.width > 0).map((box) => box.top);
    if (Math.min(...tops) < innerHeight) texts.push(node.data);
  }
  const tokens = texts.join(" ").split(/\s+/).filter(Boolean);
  const numbers = tokens.filter((token) => /\d/.test(token));
  return [tokens.filter((token) => /\p{L}/u.test(token) && !/\d/.test(token)).length, numbers.length];
}"""
"""Words without a digit, and tokens with one, that begin on the screen."""

OPEN = "all => all.map((fold) => fold.open)"


def _bottom(page: Any, selector: str) -> float:
    bottoms = page.locator(selector).evaluate_all("all => all.map((part) => part.getBoundingClientRect().bottom)")
    return float(max(bottoms))


STUDIES = (
    "lincov", "bent", "sweep", "contours", "allocate", "comparison", "start times", "ins start times", "linearity",
    "index", "brief", "filters", "judge", "identify",
)  # fmt: skip
"""Pages of studies, whose answer may be so short that folds stand on the first screen as well."""


@pytest.mark.parametrize("kind", ["report", "many", "aided", "loop", "faulty", *STUDIES])
def test_one_screen_is_the_answer(browser: Browser, page_of: Callable[[str], Path], kind: str) -> None:
    """Verdict, figure and requirements are whole; folds are closed and each says what is inside; a hand has it all."""
    with browser.opened(page_of(kind), 1280, HEIGHT, folded=True) as page:
        words, numbers = page.evaluate(SEEN)
        assert words <= WORDS
        assert numbers <= NUMBERS
        assert _bottom(page, ".first-screen > *, .first-screen figure, .first-screen .asked") <= HEIGHT
        if kind == "brief":
            return  # a slide, and below it the sheet that it rests on
        assert page.locator(".first-screen .headline").count() == 1
        assert page.locator(".first-screen figure, .first-screen .strip").count() >= 1
        folds = page.locator("details.fold")
        assert not any(folds.evaluate_all(OPEN))
        assert folds.count() >= (1 if kind in STUDIES else 4)
        assert all(page.locator("details.fold > summary .line").all_inner_texts())
        assert page.evaluate("document.documentElement.scrollHeight") < 2 * HEIGHT
        page.set_viewport_size({"width": 380, "height": HEIGHT})
        assert page.evaluate("document.documentElement.scrollWidth") <= 380


def test_the_first_screen_states_a_corrected_sigma_beside_the_linear_one(
    browser: Browser, page_of: Callable[[str], Path]
) -> None:
    """Campaign 14, whose check values are 52.167 and 20 m."""
    with browser.opened(page_of("bent"), 1280, HEIGHT, folded=True) as page:
        shown = page.locator(".first-screen").inner_text()
        assert "Sigma to second order: y 52.2 m (linear 20.0)." in shown
        assert "Do not gate or fuse with the full matrix, which is wrong." in shown


def test_a_filter_that_fails_is_said_before_mean_errors(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """Its true size is the root mean square about zero: true over filter sigma is the factor, to two digits each."""
    with browser.opened(page_of("faulty"), 1280, HEIGHT, folded=True) as page:
        assert page.locator(".first-screen .headline").inner_text().startswith("Do not trust this filter's covariance")
        shown = page.locator(".first-screen").inner_text()
        assert "The mean error of heading is" in shown
        true, own, factor = map(float, re.search(r"true (\S+) m, filter (\S+): (\S+) times", shown).groups())  # type: ignore[union-attr]
        assert true / own == pytest.approx(factor, rel=0.1)


def test_a_link_opens_the_fold_of_its_target(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """From the contents, from the first screen, twice the same, and in an address; the contents list open folds."""
    address = page_of("aided").as_uri()
    with browser.opened(page_of("aided"), 1280, HEIGHT, folded=True) as page:
        inside = page.locator("nav.contents a[href='#budget']")
        assert not inside.is_visible()
        for _ in range(2):
            page.locator("nav.contents a[href='#fold-budget']").click()
            page.wait_for_function("document.getElementById('fold-budget').open")
            inside.wait_for(state="visible")
            page.locator("#fold-budget > summary").click()
            page.wait_for_function("!document.getElementById('fold-budget').open")
        page.locator(".first-screen .asked a").first.click()
        page.wait_for_function("document.querySelectorAll('details.fold[open]').length === 1")
    for target in ("provenance", "figure-nees", "fold-filter"):
        with browser.visited(f"{address}#{target}", own=(address, "data:"), folded=True) as page:
            page.locator(f"#{target}").wait_for(state="visible")
            page.wait_for_function(f"document.getElementById('{target}').getBoundingClientRect().top < innerHeight")


def test_everything_can_be_reached_without_scripts_and_is_printed(
    browser: Browser, page_of: Callable[[str], Path]
) -> None:
    with browser.opened(page_of("report"), 1280, HEIGHT, scripts=False, folded=True) as page:
        assert page.locator("nav.contents a[href='#budget']").is_visible()
        page.locator("#fold-budget > summary").click()
        assert page.locator("#budget").is_visible()
    with browser.opened(page_of("report"), 1280, HEIGHT, folded=True) as page:
        assert not page.locator("#provenance").is_visible()
        page.emulate_media(media="print")
        heights = page.locator("section:not(#what-if)").evaluate_all(
            "all => all.map((part) => part.getBoundingClientRect().height)"
        )
        assert min(heights) > 40.0
