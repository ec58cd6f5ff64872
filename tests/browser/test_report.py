"""The report in headless Chromium: every figure visible, silent, self-contained, and as wide as the window."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mcnav.study import run_campaign
from tests.conftest import campaign

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FIGURES = ("ratios", "nees", "flight", "budget", "scatter", "histograms", "correlation")

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        CHROMIUM is None and os.environ.get("MCNAV_BROWSER") != "required", reason="no Chromium on this machine"
    ),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "run"
    run_campaign(campaign(4, name="Trajectory 4 </script> $\\frac{$ 🚀", samples=5_000), folder, "ensemble", 2)
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=quiet)
        yield chromium
        chromium.close()


@pytest.mark.parametrize("width", [1280, 380])
def test_every_figure_is_shown_and_nothing_is_loaded(browser: Any, report: Path, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    shown = page.locator("figure svg")
    assert shown.count() == len(FIGURES)
    for number in range(len(FIGURES)):
        box = shown.nth(number).bounding_box()
        assert box["width"] > 300
        assert box["height"] > 80
    assert said == []
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("h1").inner_text() == "Trajectory 4 </script> $\\frac{$ 🚀"
    assert page.locator(".verdict .headline").inner_text().startswith("Yes for the dispersion of each output")
    page.close()


def test_ids_are_unique(browser: Any, report: Path) -> None:
    """Seven figures share one page: an id that stood twice would borrow another figure's clipping."""
    page = browser.new_page()
    page.goto(report.as_uri())
    identifiers = page.evaluate("Array.from(document.querySelectorAll('[id]')).map(e => e.id)")
    assert len(identifiers) == len(set(identifiers))
    for figure in FIGURES:
        assert f"{figure}-t" in identifiers
    page.close()
