"""Position files of RTKLIB (.pos): latitude, longitude, height or earth-fixed positions, with their sigmas.

The columns follow the manual of RTKLIB 2.4.2, B.1: an off-diagonal `sdne` is the root of a covariance with its sign.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.files.lines import place_of_row
from mcnav.files.whole import is_number
from mcnav.logs.geodetic import from_earth_fixed, north_east_down
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable, Values, table_of
from mcnav.logs.times import GPS_EPOCH, WEEK
from mcnav.physics.units import printable

HEADER: Final = re.compile(r"^%\s+(GPST|UTC|JST)\s+(.*)$")
DATE: Final = re.compile(r"\d{4}/\d\d?/\d\d?")
LOOK: Final = re.compile(
    rb"% program\s*:.*RTKLIB|\A%.*\(lat/lon/height=|^% +(GPST|UTC|JST) "
    rb"|\A\s*(\d{4}/\d\d?/\d\d? +\d\d?:\d\d:\d\d|\d{4} +\d{1,6})(\.\d+)?( +-?\d+\.\d+){3} +[1-6] +\d+( +-?\d+\.\d+){6}",
    re.MULTILINE,
)
"""Beginning of such a file, whatever its ending."""

USUAL: Final = [
    "latitude(deg)", "longitude(deg)", "height(m)", "Q", "ns", "sdn(m)", "sde(m)", "sdu(m)", "sdne(m)", "sdeu(m)",
    "sdun(m)", "age(s)", "ratio",
]  # fmt: skip
"""Columns of a file without a header."""


def open_pos(path: Path) -> LogTable:
    """Read a position file; times are GPS seconds since 1980, or seconds since 1970 where they are UTC."""
    scale, names, cells, notes = _cells(path)
    time = _times(path, scale, [row[:2] for row in cells])
    values = {name: _numbers(path, name, [row[place] for row in cells]) for place, name in enumerate(names, start=2)}
    if "latitude(deg)" not in values:
        values = {**_from_earth_fixed(path, values), **values}
    words = "GPS time, s since 1980-01-06" if scale == "GPST" else f"{scale}, s since 1970-01-01"
    return table_of(path, {"time": time, **values}, {"time": "s"}, (f"times are {words}", *notes))


def _cells(path: Path) -> tuple[str, list[str], list[list[str]], tuple[str, ...]]:
    """Return scale of time, names of the columns after the time, and the cells of the rows."""
    scale, names, rows = "GPST", USUAL, list[list[str]]()
    separator: str | None = None
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if line.startswith("%"):
                header = HEADER.match(line.replace(",", " ").replace(";", " "))
                if header:
                    scale, names = header[1], header[2].split()
                continue
            if not line.strip():
                continue
            if not rows and len(line.split()) < len(line.replace(";", ",").split(",")):
                separator = ";" if ";" in line else ","
            cells = line.split() if separator is None else line.replace(separator, " ").split()
            if len(cells) < len(names) + 2:
                message = f"has {len(cells)} columns; expected {len(names) + 2}, as in the header"
                raise LogError(path, message, f"line {number}")
            rows.append(cells)
    if not rows:
        raise LogError(path, "has no positions")
    if any("baseline" in name for name in names):
        raise LogError(path, "has baselines in place of positions; write it with latitude, longitude, height")
    return scale, names, rows, ()


def _numbers(path: Path, name: str, cells: Sequence[str]) -> Array:
    try:
        return np.array(cells, dtype=float)
    except ValueError:
        row = next(row for row, cell in enumerate(cells) if not is_number(cell))
        came = f"got '{printable(cells[row], 40)}'; expected a number"
        raise LogError(path, came, f"{place_of_row(path, row)}, {name}") from None


def _times(path: Path, scale: str, cells: Sequence[Sequence[str]]) -> Array:
    """Return times in s: since 1980 of GPS time, since 1970 of others."""
    if not DATE.fullmatch(cells[0][0]):
        week, seconds = (
            _numbers(path, name, [row[place] for row in cells]) for place, name in enumerate(("week", "tow"))
        )
        return np.asarray(week * WEEK + seconds)
    try:
        days = np.array([cell[0].replace("/", "-") for cell in cells], dtype="datetime64[D]")
        clock = np.array([[float(piece) for piece in cell[1].split(":")] for cell in cells])
        seconds = days.astype("datetime64[s]").astype(np.int64) + clock @ [3600.0, 60.0, 1.0]
    except ValueError as failure:
        raise LogError(path, f"has a time that is none: {printable(str(failure), 80)}") from None
    return np.asarray(seconds - GPS_EPOCH if scale == "GPST" else seconds)


def _from_earth_fixed(path: Path, values: dict[str, Array]) -> dict[str, Values]:
    """Convert earth-fixed positions and their covariances to latitude, longitude, height and sigmas of their axes."""
    axes = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
    if not all(name in values for name in axes):
        raise LogError(path, f"has neither latitude(deg) nor x-ecef(m); it has {', '.join(values)}")
    latitude, longitude, height = from_earth_fixed(np.stack([values[name] for name in axes], axis=1))
    result = {"latitude(deg)": np.degrees(latitude), "longitude(deg)": np.degrees(longitude), "height(m)": height}
    sigmas = ("sdx(m)", "sdy(m)", "sdz(m)", "sdxy(m)", "sdyz(m)", "sdzx(m)")
    if not all(name in values for name in sigmas):
        return result
    covariance = np.empty((len(height), 3, 3))
    for name, (row, column) in zip(sigmas, ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)), strict=True):
        signed = values[name] * np.abs(values[name])
        covariance[:, row, column] = covariance[:, column, row] = signed
    local = north_east_down(latitude, longitude)
    variances = transformed_variances(local.swapaxes(1, 2), covariance)
    if np.any(variances < 0.0):
        raise LogError(path, "has covariances of earth-fixed positions that are not positive", "sdxy(m)")
    return result | dict(zip(("sdn(m)", "sde(m)", "sdd(m)"), np.sqrt(variances).T, strict=True))
