"""The report of an aided navigation in headless Chromium: its first screen, and values within an outage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.browser.conftest import Browser

HEIGHT = 800


@pytest.fixture(scope="module")
def report(page_of: Callable[[str], Path]) -> Path:
    return page_of("aided")


def test_the_answers_are_on_the_first_screen(browser: Browser, report: Path) -> None:
    """All verdicts, the worst first, and every output's sigmas by three methods with its largest sources."""
    with browser.opened(report, height=HEIGHT) as page:
        headlines = page.locator(".verdict .headline").all_inner_texts()
        assert headlines[0] == "Requirements: 0 of 1 met, 1 not met."
        assert headlines[2].startswith("Undecided: ")
        assert headlines[1].startswith("The filter is optimistic by a factor of ")
        assert "the largest error that it neglects is gyro scale factor" in headlines[1]
        rows = page.locator(".answers tbody tr")
        assert rows.count() == 9
        assert all(
            text.startswith("linear ") and "filter " in text for text in rows.locator("td.both").all_inner_texts()
        )
        for selector in (".verdict", ".asked", ".answers"):
            ends = page.locator(selector).evaluate_all("all => all.map(each => each.getBoundingClientRect().bottom)")
            assert max(ends) <= HEIGHT


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
        assert "outage of gnss: 3.33 to 5 min" in told
        assert "filter's own, ±3σ" in told
        assert "samples" not in told
