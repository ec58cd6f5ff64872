"""The site of the documentation in a browser: at a desk and in a hand, light and dark, silent and without a network."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser.accessibility import faint_texts
from tests.browser.conftest import Browser

pytestmark = pytest.mark.slow

PAGES = ("index", "campaigns", "reference/api")
"""Pages with everything there is between them: prose, code, tables, signatures, a picture."""


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_readable(browser: Browser, site: Path, page: str) -> None:
    """No page is wider than its window; text has the contrast that axe asks for; the page of a phone has its menu."""
    with browser.opened(site / f"{page}.html", folder=site) as window:
        for scheme in ("light", "dark"):
            window.emulate_media(color_scheme=scheme)
            for width in (380, 1280):
                window.set_viewport_size({"width": width, "height": 900})
                assert window.evaluate("document.documentElement.scrollWidth") <= width
                assert window.locator("label.nav-overlay-icon").is_visible() == (width == 380)
        assert faint_texts(window) == []


def test_a_word_is_found(browser: Browser, site: Path) -> None:
    """The search works from files, without a server."""
    with browser.opened(site / "index.html", folder=site) as window:
        window.get_by_placeholder("Search").first.fill("Schuler")
        window.keyboard.press("Enter")
        window.locator("#search-results li a").first.wait_for()
        assert window.locator("#search-results li a").count() > 0
