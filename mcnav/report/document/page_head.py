"""The head of a page of mcnav, read again: what kind of page it is, its heading, and its answer."""

from __future__ import annotations

from dataclasses import dataclass
from html.parser import HTMLParser
from typing import Final

LONGEST: Final = 600
"""Characters of an answer that are kept."""

TONES: Final = ("agrees", "partly", "differs", "undecided")


@dataclass(frozen=True)
class PageHead:
    """Kind, heading and first answer of a page, with its tone; empty where it has none."""

    kind: str = ""
    heading: str = ""
    answer: str = ""
    tone: str = ""


class _Reader(HTMLParser):
    """Texts of the elements that a page's head has, until its first section begins."""

    def __init__(self) -> None:
        super().__init__()
        self.texts, self.tone = {"kind": "", "heading": "", "answer": ""}, ""
        self.own, self.done = False, False
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note where a text begins."""
        named = dict(attrs)
        classes = (named.get("class") or "").split()
        if tag == "meta" and named.get("name") == "generator":
            self.own = named.get("content") == "mcnav"
        if self.done:
            return
        if tag == "section":
            self.done = True
        elif "verdict" in classes and not self.texts["answer"]:
            self.tone = next((each for each in classes if each in TONES), "")
        elif tag == "h1":
            self._inside = "heading"
        elif tag == "p" and "kicker" in classes:
            self._inside = "kind"
        elif tag == "p" and "headline" in classes and not self.texts["answer"]:
            self._inside = "answer"

    def handle_endtag(self, tag: str) -> None:
        """Note where a text ends."""
        if tag in ("p", "h1"):
            self._inside = ""

    def handle_data(self, data: str) -> None:
        """Collect a text."""
        if self._inside and not self.done:
            self.texts[self._inside] += data


def page_head(text: str) -> PageHead | None:
    """Read the head of a page; none where mcnav has not written it.

    >>> page_head('<meta name="generator" content="mcnav"><p class="kicker">Sweep</p><h1>A &amp; B</h1>')
    PageHead(kind='Sweep', heading='A & B', answer='', tone='')
    >>> page_head("<h1>Mine</h1>")
    """
    reader = _Reader()
    reader.feed(text)
    if not reader.own:
        return None
    kind, heading, answer = (" ".join(text.split())[:LONGEST] for text in reader.texts.values())
    return PageHead(kind, heading, answer, reader.tone if answer else "")
