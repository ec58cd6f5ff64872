"""Tables of text: separated by commas, semicolons, tabs or blanks, with or without a line of names, after comments."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa

from mcnav.files.lines import COMMENT, place_of_row
from mcnav.files.parquet import numbers_in
from mcnav.files.whole import is_number
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable, Values
from mcnav.physics.units import printable

BEGINNING: Final = 65_536
"""Bytes in which comments and the line of names must end."""

MOST_ROWS: Final = 60_000_000
"""Rows: a day at 500 Hz is 43 millions, whose seven columns take 2.4 GB."""

BLOCK: Final = 1 << 24
"""Bytes of a block that is read at a time."""

DELIMITERS: Final = (",", ";", "\t")
INTEGER: Final = re.compile(r"\s*[-+]?\d{10,19}\s*")
"""An integer that may lose digits as a floating-point number, such as nanoseconds since 1970."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text.

    Attributes
    ----------
    names : tuple of str
    delimiter : str
        A blank stands for any number of blanks and tabs.
    skipped : int
        Bytes before the first row.
    first : tuple of str
        Cells of the first row.
    headless : bool
    decimal : str
        What separates decimals: a point, or a comma between semicolons or tabs.
    """

    names: tuple[str, ...]
    delimiter: str
    skipped: int
    first: tuple[str, ...]
    headless: bool
    decimal: str = "."


def open_text(path: Path, size: int) -> LogTable:
    """Open a table of text; its columns are read when they are asked for."""
    with path.open("rb") as file:
        beginning = file.read(BEGINNING)
    layout = _layout(path, beginning)
    width = max(len(beginning) - layout.skipped, 1) / max(beginning.count(b"\n", layout.skipped), 1)
    if (rows := size / width) > MOST_ROWS:
        raise LogError(
            path, f"has about {rows:,.0f} rows, whose seven columns take {rows * 56e-9:,.0f} GB; at most {MOST_ROWS:,} "
            "are read, so give a part of it",
        )  # fmt: skip
    notes = ("decimals are separated by commas",) if layout.decimal == "," else ()
    return LogTable(path, layout.names, lambda names: _read(path, layout, names), layout.headless, notes=notes)


def _layout(path: Path, beginning: bytes) -> Layout:
    """Find the line of names, the delimiter and the first row."""
    text = beginning.decode("utf-8-sig", "replace")
    if beginning.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise LogError(path, "is UTF-16 text; save it as UTF-8")
    if "\0" in text:
        raise LogError(path, "is no text; expected CSV, parquet, .mat, .ulg, .bag, .db3, .mcap, .pos, .nmea or .gpx")
    skipped = len(beginning) - len(beginning.removeprefix(b"\xef\xbb\xbf"))
    named: tuple[str, ...] | None = None
    for line in beginning[skipped:].splitlines(keepends=True):
        written = decoded(line).strip("\r\n")
        comment = COMMENT.match(written)
        if not written.strip() or comment:
            skipped += len(line)
            if comment:
                named = _cells(written[comment.end() :])[0] or named
            continue
        cells, delimiter, decimal = _row(written)
        if 2 * sum(map(is_number, cells)) > len(cells):  # most of them: a row may hold a date, too
            headless = named is None or len(named) != len(cells)
            names = tuple(str(place + 1) for place in range(len(cells))) if headless or named is None else named
            return Layout(_distinct(path, names), delimiter, skipped, cells, headless, decimal)
        named = cells
        skipped += len(line)
        first, separator, decimal = _first_row(beginning[skipped:])
        if first is None:
            raise LogError(path, "has a line of names and no rows")
        if len(first) != len(named):
            named = _split(written, separator)
        if len(first) != len(named):
            message = f"has {len(first)} columns; expected {len(named)}, as in the line of names"
            raise LogError(path, message, place_of_row(path, 0))
        return Layout(_distinct(path, named), separator, skipped, first, False, decimal)
    raise LogError(path, "is empty" if not text.strip() else "has no rows, only comments")


def decoded(line: bytes) -> str:
    r"""Decode a line: UTF-8, or else the encoding of Windows, in which programs there write "°/s".

    >>> decoded("gyro [°/s]".encode("cp1252"))
    'gyro [°/s]'
    """
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace")


def _first_row(rest: bytes) -> tuple[tuple[str, ...] | None, str, str]:
    for line in rest.splitlines():
        written = decoded(line)
        if written.strip():
            return _row(written)
    return None, ",", "."


def _row(line: str) -> tuple[tuple[str, ...], str, str]:
    """Split a row of numbers into cells with decimal points; return the delimiter and what separates its decimals.

    >>> _row("0,01;-0,5;3"), _row("0.01,2")
    ((('0.01', '-0.5', '3'), ';', ','), (('0.01', '2'), ',', '.'))
    """
    for delimiter in (";", "\t"):
        cells = _split(line, delimiter)
        if len(cells) > 1 and any("," in cell for cell in cells) and all(map(_with_comma, cells)):
            return tuple(cell.replace(",", ".") for cell in cells), delimiter, ","
    return (*_cells(line), ".")


def _with_comma(cell: str) -> bool:
    """Tell whether a cell is a number whose decimals, if there are any, follow a comma, or no number."""
    return "." not in cell and cell.count(",") <= 1 and (is_number(cell.replace(",", ".")) or "," not in cell)


def _distinct(path: Path, names: tuple[str, ...]) -> tuple[str, ...]:
    twice = [name for name in names if name and names.count(name) > 1]
    if twice:
        raise LogError(path, f"has {names.count(twice[0])} columns {printable(twice[0], 40)!r}; name each once")
    return tuple(name or f"column {place}" for place, name in enumerate(names, start=1))


def _cells(line: str) -> tuple[tuple[str, ...], str]:
    """Split a line into cells, and return its delimiter."""
    delimiter = max(DELIMITERS, key=line.count)
    if not line.count(delimiter):
        delimiter = " "
    return _split(line, delimiter), delimiter


def _split(line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == " ":
        return tuple(line.split())
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter)))
    except (csv.Error, StopIteration):
        return (line.strip(),)


class _SingleBlanks(io.RawIOBase):
    """A text separated by any number of blanks, as one separated by single blanks."""

    def __init__(self, blocks: Iterator[bytes]) -> None:
        self._blocks, self._rest = blocks, b""

    def readable(self) -> bool:
        """Return that it can be read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Read at most so many bytes; all without a size."""
        parts = [self._rest]
        length = len(self._rest)
        while size < 0 or length < size:
            block = next(self._blocks, None)
            if block is None:
                break
            parts.append(block)
            length += len(block)
        content = b"".join(parts)
        end = len(content) if size < 0 else size
        self._rest = content[end:]
        return content[:end]


def _single_blanks(path: Path, skipped: int) -> Iterator[bytes]:
    """Yield whole lines whose cells are separated by single blanks."""
    rest = b""
    with path.open("rb") as file:
        file.seek(skipped)
        while block := file.read(BLOCK):
            block = rest + block
            end = block.rfind(b"\n") + 1
            rest = block[end:]
            yield _squeezed(block[:end])
    yield _squeezed(rest)


def _squeezed(text: bytes) -> bytes:
    r"""Return lines whose cells are separated by single blanks; replacing takes a tenth of the time of a pattern.

    >>> _squeezed(b"  1   2\t 3 \n4 5 6\r\n")
    b'1 2 3\n4 5 6\n'
    """
    text = text.replace(b"\t", b" ").replace(b"\r", b"")
    while b"  " in text:
        text = text.replace(b"        ", b" ").replace(b"  ", b" ")
    return text.replace(b" \n", b"\n").replace(b"\n ", b"\n").removeprefix(b" ").removesuffix(b" ")


def _read(path: Path, layout: Layout, names: Sequence[str]) -> Mapping[str, Values]:
    """Read columns of numbers or dates by their names."""
    from pyarrow import csv as arrow

    places = [layout.names.index(name) for name in names]
    types: dict[str, pa.DataType] = {}
    for place in places:
        cell = layout.first[place]
        if INTEGER.fullmatch(cell):
            types[str(place)] = pa.int64()
        elif is_number(cell) or not cell:
            types[str(place)] = pa.float64()
    convert = arrow.ConvertOptions(
        include_columns=[str(place) for place in places], column_types=types, decimal_point=layout.decimal
    )
    read = arrow.ReadOptions(column_names=[str(place) for place in range(len(layout.names))], block_size=BLOCK)
    parse = arrow.ParseOptions(delimiter=layout.delimiter)
    try:
        if layout.delimiter == " ":
            source = pa.PythonFile(_SingleBlanks(_single_blanks(path, layout.skipped)), "r")
        else:
            file = path.open("rb")
            file.seek(layout.skipped)
            source = pa.PythonFile(file, "r")
        with source:
            table = arrow.read_csv(source, read, parse, convert)
        return {name: column_values(table[str(place)]) for name, place in zip(names, places, strict=True)}
    except pa.ArrowInvalid as failure:
        raise _why(path, layout, places, str(failure)) from None
    except MemoryError:
        raise LogError(path, "takes more memory than there is; give a part of it") from None


def column_values(column: pa.ChunkedArray) -> Values:
    """Return a column of numbers, of dates as seconds since 1970, or of texts as objects."""
    kind = column.type
    if pa.types.is_timestamp(kind):
        nanoseconds = column.cast(pa.timestamp("ns", kind.tz), safe=False).cast(pa.int64())
        return np.asarray(numbers_in(nanoseconds), dtype=float) * 1e-9
    if pa.types.is_integer(kind) and not column.null_count:
        return np.asarray(numbers_in(column.cast(pa.int64(), safe=False)))
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind) or pa.types.is_null(kind):
        return np.asarray(numbers_in(column.cast(pa.float64(), safe=False)), dtype=float)
    return np.asarray(column.to_numpy(), dtype=object)


def _why(path: Path, layout: Layout, places: Sequence[int], reason: str) -> LogError:
    """Find the first row that is no row of numbers."""
    with path.open("rb") as file:
        above = file.read(layout.skipped).count(b"\n")
        for number, line in enumerate(file, start=above + 1):
            written = decoded(line).strip()
            if not written:
                continue
            cells = _split(written, layout.delimiter)
            if len(cells) != len(layout.names):
                message = f"has {len(cells)} columns; expected {len(layout.names)}, as in the first line"
                return LogError(path, message, f"line {number:,}")
            for place in places:
                cell = cells[place].replace(",", ".") if layout.decimal == "," else cells[place]
                if cells[place] and not is_number(cell) and is_number(layout.first[place]):
                    came = f"got '{printable(cells[place], 40)}'; expected a number"
                    return LogError(path, came, f"line {number:,}, {layout.names[place]}")
    return LogError(path, f"is no table of numbers: {printable(reason.splitlines()[0], 200)}")
