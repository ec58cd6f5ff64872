"""Recorded positions with what else there is: velocities, attitudes, sigmas; in SI units, with what was noticed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.files.lines import place_of_row
from mcnav.logs import px4, ros_bags
from mcnav.logs.log_error import LogError
from mcnav.logs.mapping import Column, factor_to, numbers
from mcnav.logs.tables import open_table
from mcnav.logs.times import interval_of, notes_of_steps, refuse_falling, repeated, rows, seconds_of, unwrapped
from mcnav.logs.track_columns import (
    ATTITUDE,
    POSITION_SIGMA,
    QUANTITIES,
    USUAL,
    VELOCITY,
    VELOCITY_SIGMA,
    find_columns,
    find_time,
)

if TYPE_CHECKING:
    import pandas as pd

POSITION_SIGMAS: Final = (5e-4, 1e3)
"""Sigmas that receivers have, in the median, m."""

VELOCITY_SIGMAS: Final = (1e-4, 1e2)
"""Those of velocities, m/s."""

ALTITUDES: Final = (-12_000.0, 1e9)
"""Lowest and highest altitude, m."""


@dataclass(frozen=True)
class Track:
    """Recorded positions.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s from the first row, rising.
    start : float
        Time stamp of the first row as it is recorded (GPS seconds, seconds since 1970, ...), s.
    latitude, longitude : ndarray, shape (n,)
        rad.
    altitude : ndarray, shape (n,)
        m.
    velocity : ndarray, shape (n, 3), or None
        North, east, down, m/s.
    attitude : ndarray, shape (n, 3), or None
        Roll, pitch, heading, rad.
    position_sigma : ndarray, shape (n, 3), or None
        North, east, down, m.
    velocity_sigma : ndarray, shape (n, 3), or None
        North, east, down, m/s.
    notes : tuple of str
        What was noticed, one line each.

    Examples
    --------
    >>> import mcnav as mc
    >>> here = np.zeros(2)
    >>> track = mc.Track(np.array([0.0, 1.0]), 0.0, here, here, here, None, None, None, None, ())
    >>> track.frame.columns.tolist()
    ['latitude', 'longitude', 'altitude']
    """

    time: Array
    start: float
    latitude: Array
    longitude: Array
    altitude: Array
    velocity: Array | None
    attitude: Array | None
    position_sigma: Array | None
    velocity_sigma: Array | None
    notes: tuple[str, ...]

    @property
    def frame(self) -> pd.DataFrame:
        """The track, a row a time (s) and a column a quantity such as ``velocity_north``, SI and rad.

        Columns are named as in files that `read_track` reads; units are in ``attrs["units"]``.
        """
        import pandas as pd

        level = ("north", "east", "down")
        groups = (
            ("velocity_", level, self.velocity, "m/s"), ("", ("roll", "pitch", "heading"), self.attitude, "rad"),
            ("sigma_", level, self.position_sigma, "m"), ("velocity_sigma_", level, self.velocity_sigma, "m/s"),
        )  # fmt: skip
        columns = {"latitude": self.latitude, "longitude": self.longitude, "altitude": self.altitude}
        units = {"latitude": "rad", "longitude": "rad", "altitude": "m", "time": "s"}
        for prefix, names, values, unit in groups:
            if values is not None:
                columns |= {f"{prefix}{name}": values[:, place] for place, name in enumerate(names)}
                units |= {f"{prefix}{name}": unit for name in names}
        table = pd.DataFrame(columns, index=pd.Index(self.time, name="time"))
        table.attrs["units"] = units
        return table


def read_track(
    path: str | Path, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Track:
    """Read a track.

    Parameters
    ----------
    path : str or Path
        Of any format that `open_table` reads.
    columns : mapping, optional
        Columns of the file by `time`, `latitude`, `longitude`, `altitude`, `velocity_north`, ..., `roll`, `pitch`,
        `heading`, `sigma_north`, ..., `velocity_sigma_down`; a minus sign before a name negates it.
    units : mapping, optional
        Units by the same keys, or by `position`, `velocity`, `attitude`, `sigma`, `velocity_sigma`.

    Raises
    ------
    LogError
        In one line: where the columns cannot be told, times fall or repeat, or values are missing or beyond their
        range.

    Examples
    --------
    >>> import mcnav as mc
    >>> import pandas as pd
    >>> fixes = {"latitude [deg]": [45.0, 45.001], "longitude [deg]": [7.0, 7.001], "altitude [m]": [300.0, 305.0]}
    >>> pd.DataFrame({"time [s]": [0.0, 1.0], **fixes}).to_csv("track.csv", index=False)
    >>> mc.read_track("track.csv").frame["altitude"].tolist()
    [300.0, 305.0]
    """
    path, columns, units = Path(path), columns or {}, units or {}
    table = open_table(path, columns.get("topic"), (*px4.POSITIONS, *ros_bags.POSITIONS))
    chosen, notes = find_columns(table, columns, units)
    read = table.read(list(dict.fromkeys(column.name for column in chosen.values())))
    time_column = chosen["time"]
    if not len(read[time_column.name]):
        raise LogError(path, "has no rows")
    stamps, told = unwrapped(seconds_of(path, read[time_column.name], time_column.unit or "s", time_column.name))
    values = {key: column.sign * numbers(table, read[column.name], column.name) for key, column in chosen.items()
              if key != "time"}  # fmt: skip
    _refuse_missing(path, chosen, values)
    refuse_falling(path, stamps.time, time_column.name, "")
    _ask_for_angles(path, chosen, values)
    kept, further = _without_repeated(path, stamps.time, values, time_column.name)
    time = stamps.time[kept]
    values = {key: value[kept] * _factor(path, chosen[key], key) for key, value in values.items()}
    _check_ranges(path, chosen, values, np.flatnonzero(kept))
    interval = interval_of(path, time, time_column.name)
    notes = (*table.notes, *notes, *told, *further, *notes_of_steps(time, interval), *_strange_sigmas(values))
    position = (values["latitude"], values["longitude"], values["altitude"])
    groups = (_group(values, keys) for keys in (VELOCITY, ATTITUDE, POSITION_SIGMA, VELOCITY_SIGMA))
    velocity, attitude, position_sigma, velocity_sigma = groups
    return Track(
        time - time[0], stamps.start + float(time[0]), *position, velocity, attitude, position_sigma, velocity_sigma,
        notes,
    )  # fmt: skip


@dataclass(frozen=True)
class Instants:
    """Time stamps of a record alone; see `Track`."""

    time: Array
    start: float
    notes: tuple[str, ...]


def read_instants(
    path: Path, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Instants:
    """Read the time stamps of a record, whatever else it holds.

    Parameters
    ----------
    columns, units : mapping, optional
        Column and unit of `time`; `topic` of a log with several.

    Raises
    ------
    LogError
        In one line: where the column cannot be told, or times fall or repeat.
    """
    columns = columns or {}
    table = open_table(path, columns.get("topic"))
    column = find_time(table, columns, units or {})
    values = table.read([column.name])[column.name]
    if not len(values):
        raise LogError(path, "has no rows")
    stamps, notes = unwrapped(seconds_of(path, values, column.unit or "s", column.name))
    refuse_falling(path, stamps.time, column.name, "")
    repeated(path, stamps.time, np.zeros(len(stamps.time) - 1, dtype=np.bool_), column.name, "")
    interval = interval_of(path, stamps.time, column.name)
    return Instants(stamps.time, stamps.start, (*table.notes, *notes, *notes_of_steps(stamps.time, interval)))


def _strange_sigmas(values: Mapping[str, Array]) -> tuple[str, ...]:
    """Note sigmas that no receiver has: they are in another unit, or stand for something else."""
    notes = []
    for what, keys, unit, (least, most) in (
        ("position", POSITION_SIGMA, "m", POSITION_SIGMAS), ("velocity", VELOCITY_SIGMA, "m/s", VELOCITY_SIGMAS)
    ):  # fmt: skip
        known = [values[key] for key in keys if key in values]
        median = float(np.median(known)) if known else least
        if not least <= median <= most:
            option = "sigma" if what == "position" else "velocity_sigma"
            notes.append(
                f"the sigmas of the {what} are {median:.3g} {unit} in the median, which no receiver has; "
                f'units = {{ {option} = "…" }} states another unit'
            )
    return tuple(notes)


def _factor(path: Path, column: Column, key: str) -> float:
    usual, si = USUAL[key]
    return factor_to(path, column.unit or usual, (si,), key)[0]


def _group(values: Mapping[str, Array], keys: Sequence[str]) -> Array | None:
    """Return three columns as vectors, shape (n, 3); none without them."""
    return np.stack([values[key] for key in keys], axis=1) if keys[0] in values else None


def _without_repeated(
    path: Path, time: Array, values: Mapping[str, Array], name: str
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Select all rows but repeated ones, with a note."""
    if not np.any(np.diff(time) == 0.0):
        return np.ones(len(time), dtype=np.bool_), ()
    same = np.ones(len(time) - 1, dtype=np.bool_)
    for value in values.values():
        same &= np.diff(value) == 0.0
    again = repeated(path, time, same, name, "")
    return ~again, (f"{rows(int(again.sum()))} left out, the same as the one before",)


def _refuse_missing(path: Path, chosen: Mapping[str, Column], values: Mapping[str, Array]) -> None:
    for key, value in values.items():
        missing = np.flatnonzero(~np.isfinite(value))
        if len(missing):
            more = f", like {rows(len(missing))} of {len(value):,}; leave them out" if len(missing) > 1 else ""
            raise LogError(path, f"has no number{more}", f"{place_of_row(path, missing[0])}, {chosen[key].name}")


def _ask_for_angles(path: Path, chosen: Mapping[str, Column], values: Mapping[str, Array]) -> None:
    """Refuse angles without a unit that may be radians."""
    if not (chosen["latitude"].unit or chosen["longitude"].unit):
        largest = max(float(np.max(np.abs(values[key]))) for key in ("latitude", "longitude"))
        if np.max(np.abs(values["latitude"])) <= np.pi / 2.0 and largest <= np.pi:
            raise LogError(
                path, f'are at most {largest:.6g} without a unit; state it: units = {{ position = "rad" }}, or "deg"',
                f"{chosen['latitude'].name}, {chosen['longitude'].name}",
            )  # fmt: skip
    if "heading" in chosen and not chosen["heading"].unit:
        largest = float(np.max(np.abs(values["heading"])))
        if 0.0 < largest <= 2.0 * np.pi and float(np.ptp(values["heading"])) > 0.0:
            raise LogError(
                path, f'is at most {largest:.6g} without a unit; state it: units = {{ attitude = "rad" }}, or "deg"',
                chosen["heading"].name,
            )  # fmt: skip


def _check_ranges(path: Path, chosen: Mapping[str, Column], values: Mapping[str, Array], places: IndexArray) -> None:
    """Refuse values that are no places, no attitudes and no sigmas; `places` are their rows in the file."""
    limits = {"latitude": (-90.0, 90.0), "longitude": (-360.0, 360.0), "pitch": (-90.0, 90.0)}
    for key in QUANTITIES:
        if key not in values:
            continue
        shown, unit = (np.degrees(values[key]), " deg") if key in limits else (values[key], " m")
        if key in limits:
            low, high = limits[key]
        elif key == "altitude":
            low, high = ALTITUDES
        elif key in POSITION_SIGMA or key in VELOCITY_SIGMA:
            low, high, unit = 0.0, 1e9, ""
        else:
            continue
        wrong = np.flatnonzero((shown < low * (1.0 + 1e-9)) | (shown > high * (1.0 + 1e-9)))
        if len(wrong):
            raise LogError(
                path, f"got {shown[wrong[0]]:.9g}{unit}; {key.replace('_', ' ')} lies between {low:g} and {high:g}",
                f"{place_of_row(path, places[wrong[0]])}, {chosen[key].name}",
            )  # fmt: skip
