"""Identification of an inertial measurement unit's noise from logs at rest: ``mcnav identify``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from scipy.stats import chi2

from mcnav.arrays.types import Array
from mcnav.errors import CampaignError, Problem
from mcnav.execution.threads import one_thread
from mcnav.files.whole import indented_json, to_json
from mcnav.identification.allan import AllanDeviation, allan_deviation
from mcnav.identification.estimates import relative_covariance
from mcnav.identification.fit import AxisFit
from mcnav.identification.goodness import Goodness
from mcnav.identification.identify import identify_noise
from mcnav.identification.lattice import resolution
from mcnav.identification.processes import CORRELATION_TIME, FLICKER, Grid
from mcnav.identification.several import common_noise, repeatability
from mcnav.identification.stand_in import StandIn, stand_in
from mcnav.identification.statements import statements
from mcnav.logs.imu_log import ImuLog, read_imu_log
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.physics.units import UnitError, conversion, quantity
from mcnav.report.document.html import page_html
from mcnav.report.pages.identify import page
from mcnav.report.results.identified import AxisReport, IdentificationReport, LogFacts, ParameterRow, SpectrumPoints
from mcnav.studies.identified_campaign import campaign_sigmas, open_campaign
from mcnav.studies.identified_imu import imu_table, limits_of_axes, nearest_grades
from mcnav.studies.standstill import refuse_motion
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.scenario import PROCESS_UNITS

FILE: Final = "identify.json"
PAGE: Final = "identify.html"
IMU: Final = "imu.toml"

GAP: Final = 1.5
"""Steps above this many intervals end a stretch."""

SAME_INTERVAL: Final = 1e-3
"""Share by which the intervals of several logs may differ."""

WEIGHT: Final = 0.02
"""Share by which the mean specific force may depart from gravity: biases and gravity anomalies are far less."""

SAME_ATTITUDE: Final = 0.002
"""Angle between mean specific forces, rad, from which it is said: 2 mg of bias."""

POINTS_PER_DECADE: Final = 12
"""Points of the spectrum in a decade."""

KEYS: Final = {
    "random_walk": "{}_random_walk",
    "instability": "bias_instability.sigma",
    "correlation_time": "bias_instability.correlation_time",
    "rate_random_walk": "rate_random_walk",
    "flicker": "flicker",
    "quantization": "quantization.sigma",
}
"""Keys of ``[imu.gyro]`` and ``[imu.accelerometer]`` by the names of `mcnav.identification.processes`.

``[imu]`` has no key for flicker noise: `mcnav.identification.stand_in` writes it as other processes.
"""

WALKS: Final = {"gyro": "angle", "accelerometer": "velocity"}


@dataclass(frozen=True)
class IdentifyPlan:
    """Settings by which logs are read.

    Attributes
    ----------
    columns, units : mapping of str to str
        As `mcnav.logs.imu_log.read_imu_log` takes them.
    begin, end : float, optional
        Part of each log that is used, s from its first reading.
    below : float, optional
        Upper end of the frequencies that are used, Hz.
    campaign : Path, optional
        Campaign whose navigation errors are computed with what the logs identify.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    begin: float | None = None
    end: float | None = None
    below: float | None = None
    campaign: Path | None = None


def read_plan(
    columns: Mapping[str, str], units: Mapping[str, str], interval: str | None, begin: str | None, end: str | None,
    below: str | None, campaign: Path | None,
) -> IdentifyPlan:  # fmt: skip
    """Read the options of the command line; `CampaignError` names one that is none."""
    times = dict[str, float | None]()
    given = (("--interval", interval, "s"), ("--from", begin, "s"), ("--to", end, "s"), ("--below", below, "Hz"))
    for option, text, unit in given:
        try:
            times[option] = None if text is None else quantity(f"{text} {unit}" if is_number(text) else text, unit)
        except UnitError as wrong:
            raise CampaignError([Problem(option, "", str(wrong))]) from None
    stated = {} if times["--interval"] is None else {"interval": f"{times['--interval']:.17g} s"}
    return IdentifyPlan({**columns, **stated}, units, times["--from"], times["--to"], times["--below"], campaign)


def is_number(text: str) -> bool:
    """Return whether a text is a number without a unit."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def key_of(instrument: str, name: str) -> str:
    """Return the key of a parameter in ``[imu]``.

    >>> key_of("gyro", "random_walk"), key_of("accelerometer", "instability")
    ('angle_random_walk', 'bias_instability.sigma')
    """
    return KEYS[name].format(WALKS[instrument])


def identify_logs(paths: Sequence[Path], plan: IdentifyPlan | None = None) -> IdentificationReport:
    """Identify the noise of a unit from one or several logs at rest.

    Raises
    ------
    CampaignError
        When a log cannot be read, is not at rest, has no 1,000 readings without a gap, or the logs have different
        intervals.
    """
    plan = plan or IdentifyPlan()
    facts, records = list[LogFacts](), dict[tuple[str, str], list[_AxisRecord]]()
    varied = None if plan.campaign is None else open_campaign(plan.campaign)
    with one_thread():
        for path in paths:
            log = read_imu_log(path, plan.columns, plan.units)
            pa.default_memory_pool().release_unused()  # of a day of readings 0.3 GB
            chosen, notes = _stretch(path, log, plan)
            refuse_motion(path, log, chosen)
            facts.append(LogFacts(str(path), chosen.stop - chosen.start, log.interval, (*log.notes, *notes)))
            _check_interval(facts)
            for instrument, axis, readings in _axes_of(log, chosen):
                own = records.setdefault((instrument, axis), [])
                if np.ptp(readings) > 0.0:
                    own.append(_record(path, f"{instrument} {axis}", readings, log.interval, plan.below))
        axes = tuple(_axis_report(*key, own) for key, own in records.items() if len(own) == len(paths))
        stuck = [f"{' '.join(key)} is left out: all of its readings are the same"
                 for key, own in records.items() if len(own) < len(paths)]  # fmt: skip
        if not axes:
            raise CampaignError([Problem(str(paths[0]), "", "all readings are the same; the instruments are off")])
        table, notes = imu_table(axes), (*stuck, *limits_of_axes(axes), *_of_attitude(axes))
        report = IdentificationReport(tuple(facts), axes, nearest_grades(axes), notes, table)
        if varied is not None:
            report = replace(report, sigmas=campaign_sigmas(varied, report))
    return report


@dataclass(frozen=True, eq=False)
class _AxisRecord:
    """Results of the readings of an axis in one log; the readings themselves are not kept."""

    fitted: AxisFit
    goodness: Goodness
    resolution: float | None
    allan: AllanDeviation
    limits: str


def _stretch(path: Path, log: ImuLog, plan: IdentifyPlan) -> tuple[slice, tuple[str, ...]]:
    """Return the longest stretch without a gap within the part asked for."""
    begin = plan.begin or 0.0
    end = float(log.time[-1]) if plan.end is None else plan.end
    first, last = np.searchsorted(log.time, [begin - 1e-9, end + 1e-9])
    if last - first < 2:
        message = f"got {begin:g} to {end:g} s; the record has 0 to {log.time[-1]:.10g} s"
        raise CampaignError([Problem(str(path), "--from, --to", message)])
    gaps = np.flatnonzero(np.diff(log.time[first:last]) > GAP * log.interval) + 1
    edges = np.concatenate([[0], gaps, [last - first]])
    longest = int(np.argmax(np.diff(edges)))
    chosen = slice(int(first + edges[longest]), int(first + edges[longest + 1]))
    if not len(gaps):
        return chosen, ()
    used = (chosen.stop - chosen.start) / (last - first)
    told = (
        f"{len(gaps):,} gap{'s' if len(gaps) > 1 else ''}; the longest stretch without one is used, "
        f"from {log.time[chosen.start]:.6g} to {log.time[chosen.stop - 1]:.6g} s, {100.0 * used:.3g} % of the readings"
    )
    return chosen, (told,)


def _axes_of(log: ImuLog, chosen: slice) -> Iterator[tuple[str, str, Array]]:
    """Yield instrument, axis and readings of each axis."""
    for instrument, vector in (("gyro", log.gyro), ("accelerometer", log.accelerometer)):
        if vector is not None:
            yield from ((instrument, axis, np.ascontiguousarray(vector[chosen, k])) for k, axis in enumerate(AXES))


def _check_interval(facts: Sequence[LogFacts]) -> None:
    """Refuse logs whose readings have not the interval of the first one."""
    first, last = facts[0], facts[-1]
    if abs(last.interval / first.interval - 1.0) > SAME_INTERVAL:
        message = (
            f"has an interval of {last.interval:.6g} s between readings, and {first.name} of {first.interval:.6g} s; "
            "identify them one by one"
        )
        raise CampaignError([Problem(last.name, "", message)])


def _record(path: Path, name: str, readings: Array, interval: float, below: float | None) -> _AxisRecord:
    """Identify the noise of one axis in one log."""
    try:
        noise = identify_noise(readings, interval, below)
    except ValueError as wrong:
        raise CampaignError([Problem(str(path), name, str(wrong))]) from None
    chosen = noise.fitted.chosen
    if noise.hold is not None:
        readings, interval = noise.hold.readings, noise.fitted.record.interval
    allan = allan_deviation(readings, interval, chosen.model, chosen.best.logs, relative_covariance(chosen))
    # the ordinates, as large as the log, are in the bands of the candidates
    light = replace(noise.fitted, record=replace(noise.fitted.record, ordinates=np.empty(0), lowest=np.empty(0)))
    return _AxisRecord(light, noise.goodness, resolution(readings), allan, noise.limits)


def _axis_report(instrument: str, axis: str, records: Sequence[_AxisRecord]) -> AxisReport:
    """Put together what one or several logs say of an axis."""
    fitted, agreement, repeated = records[0].fitted, None, None
    means = np.array([record.fitted.record.mean for record in records])
    if len(records) > 1:
        common = common_noise([record.fitted for record in records])
        fitted, agreement, repeated = common.fitted, common.p_value, repeatability(means)
    longest = max(records, key=lambda record: record.fitted.chosen.bands.grid.duration)
    chosen = fitted.chosen
    steps = [record.resolution for record in records if record.resolution is not None]
    return AxisReport(
        instrument, axis, fitted, tuple(record.goodness for record in records), means,
        max(steps) if len(steps) == len(records) else None, agreement, repeated,
        tuple(_parameters(instrument, axis, fitted)),
        longest.allan.beside(chosen.model, chosen.best.logs, relative_covariance(chosen)),
        _spectrum(longest.fitted, fitted), chosen.bands.grid.interval, _stand_in(fitted),
        tuple(dict.fromkeys(record.limits for record in records if record.limits)),
    )  # fmt: skip


def _stand_in(fitted: AxisFit) -> StandIn | None:
    """Find what stands for flicker noise that is identified."""
    shown = any(estimate.name == FLICKER.size and estimate.identified for estimate in fitted.estimates)
    return stand_in(fitted.chosen) if shown else None


def _parameters(instrument: str, axis: str, fitted: AxisFit) -> Iterator[ParameterRow]:
    """State every parameter of ``[imu]`` that a log at rest can show."""
    for statement in statements(fitted):
        key = key_of(instrument, statement.name)
        unit, shown = _units(instrument, statement.name)
        hours = None if statement.duration_wanted is None else statement.duration_wanted / 3600.0
        yield ParameterRow(
            instrument,
            axis,
            key,
            statement.value,
            statement.low,
            statement.high,
            unit,
            shown,
            conversion(unit, shown),
            hours,
            statement.certain,
        )


def _units(instrument: str, name: str) -> tuple[str, str]:
    """Return the SI unit of a parameter, and the one that is shown; flicker noise has those of a bias instability."""
    if name == CORRELATION_TIME:
        return "s", "s"
    key = key_of(instrument, "instability" if name == FLICKER.size else name)
    return PROCESS_UNITS[f"{instrument}_{key.split('.')[0]}"]


def _spectrum(shown: AxisFit, fitted: AxisFit) -> SpectrumPoints:
    """Return the spectral density of a log in bands, with that of the model: ``sqrt(λ Δ)``, N of white noise."""
    bands, chosen = shown.chosen.bands, fitted.chosen
    grid = bands.grid
    place = np.floor(POINTS_PER_DECADE * np.log10(grid.order)).astype(int)
    _, first = np.unique(place, return_index=True)
    numbers, sums = np.add.reduceat(bands.numbers, first), np.add.reduceat(bands.sums, first)
    frequency = np.exp(np.add.reduceat(bands.numbers * np.log(grid.frequency), first) / numbers)
    order = frequency * 2.0 * grid.duration
    variances = chosen.model.variances(Grid(grid.interval, grid.count, order), chosen.best.logs)[0]
    level = np.sqrt(sums * grid.interval)
    return SpectrumPoints(
        frequency, level / np.sqrt(numbers), level / np.sqrt(chi2.ppf(0.975, numbers)),
        level / np.sqrt(chi2.ppf(0.025, numbers)), np.sqrt(variances * grid.interval),
    )  # fmt: skip


def _of_attitude(axes: Sequence[AxisReport]) -> tuple[str, ...]:
    """Say what the means of the readings are of."""
    notes = []
    force = np.array([axis.means for axis in axes if axis.instrument == "accelerometer"])
    if len(force) == len(AXES):
        size = np.linalg.norm(force, axis=0)
        off = size / STANDARD_GRAVITY - 1.0
        if np.abs(off).max() > WEIGHT:
            notes.append(f"the mean specific force is {size[np.argmax(np.abs(off))]:.4g} m/s^2, not gravity's 9.8: "
                         "was the unit at rest?")  # fmt: skip
    if axes[0].repeatability is not None:
        notes.append(
            "the means of the readings have the earth's rate and gravity in them: their standard deviation from log to "
            "log is that of the biases from one turn-on to the next only if the attitude was the same in all logs"
        )
        if len(force) == len(AXES) and (spread := _turned(force)) > SAME_ATTITUDE:
            notes.append(f"the mean specific forces are up to {np.degrees(spread):.3g} deg apart in direction: either "
                         "the attitude was another one, or the accelerometers' biases changed as much")  # fmt: skip
    return tuple(notes)


def _turned(force: Array) -> float:
    """Return the largest angle between mean specific forces, shape (3, logs), rad."""
    unit = force / np.linalg.norm(force, axis=0)
    return float(np.arccos(np.clip(unit.T @ unit, -1.0, 1.0)).max())


def files_of(report: IdentificationReport) -> dict[str, str]:
    """Return the content of the files by name."""
    return {
        FILE: indented_json(identification_table(report)) + "\n",
        PAGE: page_html(page(report)),
        IMU: report.imu,
    }


def identification_table(report: IdentificationReport) -> dict[str, object]:
    """Arrange the results as ``identify.json`` has them: SI units, and the names of ``[imu]``."""
    instruments: dict[str, Any] = {}
    for axis in report.axes:
        table = instruments.setdefault(axis.instrument, {})
        for row in axis.parameters:
            inside = table
            for name in row.key.split("."):
                inside = inside.setdefault(name, {})
            inside[axis.axis] = {
                "value": row.value, "from": row.low, "to": row.high, "unit": row.unit, "hours_wanted": row.hours_wanted,
                "certain": row.certain,
            }  # fmt: skip
        unit = axis.unit
        if axis.repeatability is not None:
            spread = axis.repeatability
            entry = {"value": spread.value, "from": spread.low, "to": spread.high, "unit": unit}
            table.setdefault("bias", {})[axis.axis] = entry
        table.setdefault("record", {})[axis.axis] = _record_table(axis, unit)
    sigmas = report.sigmas
    table = {
        "logs": [vars(log) | {"duration": log.duration} for log in report.logs],
        **instruments,
        "notes": report.notes,
        "grades": [vars(row) for row in report.grades],
        "campaign": None if sigmas is None else vars(sigmas) | {"rows": [vars(row) for row in sigmas.rows]},
    }
    return dict(to_json(table))


def _record_table(axis: AxisReport, unit: str) -> dict[str, object]:
    """Return what is known of an axis besides its parameters."""
    first, second = axis.fitted.candidates[:2]
    return {
        "mean": axis.means, "unit": unit, "model": str(first.model), "next_model": str(second.model),
        "margin": axis.fitted.margin, "cannot_tell": axis.fitted.ambiguities,
        "stand_in": None if axis.stand_in is None else vars(axis.stand_in), "limits": axis.limits,
        "p_value": [test.p for test in axis.goodness],
        "rejected": [test.rejected for test in axis.goodness], "agreement": axis.agreement,
        "resolution": axis.resolution,
    }  # fmt: skip
