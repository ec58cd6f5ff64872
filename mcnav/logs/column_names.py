"""Meanings of columns by their names, and the units that stand in names.

Names are compared as small letters and digits joined by `_`: "GyroX (deg/s)" is `gyro_x` with the unit deg/s,
"gyro_rad[0]" is `gyro_rad_0`, "field.angular_velocity.x" is `field_angular_velocity_x`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.physics.units import QUESTIONS, UnitError, conversion

BRACKET: Final = re.compile(r"^(.*?)\s*[\[({]([^\[\](){}]*)[\])}]\s*$", re.DOTALL)
AXIS: Final = re.compile(r"^(.*?)_?([xyz]|[0-3])$")
SPELLINGS: Final = {
    "degrees": "deg", "degree": "deg", "radians": "rad", "radian": "rad", "dps": "deg/s", "deg_s": "deg/s",
    "degs": "deg/s", "deg_per_s": "deg/s", "deg_h": "deg/h", "rad_s": "rad/s", "rads": "rad/s", "rad_per_s": "rad/s",
    "m_s2": "m/s^2", "ms2": "m/s^2", "mps2": "m/s^2", "m_s_2": "m/s^2", "m_s": "m/s", "mps": "m/s",
    "gs": "g", "seconds": "s", "sec": "s", "secs": "s", "msec": "ms", "usec": "us", "nsec": "ns", "nanoseconds": "ns",
    "microseconds": "us", "milliseconds": "ms", "meters": "m", "metres": "m",
}  # fmt: skip
"""Units as names and headers spell them."""

TARGETS: Final = ("rad/s", "m/s^2", "s", "rad", "m/s", "m")
"""SI units of what is recorded."""

SUFFIXES: Final = "|".join(
    sorted((*SPELLINGS, "deg", "rad", "g", "mg", "m", "ns", "us", "ms", "s"), key=len, reverse=True)
)


@dataclass(frozen=True)
class Named:
    """Meaning of a column's name.

    Attributes
    ----------
    written : str
        The name in the file.
    plain : str
        Small letters and digits joined by `_`, without a unit.
    unit : str
        Unit in brackets, or at the end; empty for none.
    """

    written: str
    plain: str
    unit: str


def spelled_unit(text: str) -> str:
    """Spell a unit as `mcnav.physics.units` reads it, or asks for it; empty where it is none.

    >>> spelled_unit("rad s^-1"), spelled_unit("m s^-2"), spelled_unit("DEG/SEC"), spelled_unit("NM")
    ('rad/s', 'm/s^2', 'deg/s', 'NM')
    >>> spelled_unit("frames"), spelled_unit("nm")
    ('', 'nm')
    """
    text = text.strip()
    spelled = text if text != text.upper() or any(_converts(text, target) for target in TARGETS) else text.lower()
    spelled = re.sub(r"\b(deg|rad|m)ree?s?\b", r"\1", spelled)
    spelled = re.sub(r"[ *·]+([a-zA-Z]+)\^?-1\b", r"/\1", spelled)
    spelled = re.sub(r"[ *·]+([a-zA-Z]+)\^?-(\d)", r"/\1^\2", spelled)
    spelled = re.sub(r"\b(s|sec)(?:\*\*)?2\b", "s^2", spelled).replace("**", "^")
    spelled = re.sub(r"\b(sec|secs|second|seconds)\b", "s", spelled)
    spelled = SPELLINGS.get(spelled.lower(), spelled)
    for each in dict.fromkeys((spelled, "g" if spelled == "G" else spelled, spelled.lower())):
        if any(_converts(each, target) for target in TARGETS):
            return each
    return text if text in QUESTIONS else ""


def _converts(unit: str, target: str) -> bool:
    try:
        conversion(unit, target)
    except UnitError:
        return False
    return True


def plain_name(text: str) -> str:
    """Return a name as small letters and digits joined by `_`.

    >>> plain_name("GyroX"), plain_name("gyro_rad[0]"), plain_name("%time"), plain_name("TimeUS")
    ('gyro_x', 'gyro_rad_0', 'time', 'time_us')
    """
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text)
    return re.sub(r"[^0-9a-z]+", "_", split.lower()).strip("_")


def named(written: str) -> Named:
    """Read the name of a column.

    >>> named("w_RS_S_x [rad s^-1]")
    Named(written='w_RS_S_x [rad s^-1]', plain='w_rs_s_x', unit='rad/s')
    >>> named("acc_x_g").unit, named("gyro_rad[0]").plain, named("time_ns").unit
    ('g', 'gyro_rad_0', 'ns')
    """
    result = BRACKET.match(written)
    if result and not result[2].strip().isdigit() and (unit := spelled_unit(result[2])):
        return Named(written, plain_name(result[1]), unit)
    plain = plain_name(written)
    ending = re.fullmatch(rf"(.+[a-z]|.+_[xyz0-3])_({SUFFIXES})", plain)
    if ending and ending[1] not in ("w_rs", "a_rs"):
        return Named(written, ending[1], SPELLINGS.get(ending[2], ending[2]))
    middle = re.fullmatch(rf"(.+)_({SUFFIXES})_([xyz])", plain)
    if middle and middle[1] not in ("w_rs", "a_rs"):
        return Named(written, f"{middle[1]}_{middle[3]}", SPELLINGS.get(middle[2], middle[2]))
    return Named(written, plain, "")


@dataclass(frozen=True)
class Triad:
    """Three columns that are the components of a vector along x, y, z."""

    stem: str
    columns: tuple[str, str, str]
    unit: str


def triads(names: Sequence[str], stems: re.Pattern[str], units: Mapping[str, str]) -> list[Triad]:
    """Return the triads of columns whose names without the axis match.

    >>> triads(["t", "wx", "wy", "wz"], re.compile("w|gyro"), {})
    [Triad(stem='w', columns=('wx', 'wy', 'wz'), unit='')]
    """
    groups: dict[str, dict[str, Named]] = {}
    for each in map(named, names):
        axis = AXIS.match(each.plain)
        if axis and stems.fullmatch(axis[1]):
            groups.setdefault(axis[1], {})[axis[2]] = each
    result: list[Triad] = []
    for stem, axes in groups.items():
        for trio in ("xyz", "012", "123"):
            if all(axis in axes for axis in trio):
                first, second, third = (axes[axis].written for axis in trio)
                unit = units.get(first, "") or axes[trio[0]].unit
                result.append(Triad(stem, (first, second, third), unit))
                break
    return result
