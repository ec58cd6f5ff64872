"""The report in headless Chromium: its figures, sorted tables, series that hide, data to copy, outliers by number."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import NAME, Browser

FIGURES = {
    "flight": 4, "ratios": 2, "nees": 2, "matrices": 6, "budget": 2, "scatter": 6, "histograms": 4, "quantiles": 4,
    "convergence": 4, "combination": 2,
}  # fmt: skip
"""Figures of the report, and plots in each."""


@pytest.fixture(scope="module")
def report(page_of: Callable[[str], Path]) -> Path:
    return page_of("report")


def test_every_figure_has_its_plots(browser: Browser, report: Path) -> None:
    with browser.opened(report) as page:
        for key, plots in FIGURES.items():
            assert page.locator(f"#figure-{key} svg").count() == plots
            assert page.locator(f"#{key}-0-c").count() == 1
        assert page.locator("h1").inner_text() == NAME
        captions = page.locator("figure[id^=figure-] figcaption").all_inner_texts()
        assert [text.split(".")[0] for text in captions] == [f"Figure {k}" for k in range(1, len(captions) + 1)]
        assert all(page.locator("figcaption .shows").all_inner_texts())
        assert page.locator("figcaption .shows").count() == len(captions)
        assert page.locator(".first-screen .headline").inner_text().startswith("Every sigma is right.")
        assert "Every sigma is right." in page.locator(".tile .headline").first.inner_text()
        assert page.title() == f"Linear analysis holds output by output – {NAME} – mcnav"


def test_tables_sort_series_toggle_and_data_is_copied(browser: Browser, report: Path) -> None:
    with browser.opened(report) as page:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        page.locator("#budget summary", has_text="All 10 causes").click()
        table = page.locator("#budget table", has_text="Linear error budget:")
        shares = table.locator("tbody tr td:nth-child(3)")
        table.locator("thead th:nth-child(3) button").press("Enter")
        found = [float(text.split("\n")[0].replace("<", "").replace("–", "nan")) for text in shares.all_inner_texts()]
        assert found == sorted(found)
        assert table.locator("thead th:nth-child(3)").get_attribute("aria-sort") == "ascending"
        figure = page.locator("#figure-ratios")
        plain = figure.locator(".series-plain").first
        hidden = "each => getComputedStyle(each).display === 'none'"
        assert not plain.evaluate(hidden)
        toggle = figure.get_by_role("button", name="Monte Carlo (plain)")
        toggle.press("Space")
        assert plain.evaluate(hidden)
        assert toggle.get_attribute("aria-pressed") == "false"
        figure.locator("summary").click()
        figure.get_by_role("button", name="Copy as CSV").click()
        figure.get_by_role("button", name="Copied").wait_for()
        copied = page.evaluate("navigator.clipboard.readText()").splitlines()
        assert copied[0].startswith("output,paired sigma ratio,paired interval from")
        assert [line.split(",")[0] for line in copied[1:]] == ["altitude", "range", "altitude rate", "range rate"]


def test_outliers_carry_their_sample_number(browser: Browser, report: Path) -> None:
    with browser.opened(report) as page:
        farthest = page.locator("#dispersion table", has_text="largest squared distance")
        assert "mcnav replay . SAMPLE" in farthest.locator("caption").inner_text()
        assert all(index.isdecimal() for index in farthest.locator("tbody th").all_inner_texts())
        tips = page.locator("#figure-scatter g.points title").all_text_contents()
        assert len(tips) == 3 * FIGURES["scatter"]
        assert all(tip.startswith("sample ") for tip in tips)


def _middle(page: Any, plot: Any, across: float = 0.5, down: float = 0.5) -> tuple[float, float]:
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def test_no_script_runs_but_that_of_the_page(browser: Browser, report: Path) -> None:
    """The content security policy is in force: a script that text smuggles into the page is refused."""
    with browser.opened(report, silent=False) as page:
        page.evaluate("""() => document.body.append(
            Object.assign(document.createElement("script"), { textContent: "document.title = 'smuggled'" }))""")
        assert page.title() != "smuggled"
        assert page.locator(".tip").count() == 1


def test_figures_say_the_values_under_the_pointer(browser: Browser, report: Path) -> None:
    """Curves at one time with their units, single points, what carries a text of its own; by keyboard as well."""
    with browser.opened(report) as page:
        tip = page.locator(".tip")
        page.mouse.move(1, 1)  # a page's first event has no movement, and scrolling by keys must not move the values
        for key, wanted in {
            "flight": r"range [−\d.,]+ km\naltitude: [\d.,]+ km",
            "nees": r"squared distance to the linear covariance [\d.]+\nMonte Carlo, .* to .*\nchi-square, 4 degrees: "
            r"[\d.]+",
            "histograms": r"altitude [−\d.,]+ km\nMonte Carlo, .* km to .* km: [\d.,]+\nlinear Gaussian: [\d.,]+",
            "scatter": r"(samples|linear, 1 and 3 sigma|Monte Carlo .*)\naltitude [−\d.,]+ km\nrange [−\d.,]+ km",
            "convergence": r"samples [\d,.]+\n(.*\n)*Monte Carlo \(paired\): [\d.]+",
        }.items():
            page.mouse.move(*_middle(page, page.locator(f"#figure-{key} svg").first))
            page.wait_for_function("!document.querySelector('.tip').hidden")
            assert re.fullmatch(wanted, tip.inner_text().strip()), tip.inner_text()
            page.mouse.move(1, 1)
            page.wait_for_function("document.querySelector('.tip').hidden")
        for key, wanted in {
            "budget": r"altitude, gyro drift: [\d.]+ %",
            "scatter": r"samples\naltitude .* km\nrange .* km",
        }.items():
            page.locator(f"#figure-{key} .plot").first.focus()
            page.keyboard.press("ArrowRight")
            assert re.fullmatch(wanted, tip.inner_text().strip()), tip.inner_text()


def test_a_known_value_lies_under_the_pointer(browser: Browser, report: Path) -> None:
    """The table's last point of a curve is what the keyboard says of it, to a two-thousandth of the axis."""
    with browser.opened(report) as page:
        rows = page.locator("#figure-convergence details.data tbody tr")
        last = rows.nth(rows.count() - 1).locator("td").all_text_contents()
        page.locator("#figure-convergence .plot").first.focus()
        for _ in range(rows.count()):
            page.keyboard.press("ArrowRight")
        told = page.locator(".tip").inner_text().split()
        assert float(told[-1]) == pytest.approx(float(last[1]), abs=1e-3)


def test_time_histories_zoom_together(browser: Browser, report: Path) -> None:
    """A frame drawn with the pointer, ticks within it, one button for all; the page is as before after it."""
    with browser.opened(report) as page:
        figure = page.locator("#figure-convergence")
        ticks = "all => all.map(each => each.querySelector('g.x').textContent)"
        before = figure.locator("svg").evaluate_all(ticks)
        upward = "each => each.querySelector('g.y').textContent"
        whole = figure.locator("svg").nth(1).evaluate(upward)
        paths = figure.locator("path.line").evaluate_all("all => all.map(each => each.getAttribute('d'))")
        plot = figure.locator("svg").first
        page.mouse.move(*_middle(page, plot, 0.5, 0.4))
        page.mouse.down()
        page.mouse.move(*_middle(page, plot, 0.75, 0.42), steps=3)
        page.mouse.up()
        assert figure.get_by_role("button", name="Whole range").count() == FIGURES["convergence"]
        after = figure.locator("svg").evaluate_all(ticks)
        assert len(set(after)) == 1
        assert after != before
        assert figure.locator("svg").nth(1).evaluate(upward) != whole  # fits what is seen
        assert figure.locator("path.line").evaluate_all("all => all.map(each => each.getAttribute('d'))") != paths
        figure.get_by_role("button", name="Whole range").last.click()
        assert figure.get_by_role("button", name="Whole range").count() == 0
        assert figure.locator("svg").evaluate_all(ticks) == before
        assert figure.locator("path.line").evaluate_all("all => all.map(each => each.getAttribute('d'))") == paths
        scatter = page.locator("#figure-scatter .plot").first
        scatter.focus()
        page.keyboard.press("+")
        assert scatter.get_by_role("button", name="Whole range").count() == 1
        page.keyboard.press("0")
        assert scatter.get_by_role("button", name="Whole range").count() == 0
