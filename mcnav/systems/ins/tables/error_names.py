"""Names of the constant errors that sensors bring, whatever the sensors' own names: patterns, for editors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.quantity import OFFSETS
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import DELAY, LEVER_ARM, SCALE_FACTOR
from mcnav.systems.ins.tables.sensor_tables import NAME


def error_patterns() -> dict[str, str]:
    """Return patterns of the names of sensors' constant errors and of their kinds, by SI unit; empty for any unit."""
    units: dict[str, set[str]] = {}
    for suffix, unit in _suffixes():
        units.setdefault(suffix, set()).add(unit)
    patterns: dict[str, list[str]] = {}
    for suffix, several in units.items():
        patterns.setdefault(next(iter(several)) if len(several) == 1 else "", []).append(suffix)
    return {unit: name_pattern(suffixes) for unit, suffixes in patterns.items()}


def kinds_of_errors() -> tuple[str, ...]:
    """Return what follows a sensor's name in the kinds of its errors that filters estimate, of all types."""
    kinds = [suffix for suffix, _ in _suffixes(axes=False)]
    kinds += ["flexure"] if any(kind.flexure for kind in SENSOR_TYPES.values()) else []
    return tuple(dict.fromkeys(kinds))


def name_pattern(suffixes: Iterable[str]) -> str:
    """Return the pattern of the names of sensors' errors that end so."""
    return f"^{NAME.pattern}_({'|'.join(suffixes)})$"


def _suffixes(axes: bool = True) -> Iterator[tuple[str, str]]:
    """Yield what follows a sensor's name in those of its constant errors, with their SI units."""
    for kind in SENSOR_TYPES.values():
        for measured, measures in kind.quantities.items():
            of = QUANTITIES[measures]
            names = [f"_{axis}" for axis in of.axes if axis and axes]
            label = kind.label("", measured).removeprefix("_")
            errors = [("bias", of.unit), *([("scale_factor", SCALE_FACTOR[0])] if of.scaled else [])]
            for error, unit in errors:
                yield from ((f"{label}_{error}{axis}".removeprefix("_"), unit) for axis in ("", *names))
        for offset in kind.offsets:
            along, unit, *_ = OFFSETS[offset]
            yield from ((f"{offset}{axis}", unit) for axis in ("", *(f"_{axis_along}" for axis_along in along if axes)))
        if kind.delays:
            yield "delay", DELAY[0]
        if kind.lever_arm:
            yield from ((f"lever_arm{axis}", LEVER_ARM[0]) for axis in ("", *(f"_{axis}" for axis in AXES if axes)))
