"""The site of the documentation in a browser: at a desk and in a hand, light and dark, silent and without a network."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

PAGES = ("index", "tutorial-aided", "campaigns", "reference/commands", "reference/api", "reference/examples")
"""Pages with everything there is between them: prose, code, tables, signatures, a picture."""


@contextmanager
def opened(browser: Any, site: Path, page: str, width: int, **options: Any) -> Iterator[Any]:
    """Open a page of the site; at the end, it has said nothing and asked for files alone."""
    window = browser.new_page(viewport={"width": width, "height": 900}, **options)
    said: list[str] = []
    asked: list[str] = []
    window.on("console", lambda message: said.append(message.text))
    window.on("pageerror", lambda error: said.append(str(error)))
    window.on("request", lambda request: asked.append(request.url))
    window.goto((site / f"{page}.html").as_uri())
    yield window
    window.close()
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_is_readable(browser: Any, site: Path, page: str, scheme: str) -> None:
    """No page is wider than its window; text has the contrast that axe asks for; the page of a phone has its menu."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    for width in (1280, 380):
        with opened(browser, site, page, width, color_scheme=scheme) as window:
            assert window.evaluate("document.documentElement.scrollWidth") <= width
            assert window.locator("label.nav-overlay-icon").is_visible() == (width == 380)
    with opened(browser, site, page, 1280, color_scheme=scheme) as window:
        found = axe.run(window, options={"runOnly": ["color-contrast"], "resultTypes": ["violations"]})
        assert [node["html"] for each in found.response["violations"] for node in each["nodes"]] == []


def test_a_word_is_found(browser: Any, site: Path) -> None:
    """The search works from files, without a server."""
    with opened(browser, site, "index", 1280) as window:
        window.get_by_placeholder("Search").first.fill("Schuler")
        window.keyboard.press("Enter")
        window.locator("#search-results li a").first.wait_for()
        assert window.locator("#search-results li a").count() > 0
