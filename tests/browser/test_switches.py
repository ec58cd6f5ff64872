"""Switches of units and of multiples of sigma: what a page shows then is the same quantity, to its digits."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from mcnav.physics.units import conversion
from mcnav.report.format import number
from tests.browser.conftest import UNFOLD, Browser

NUMBERS = """() => Array.from(document.querySelectorAll("tr:has([data-unit]) data")).map((each) => {
  const unit = each.closest("tr").querySelector("[data-unit]");
  return [each.textContent, Number(each.value), each.className, unit.dataset.unit, unit.textContent];
})"""

TICKS = """() => Array.from(document.querySelectorAll("figure svg")).map((svg) => [
  svg.dataset.yUnit, svg.dataset.y,
  Array.from(svg.querySelectorAll("g.y text")).map((each) => [each.textContent, Number(each.getAttribute("y"))]),
  Array.from(svg.querySelectorAll(":scope > text")).map((each) => each.textContent).join(" | ")])"""

WORDS = (
    """() => Array.from(document.querySelectorAll(".tile, .shows, #requirements td")).map((each) => each.textContent)"""
)


def quantities(words: list[str], units: str) -> list[tuple[float, str]]:
    """Return the numbers with one of some units behind them, but the lower ends of intervals."""
    found = re.findall(rf"(\d[\d.,]*) ({units})(?![\w/])", " | ".join(words))
    return [(float(number_.replace(",", "")), unit) for number_, unit in found]


SPELLED = {"NM": "nmi", "m/s²": "m/s^2", "kt": "nmi/h"}
"""Units of pages as campaign files have them."""


@cache
def size(unit: str, other: str) -> float:
    """Return how many of another unit one unit is."""
    return float(conversion(SPELLED.get(unit, unit), SPELLED.get(other, other)))


def test_tables(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """Every number is its value in the unit beside it, times the multiple of sigma; captions say which."""
    with browser.opened(page_of("aided")) as page:
        as_computed, told = page.evaluate(NUMBERS), page.evaluate(WORDS)
        caption = page.locator("table caption").first
        multiples = {"3σ": (3.0, "Three sigma at"), "95 %": (1.959963985, "1.96 sigma (95 % of normal errors) at")}
        for sigma, (multiple, words) in multiples.items():
            for system, expected in (("SI", {"m", "m/s", "rad"}), ("aviation", {"ft", "kt", "deg"})):
                page.get_by_label(sigma, exact=True).evaluate("each => each.click()")
                page.get_by_label(system, exact=True).evaluate("each => each.click()")
                shown = page.evaluate(NUMBERS)
                assert {unit for *_, unit in shown} == expected
                assert caption.inner_text().startswith(words)
                assert page.locator(".stays").inner_text().startswith("In sentences and figures sigma is 1σ")
                for (text, value, kind, unit, now), (before, *_) in zip(shown, as_computed, strict=True):
                    digits = len(re.sub(r"\D", "", before).lstrip("0"))
                    factor = size(unit, now) * (multiple if kind == "sigma" else 1.0)
                    assert text in {number(value * factor * (1.0 + tiny), digits) for tiny in (-1e-9, 1e-9)}
        assert "1σ" not in page.locator("#what-if .sigmas caption").inner_text()
        said = quantities(told, "km|m/s|m|mrad|deg|arcsec")
        changed = quantities(page.evaluate(WORDS), "NM|kt|ft|deg")
        assert len(said) > 20
        for (value, unit), (other, now) in zip(said, changed, strict=True):
            assert other == pytest.approx(value * size(unit, now), rel=6e-3)  # both have three digits
        page.reload()
        page.evaluate(UNFOLD)
        assert page.evaluate(NUMBERS) == shown
        page.get_by_label("1σ", exact=True).press("Space")
        page.get_by_label("as computed", exact=True).check()
        assert page.evaluate(NUMBERS) == as_computed
        assert page.evaluate(WORDS) == told
        assert page.locator(".stays").inner_text() == ""


def test_axes(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """A tick stands where the axis has its value, and the title has the unit of the ticks."""
    with browser.opened(page_of("lincov")) as page:
        page.get_by_label("aviation", exact=True).check()
        checked = 0
        for unit, limits, ticks, titles in page.evaluate(TICKS):
            low, high, start, end, log = map(float, limits.split())
            found = re.search(r"\((NM|ft|kt|deg)\)", titles)
            if not found or log or unit not in ("m", "km", "m/s", "mrad"):
                continue
            factor = size(unit, found[1])
            for text, y in ticks:
                at = low + (high - low) * (y - 80.0 - start) / (end - start)
                value = float(text.replace("−", "-").replace(",", ""))
                assert value == pytest.approx(factor * at, abs=1e-6 * factor * (high - low))  # limits have ten digits
                checked += 1
        assert checked > 20
        page.get_by_label("as computed", exact=True).check()  # it is remembered


def test_sizes_of_units(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """The page's factors are those of campaign files."""
    script = page_of("lincov").read_text(encoding="utf-8")
    table = re.search(r"const UNITS = \{(.*?)\};", script, re.DOTALL)
    assert table is not None
    names = re.findall(r'"?([\w/²^]+)"?: \[([^,\]]+), "([^"]+)", "([^"]+)"\]', table[1])
    assert len(names) > 20
    for name, written, si, aviation in names:
        assert size(name, si) == pytest.approx(
            eval(written.replace("DEGREE", repr(math.pi / 180.0))),
            rel=1e-12,
        )
        assert size(si, aviation) > 0.0
