"""The report in headless Chromium: every figure visible, silent, self-contained, readable by everyone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mcnav.reproduce import story_page
from mcnav.study import run_campaign
from tests.conftest import campaign

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
NAME = "Trajectory 4 </script> $\\frac{$ 🚀 تجربة"
FIGURES = {
    "flight": 4, "ratios": 2, "nees": 2, "matrices": 6, "budget": 2, "scatter": 6, "histograms": 4, "quantiles": 4,
    "convergence": 4,
}  # fmt: skip
"""Figures of the report, and plots in each."""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        CHROMIUM is None and os.environ.get("MCNAV_BROWSER") != "required", reason="no Chromium on this machine"
    ),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "run"
    asked = {"quantile": [{"output": "altitude", "probability": 0.9973, "below": "120 km"}]}
    run_campaign(campaign(4, name=NAME, samples=5_000, accept=asked), folder, "ensemble", 2)
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=quiet)
        yield chromium
        chromium.close()


@pytest.mark.parametrize("javascript", [True, False], ids=["with JavaScript", "without"])
@pytest.mark.parametrize("width", [1280, 380])
def test_every_figure_is_shown_and_nothing_is_loaded(browser: Any, report: Path, width: int, javascript: bool) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900}, java_script_enabled=javascript)
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    for key, plots in FIGURES.items():
        shown = page.locator(f"#figure-{key} svg")
        assert shown.count() == plots
        for number in range(plots):
            box = shown.nth(number).bounding_box()
            assert box["width"] > 200
            assert box["height"] > 80
            assert box["x"] + box["width"] <= width
    assert said == []
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]
    if javascript:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("h1").inner_text() == NAME
    assert page.locator(".verdict .headline").inner_text().startswith("Yes for the dispersion of each output")
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_serious_by_axe(browser: Any, report: Path, scheme: str) -> None:
    """With everything unfolded: names, roles, contrast, headings, tables, keyboard."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme=scheme)
    page.goto(report.as_uri())
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
    found = axe.Axe().run(page).response["violations"]
    serious = [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")]
    assert serious == []
    page.close()


def test_tables_sort_series_toggle_and_data_is_copied(browser: Any, report: Path) -> None:
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(report.as_uri())
    table = page.locator("#budget table", has_text="Error budget:")
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


def test_printed_no_figure_is_cut(browser: Any, report: Path) -> None:
    page = browser.new_page(viewport={"width": 700, "height": 990})
    page.emulate_media(media="print")
    page.goto(report.as_uri())
    assert page.pdf(format="A4").startswith(b"%PDF")
    breaks = page.locator(".plot").evaluate_all("all => all.map(each => getComputedStyle(each).breakInside)")
    assert set(breaks) == {"avoid"}
    assert page.evaluate("document.documentElement.scrollWidth") <= 700
    page.close()


@pytest.mark.parametrize("width", [1280, 380])
def test_the_story_of_84_minutes(browser: Any, width: int, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("request", lambda request: asked.append(request.url))
    story = story_page.write(tmp_path)[0].as_uri()
    page.goto(story)
    assert page.locator("figure svg").count() == 8
    assert said == []
    assert [url for url in asked if not url.startswith("data:")] == [story]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    identifiers = page.evaluate("Array.from(document.querySelectorAll('[id]')).map(e => e.id)")
    assert len(identifiers) == len(set(identifiers))
    page.close()


def test_ids_are_unique(browser: Any, report: Path) -> None:
    """Many plots share one page: an id that stood twice would borrow another plot's clipping."""
    page = browser.new_page()
    page.goto(report.as_uri())
    identifiers = page.evaluate("Array.from(document.querySelectorAll('[id]')).map(e => e.id)")
    assert len(identifiers) == len(set(identifiers))
    for figure in FIGURES:
        assert f"{figure}-0-t" in identifiers
    page.close()
