"""The table ``[imu]``: sizes of the instruments' constant errors and processes, from a catalogue or a data sheet.

A value holds for each axis. A list gives the axes one by one (three, or for misalignments six, in the order of
`mcnav.systems.ins.imu.instruments.CROSS_AXES`), and a table such as ``{ x = "1 deg/h" }`` some of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.entries.axes import read_axes
from mcnav.entries.context import FileContext
from mcnav.errors import suggestion
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, Imu, Noise
from mcnav.systems.ins.tables.imu_catalogue import INSTABILITY, KINDS, catalogue
from mcnav.systems.ins.tables.quantization import QUANTIZATION, read_quantization

ALLAN_MINIMUM: Final = 0.61736
"""Allan deviation of a Gauss-Markov process at its maximum, over the process's sigma."""

SHORTEST_CORRELATION: Final = 0.1
"""Shortest correlation time, s: below it a process is white noise, and is to be given as such."""

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


def read_imu(entries: object, context: FileContext, place: str = "imu", replaced: Imu | None = None) -> ImuSizes | None:
    """Read ``[imu]``, or a table like it at another place; mistakes are added to the context.

    Parameters
    ----------
    replaced : Imu, optional
        Processes whose values the table replaces, one by one. The sigmas found are then of the axes that it names.
    """
    before = len(context.problems)
    if not isinstance(entries, dict):
        context.problem(place, "expected a table")
        return None
    tables = _with_grade(entries, place, context)
    missing = 0.0 if replaced is None else np.nan
    sigmas: dict[str, float] = {}
    noises: dict[str, Noise] = {}
    for instrument, kinds in KINDS.items():
        table = tables.get(instrument, {})
        key = f"{place}.{instrument}"
        if not isinstance(table, dict):
            context.problem(key, "expected a table")
            continue
        known = sorted({name.partition(".")[0] for name in kinds})
        for name in table:
            if name not in known:
                context.problem(f"{key}.{name}", f"unknown key{suggestion(name, known)}")
        walk = WALKS[instrument]
        for name in (each for each in known if each in table and "." not in each):
            if name in (walk, "rate_random_walk", INSTABILITY, QUANTIZATION):
                continue
            axes = CROSS_AXES if name == "misalignment" else AXES
            sizes = read_axes(table[name], kinds[name], axes, f"{key}.{name}", context, missing)
            imu_sizes = {f"{instrument}_{name}_{axis}": float(size) for axis, size in zip(axes, sizes, strict=True)}
            sigmas |= {source: size for source, size in imu_sizes.items() if not np.isnan(size)}

        def process(
            name: str, table: Mapping[str, Any] = table, kinds: Mapping[str, str] = kinds, key: str = key
        ) -> Array:
            return read_axes(table.get(name, {}), kinds[name], AXES, f"{key}.{name}", context, missing)

        below = None if replaced is None else getattr(replaced, instrument)
        instability = _read_instability(table.get(INSTABILITY), kinds, f"{key}.{INSTABILITY}", context, below)
        if replaced is None:
            counted = read_quantization(table.get(QUANTIZATION), kinds, f"{key}.{QUANTIZATION}", context)
        else:
            counted = (np.full(3, np.nan), np.full(3, np.nan))
            if QUANTIZATION in entries.get(instrument, {}):
                context.problem(f"{key}.{QUANTIZATION}", "filters neglect quantization; leave it out")
        noise = Noise(process(walk), *instability, process("rate_random_walk"), *counted)
        noises[instrument] = _replace(noise, below)
    if len(context.problems) > before:
        return None
    return ImuSizes(sigmas, Imu(noises["gyro"], noises["accelerometer"]))


def _replace(noise: Noise, replaced: Noise | None) -> Noise:
    """Put values in place of those that are missing."""
    if replaced is None:
        return noise
    pairs = ((getattr(noise, each.name), getattr(replaced, each.name)) for each in fields(Noise))
    return Noise(*(np.where(np.isnan(result), below, result) for result, below in pairs))


def _with_grade(entries: Mapping[str, Any], place: str, context: FileContext) -> dict[str, Any]:
    """Put the values of the catalogue below those of the file."""
    for name in entries.keys() - {"grade", *KINDS}:
        context.problem(f"{place}.{name}", f"unknown key{suggestion(name, ['grade', *KINDS])}")
    grade = entries.get("grade")
    if grade is None:
        return dict(entries)
    known = catalogue()
    if not isinstance(grade, str) or grade not in known:
        context.problem(f"{place}.grade", f"got {grade!r}{suggestion(str(grade), list(known))}; mcnav imu lists them")
        return dict(entries)
    below = {instrument: known[grade].get(instrument, {}) for instrument in KINDS}
    above = {instrument: table for instrument, table in entries.items() if instrument in KINDS}
    return below | {
        instrument: {**below[instrument], **table} if isinstance(table, dict) else table
        for instrument, table in above.items()
    }


def _read_instability(
    entry: object, kinds: Mapping[str, str], key: str, context: FileContext, replaced: Noise | None
) -> tuple[Array, Array]:
    """Read a first-order Gauss-Markov process by axis: sigma and correlation time.

    Where it replaces another one, one of the two may be missing.
    """
    none = (np.zeros(3), np.full(3, 3600.0)) if replaced is None else (np.full(3, np.nan), np.full(3, np.nan))
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
    complete = len(sizes) == 1 and "correlation_time" in entry
    if not complete and (replaced is None or len(sizes) > 1 or not entry.keys() & set(names)):
        context.problem(key, f"got {', '.join(sorted(entry)) or 'nothing'}; {expected}")
        return none
    problems, (sigma, correlation), missing = len(context.problems), none, float(none[0][0])
    for name in sizes:
        sigma = read_axes(entry[name], kinds[f"{INSTABILITY}.{name}"], AXES, f"{key}.{name}", context, missing)
        sigma = sigma / ALLAN_MINIMUM if name == "allan_minimum" else sigma
    at = f"{key}.correlation_time"
    if "correlation_time" in entry:
        correlation = read_axes(entry["correlation_time"], "s", AXES, at, context, missing)
    if len(context.problems) > problems:
        return none
    if np.any(correlation < SHORTEST_CORRELATION):
        came = f"got {entry['correlation_time']!r}"
        context.problem(at, f"{came}; expected at least {SHORTEST_CORRELATION:g} s, white noise is shorter")
    elif replaced is not None and np.any((sigma > 0.0) & (replaced.instability == 0.0) & np.isnan(correlation)):
        context.problem(at, "is missing, and the instrument itself has no such process; give it")
    else:
        return sigma, correlation
    return none
