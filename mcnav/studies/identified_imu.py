"""Table ``[imu]`` of a campaign file from identified logs, and the grades of the catalogue around it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.physics.units import conversion, quantity
from mcnav.report.pages.identify import duration_words, statement_words
from mcnav.report.results.identified import AxisReport, GradeRow, ParameterRow
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, CatalogueUnit, catalogue_units, units_of_values
from mcnav.systems.ins.tables.instrument_tables import INTERVALS

GRADE: Final = "Grade"
"""Beginning of the titles of the catalogue's grades."""

COMPARED: Final = ("angle_random_walk", "velocity_random_walk", "bias_instability.sigma")
"""Values that every grade has, if the instrument has them."""

BIAS_UNITS: Final = {"gyro": "deg/h", "accelerometer": "ug"}

SIGMA, TIME = "bias_instability.sigma", "bias_instability.correlation_time"

FLICKER: Final = "flicker"
"""Key of flicker noise in ``identify.json``; ``[imu]`` has none."""

STAND_IN: Final = {SIGMA: "instability", TIME: "correlation_time", "rate_random_walk": "rate_random_walk"}
"""Parameters that stand for flicker noise, by their keys."""


def limits_of_axes(axes: Sequence[AxisReport]) -> list[str]:
    """Say what was done to readings, and what part of a spectrum was fitted; axes of which it is the same together."""
    names = dict[str, list[str]]()
    for axis in axes:
        for limits in axis.limits:
            names.setdefault(limits, []).append(axis.name)
    return [f"{', '.join(own)}: {limits}" for limits, own in names.items()]


def imu_table(axes: Sequence[AxisReport]) -> str:
    """Write ``[imu.gyro]`` and ``[imu.accelerometer]``; what the logs do not identify is a comment."""
    text = "# Noise identified from logs at rest; 95 % intervals are comments.\n"
    text += "".join(f"{_comment(limits)}\n" for limits in limits_of_axes(axes))
    for instrument in dict.fromkeys(axis.instrument for axis in axes):
        own = [axis for axis in axes if axis.instrument == instrument]
        keys = (FLICKER, *units_of_values()[instrument])
        rows = {key: [row for axis in own for row in axis.parameters if row.key == key] for key in keys}
        lines = [*_lines(rows, own), *map(_comment, _doubts(own))]
        text += f"\n[imu.{instrument}]\n" + "".join(f"{line}\n" for line in lines)
    return text


def _comment(words: str) -> str:
    return f"# {words}"


def _doubts(axes: Sequence[AxisReport]) -> Iterator[str]:
    """Say what stands for flicker noise, and what the logs cannot tell."""
    for axis in axes:
        if axis.stand_in is not None:
            least, most = duration_words(axis.stand_in.shortest), duration_words(axis.stand_in.longest)
            yield (
                f"{axis.axis}: bias_instability and rate_random_walk stand for flicker noise, with "
                f"{100.0 * axis.stand_in.error:.2g} % of error in Allan deviation from {least} to {most}"
            )
        if axis.fitted.rivals:
            yield f"{axis.axis}: the logs cannot tell {' or '.join(axis.fitted.ambiguities)}"


def usable(rows: Mapping[str, Sequence[ParameterRow]], axes: Sequence[AxisReport]) -> dict[str, list[ParameterRow]]:
    """Return the identified rows by key: those of a Gauss-Markov process only where its time is identified as well.

    What stands for flicker noise replaces the slow processes of its axis.
    """
    known = {key: [row for row in own if row.value is not None] for key, own in rows.items()}
    timed = {row.axis for row in known.get(TIME, [])} & {row.axis for row in known.get(SIGMA, [])}
    for key in (SIGMA, TIME):
        known[key] = [row for row in known.get(key, []) if row.axis in timed]
    standing = {axis.axis: axis.stand_in.parameters for axis in axes if axis.stand_in is not None}
    for key, name in STAND_IN.items():
        kept = {row.axis: row for row in known[key]}
        kept |= {row.axis: replace(row, value=standing[row.axis][name]) for row in rows[key] if row.axis in standing}
        known[key] = [kept[axis] for axis in AXES if axis in kept]
    return known


def _lines(rows: Mapping[str, Sequence[ParameterRow]], axes: Sequence[AxisReport]) -> Iterator[str]:
    interval = axes[0].interval
    yield from _bias(axes)
    known = usable(rows, axes)
    for key in rows:
        named = known.get(key, [])
        if key == SIGMA and named:
            times = {row.axis: row for row in known[TIME]}
            # an axis without the process has no sigma, and any time
            longest = max(times.values(), key=lambda row: row.value or 0.0)
            complete = ", ".join(f'{axis} = "{_written(times.get(axis, longest))}"' for axis in AXES)
            yield f"bias_instability = {{ sigma = {_axes(named)}, correlation_time = {{ {complete} }} }}"
        elif key == "quantization.sigma" and named:
            if INTERVALS[0] <= interval <= INTERVALS[1]:
                yield f'quantization = {{ sigma = {_axes(named)}, interval = "{interval:.9g} s" }}'
            else:
                yield f"# quantization, of readings each {interval:.9g} s: sigma = {_axes(named)}"
        elif key == FLICKER and named:
            yield f"# {key} = {_axes(named)}"
        elif "." not in key and named:
            yield f"{key} = {_axes(named)}"
        for row in rows[key]:
            if row.stated:
                yield f"# {row.key}.{row.axis}: {statement_words(row)}"


def _bias(axes: Sequence[AxisReport]) -> Iterator[str]:
    """Write the turn-on repeatability, where there are several logs."""
    shown = [(axis.axis, axis.repeatability) for axis in axes if axis.repeatability is not None]
    if not shown:
        return
    unit = BIAS_UNITS[axes[0].instrument]
    factor = conversion(axes[0].unit, unit)
    yield "bias = {{ {} }}".format(", ".join(f'{name} = "{each.value * factor:.4g} {unit}"' for name, each in shown))
    for name, each in shown:
        interval = f"{each.low * factor:.4g} to {each.high * factor:.4g} {unit}"
        yield f"# bias.{name}: {interval}, of {len(each.means)} logs; if the attitude was the same in all"


def _axes(rows: Sequence[ParameterRow]) -> str:
    return "{{ {} }}".format(", ".join(f'{row.axis} = "{_written(row)}"' for row in rows))


def _written(row: ParameterRow) -> str:
    return f"{(row.value or 0.0) * row.factor:.4g} {row.shown_in}"


def nearest_grades(axes: Sequence[AxisReport]) -> tuple[GradeRow, ...]:
    """Compare the identified values, the geometric means of the axes, with the grades of the catalogue."""
    grades = [unit for unit in catalogue_units() if unit.title.startswith(GRADE)]
    rows = []
    for instrument in dict.fromkeys(axis.instrument for axis in axes):
        for key in COMPARED:
            own = [row for axis in axes if axis.instrument == instrument for row in axis.parameters if row.key == key]
            values = [row.value for row in own if row.value is not None]
            if values:
                value = float(np.exp(np.mean(np.log(values))))
                rows.append(_grade_row(own[0], value, {unit.name: _size(unit, instrument, key) for unit in grades}))
    return tuple(rows)


def _size(unit: CatalogueUnit, instrument: str, key: str) -> float:
    """Return the size of a grade's value, SI."""
    sizes = {value.key: quantity(value.text, value.unit) for value in unit.values if value.instrument == instrument}
    minimum = sizes.get("bias_instability.allan_minimum", np.nan) / ALLAN_MINIMUM
    return sizes.get(key, minimum if key == SIGMA else np.nan)


def _grade_row(row: ParameterRow, value: float, sizes: Mapping[str, float]) -> GradeRow:
    """Place a value between grades, which rise from fine to coarse."""
    known = {name: size for name, size in sizes.items() if np.isfinite(size)}
    finer = [name for name, size in known.items() if size <= value]
    coarser = [name for name, size in known.items() if size > value]
    nearest = min(known, key=lambda name: abs(np.log(known[name] / value)))

    def shown(name: str) -> str:
        return f"{name} ({known[name] * row.factor:.3g})"

    below = max(finer, key=lambda name: known[name], default="")
    above = min(coarser, key=lambda name: known[name], default="")
    return GradeRow(
        row.instrument, row.key, value * row.factor, row.shown_in,
        shown(below) if below else "", shown(above) if above else "", nearest,
    )  # fmt: skip
