"""The report in headless Chromium: its figures, sorted tables, series that hide, data to copy, outliers by number."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import NAME

FIGURES = {
    "flight": 4, "ratios": 2, "nees": 2, "matrices": 6, "budget": 2, "scatter": 6, "histograms": 4, "quantiles": 4,
    "convergence": 4,
}  # fmt: skip
"""Figures of the report, and plots in each."""


@pytest.fixture(scope="module")
def report(page_of: Callable[[str], Path]) -> Path:
    return page_of("report")


def test_every_figure_has_its_plots(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    for key, plots in FIGURES.items():
        assert page.locator(f"#figure-{key} svg").count() == plots
        assert page.locator(f"#{key}-0-t").count() == 1
    assert page.locator("h1").inner_text() == NAME
    assert page.locator(".verdict .headline").inner_text().startswith("Yes for the dispersion of each output")
    page.close()


def test_a_script_that_is_not_the_report_s_own_does_not_run(browser: Any, report: Path) -> None:
    """The content security policy names the report's script by its hash."""
    page = browser.new_page()
    page.goto(report.as_uri())
    found = page.evaluate(
        "() => { const script = document.createElement('script'); script.textContent = 'window.injected = 1';"
        " document.body.append(script); return [window.injected ?? null, document.scripts.length]; }"
    )
    assert found[0] is None
    assert found[1] > 1
    page.close()


def test_tables_sort_series_toggle_and_data_is_copied(browser: Any, report: Path) -> None:
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(report.as_uri())
    table = page.locator("#budget table", has_text="Linear error budget:")
    shares = table.locator("tbody tr td:nth-child(4)")
    table.locator("thead th:nth-child(4) button").press("Enter")
    found = [float(text.replace("<", "").replace("–", "nan")) for text in shares.all_inner_texts()]
    assert found == sorted(found)
    assert table.locator("thead th:nth-child(4)").get_attribute("aria-sort") == "ascending"
    figure = page.locator("#figure-ratios")
    plain = figure.locator(".series-plain").first
    hidden = "each => getComputedStyle(each).display === 'none'"
    assert not plain.evaluate(hidden)
    toggle = figure.get_by_role("button", name="Monte Carlo, plain sample")
    toggle.press("Space")
    assert plain.evaluate(hidden)
    assert toggle.get_attribute("aria-pressed") == "false"
    figure.locator("summary").click()
    figure.get_by_role("button", name="Copy as CSV").click()
    figure.get_by_role("button", name="Copied").wait_for()
    copied = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert copied[0].startswith("output,paired sigma ratio,paired interval from")
    assert [line.split(",")[0] for line in copied[1:]] == ["altitude", "range", "altitude rate", "range rate"]
    context.close()


def test_outliers_carry_their_sample_number(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    farthest = page.locator("#dispersion table", has_text="largest NEES").locator("tbody tr").first
    index = farthest.locator("th").inner_text()
    assert f"mcnav replay . {index}" in farthest.inner_text()
    tips = page.locator("#figure-scatter g > title").all_text_contents()
    assert len(tips) == 3 * FIGURES["scatter"]
    assert all(tip.startswith("sample ") for tip in tips)
    page.close()
