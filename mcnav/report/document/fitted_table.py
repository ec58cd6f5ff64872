"""Tables for the terminal that show every number in full at any width.

A table uses the first of these forms that fits: as it is; with headings and texts wrapped between words; without spare
columns, which a line below names; with the first columns wrapped, too; in blocks of columns that repeat the first ones;
as one record below another. No text is taller than `TALLEST`, but for lists of shares, which have a line for each. In a
pipe or a file the width is unlimited.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from textwrap import wrap
from typing import Final

from rich.cells import cell_len
from rich.console import Console, ConsoleDimensions, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from mcnav.physics.units import printable

UNLIMITED: Final = 1_000_000
"""Width of a pipe."""

GAP: Final = 2
"""Spaces between columns."""

TALLEST: Final = 2
"""Lines of a text in a column, above which it is read more easily in a record."""

SHARES: Final = " %, "
"""Between the entries of a list of shares."""

INDENT: Final = 2
"""Spaces before the lines of a record."""


class OpenConsole(Console):
    """A console that is as wide as its terminal, and unlimited when it writes to a pipe or a file.

    Characters that are not printable are escaped: names in a run folder may be anyone's, and would act
    in a terminal.
    """

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield segments of printable text."""
        for text, style, control in super().render(renderable, options):
            lines = text if control else "\n".join(printable(line, len(line)) for line in text.split("\n"))
            yield Segment(lines, style, control)

    @property
    def size(self) -> ConsoleDimensions:
        """Width and height in cells."""
        size = super().size
        return size if self.is_terminal else ConsoleDimensions(UNLIMITED, size.height)

    @size.setter
    def size(self, new_size: tuple[int, int]) -> None:
        self._width, self._height = new_size


@dataclass(frozen=True)
class Column:
    """One column of texts, which may be wrapped, or of numbers, which stay on one line.

    Columns whose ``spare`` is above zero may be omitted, those with the largest number first.
    """

    heading: str
    text: bool = False
    spare: int = 0


def texts(*headings: object) -> list[Column]:
    """Return columns of texts."""
    return [Column(str(heading), text=True) for heading in headings]


def numbers(*headings: str, spare: bool = False) -> list[Column]:
    """Return columns of numbers; spare ones are omitted from the right."""
    return [Column(heading, spare=place if spare else 0) for place, heading in enumerate(headings, start=1)]


@dataclass
class FittedTable:
    """Rows under headings, laid out for the width of the console.

    The first ``keys`` columns identify a row: every block repeats them. ``elsewhere`` names where omitted columns are.
    """

    title: str
    columns: Sequence[Column]
    keys: int = 1
    elsewhere: str = ""
    rows: list[list[Text]] = field(default_factory=list)

    def add(self, *cells: str | Text) -> None:
        """Append a row."""
        self.rows.append([cell if isinstance(cell, Text) else Text(cell) for cell in cells])

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines."""
        width = options.max_width
        if self.title:
            yield from _wrapped(console, Text(self.title, style="bold"), width)
        everything = list(range(len(self.columns)))
        if sum(map(self._widest, everything)) + GAP * (len(everything) - 1) > width:
            self.rows = [list(map(_one_a_line, row)) for row in self.rows]
        kept, blocks = self._layout(everything, width)
        for number, block in enumerate(blocks):
            if number:
                yield Text()
            yield from self._block(console, block, width)
        if not blocks:
            yield from self._records(console, kept, width)
        omitted = [self.columns[at].heading for at in everything if at not in kept]
        if omitted:
            where = f"; see {self.elsewhere}" if self.elsewhere else ""
            remark = f"not shown at this width: {', '.join(omitted)}{where}"
            yield from _wrapped(console, Text(remark, style="dim"), width)

    def _layout(self, columns: list[int], width: int) -> tuple[list[int], list[list[int]]]:
        """Return the columns kept, and the blocks that show them; no block where records are needed."""
        while not self._fits(columns, width, whole_keys=True):
            spare = max(columns, key=lambda at: (self.columns[at].spare, at))
            if not self.columns[spare].spare:
                break
            columns = [at for at in columns if at != spare]
        keys, others = columns[: self.keys], columns[self.keys :]
        blocks: list[list[int]] = []
        for at in others:
            if blocks and self._can_be_read([*blocks[-1], at], width):
                blocks[-1].append(at)
            elif self._can_be_read([*keys, at], width):
                blocks.append([*keys, at])
            else:
                return columns, []
        if not others and self._can_be_read(keys, width):
            blocks.append(keys)
        return columns, blocks

    def _can_be_read(self, columns: Sequence[int], width: int) -> bool:
        return self._fits(columns, width) and self._height(columns, width) <= TALLEST

    def _has_lists(self, at: int) -> bool:
        """Return whether a column has texts of several lines, which are not wrapped."""
        return any("\n" in row[at].plain for row in self.rows)

    def _height(self, columns: Sequence[int], width: int) -> int:
        """Return the lines of the tallest heading or text in a block, lists aside."""
        heights = [1]
        for at, size in zip(columns, self._widths(columns, width), strict=True):
            if self._widest(at) > size:
                cells = [] if self._has_lists(at) else [row[at].plain for row in self.rows]
                heights += [len(wrap(text, size)) for text in (self.columns[at].heading, *cells)]
        return max(heights)

    def _fits(self, columns: Iterable[int], width: int, whole_keys: bool = False) -> bool:
        needed = [self._widest(at) if whole_keys and at < self.keys else self._narrowest(at) for at in columns]
        return sum(needed) + GAP * (len(needed) - 1) <= width

    def _narrowest(self, at: int) -> int:
        """Return the width below which a number or a word would be broken."""
        column, cells = self.columns[at], [row[at].plain for row in self.rows]
        if self._has_lists(at):
            return max(cell_len(line) for cell in cells for line in cell.split("\n"))
        words = [word for text in (column.heading, *(cells if column.text else ())) for word in text.split()]
        return max(map(cell_len, words + ([] if column.text else cells)), default=0)

    def _widest(self, at: int) -> int:
        """Return the width at which nothing is wrapped."""
        lines = [line for row in self.rows for line in row[at].plain.split("\n")]
        return max(map(cell_len, (self.columns[at].heading, *lines)))

    def _widths(self, columns: Sequence[int], width: int) -> list[int]:
        """Return the width of each column; the widest are narrowed until all fit, the first columns last."""
        wanted = [self._widest(at) for at in columns]
        least = [self._narrowest(at) for at in columns]
        while sum(wanted) + GAP * (len(columns) - 1) > width:
            shrinkable = [k for k in range(len(columns)) if wanted[k] > least[k]]
            if not shrinkable:
                break
            wanted[max(shrinkable, key=lambda k: (columns[k] >= self.keys, wanted[k]))] -= 1
        return wanted

    def _block(self, console: Console, columns: Sequence[int], width: int) -> Iterable[Text]:
        widths = self._widths(columns, width)
        headings = [Text(self.columns[at].heading, style="bold") for at in columns]
        for row in (headings, *([row[at] for at in columns] for row in self.rows)):
            cells = [
                cell.wrap(console, max(size, 1), justify="left" if self.columns[at].text else "right", overflow="fold")
                for at, cell, size in zip(columns, row, widths, strict=True)
            ]
            for number in range(max(map(len, cells))):
                line = Text(no_wrap=True, overflow="ignore")
                for cell, size in zip(cells, widths, strict=True):
                    part = cell[number] if number < len(cell) else Text()
                    line.append_text(part)
                    line.append(" " * (size - part.cell_len + GAP))
                line.rstrip()
                yield line

    def _records(self, console: Console, columns: Sequence[int], width: int) -> Iterable[Text]:
        for number, row in enumerate(self.rows):
            if number:
                yield Text()
            heads = len(row) > 1 and not any(cell.plain for cell in row[1:])
            for place, at in enumerate(columns[:1] if heads else columns):
                heading = self.columns[at].heading
                cell = Text(row[at].plain.replace("\n", ", ")) if "\n" in row[at].plain else row[at]
                line = Text.assemble((f"{heading}: " if heading and not heads else "", Style(bold=True)), cell)
                yield from _wrapped(console, line, width, INDENT if place else 0)


def _one_a_line(cell: Text) -> Text:
    """Put each entry of a list of shares on a line of its own."""
    return Text(cell.plain.replace(SHARES, " %\n")) if SHARES in cell.plain else cell


def _wrapped(console: Console, text: Text, width: int, indent: int = 0) -> Iterable[Text]:
    """Wrap a text; only words longer than a line are broken."""
    for line in text.wrap(console, max(width - indent, 1), overflow="fold"):
        line.rstrip()
        yield Text.assemble(" " * indent, line, no_wrap=True, overflow="ignore")
