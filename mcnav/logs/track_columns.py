"""Columns of a track in a record, and their units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from mcnav.logs.column_names import Named, named
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable
from mcnav.logs.mapping import Column, cannot_tell, check_keys, mapped, stated_unit

POSITION: Final = ("latitude", "longitude", "altitude")
VELOCITY: Final = ("velocity_north", "velocity_east", "velocity_down")
ATTITUDE: Final = ("roll", "pitch", "heading")
POSITION_SIGMA: Final = ("sigma_north", "sigma_east", "sigma_down")
VELOCITY_SIGMA: Final = ("velocity_sigma_north", "velocity_sigma_east", "velocity_sigma_down")
GROUPS: Final = (VELOCITY, ATTITUDE, POSITION_SIGMA, VELOCITY_SIGMA)
"""Groups of columns of which a track has all or none."""

QUANTITIES: Final = (*POSITION, *VELOCITY, *ATTITUDE, *POSITION_SIGMA, *VELOCITY_SIGMA)

COLUMNS: Final = ("time", *QUANTITIES, "topic")
UNITS: Final = ("time", *QUANTITIES, "velocity", "sigma", "velocity_sigma", "position", "attitude")
"""Keys of the units: of single columns, or of the groups; `position` is that of latitude and longitude."""

USUAL: Final[Mapping[str, tuple[str, str]]] = {
    "time": ("s", "s"),
    **dict.fromkeys(("latitude", "longitude", *ATTITUDE), ("deg", "rad")),
    **dict.fromkeys(("altitude", *POSITION_SIGMA), ("m", "m")),
    **dict.fromkeys((*VELOCITY, *VELOCITY_SIGMA), ("m/s", "m/s")),
}
"""Unit of each column, unless another is stated, and its SI unit."""

NAMES: Final = {
    "latitude": r"lat|latitude|gps_lat|gps_latitude",
    "longitude": r"lon|lng|long|longitude|gps_lon|gps_longitude",
    "altitude": r"alt|altitude|height|h|hgt|elevation|ele|ellipsoidal_height|altitude_ellipsoid|height_ellipsoid",
    "velocity_north": r"vn|v_n|vel_n|vel_north|velocity_north|v_north|vel_n_m_s|north_velocity|vnorth",
    "velocity_east": r"ve|v_e|vel_e|vel_east|velocity_east|v_east|vel_e_m_s|east_velocity|veast",
    "velocity_down": r"vd|v_d|vel_d|vel_down|velocity_down|v_down|vel_d_m_s|down_velocity|vdown",
    "roll": r"roll|roll_angle",
    "pitch": r"pitch|pitch_angle",
    "heading": r"heading|yaw|azimuth|true_heading|hdg",
    "sigma_north": r"(sd|std|sigma)_?(n|north)|(north)_std",
    "sigma_east": r"(sd|std|sigma)_?(e|east)|(east)_std",
    "sigma_down": r"(sd|std|sigma)_?(u|d|up|down)|(up|down)_std",
    "velocity_sigma_north": r"(sd|std|sigma)_?v_?(n|north)|velocity_sigma_(n|north)",
    "velocity_sigma_east": r"(sd|std|sigma)_?v_?(e|east)|velocity_sigma_(e|east)",
    "velocity_sigma_down": r"(sd|std|sigma)_?v_?(u|d|up|down)|velocity_sigma_(u|d|up|down)",
}
"""Names of each quantity, as `plain_name` writes them; upward velocities have their own."""

UPWARD: Final = re.compile(r"vu|v_u|vel_u|vel_up|velocity_up|v_up|up_velocity|vup|climb_rate")
"""Names of velocities up, which are negated."""

TIME: Final = re.compile(
    r"(.*_)?(time|t|timestamp|stamp|header_stamp|gps_time|gpst|gpstime|tow|sow|gps_tow|seconds|sec|date|datetime|utc|epoch)"
)

HEADLESS: Final[Mapping[int, tuple[tuple[str, ...], str]]] = {
    7: (("time", *POSITION, *POSITION_SIGMA), "those of a GNSS file of KF-GINS: time, position, its sigmas"),
    10: (("time", *POSITION, *VELOCITY, *ATTITUDE), "time, position, velocity north, east, down, roll, pitch, heading"),
    11: (
        ("", "time", *POSITION, *VELOCITY, *ATTITUDE),
        "those of a navigation file of KF-GINS: week, time, position, velocity north, east, down, roll, pitch, heading",
    ),
    13: (
        ("time", *POSITION, *POSITION_SIGMA, *VELOCITY, *VELOCITY_SIGMA),
        "time, position, its sigmas, velocity north, east, down, its sigmas",
    ),
}
"""Columns of files without a header by their number, and how that is told."""

TEMPLATE: Final = 'columns = { time = "…", latitude = "…", longitude = "…", altitude = "…" }'


def find_columns(
    table: LogTable, columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[Mapping[str, Column], tuple[str, ...]]:
    """Find the columns of a track by their keys: those that a mapping names, and otherwise those whose names tell.

    Raises `LogError` where they cannot be told, with a mapping to paste.
    """
    check_keys(table.path, columns, COLUMNS, "columns")
    check_keys(table.path, units, UNITS, "units")
    units = _of_groups(units)
    if table.headless and not set(columns) - {"topic"}:
        return _by_place(table, units)
    names = [named(name) for name in table.names]
    result: dict[str, Column] = {}
    for key in ("time", *QUANTITIES):
        column = mapped(table, columns, units, key) if key in columns else _suggested(table, names, units, key)
        if column is not None:
            result[key] = column
    lacking = [key for key in ("time", *POSITION) if key not in result]
    if lacking:
        raise cannot_tell(table, f"none of them is {' or '.join(lacking)} by its name", TEMPLATE)
    for group in GROUPS:
        present = [key for key in group if key in result]
        if any(key in columns for key in present) and len(present) < len(group):
            others = " and ".join(key for key in group if key not in result)
            raise LogError(table.path, f"has {' and '.join(present)} only; expected {others}, too", "columns")
        if len(present) < len(group):
            for key in present:
                del result[key]
    return result, ()


def find_time(table: LogTable, columns: Mapping[str, str], units: Mapping[str, str]) -> Column:
    """Find the column of time alone; the first of a file without a header."""
    check_keys(table.path, columns, ("time", "topic"), "columns")
    check_keys(table.path, units, ("time",), "units")
    if "time" in columns:
        return mapped(table, columns, units, "time")
    if table.headless:
        return Column(table.names[0], stated_unit(table, units, "time", table.names[0]))
    column = _suggested(table, [named(name) for name in table.names], units, "time")
    if column is None:
        raise cannot_tell(table, "none of them is that of time by its name", 'columns = { time = "…" }')
    return column


def _of_groups(units: Mapping[str, str]) -> dict[str, str]:
    """Give the units of groups to their columns."""
    members = {
        "position": POSITION[:2], "velocity": VELOCITY, "attitude": ATTITUDE, "sigma": POSITION_SIGMA,
        "velocity_sigma": VELOCITY_SIGMA,
    }  # fmt: skip
    spread = {key: unit for group, unit in units.items() for key in members.get(group, ())}
    return {**spread, **{key: unit for key, unit in units.items() if key not in members}}


def _suggested(table: LogTable, names: list[Named], units: Mapping[str, str], key: str) -> Column | None:
    """Return the only column whose name is that of a quantity; none without any.

    Raises `LogError` where there are several.
    """
    pattern = TIME if key == "time" else re.compile(NAMES[key])
    fitting = [name.written for name in names if pattern.fullmatch(name.plain)]
    if len(fitting) > 1:  # a name without more than the quantity is the better one
        plain = [name.written for name in names if name.plain in (key, "time", "stamp", "header_stamp")]
        fitting = [name for name in fitting if name in plain][:1] or fitting
    if len(fitting) > 1:
        choices = " or ".join(fitting[:4])
        raise LogError(table.path, f'has {choices} for {key}; name one: columns = {{ {key} = "{fitting[0]}" }}')
    if fitting:
        return Column(fitting[0], stated_unit(table, units, key, fitting[0]))
    if key == "velocity_down" and len(up := [name.written for name in names if UPWARD.fullmatch(name.plain)]) == 1:
        return Column(up[0], stated_unit(table, units, key, up[0]), -1.0)
    return None


def _by_place(table: LogTable, units: Mapping[str, str]) -> tuple[Mapping[str, Column], tuple[str, ...]]:
    """Return the columns of a file without a header by their number."""
    if len(table.names) not in HEADLESS:
        raise cannot_tell(table, "those of a track cannot be told", TEMPLATE)
    keys, words = HEADLESS[len(table.names)]
    columns = {
        key: Column(name, stated_unit(table, units, key, name) or USUAL[key][0])
        for key, name in zip(keys, table.names, strict=True)
        if key
    }
    return columns, (f"columns without names are taken for {words}; angles in deg",)
