"""A table as data: columns, their cells, and text within them.

A column is defined once: heading, content and form on a page and in the terminal. Texts are escaped where they are
shown; only `markupsafe.Markup` is markup, which a terminal shows without its tags.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, Generic, Literal, TypeVar

from markupsafe import Markup

from mcnav.report.format import number

if TYPE_CHECKING:
    from mcnav.report.drawing.strip import Strip

Place = Literal["page", "terminal"]
"""Medium in which a part is shown."""

Row = TypeVar("Row")

EMPHASIS: Final = Markup("<em>{}</em>").format
STRONG: Final = Markup("<strong>{}</strong>").format
CODE: Final = Markup("<code>{}</code>").format
UNIT: Final = Markup('<span class="unit">{}</span>').format
WRAPPED: Final = Markup('<span class="words">{}</span>').format
"""Inline markup; what it encloses is escaped."""


MOST_ROWS, MOST_CELLS, FEWEST_ROWS = 300, 10_000, 20
"""Rows and cells of a table that a page shows at most, and rows that it shows however many columns it has."""


def row_limit(columns: int) -> int:
    """Return the rows that a page shows at most of a table with so many columns.

    >>> row_limit(8), row_limit(200), row_limit(2_000)
    (300, 50, 20)
    """
    return max(FEWEST_ROWS, min(MOST_ROWS, MOST_CELLS // columns))


def five_digits(value: float | None) -> str:
    """Format a number with five significant digits."""
    return number(value, 5)


def counted(value: float | None) -> str:
    """Format a whole number; a missing one is a dash.

    >>> counted(12345), counted(None)
    ('12,345', '–')
    """
    return "–" if value is None else f"{value:,.0f}"


def label(words: str, tone: str = "") -> Markup:
    """Mark words as a coloured label, within a text or a cell."""
    return Markup('<span class="tag {}">{}</span>').format(tone, words)


def counts_in_words(counts: Sequence[tuple[str, int]]) -> Markup:
    """Say how many there are of each kind.

    >>> counts_in_words([("agree", 3), ("differ", 1)])
    Markup('<strong>3</strong> agree, <strong>1</strong> differ.')
    """
    return Markup("{}.").format(
        Markup(", ").join(Markup("{} {}").format(STRONG(f"{n:,}"), words) for words, n in counts)
    )


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes
    ----------
    text : str
        Its content.
    unit : str
        Unit of the content, behind it.
    tone : str, optional
        Tone of a coloured label: ``agrees``, ``partly``, ``undecided``, ``differs`` or nothing; none: no label.
    below : str
        Second line, on a page alone.
    strip : Strip, optional
        Drawing beside a ratio, on a page alone.
    behind : str
        Words behind a label.
    mark : str
        How a computed number compares with a printed one, on a page: ``digits``, ``tolerance``, ``small``,
        ``inconsistent``, ``differs``.
    hint : str
        Words that a pointer shows.
    minor : bool
        Whether it is shown in grey.
    rows, columns : int
        Cells of a page that it covers; zero rows: one above covers it.
    value, value_below : float, optional
        What its text, and its second line, show in digits, where readers may choose other units: see `Column.size`.
    """

    text: str = ""
    unit: str = ""
    tone: str | None = None
    below: str = ""
    strip: Strip | None = None
    behind: str = ""
    mark: str = ""
    hint: str = ""
    minor: bool = False
    rows: int = 1
    columns: int = 1
    value: float | None = None
    value_below: float | None = None


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One column of a table.

    Attributes
    ----------
    heading : str
        Heading on a page.
    content : callable
        Returns the content of a row: a cell, a text, or a number.
    brief : str, optional
        Heading in the terminal, by default that of the page.
    kind : str
        ``number``, which stays on one line; ``label``, a short text that stands like a number on a page; ``text``;
        ``words``, which are wrapped.
    form : callable
        Formats a number.
    unit : str
        Unit of all rows, in the heading.
    place : str, optional
        The only place where it is shown.
    of_user : bool
        Whether it has names that are the user's, which may be written from right to left.
    spare : int
        Above zero in columns that a narrow terminal may leave out, those with the largest number first.
    beside : str, optional
        What precedes its cells on a small screen that shows no headings; by default the heading of a number.
    size : str
        ``sigma`` or ``value`` of numbers in the unit of their row, that of its first cell: readers of a page may choose
        another multiple of sigma, and other units. All numbers in that unit are in such columns.
    """

    heading: str
    content: Callable[[Row], Cell | str | float | None]
    brief: str | None = None
    kind: Literal["number", "label", "text", "words"] = "number"
    form: Callable[[float | None], str] = number
    unit: str = ""
    place: Place | None = None
    of_user: bool = False
    spare: int = 0
    beside: str | None = None
    size: Literal["", "sigma", "value"] = ""

    @property
    def name_beside(self) -> str:
        """Text before its cells where there are no headings; may be empty."""
        if self.beside is not None:
            return self.beside
        return self.heading[:1].lower() + self.heading[1:] if self.kind == "number" else ""

    def cell(self, row: Row) -> Cell:
        """Return the cell of a row."""
        content = self.content(row)
        if isinstance(content, Cell):
            return content
        if isinstance(content, str):
            return Cell(content)
        return Cell(self.form(content), value=content if self.size else None)

    @property
    def terminal_heading(self) -> str:
        """The heading in the terminal, with the unit in brackets."""
        heading = self.heading if self.brief is None else self.brief
        return f"{heading} [{self.unit}]" if self.unit else heading


@dataclass(frozen=True)
class Table(Generic[Row]):
    """A table: columns, and the rows of which they show something.

    Attributes
    ----------
    caption : str
        Caption on a page.
    title : str
        Heading in the terminal.
    keys : int
        First columns in the terminal, which identify a row; on a page the first one does.
    style : str
        Class of the style sheet.
    name : str
        Identifier on its page.
    verdict : callable, optional
        Returns the verdict of a row, by which readers can choose rows.
    faint : callable, optional
        Returns whether the terminal shows a row faintly.
    elsewhere : str
        Where the columns are that a narrow terminal leaves out.
    group : callable, optional
        Returns the heading of the rows that a row belongs to; empty: none. Rows of a group follow one another.
    """

    caption: str
    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    title: str = ""
    keys: int = 1
    style: str = ""
    name: str = ""
    verdict: Callable[[Row], str] | None = None
    faint: Callable[[Row], bool] | None = None
    elsewhere: str = ""
    group: Callable[[Row], str] | None = None

    def columns_in(self, place: Place) -> list[Column[Row]]:
        """Return the columns that are shown in a place."""
        return [column for column in self.columns if column.place in (None, place)]

    def cells_in(self, place: Place) -> list[list[Cell]]:
        """Return the cells that are shown in a place, row by row."""
        columns = self.columns_in(place)
        return [[column.cell(row) for column in columns] for row in self.rows]

    def foremost(self, prominence: Callable[[Row], Any], rows: str, which: str) -> Table[Row]:
        """Return it with the most prominent rows that a page has room for, in their order, which its caption says."""
        most = row_limit(len(self.columns))
        if len(self.rows) <= most:
            return self
        ranked = sorted(range(len(self.rows)), key=lambda place: prominence(self.rows[place]), reverse=True)
        caption = f"{self.caption} Of {len(self.rows):,} {rows} the page shows {most}: {which}. summary.json has all."
        return replace(self, caption=caption, rows=[self.rows[place] for place in sorted(ranked[:most])])

    @property
    def measured(self) -> bool:
        """Return whether readers may choose the unit of its rows."""
        return any(column.size for column in self.columns)

    @property
    def headings(self) -> list[str]:
        """Heading above each row; empty where the row before has the same."""
        groups = ["", *("" if self.group is None else self.group(row) for row in self.rows)]
        return [group if group != before else "" for before, group in pairwise(groups)]

    def placed(self) -> Iterator[tuple[str, str, list[tuple[Column[Row], Cell]]]]:
        """Yield for each row of a page the heading above it, its verdict and its cells, without those covered."""
        columns = self.columns_in("page")
        for heading, row, cells in zip(self.headings, self.rows, self.cells_in("page"), strict=True):
            covered, placed = 0, list[tuple[Column[Row], Cell]]()
            for column, cell in zip(columns, cells, strict=True):
                if covered == 0 and cell.rows:
                    placed.append((column, cell))
                    covered = cell.columns
                covered = max(covered - 1, 0)
            yield heading, "" if self.verdict is None else self.verdict(row), placed
