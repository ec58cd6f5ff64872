"""A short page as PDF files, drawn by matplotlib: its head as one slide, and all of it as A4 sheets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure as MplFigure
from matplotlib.patches import Rectangle

from mcnav.report.document.parts import (
    Beside,
    Facts,
    Findings,
    Heading,
    Note,
    Page,
    Part,
    Section,
    Sentence,
    Verdict,
)
from mcnav.report.document.table import Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.on_axes import STYLE, draw
from mcnav.report.drawing.palette import INK, MUTED
from mcnav.report.drawing.ticks import text_width

A4: Final = (8.27, 11.69)
SLIDE: Final = (13.333, 7.5)
"""Width and height, in; a slide is 16:9."""

MARGIN: Final = 0.5
"""Margin of all sides, in."""

LARGER: Final = 1.8
"""Size of a slide's text over that of a sheet's."""

SMALLER: Final = (1.0, 0.9, 0.8)
"""Sizes of a sheet's text that are tried until it is one sheet."""

LEFT: Final = 0.56
"""Share of a slide's width that its figure has."""

TITLE, HEADING, TEXT, SMALL = 13.0, 10.0, 7.5, 6.5
"""Sizes of text, points."""

LEADING: Final = 1.35
"""Distance of lines, in sizes of their text."""

BUTTON: Final = re.compile("<button.*?</button>", re.DOTALL)

TONES: Final = {"agrees": "#0a7a55", "differs": "#c2350a", "partly": "#a87400", "undecided": "#a87400"}
"""Colours of verdicts."""

DRAWING: Final = 1.85
"""Height of a figure with an x axis of its own, in; one of bars needs what its names need."""

BAR: Final = 0.15
"""Height of a bar with its distance, in."""


def write_sheet(page: Page, path: Path) -> Path:
    """Write a page as a PDF file of one A4 sheet without the date, with smaller text where it asks for more.

    A page that is too long at the smallest size has more sheets.
    """
    for larger in SMALLER:
        sheets = _filled(page, A4, larger, page.sections)
        if len(sheets.figures) == 1:
            break
    return _write(page, path, sheets)


def write_slide(page: Page, path: Path) -> Path:
    """Write the head of a page as a PDF file of one slide without the date."""
    return _write(page, path, _filled(page, SLIDE, LARGER, ()))


def _filled(page: Page, size: tuple[float, float], larger: float, sections: Sequence[Section]) -> _Sheets:
    """Draw the head of a page and some sections."""
    sheets = _Sheets(size, larger)
    with mpl.rc_context(STYLE | {"font.size": TEXT * larger}):
        sheets.text(page.heading, TITLE)
        for part in page.head:
            sheets.part(part)
        for section in sections:
            sheets.section(section)
    return sheets


def _write(page: Page, path: Path, sheets: _Sheets) -> Path:
    with (
        mpl.rc_context(STYLE | {"font.size": TEXT * sheets.larger}),
        PdfPages(path, metadata={"CreationDate": None, "Title": page.title}) as file,
    ):
        for figure in sheets.figures:
            file.savefig(figure)
    return path


def wrapped(text: str, width: float, size: float) -> list[str]:
    """Break a text into lines of a width, in, at blanks; a word that is too long stands alone.

    >>> wrapped("one two three", 0.6, 8.0)
    ['one two', 'three']
    """
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and text_width(longer, size) / 72.0 > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _plain(text: str) -> str:
    """Return text without markup, and without buttons, which paper does not have."""
    return Markup(BUTTON.sub("", text)).striptags() if isinstance(text, Markup) else text


class _Sheets:
    """Sheets that are filled from above; ``down`` is the distance of the next part from the upper edge, in.

    ``left`` and ``width`` are those of the column that is filled, ``larger`` multiplies the sizes of text.
    """

    def __init__(self, size: tuple[float, float], larger: float) -> None:
        self.figures: list[MplFigure] = []
        self.size, self.larger = size, larger
        self.down, self.left, self.width = size[1], MARGIN, size[0] - 2.0 * MARGIN

    def room(self, height: float) -> None:
        """Begin another sheet where so much, in, does not fit into this one."""
        if self.down + height > self.size[1] - MARGIN:
            self.figures.append(MplFigure(figsize=self.size))
            self.down = MARGIN

    def put(self, x: float, down: float, text: str, size: float, colour: str = INK, **more: Any) -> None:
        """Write a line; its upper left corner is so far, in, from the left of the column and from the upper edge."""
        at = (self.left + x) / self.size[0], 1.0 - down / self.size[1]
        self.figures[-1].text(*at, text, fontsize=size * self.larger, color=colour, va="top", **more)

    def high(self, size: float) -> float:
        """Return the height of a line, in."""
        return size * self.larger * LEADING / 72.0

    def broken(self, text: str, size: float, width: float = 0.0) -> list[str]:
        """Break a text into lines of a width, by default that of the column."""
        return wrapped(_plain(text), width or self.width, size * self.larger)

    def text(self, text: str, size: float = TEXT, colour: str = INK) -> None:
        """Write a paragraph."""
        for line in self.broken(text, size):
            self.room(self.high(size))
            self.put(0.0, self.down, line, size, colour)
            self.down += self.high(size)
        self.down += 0.04

    def section(self, section: Section) -> None:
        """Write a section; its heading stays with what follows."""
        self.down += 0.1
        self.room(1.2)
        self.text(section.title, HEADING)
        for part in section.parts:
            self.part(part)

    def part(self, part: Part) -> None:
        """Write a part of a page."""
        match part:
            case Verdict():
                self.verdict(part)
            case Beside():
                self.beside(part)
            case Facts():
                for name, words in part.entries:
                    self.text(name, SMALL, MUTED)
                    self.text(words)
            case Findings():
                for finding, tone, words in part.entries:
                    self.finding(finding, tone, words)
                if part.further:
                    self.text(part.further, SMALL, MUTED)
            case Table():
                self.table(part)
            case Figure():
                self.figure(part)
            case Sentence():
                self.text(part.text)
            case Note():
                self.text(part.text, SMALL, MUTED)
            case Heading():
                self.text(part.text, 9.0)
            case _:
                raise TypeError(f"a sheet has no place for {type(part).__name__}")

    def verdict(self, verdict: Verdict) -> None:
        """Draw a verdict with its sentences beside a bar of its colour."""
        colour = TONES.get(verdict.tone, MUTED)
        lines = [(line, HEADING, colour) for line in self.broken(verdict.headline, HEADING, self.width - 0.3)]
        for text in (*verdict.sentences, *verdict.warnings):
            lines += [(line, TEXT, INK) for line in self.broken(text, TEXT, self.width - 0.3)]
        height = 0.12 + sum(self.high(size) for _, size, _ in lines)
        self.room(height)
        corner = self.left / self.size[0], 1.0 - (self.down + height) / self.size[1]
        self.figures[-1].add_artist(
            Rectangle(corner, 0.06 / self.size[0], height / self.size[1], facecolor=colour, edgecolor="none")
        )
        down = self.down + 0.06
        for text, size, line_colour in lines:
            self.put(0.2, down, text, size, line_colour)
            down += self.high(size)
        self.down += height + 0.12

    def beside(self, part: Beside) -> None:
        """Draw figures, and parts beside them on a slide, below them on a sheet."""
        top, left, width = self.down, self.left, self.width
        if self.larger > 1.0:
            self.width = LEFT * width
        for figure in part.figures:
            self.figure(figure)
        if self.larger > 1.0:
            self.down, self.left, self.width = top, left + (LEFT + 0.03) * width, (0.97 - LEFT) * width
        for other in part.parts:
            self.part(other)
        self.left, self.width = left, width

    def finding(self, finding: str, tone: str, words: str) -> None:
        """Write a finding in its colour, and what it is on beside it."""
        beside = text_width(f"{finding}  ", TEXT * self.larger) / 72.0
        lines = self.broken(words, TEXT, self.width - beside)
        self.room(len(lines) * self.high(TEXT))
        self.put(0.0, self.down, finding, TEXT, TONES.get(tone, MUTED))
        for line in lines:
            self.put(beside, self.down, line, TEXT)
            self.down += self.high(TEXT)
        self.down += 0.04

    def table(self, table: Table[Any]) -> None:
        """Write a table; columns are as wide as their text asks for, those of words share what is left."""
        kept = [k for k, column in enumerate(table.columns_in("page")) if column.heading]
        columns = [table.columns_in("page")[k] for k in kept]
        rows = [[row[k] for k in kept] for row in table.cells_in("page")]
        heads = [f"{column.heading} [{column.unit}]" if column.unit else column.heading for column in columns]
        texts = [[[f"{_plain(cell.text)} {cell.unit}".strip(), _plain(cell.below)] for cell in row] for row in rows]
        asked = [
            max(text_width(text, SMALL) for text in (heads[k], *(each for row in texts for each in row[k]))) / 72.0
            for k in range(len(columns))
        ]
        widths = _shared(asked, self.width - 0.12 * (len(columns) - 1))
        lines = [[wrapped(head, width, SMALL) for head, width in zip(heads, widths, strict=True)]]
        lines += [
            [[line for text in cell if text for line in wrapped(text, width, SMALL)] for cell, width in
             zip(row, widths, strict=True)]
            for row in texts
        ]  # fmt: skip
        for number, row in enumerate(lines):
            height = max(map(len, row)) * SMALL * LEADING / 72.0 + 0.04
            self.room(height)
            left = 0.0
            for k, (cell, width) in enumerate(zip(row, widths, strict=True)):
                tone = rows[number - 1][k].tone if number else None
                for line, text in enumerate(cell):
                    colour = MUTED if number == 0 or line >= len(wrapped(texts[number - 1][k][0], width, SMALL)) else (
                        TONES.get(tone or "", INK)
                    )  # fmt: skip
                    self.put(left, self.down + line * SMALL * LEADING / 72.0, text, SMALL, colour)
                left += width + 0.12
            self.down += height
        self.down += 0.06

    def figure(self, figure: Figure) -> None:
        """Draw the first panels of a figure, two beside each other, with its key and sentence."""
        panels = figure.first[:2]
        named = max((len(panel.y.names) for panel in panels), default=0)
        high = max(DRAWING, BAR * named + 0.6) * min(self.larger, 1.0)
        if self.larger > 1.0:
            high = self.size[1] - self.down - MARGIN - 0.5
        self.room(high + 0.5)
        if figure.shows:
            self.text(figure.shows)
        if figure.key:
            self.key(figure)
        left = 0.25 if named else 0.08
        wide, tall = self.size
        for place, panel in enumerate(panels):
            share = self.width / len(panels)
            box = (
                (self.left + (place + left) * share) / wide, 1.0 - (self.down + high - 0.45) / tall,
                share * (0.97 - left) / wide, (high - 0.65) / tall,
            )  # fmt: skip
            draw(panel, self.figures[-1].add_axes(box), SMALL * self.larger / 8.0)
        self.down += high
        if figure.caption:
            self.text(figure.caption, SMALL, MUTED)

    def key(self, figure: Figure) -> None:
        """Write the names of a figure's series beside squares of their colours, in one line."""
        left, mark = 0.0, 0.14 * self.larger
        for series in figure.key:
            wide = text_width(f"■ {series.label}   ", SMALL * self.larger) / 72.0
            if left and left + wide > self.width:
                left, self.down = 0.0, self.down + self.high(SMALL)
            self.put(left, self.down, "■", SMALL, series.colour)
            self.put(left + mark, self.down, series.label, SMALL)
            left += wide
        self.down += self.high(SMALL) + 0.04


def _shared(asked: Sequence[float], room: float) -> list[float]:
    """Share a width among columns: each has what it asks for, or an equal part of what the narrower ones leave.

    >>> _shared([1.0, 5.0, 9.0], 9.0)
    [1.0, 4.0, 4.0]
    """
    result, left, columns = [0.0] * len(asked), room, len(asked)
    for place in sorted(range(len(asked)), key=asked.__getitem__):
        result[place] = min(asked[place], left / columns)
        left, columns = left - result[place], columns - 1
    return result
