"""Trajectory files: CSV or parquet with a header, or CSV without one in the order of Groves' software.

The columns are ``time, lat, lon, alt, VN, VE, VD, roll, pitch, heading`` in s, deg, m, m/s (down positive) and deg.
Other names and units are given by a table such as ``{ lat = "latitude [rad]", alt = "height [ft]" }``; a unit may also
stand in the header itself. VN, VE and VD may be missing, and other columns are ignored.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.entries.near_files import near_file
from mcnav.errors import reason_of, suggestion
from mcnav.files.parquet import numbers_in
from mcnav.files.whole import TextError, is_number, read_whole, text_of
from mcnav.physics.units import UnitError, printable, quantity
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.tables.trajectory_formats import foreign_format, why_no_header
from mcnav.systems.ins.truth.rows import (
    ANGLES,
    COLUMNS,
    POSITION,
    VELOCITY,
    TrajectoryError,
    TrajectoryRows,
    check_rows,
)
from mcnav.systems.ins.truth.smoothing import last_decimal

if TYPE_CHECKING:
    import pyarrow as pa

LARGEST_FILE: Final = 1_000_000_000
"""Bytes."""

MOST_ROWS: Final = 5_000_000
"""Rows; fourteen hours at 100 Hz."""

LONGEST_HEADER: Final = 20_000
"""Bytes of the first line."""

ENDINGS: Final = (".csv", ".parquet", ".txt", ".toml", ".pos", ".nmea", ".gpx", ".ulg")
"""Endings of files that ``mcnav check --trajectory`` may read."""

DELIMITERS: Final = (",", ";", "\t")

PARQUET: Final = b"PAR1"
"""First bytes of a parquet file."""

UNITS: Final = {
    "time": ("s", "s"),
    **dict.fromkeys(("lat", "lon", *ANGLES), ("deg", "rad")),
    "alt": ("m", "m"),
    **dict.fromkeys(VELOCITY, ("m/s", "m/s")),
}
"""Unit of each column, unless another is given, and the SI unit that it is converted to."""


@dataclass(frozen=True)
class Column:
    """A column of a file.

    Attributes
    ----------
    place : int
        Counted from zero.
    written : str
        Name in the file.
    factor : float
        SI units per unit of the file.
    """

    place: int
    written: str
    factor: float


def read_trajectory_file(
    path: Path, columns: Mapping[str, str] | None = None, earth: Earth = WGS84, sha256: str | None = None
) -> TrajectoryRows:
    """Read and check a trajectory file.

    Parameters
    ----------
    columns : mapping, optional
        Names in the file, each with its unit in brackets where it is another: ``{"lat": "latitude [rad]"}``.
    earth : Earth
        Figure over which positions and velocities are compared.
    sha256 : str, optional
        Digest by which the file was identified: another content is not read.

    Raises
    ------
    TrajectoryError
        When the file cannot be read or describes no flight: with row and column, what came, and what would do.
    """
    try:
        content = read_whole(path, LARGEST_FILE)
    except OSError as failure:
        raise TrajectoryError(_why_unreadable(path, failure)) from None
    if sha256 is not None and hashlib.sha256(content).hexdigest() != sha256:
        raise TrajectoryError("has changed while it was read; run the command again")
    read = _read_parquet if content.startswith(PARQUET) else _read_csv
    try:
        rows = _rows_of(read(content, columns or {}))
        check_rows(rows, earth)
    except TrajectoryError as wrong:
        raise wrong.of_file(path) from None
    return rows


def _why_unreadable(path: Path, failure: OSError) -> str:
    if isinstance(failure, FileNotFoundError):
        return f"no such file; expected a trajectory as CSV or parquet{near_file(path, ENDINGS)}"
    if path.is_dir():
        return "is a folder; expected a trajectory file, CSV or parquet"
    if path.exists() and not path.is_file():
        return "is a pipe or device; expected a regular file, CSV or parquet"
    return f"cannot be read: {failure.strerror or failure}"


@dataclass(frozen=True)
class Table:
    """Columns of a file in SI units and rad by their names, and the unit of their last decimal where that is known."""

    values: Mapping[str, Array]
    resolution: Mapping[str, float]


def _rows_of(table: Table) -> TrajectoryRows:
    values = table.values
    velocity = np.stack([values[name] for name in VELOCITY], axis=1) if VELOCITY[0] in values else None
    angles = np.stack([values[name] for name in ANGLES], axis=1)
    latitude, longitude, altitude = (table.resolution[name] for name in POSITION)
    # many decimals of one angle say that the positions were not rounded
    resolution = (latitude, longitude, altitude) if latitude > 0.0 and longitude > 0.0 else (0.0, 0.0, 0.0)
    return TrajectoryRows(values["time"], values["lat"], values["lon"], values["alt"], angles, velocity, resolution)


def _check_size(rows: int) -> None:
    if rows > MOST_ROWS:
        raise TrajectoryError(f"has {rows:,} rows; at most {MOST_ROWS:,} are read, so leave out rows or split the file")


def _find_columns(header: Sequence[str], columns: Mapping[str, str]) -> dict[str, Column]:
    """Find each column in a header, by its own name or by the one given for it."""
    unknown = [name for name in columns if name not in COLUMNS]
    if unknown:
        raise TrajectoryError(
            f"columns.{unknown[0]}: no such column of a trajectory{suggestion(unknown[0], list(COLUMNS))}"
        )
    names = [entry.strip() for entry in header]
    result: dict[str, Column] = {}
    for name in COLUMNS:
        place, unit = _place_of(name, names, columns)
        if place is None:
            continue
        try:
            factor = quantity(f"1 {unit}", UNITS[name][1]) if unit != UNITS[name][1] else 1.0
        except UnitError as wrong:
            raise TrajectoryError(f"columns.{name}: {wrong}") from None
        result[name] = Column(place, names[place], factor)
    present = [name for name in VELOCITY if name in result]
    if 0 < len(present) < len(VELOCITY):
        raise TrajectoryError(f"has {' and '.join(present)} only; give VN, VE and VD, or none of them")
    return result


def _place_of(name: str, header: Sequence[str], columns: Mapping[str, str]) -> tuple[int | None, str]:
    """Find a column by its name, and its unit."""
    asked = columns.get(name, name)
    wanted, unit = _name_and_unit(asked)
    # a name of the file may itself end in brackets
    places = [place for place, entry in enumerate(header) if entry == asked.strip()]
    places = places or [place for place, entry in enumerate(header) if _name_and_unit(entry)[0] == wanted]
    if len(places) > 1:
        raise TrajectoryError(f"has {len(places)} columns {printable(wanted)!r}; name each once")
    if not places:
        if name in VELOCITY and name not in columns:
            return None, ""
        known = [_name_and_unit(entry)[0] for entry in header if entry]
        hint = suggestion(wanted, known)
        remedy = f'; name it with columns = {{ {name} = "..." }}' if name not in columns else ""
        raise TrajectoryError(f"has no column {printable(wanted)!r}{hint}{remedy}")
    return places[0], unit or _name_and_unit(header[places[0]])[1] or UNITS[name][0]


def _name_and_unit(written: str) -> tuple[str, str]:
    """Split a column's name from a unit in brackets.

    >>> _name_and_unit("latitude [rad]"), _name_and_unit("lat")
    (('latitude', 'rad'), ('lat', ''))
    """
    name, bracket, unit = written.strip().partition("[")
    return (name.strip(), unit[:-1].strip()) if bracket and unit.endswith("]") else (written.strip(), "")


def _read_csv(content: bytes, columns: Mapping[str, str]) -> Table:
    _check_size(max(content.count(b"\n"), content.count(b"\r")))
    start = len(content) - len(content.lstrip(b"\r\n"))
    ends = [at for at in (content.find(end, start) for end in (b"\n", b"\r")) if at >= 0]
    line = content[start : min(ends, default=len(content))]
    if not line.strip():
        raise TrajectoryError("is empty; expected a trajectory as CSV or parquet")
    if (foreign := foreign_format(content)) is not None:
        raise TrajectoryError(foreign)
    if len(line) > LONGEST_HEADER:
        raise TrajectoryError("is no table: its first line is longer than that of any trajectory")
    try:
        text = text_of(line).strip("\r\n")
    except TextError as wrong:
        raise TrajectoryError(f"is neither CSV nor parquet: it {wrong}") from None
    delimiter = max(DELIMITERS, key=text.count)
    try:
        header = next(csv.reader([text.lstrip("#% ")], delimiter=delimiter))
    except (csv.Error, StopIteration):
        raise TrajectoryError("is no table: its first line is neither names nor numbers") from None
    headless = all(is_number(entry) for entry in header)
    if headless and columns:
        raise TrajectoryError("has no header, so that columns cannot be named; add one, or leave out columns")
    if headless and len(header) != len(COLUMNS):
        raise TrajectoryError(
            f"has no header and {len(header)} columns; without a header the {len(COLUMNS)} are {', '.join(COLUMNS)}"
        )
    wanted = [_name_and_unit(columns.get(name, name))[0] for name in COLUMNS]
    if not headless and (reason := why_no_header(text, header, wanted)) is not None:
        raise TrajectoryError(reason)
    result = _find_columns(COLUMNS if headless else header, columns)
    body = content if headless and not start else content[start if headless else start + len(line) + 1 :]
    if not body.strip():
        raise TrajectoryError("has a header and no rows")
    table = _parse(body, len(header), delimiter, result.values())
    values = {name: np.asarray(numbers_in(table[number]), dtype=float) for number, name in enumerate(result)}
    return _converted(values, result)


def _converted(values: Mapping[str, Array], columns: Mapping[str, Column]) -> Table:
    """Convert columns to SI units and rad."""
    converted = {name: values[name] * columns[name].factor for name in values}
    return Table(converted, {name: last_decimal(values[name]) * columns[name].factor for name in POSITION})


def _parse(body: bytes, width: int, delimiter: str, columns: Iterable[Column]) -> list[pa.ChunkedArray]:
    """Parse some columns of numbers; those that pyarrow cannot read are read, or refused, one by one."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    names = [str(place) for place in range(width)]
    wanted = [str(column.place) for column in columns]
    parse = arrow.ParseOptions(delimiter=delimiter)

    def table(kind: pa.DataType) -> pa.Table:
        # only an empty cell is missing: "NA" is a text
        convert = arrow.ConvertOptions(
            include_columns=wanted, column_types=dict.fromkeys(wanted, kind), null_values=[""], strings_can_be_null=True
        )
        return arrow.read_csv(pa.BufferReader(body), arrow.ReadOptions(column_names=names), parse, convert)

    try:
        parsed = table(pa.float64())
        return [parsed[name] for name in wanted]
    except pa.ArrowInvalid:
        pass
    try:
        texts = table(pa.binary())
    except pa.ArrowInvalid as failure:
        raise _uneven(body, width, delimiter, str(failure)) from None
    return [pa.chunked_array([_numbers(texts[str(column.place)].to_pylist(), column)]) for column in columns]


def _numbers(cells: Sequence[bytes | None], column: Column) -> Array:
    numbers = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = (cell or b"").decode("utf-8", "replace").strip()
        if not is_number(text):
            came = f"got '{printable(text, 40)}'" if text else "is empty"
            raise TrajectoryError(f"{came}; expected a number", row + 1, column.written)
        numbers[row] = float(text)
    return numbers


def _uneven(body: bytes, width: int, delimiter: str, reason: str) -> TrajectoryError:
    """Find the first row with another number of columns."""
    lines = (line for line in io.StringIO(body.decode("utf-8", "replace")) if line.strip())
    try:
        for row, cells in enumerate(csv.reader(lines, delimiter=delimiter), start=1):
            if len(cells) != width:
                return TrajectoryError(f"has {len(cells)} columns; expected {width}, as in the first line", row)
    except csv.Error as failure:
        reason = str(failure)
    return TrajectoryError(f"is no table of numbers: {printable(reason.splitlines()[0], 200)}")


def _read_parquet(content: bytes, columns: Mapping[str, str]) -> Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(io.BytesIO(content))
        rows, schema = file.metadata.num_rows, file.schema_arrow
    except (OSError, ValueError, pa.ArrowException) as failure:
        raise TrajectoryError(f"is no parquet file that can be read: {reason_of(failure)}") from None
    _check_size(rows)
    parquet = _find_columns(schema.names, columns)
    for column in parquet.values():
        kind = schema.field(column.place).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise TrajectoryError(f"holds {kind}; expected numbers", column=column.written)
    try:
        table = file.read(columns=[column.written for column in parquet.values()])
        return _converted({name: _floats(table[column.written]) for name, column in parquet.items()}, parquet)
    except (OSError, ValueError, pa.ArrowException) as failure:
        raise TrajectoryError(f"is no parquet file that can be read: {reason_of(failure)}") from None


def _floats(column: pa.ChunkedArray) -> Array:
    """Convert a column of any type of number to floating-point numbers, NaN where they are missing."""
    import pyarrow as pa

    return np.asarray(numbers_in(column.cast(pa.float64(), safe=False)), dtype=float)
