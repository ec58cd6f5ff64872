"""What an index reads of a page: its own words, and none of a page that is somebody else's."""

from __future__ import annotations

import pytest

from mcnav.report.document.html import page_html
from mcnav.report.document.page_head import LONGEST, PageHead, page_head
from mcnav.report.document.parts import Page, Section, Sentence, Verdict

HOSTILE = "</p></h1><script>alert(1)</script> & <b> \u202e"


@pytest.mark.parametrize("tone", ["agrees", "partly", "differs", "undecided"])
def test_kind_heading_and_first_answer(tone: str) -> None:
    head = [Verdict(HOSTILE, tone, ["further"]), Verdict("the second", "agrees")]
    page = page_html(Page("title", "A kind", f"Heading {HOSTILE}", head))
    shown = HOSTILE.replace("\u202e", "[U+202E]")  # pages turn no text
    assert page_head(page) == PageHead("A kind", f"Heading {shown}", shown, tone)


def test_an_answer_in_a_section_is_no_answer_of_the_page() -> None:
    page = page_html(Page("title", "A kind", "Heading", sections=[Section("one", "One", [Verdict("no", "differs")])]))
    assert page_head(page) == PageHead("A kind", "Heading")
    assert page_head(page_html(Page("title", "A kind", "Heading", [Sentence("words")]))) == PageHead(
        "A kind", "Heading"
    )


@pytest.mark.parametrize("text", ["", "<h1>Mine</h1>", "\0" * 100, "<meta name=generator content=other><h1>x</h1>"])
def test_other_pages_have_no_head(text: str) -> None:
    assert page_head(text) is None


def test_a_page_that_is_cut_off_and_a_long_answer() -> None:
    page = page_html(Page("title", "A kind", "Heading", [Verdict("long " * 1_000, "agrees")]))
    head = page_head(page)
    assert head is not None
    assert len(head.answer) == LONGEST
    cut = page_head(page[: page.index("Heading</h1>") + 4])
    assert cut == PageHead("A kind", "Head")
