"""A page as data: sections of sentences, tables and figures.

`mcnav.report.document.html` writes a page as HTML, `mcnav.report.document.terminal_parts` prints its parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from markupsafe import Markup

from mcnav.report.document.table import Table

if TYPE_CHECKING:
    from mcnav.report.drawing.figure import Figure  # slow to import: a terminal shows none
    from mcnav.report.drawing.strip import Strip


@dataclass(frozen=True)
class Sentence:
    """A paragraph."""

    text: str
    tone: str = ""


@dataclass(frozen=True)
class Note:
    """A paragraph in small type: how numbers were computed, and what they are not."""

    text: str


@dataclass(frozen=True)
class Verdict:
    """An answer in large type with its tone, and below it sentences and warnings."""

    headline: str
    tone: str = ""
    sentences: Sequence[str] = ()
    warnings: Sequence[str] = ()


@dataclass(frozen=True)
class Verdicts:
    """Several answers beside each other."""

    verdicts: Sequence[Verdict]


@dataclass(frozen=True)
class Tile:
    """The answer to one question, to be seen at a glance.

    Attributes
    ----------
    subject, status : str
        What it is on, and the answer in a word or two.
    tone : str
        Tone of the answer.
    sentence : str
        The answer in a sentence.
    value, of : str
        The number farthest off, in large type, and what it is of; empty where there is none.
    strip : Strip, optional
        Its mark, if it is a ratio.
    link : str
        Section of the page on the subject; empty: none.
    details : sequence of str
        Sentences that the reader unfolds.
    warnings : sequence of str
        Sentences that stand below all tiles.
    further : sequence of (str, str)
        What one asks next, and the section of the page that answers it.
    """

    subject: str
    status: str
    tone: str
    sentence: str
    value: str = ""
    of: str = ""
    strip: Strip | None = None
    link: str = ""
    details: Sequence[str] = ()
    warnings: Sequence[str] = ()
    further: Sequence[tuple[str, str]] = ()


WARNINGS: Final = "warnings"
"""Place of the warnings of tiles on a page, to which links lead."""


@dataclass(frozen=True)
class Tiles:
    """Tiles beside each other, the worst first."""

    tiles: Sequence[Tile]


@dataclass(frozen=True)
class Facts:
    """Names with a few words on each, beside each other or, if ``below``, one below the other."""

    entries: Sequence[tuple[str, str]]
    below: bool = False


@dataclass(frozen=True)
class Findings:
    """Requirements, or what ``name`` says, in one line each: finding, its tone, words; ``further``: where more are."""

    entries: Sequence[tuple[str, str, str]]
    further: str = ""
    name: str = "Requirements"


@dataclass(frozen=True)
class Answers:
    """The foremost tables of a page, which have a form of their own on small screens."""

    tables: Sequence[Table[Any]]
    style: str = ""


@dataclass(frozen=True)
class Heading:
    """Heading of a part of a section."""

    text: str


@dataclass(frozen=True)
class Folded:
    """Parts that are shown when the reader unfolds them; ``explains``: how numbers above are defined."""

    summary: str
    parts: Sequence[Part]
    explains: bool = False


@dataclass(frozen=True)
class Beside:
    """Figures beside each other, and parts beside them."""

    figures: Sequence[Figure]
    parts: Sequence[Part] = ()


@dataclass(frozen=True)
class Listing:
    """A list of texts, numbered or not."""

    entries: Sequence[str]
    numbered: bool = False


@dataclass(frozen=True)
class Lines:
    """Text in lines of its own, such as a traceback, and its name for readers who do not see it."""

    text: str
    name: str


@dataclass(frozen=True)
class Formula:
    """An equation of `mcnav.report.document.formulas`."""

    mathml: Markup


@dataclass(frozen=True)
class MarkKey:
    """Key to the marks of a table: their kinds, and what they mean."""

    entries: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class WhatIfPart:
    """Data of the section "What if", which its script shows: see `mcnav.report.pages.run.sections.what_if`.

    ``first``: whether it stands on the first screen, with the numbers that matter most and a few curves.
    """

    json: str
    first: bool = False


@dataclass(frozen=True)
class LivePart:
    """First state of a live page, which its script shows and renews: see `mcnav.report.pages.live`."""

    json: str


Part: TypeAlias = (
    "Sentence | Note | Verdict | Verdicts | Tiles | Facts | Findings | Answers | Heading | Folded | Beside | Listing"
    " | Lines | Formula | MarkKey | WhatIfPart | LivePart | Table[Any] | Figure"
)
"""Parts of a page."""


@dataclass(frozen=True)
class Section:
    """A section of a page; ``name`` is that of its link."""

    name: str
    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Fold:
    """Parts and sections that the reader unfolds; ``line`` says what is inside, ``name`` is that of its link."""

    name: str
    title: str
    line: str
    parts: Sequence[Part]
    sections: Sequence[Section]

    @property
    def measured(self) -> bool:
        """Return whether it has the foremost table, above which readers choose the unit of numbers."""
        return any(table.measured for part in self.parts if isinstance(part, Answers) for table in part.tables)


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes
    ----------
    title : str
        Title of the window.
    kind : str
        What the page is, above its heading.
    heading : str
        Heading, which may have names that are the user's.
    head, foot : sequence of Part
        Parts above and below the sections.
    folds : sequence of Fold
        Sections that are folded, below the others.
    short : bool
        Whether the folds may stand on the first screen as well, because it says little.
    slide : bool
        Whether the head fills the first screen of a page without folds.
    status, tone : str
        The foremost answer in words, which the title of the window begins with, and its tone, which colours the
        window's icon; empty: none.
    """

    title: str
    kind: str
    heading: str
    head: Sequence[Part] = ()
    sections: Sequence[Section] = ()
    foot: Sequence[Part] = ()
    status: str = ""
    tone: str = ""
    folds: Sequence[Fold] = ()
    short: bool = False
    slide: bool = False

    @property
    def measured(self) -> bool:
        """Return whether a foremost table has numbers of which readers may choose the unit."""
        return any(table.measured for part in self.head if isinstance(part, Answers) for table in part.tables)

    @property
    def all_sections(self) -> list[Section]:
        """All sections, those that are folded as well."""
        return [*self.sections, *(section for fold in self.folds for section in fold.sections)]


def joined(*parts: Part | None) -> tuple[Part, ...]:
    """Return the parts that there are."""
    return tuple(part for part in parts if part is not None)


def headed(heading: str, *parts: Part | None) -> tuple[Part, ...]:
    """Return the parts that there are under a heading; nothing where there are none."""
    known = joined(*parts)
    return (Heading(heading), *known) if known else ()


def folded(summary: str, *parts: Part | None) -> tuple[Part, ...]:
    """Return the parts that there are, to be unfolded; nothing where there are none."""
    known = joined(*parts)
    return (Folded(summary, known),) if known else ()
