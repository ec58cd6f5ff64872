"""Sentences of a page, a terminal or a message, and those that are too long to be read at once."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import Final

MOST: Final = 25
"""Most words of a sentence."""

BLOCKS: Final = frozenset(
    [
        "p",
        "li",
        "div",
        "section",
        "h2",
        "h3",
        "summary",
        "figcaption",
        "caption",
        "dt",
        "dd",
        "td",
        "th",
        "tr",
        "table",
        "details",
        "header",
        "nav",
        "main",
        "br",
        "ul",
        "ol",
        "dl",
        "figure",
        "small",
        "label",
        "option",
        "text",
        "desc",
    ]
)
"""Elements that begin and end a text of their own."""

LEFT_OUT: Final = frozenset(
    ("script", "style", "noscript", "svg", "math", "table", "code", "pre", "title", "select", "h1")
)
"""Elements whose words are no sentences of ours: names of users, code, formulas, drawings, cells of tables."""

VOID: Final = frozenset(("br", "img", "input", "meta", "link", "hr", "col", "wbr"))


class _Texts(HTMLParser):
    """Collects the texts of a page, one for each block; of tables their captions."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.text = ""
        self.texts: list[str] = []

    def end_text(self) -> None:
        if self.text.strip():
            self.texts.append(" ".join(self.text.split()))
        self.text = ""

    @property
    def _silent(self) -> bool:
        hiding = [place for place, tag in enumerate(self.open) if tag in LEFT_OUT]
        return any(self.open[place] != "table" or "caption" not in self.open[place:] for place in hiding)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in BLOCKS:
            self.end_text()
        if tag == "code" and not self._silent:
            self.text += " code "
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in BLOCKS:
            self.end_text()
        while tag in self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.text += data


def texts_of(page: str) -> list[str]:
    """Return the texts of an HTML page without its tables, code and formulas."""
    parser = _Texts()
    parser.feed(page)
    parser.end_text()
    return parser.texts


def prose_of(page: str) -> list[str]:
    r"""Return the paragraphs and entries of lists of a page in Markdown, with a word in place of each piece of code.

    >>> prose_of("# A\n\nSee [the page](A.md)\nfor `a b`.\n- one\n- two\n\n| a | b |\n")
    ['See the page for code.', '- one', '- two']
    """
    page = re.sub(r"^```.*?^```[^\n]*$", "", page, flags=re.MULTILINE | re.DOTALL)
    page = re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", re.sub(r"`[^`]+`", "code", page.replace("**", "")))
    silent = re.compile(r"^(\||    |#|<|\$|>>>|!\[).*$", re.MULTILINE)
    blocks = re.split(r"\n\s*\n|\n(?= *- |\d+\. )", silent.sub("\n", page))
    return [text for text in (" ".join(block.split()) for block in blocks) if text]


def too_long(text: str) -> list[str]:
    """Return the sentences of a text that have more words than `MOST`; numbers are words.

    >>> too_long("One two. " + 13 * "word " + "; " + 13 * "word ")[0][:4]
    'word'
    >>> too_long(25 * "word " + ". " + 25 * "word ")
    []
    """
    sentences = re.split(r"(?<=[.!?])\s+|\n\s*\n", text)
    return [sentence for sentence in sentences if sum(bool(re.search(r"\w", word)) for word in sentence.split()) > MOST]


TABULAR: Final = re.compile(r"\S {2,}\S|^\s*[\w.]+ = |^\[|^#|^(written|next|note): ")
"""Lines of a terminal that are no prose: rows of tables, lines of TOML, comments, files and commands."""


def printed_sentences(output: str) -> list[str]:
    r"""Return the sentences of a terminal's output that are too long; tables, TOML and commands aside.

    >>> printed_sentences("sigma  " + 30 * "word " + "\nAll is well.\n")
    []
    >>> len(printed_sentences(26 * "word " + ".\n"))
    1
    """
    prose = [line for line in output.splitlines() if line.strip() and not TABULAR.search(line)]
    return [sentence for line in prose for sentence in too_long(line)]
