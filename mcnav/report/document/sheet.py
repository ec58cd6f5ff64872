"""A short page as a PDF of A4 sheets: tiles, tables, sentences and figures one below the other, drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure as MplFigure
from matplotlib.patches import Rectangle

from mcnav.report.document.parts import Heading, Note, Page, Part, Section, Sentence, Tile, Tiles
from mcnav.report.document.table import Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.on_axes import STYLE, draw
from mcnav.report.drawing.palette import INK, MUTED, PAPER
from mcnav.report.drawing.ticks import text_width

A4: Final = (8.27, 11.69)
"""Width and height, in."""

MARGIN: Final = 0.5
"""Margin of all sides, in."""

WIDTH: Final = A4[0] - 2.0 * MARGIN

TITLE, HEADING, TEXT, SMALL = 13.0, 10.0, 7.5, 6.5
"""Sizes of text, points."""

LEADING: Final = 1.35
"""Distance of lines, in sizes of their text."""

TONES: Final = {"agrees": "#0a7a55", "differs": "#c2350a", "partly": "#a87400", "undecided": "#a87400"}
"""Colours of verdicts."""

DRAWING: Final = 1.85
"""Height of a figure with an x axis of its own, in; one of bars needs what its names need."""

BAR: Final = 0.15
"""Height of a bar with its distance, in."""


def write_pdf(page: Page, path: Path) -> Path:
    """Write a page as a PDF file without the date."""
    sheets = _Sheets()
    with mpl.rc_context(STYLE | {"font.size": TEXT}):
        sheets.text(page.kind.upper(), SMALL, MUTED)
        sheets.text(page.heading, TITLE)
        for part in page.head:
            sheets.part(part)
        for section in page.sections:
            sheets.section(section)
        with PdfPages(path, metadata={"CreationDate": None, "Title": page.title}) as file:
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
    return Markup(text).striptags() if isinstance(text, Markup) else text


class _Sheets:
    """Sheets that are filled from above; ``down`` is the distance of the next part from the upper edge, in."""

    def __init__(self) -> None:
        self.figures: list[MplFigure] = []
        self.down = A4[1]

    def room(self, height: float) -> None:
        """Begin another sheet where so much, in, does not fit into this one."""
        if self.down + height > A4[1] - MARGIN:
            self.figures.append(MplFigure(figsize=A4))
            self.down = MARGIN

    def put(self, x: float, down: float, text: str, size: float, colour: str = INK, **more: Any) -> None:
        """Write a line; its upper left corner is so far, in, from the left margin and from the upper edge."""
        at = (MARGIN + x) / A4[0], 1.0 - down / A4[1]
        self.figures[-1].text(*at, text, fontsize=size, color=colour, va="top", **more)

    def text(self, text: str, size: float = TEXT, colour: str = INK) -> None:
        """Write a paragraph."""
        for line in wrapped(_plain(text), WIDTH, size):
            height = size * LEADING / 72.0
            self.room(height)
            self.put(0.0, self.down, line, size, colour)
            self.down += height
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
            case Tiles():
                self.tiles(part.tiles)
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

    def tiles(self, tiles: Sequence[Tile]) -> None:
        """Draw tiles beside each other."""
        gap = 0.12
        wide = (WIDTH - gap * (len(tiles) - 1)) / len(tiles)
        inner = wide - 0.2
        filled = [[*_lines_of_tile(tile, inner)] for tile in tiles]
        high = 0.16 + max(sum(size * LEADING / 72.0 for _, size, _ in lines) for lines in filled)
        self.room(high)
        for place, (tile, lines) in enumerate(zip(tiles, filled, strict=True)):
            left = place * (wide + gap)
            corner = (MARGIN + left) / A4[0], 1.0 - (self.down + high) / A4[1]
            colour = TONES.get(tile.tone, MUTED)
            box = Rectangle(corner, wide / A4[0], high / A4[1], facecolor=PAPER, edgecolor=colour, linewidth=1.2)
            self.figures[-1].add_artist(box)
            down = self.down + 0.08
            for text, size, strong in lines:
                self.put(left + 0.1, down, text, size, colour if strong else INK)
                down += size * LEADING / 72.0
        self.down += high + 0.1

    def table(self, table: Table[Any]) -> None:
        """Write a table; columns are as wide as their text asks for, those of words share what is left."""
        columns, rows = table.columns_in("page"), table.cells_in("page")
        heads = [f"{column.heading} [{column.unit}]" if column.unit else column.heading for column in columns]
        texts = [[[_plain(f"{cell.text} {cell.unit}").strip(), _plain(cell.below)] for cell in row] for row in rows]
        asked = [
            max(text_width(text, SMALL) for text in (heads[k], *(each for row in texts for each in row[k]))) / 72.0
            for k in range(len(columns))
        ]
        widths = _shared(asked, WIDTH - 0.12 * (len(columns) - 1))
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
        high = max(DRAWING, BAR * named + 0.6)
        self.room(high + 0.5)
        if figure.shows:
            self.text(figure.shows)
        if figure.key:
            self.key(figure)
        left = 0.25 if named else 0.08
        for place, panel in enumerate(panels):
            wide = 1.0 / len(panels)
            box = (
                (MARGIN + WIDTH * (place * wide + left * wide)) / A4[0], 1.0 - (self.down + high - 0.45) / A4[1],
                WIDTH * wide * (0.97 - left) / A4[0], (high - 0.65) / A4[1],
            )  # fmt: skip
            draw(panel, self.figures[-1].add_axes(box), SMALL / 8.0)
        self.down += high
        if figure.caption:
            self.text(figure.caption, SMALL, MUTED)

    def key(self, figure: Figure) -> None:
        """Write the names of a figure's series beside squares of their colours, in one line."""
        left = 0.0
        for series in figure.key:
            wide = text_width(f"■ {series.label}   ", SMALL) / 72.0
            if left and left + wide > WIDTH:
                left, self.down = 0.0, self.down + SMALL * LEADING / 72.0
            self.put(left, self.down, "■", SMALL, series.colour)
            self.put(left + 0.14, self.down, series.label, SMALL)
            left += wide
        self.down += SMALL * LEADING / 72.0 + 0.04


def _lines_of_tile(tile: Tile, width: float) -> Iterator[tuple[str, float, bool]]:
    """Yield the lines of a tile, their size, and whether they are in its colour."""
    yield f"{tile.subject}: {tile.status}", 9.0, True
    if tile.value:
        yield tile.value, 14.0, True
    for line in wrapped(tile.of, width, SMALL) if tile.of else ():
        yield line, SMALL, False
    for line in wrapped(_plain(tile.sentence), width, SMALL):
        yield line, SMALL, False


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
