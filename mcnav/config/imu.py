"""The table ``[imu]``: sizes of the instruments' constant errors and processes, from a catalogue or a data sheet.

A value holds for each axis. A list gives the axes one by one (three, or for misalignments six, in the order of
`mcnav.physics.ins.instruments.CROSS_AXES`), and a table such as ``{ x = "1 deg/h" }`` some of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.config.context import FileContext
from mcnav.config.imu_catalogue import INSTABILITY, KINDS, catalogue
from mcnav.errors import suggestion
from mcnav.physics.ins.instruments import AXES, CROSS_AXES, Imu, Noise

ALLAN_MINIMUM: Final = 0.61736
"""Allan deviation of a Gauss-Markov process at its maximum, over the process's sigma."""

SHORTEST_CORRELATION: Final = 0.1
"""Shortest correlation time, s: below it a process is white noise, and is to be given as such."""

NOT_MODELLED: Final = "quantization"
"""Kind of error that the catalogue lists and the navigator does not have."""

WALKS: Final = {"gyro": "angle_random_walk", "accelerometer": "velocity_random_walk"}


@dataclass(frozen=True)
class ImuSizes:
    """Sizes of an inertial measurement unit's errors.

    Attributes
    ----------
    sigmas : mapping of str to float
        Of the constant errors, by source, SI.
    processes : Imu
    """

    sigmas: Mapping[str, float]
    processes: Imu


def read_imu(entries: object, context: FileContext) -> ImuSizes | None:
    """Read ``[imu]``; mistakes are added to the context."""
    before = len(context.problems)
    if not isinstance(entries, dict):
        context.problem("imu", "expected a table")
        return None
    tables = _with_grade(entries, context)
    sigmas: dict[str, float] = {}
    noises: dict[str, Noise] = {}
    for instrument, kinds in KINDS.items():
        table = tables.get(instrument, {})
        key = f"imu.{instrument}"
        if not isinstance(table, dict):
            context.problem(key, "expected a table")
            continue
        known = sorted({name.partition(".")[0] for name in kinds} - {NOT_MODELLED})
        for name in table:
            if name == NOT_MODELLED:
                context.problem(f"{key}.{name}", "is not modelled; leave it out")
            elif name not in known:
                context.problem(f"{key}.{name}", f"unknown key{suggestion(name, known)}")
        walk = WALKS[instrument]
        for name in (each for each in known if each in table and "." not in each):
            if name in (walk, "rate_random_walk", INSTABILITY):
                continue
            axes = CROSS_AXES if name == "misalignment" else AXES
            sizes = _read_axes(table[name], kinds[name], axes, f"{key}.{name}", context)
            sigmas |= {f"{instrument}_{name}_{axis}": size for axis, size in zip(axes, sizes, strict=True)}

        def process(
            name: str, table: Mapping[str, Any] = table, kinds: Mapping[str, str] = kinds, key: str = key
        ) -> Array:
            return _read_axes(table.get(name, {}), kinds[name], AXES, f"{key}.{name}", context)

        instability, correlation = _read_instability(table.get(INSTABILITY), kinds, f"{key}.{INSTABILITY}", context)
        noises[instrument] = Noise(process(walk), instability, correlation, process("rate_random_walk"))
    if len(context.problems) > before:
        return None
    return ImuSizes(sigmas, Imu(noises["gyro"], noises["accelerometer"]))


def _with_grade(entries: Mapping[str, Any], context: FileContext) -> dict[str, Any]:
    """Put the values of the catalogue below those of the file."""
    for name in entries.keys() - {"grade", *KINDS}:
        context.problem(f"imu.{name}", f"unknown key{suggestion(name, ['grade', *KINDS])}")
    grade = entries.get("grade")
    if grade is None:
        return dict(entries)
    known = catalogue()
    if not isinstance(grade, str) or grade not in known:
        context.problem("imu.grade", f"got {grade!r}{suggestion(str(grade), list(known))}; mcnav imu lists them")
        return dict(entries)
    below = {
        instrument: {name: value for name, value in known[grade].get(instrument, {}).items() if name != NOT_MODELLED}
        for instrument in KINDS
    }
    above = {instrument: table for instrument, table in entries.items() if instrument in KINDS}
    return below | {
        instrument: {**below[instrument], **table} if isinstance(table, dict) else table
        for instrument, table in above.items()
    }


def _read_axes(entry: object, unit: str, axes: Sequence[str], key: str, context: FileContext) -> Array:
    """Read the sizes of some axes, shape (axes,); zero where none is given."""
    found = np.zeros(len(axes))
    if isinstance(entry, dict):
        for axis in entry.keys() - set(axes):
            context.problem(f"{key}.{axis}", f"unknown axis; expected {', '.join(axes)}")
        given = {axis: (f"{key}.{axis}", value) for axis, value in entry.items() if axis in axes}
    elif isinstance(entry, list):
        if len(entry) != len(axes):
            context.problem(key, f"got a list of {len(entry)}; expected {len(axes)}, for {', '.join(axes)}")
            return found
        given = {
            axis: (f"{key} #{number}", each) for number, (axis, each) in enumerate(zip(axes, entry, strict=True), 1)
        }
    else:
        given = dict.fromkeys(axes, (key, entry))
    problems = len(context.problems)
    for number, axis in enumerate(axes):
        if axis not in given or len(context.problems) > problems:
            continue
        at, value = given[axis]
        size = context.quantity(value, unit, at)
        if size is not None and size < 0.0:
            context.problem(at, f"got {value!r}; a size must not be negative")
        found[number] = size or 0.0
    return found


def _read_instability(entry: object, kinds: Mapping[str, str], key: str, context: FileContext) -> tuple[Array, Array]:
    """Read a first-order Gauss-Markov process by axis: sigma and correlation time."""
    none = np.zeros(3), np.full(3, 3600.0)
    if entry is None:
        return none
    expected = 'expected { sigma = "0.003 deg/h", correlation_time = "1 h" }, or allan_minimum in place of sigma'
    if not isinstance(entry, dict):
        context.problem(key, f"got {entry!r}; {expected}")
        return none
    names = ("sigma", "allan_minimum", "correlation_time")
    for name in entry.keys() - set(names):
        context.problem(f"{key}.{name}", f"unknown key{suggestion(name, list(names))}")
    sizes = [name for name in names[:2] if name in entry]
    if len(sizes) != 1 or "correlation_time" not in entry:
        context.problem(key, f"got {', '.join(sorted(entry)) or 'nothing'}; {expected}")
        return none
    problems = len(context.problems)
    sigma = _read_axes(entry[sizes[0]], kinds[f"{INSTABILITY}.{sizes[0]}"], AXES, f"{key}.{sizes[0]}", context)
    if sizes[0] == "allan_minimum":
        sigma = sigma / ALLAN_MINIMUM
    at = f"{key}.correlation_time"
    correlation = _read_axes(entry["correlation_time"], "s", AXES, at, context)
    if len(context.problems) == problems and np.any(correlation < SHORTEST_CORRELATION):
        context.problem(
            at,
            f"got {entry['correlation_time']!r}; expected at least {SHORTEST_CORRELATION:g} s, white noise is shorter",
        )
        return none
    return (sigma, correlation) if len(context.problems) == problems else none
