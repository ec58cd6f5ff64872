"""Columns of the gyros and accelerometers in a record, and their units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from mcnav.logs.column_names import named, triads
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable
from mcnav.logs.mapping import Column, cannot_tell, check_keys, mapped, stated_unit
from mcnav.physics.units import UnitError, quantity

AXES: Final = ("x", "y", "z")
GYRO: Final = tuple(f"gyro_{axis}" for axis in AXES)
ACCELEROMETER: Final = tuple(f"accelerometer_{axis}" for axis in AXES)
VECTORS: Final = ("gyro", "accelerometer")

COLUMNS: Final = ("time", *GYRO, *ACCELEROMETER, "interval", "topic")
"""Keys of a mapping: `interval` in place of `time`, such as "0.01 s"; `topic` of a log with several tables."""

UNITS: Final = ("time", *VECTORS, *GYRO, *ACCELEROMETER)
"""Keys of the units; `gyro` and `accelerometer` of all three axes."""

STEMS: Final = {
    "gyro": re.compile(
        r"(.*_)?(gyro\w*|gyr|gyros|angular_velocity|angular_rate|ang_vel|angvel|w_rs_s|omega|rotation_rate|"
        r"rate_gyro|delta_angle|delta_theta|dtheta|dang|w|g|gyr_raw|rot_rate)"
    ),
    "accelerometer": re.compile(
        r"(.*_)?(accel\w*|acc|accs|linear_acceleration|specific_force|a_rs_s|delta_velocity|dvel|delta_vel|dv|a|f|"
        r"acc_raw|lin_acc)"
    ),
}
"""Names of vectors, without the axis."""

NEVER: Final = re.compile(r".*(covariance|bias|sigma|std|noise|variance|clip|device_id|integral_dt|temperature).*")
"""Names that hold one of those of a vector and are another quantity."""

INCREMENTS: Final = re.compile(r"(.*_)?(delta_angle|delta_theta|dtheta|dang|delta_velocity|dvel|delta_vel|dv)")

TIME: Final = re.compile(
    r"(field_|.*_)?(time|t|timestamp|timestamps|stamp|stamps|header_stamp|timestamp_sample|gps_time|gpst|gpstime|tow|"
    r"sow|gps_tow|gps_sow|seconds|sec|secs|date|datetime|utc|epoch)"
)

TEMPLATE: Final = (
    'columns = { time = "…", gyro_x = "…", gyro_y = "…", gyro_z = "…", accelerometer_x = "…", accelerometer_y = "…", '
    'accelerometer_z = "…" }, units = { gyro = "rad/s", accelerometer = "m/s^2" }'
)

SEVEN: Final = 7
"""Columns of a record without a header that is recognised: time, three of gyros, three of accelerometers."""


@dataclass(frozen=True)
class ImuColumns:
    """Columns of a record.

    Attributes
    ----------
    time : Column or None
        None where the interval is given.
    interval : float or None
        s; in place of a column.
    vectors : mapping of str to tuple of three Column
        Of `gyro` and `accelerometer`, those that there are.
    guessed : bool
        Whether they are told by their places alone, so that gravity has to confirm them.
    """

    time: Column | None
    interval: float | None
    vectors: Mapping[str, tuple[Column, ...]]
    guessed: bool = False


def check_mapping(table_path: LogTable, columns: Mapping[str, str], units: Mapping[str, str]) -> None:
    """Raise `LogError` where a mapping has an unknown key or an entry that is no text."""
    check_keys(table_path.path, columns, COLUMNS, "columns")
    check_keys(table_path.path, units, UNITS, "units")


def find_columns(table: LogTable, columns: Mapping[str, str], units: Mapping[str, str]) -> ImuColumns:
    """Find the columns of a record: those that a mapping names, and otherwise those whose names tell.

    Raises `LogError` where they cannot be told, with a mapping to paste.
    """
    check_mapping(table, columns, units)
    told = {name: _told(table, columns, units, name) for name in VECTORS}
    interval = _interval(table, columns)
    if table.headless and not any(told.values()):
        if len(table.names) != SEVEN or columns:
            raise cannot_tell(table, "those of the instruments cannot be told", TEMPLATE.replace("…", "1", 1))
        return _by_place(table, units)
    if not any(told.values()):
        told = {name: _suggested(table, units, name) for name in VECTORS}
    vectors = {name: trio for name, trio in told.items() if trio is not None}
    if not vectors:
        raise cannot_tell(table, "none of them is that of a gyro or an accelerometer by its name", TEMPLATE)
    time = None if interval is not None else _time(table, columns, units)
    return ImuColumns(time, interval, vectors)


def _interval(table: LogTable, columns: Mapping[str, str]) -> float | None:
    if "interval" not in columns:
        return None
    if "time" in columns:
        raise LogError(table.path, "stands beside time; expected one of them", "columns.interval")
    try:
        interval = quantity(columns["interval"], "s")
    except UnitError as wrong:
        raise LogError(table.path, str(wrong), "columns.interval") from None
    if interval <= 0.0:
        raise LogError(table.path, f"got {columns['interval']!r}; expected a time above zero", "columns.interval")
    return interval


def _told(
    table: LogTable, columns: Mapping[str, str], units: Mapping[str, str], vector: str
) -> tuple[Column, ...] | None:
    """Return the columns of a vector that a mapping names; none where it names none."""
    keys = [f"{vector}_{axis}" for axis in AXES]
    given = [key for key in keys if key in columns]
    if not given:
        return None
    if len(given) < len(AXES):
        lacking = " and ".join(key for key in keys if key not in columns)
        raise LogError(table.path, f"names {' and '.join(given)} only; expected {lacking}, too", "columns")
    return tuple(mapped(table, columns, units, key) for key in keys)


def _suggested(table: LogTable, units: Mapping[str, str], vector: str) -> tuple[Column, ...] | None:
    """Return the only columns whose names are those of a vector; none without any."""
    names = [name for name in table.names if not NEVER.fullmatch(named(name).plain)]
    trios = triads(names, STEMS[vector], table.units)
    if len(trios) > 1:
        choices = " or ".join(", ".join(trio.columns) for trio in trios[:4])
        keys = ", ".join(f'{vector}_{axis} = "{name}"' for axis, name in zip(AXES, trios[0].columns, strict=True))
        raise LogError(
            table.path, f"has {len(trios)} sets of columns of the {vector}: {choices}; name one: columns = {{ {keys} }}"
        )
    if not trios:
        return None
    default = ""
    if INCREMENTS.fullmatch(trios[0].stem):
        default = "rad" if vector == "gyro" else "m/s"
    keys_of = [f"{vector}_{axis}" for axis in AXES]
    return tuple(
        Column(name, _vector_unit(stated_unit(table, units, key, name) or default, vector, trios[0].stem))
        for key, name in zip(keys_of, trios[0].columns, strict=True)
    )


def _vector_unit(unit: str, vector: str, stem: str) -> str:
    """Return the unit of a vector: PX4 writes `gyro_rad` for rates in rad/s."""
    return "rad/s" if unit == "rad" and vector == "gyro" and not INCREMENTS.fullmatch(stem) else unit


def _time(table: LogTable, columns: Mapping[str, str], units: Mapping[str, str]) -> Column:
    """Return the column of time: the one that is named, or the only one whose name is that of a time."""
    if "time" in columns:
        return mapped(table, columns, units, "time")
    candidates = [name for name in table.names if TIME.fullmatch(named(name).plain)]
    for better in (r"(.*_)?(header_)?stamp", r"time|t|timestamp", r"(.*_)?time(stamp)?"):
        preferred = [name for name in candidates if re.fullmatch(better, named(name).plain)]
        if len(candidates) > 1 and len(preferred) == 1:
            candidates = preferred
    if len(candidates) != 1:
        what = "none of them is that of time by its name" if not candidates else "several are those of time"
        raise cannot_tell(table, what, 'columns = { time = "…" }, or without one columns = { interval = "0.01 s" }')
    return Column(candidates[0], stated_unit(table, units, "time", candidates[0]))


def _by_place(table: LogTable, units: Mapping[str, str]) -> ImuColumns:
    """Return the seven columns of a record without a header: time, gyros, accelerometers."""
    keys = ("time", *GYRO, *ACCELEROMETER)
    columns = [Column(name, stated_unit(table, units, key, name)) for key, name in zip(keys, table.names, strict=True)]
    return ImuColumns(
        columns[0], None, {"gyro": tuple(columns[1:4]), "accelerometer": tuple(columns[4:])}, guessed=True
    )
