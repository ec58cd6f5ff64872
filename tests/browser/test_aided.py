"""The report of an aided navigation in headless Chromium: its first screen, and values within an outage."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.browser.conftest import Browser
from tests.conftest import ROOT

HEIGHT = 800


@pytest.fixture(scope="module")
def report(page_of: Callable[[str], Path]) -> Path:
    return page_of("aided")


def test_verdicts_stand_in_their_folds(browser: Browser, report: Path) -> None:
    """Each verdict, and every output's sigmas by three methods with its largest causes.

    A verdict has its worst number in three digits, and leads to its section; the worst one is the window's title.
    """
    asked = (ROOT / "mcnav" / "docs" / "REPORT.md").read_text(encoding="utf-8").partition("## Fifteen questions")[2]
    asked = asked.partition("## ")[0]
    assert asked.count("? |") == 15
    with browser.opened(report, height=HEIGHT) as page:
        assert set(re.findall(r"\*([^*]+)\*", asked)) <= set(page.locator("nav.contents a").all_text_contents())
        headlines = page.locator(".tile .headline").all_inner_texts()
        assert headlines[2] == (
            "Requirements: 0 of 1 met, 1 not met. Least margin: heading, 95 %: 4.59 mrad, limit 3 mrad. "
            "Errors may be × 0.654; with 95 % confidence at least 4.31 mrad."
        )
        assert page.locator(".tile .tag").all_inner_texts() == ["optimistic", "undecided", "not met"]
        assert page.title().startswith("Requirements not met – ")
        for number, target in enumerate(("filter", "linear", "requirements")):
            tile = page.locator(".tile").nth(number)
            assert re.fullmatch(r"\d\.\d\d( mrad)?", tile.locator("strong").inner_text().strip())
            tile.locator(".subject a").click()
            page.wait_for_function(f"Math.abs(document.getElementById('{target}').getBoundingClientRect().top) < 40 "
                                   "|| innerHeight + scrollY > document.body.scrollHeight - 2")  # fmt: skip
            page.evaluate("scrollTo(0, 0)")
        assert headlines[1] == "120 samples do not decide whether every linear sigma is right."
        assert headlines[0].startswith("Do not trust this filter's covariance: ")
        more = page.locator(".tile").first.locator("details").text_content() or ""
        assert "Largest unmodelled error: gyro scale factor x (" in more
        rows = page.locator(".answers tbody tr")
        assert rows.count() == 9
        assert page.locator(".answers tbody .strip").count() == 9
        assert re.search(r"\d to [\d.]+; (partly |)(beyond|within) the tolerance", rows.first.inner_text())
        assert all(
            text.startswith("linear ") and "filter " in text for text in rows.locator("td.both").all_inner_texts()
        )


def test_values_within_an_outage(browser: Browser, report: Path) -> None:
    """The pointer sees the curves through the shading, and which outage it is."""
    with browser.opened(report, height=HEIGHT) as page:
        figure = page.locator("#figure-envelopes")
        plot = figure.locator("svg").first
        plot.scroll_into_view_if_needed()
        shade = figure.locator("svg").first.locator("path.shade").bounding_box()
        page.mouse.move(1, 1)  # a page's first event has no movement
        page.mouse.move(shade["x"] + 0.5 * shade["width"], shade["y"] + 0.1 * shade["height"])
        tip = page.locator(".tip")
        tip.wait_for(state="visible")
        told = tip.inner_text()
        assert "outage of gnss: 8.33 to 10 min" in told
        for series in ("linear", "Monte Carlo", "filter"):
            assert re.search(rf"^{series}: −(\S+) m\n{series}: \1 m$", told, re.MULTILINE), series  # both lines at 3σ
        assert "samples" not in told
        assert "error, ±3σ" in plot.text_content()
