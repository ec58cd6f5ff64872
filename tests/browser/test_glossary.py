"""Words of a report are explained where they stand, by the page of the glossary."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from mcnav.docs.pages import page_text
from mcnav.report.document.glossary import HINTED, glossary
from tests.browser.conftest import Browser


def test_words_of_reports_are_in_the_glossary() -> None:
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", page_text("glossary"), re.MULTILINE)
    assert set(HINTED) <= {word for words, _ in rows for word in words.split(", ")}
    assert glossary()["NEES"] in page_text("glossary").replace("`", "")


def test_by_pointer_and_by_keyboard(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """All have their meaning under the pointer; the first of each in a section takes the focus, and none twice."""
    with browser.opened(page_of("aided")) as page:
        told = page.locator(".meaning")
        texts = page.locator("section#filter .term").all_inner_texts()
        assert {"NEES", "NIS"} <= set(texts)
        focused = page.locator("section#filter button.term").evaluate_all("all => all.map((each) => each.textContent)")
        assert len({each.lower() for each in focused}) == len(focused)
        page.locator("section#filter button.term", has_text="NIS").first.focus()
        assert told.inner_text() == f"NIS: {glossary()['NIS']}."
        described = page.locator("section#filter button.term", has_text="NIS").first.get_attribute("aria-describedby")
        assert page.locator(f"#{described}").text_content() == glossary()["NIS"]
        page.keyboard.press("Escape")
        assert told.is_hidden()
        page.locator("section#filter span.term:visible", has_text="NEES").first.hover()
        assert told.inner_text() == f"NEES: {glossary()['NEES']}."
        inside = page.locator(":is(svg, code, .what-if, details.data, button button, a button) .term")
        assert inside.count() == 0
