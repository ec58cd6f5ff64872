"""Events over a flight: updates, rejections and outages of sensors, faults, manoeuvres, requirements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import SensorConsistency
from mcnav.analysis.filter_remarks import period
from mcnav.arrays.types import Array
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

Happening = Literal["updates", "outage", "fault", "turn", "climb", "descent", "requirement"]

NOTABLE: Final = 0.005
"""Share of rejected updates from which on it is told, and never below twice the median over the flight."""

MANOEUVRES: Final = "manoeuvres"
"""Name of their row."""

TURNING: Final = 0.2
"""Rate of turn from which on it is a manoeuvre, deg/s."""

CLIMBING: Final = 0.5
"""Vertical speed from which on it is one, m/s."""

MOVING: Final = 1.0
"""Speed from which on heading and altitude are those of a flight, m/s."""


@dataclass(frozen=True)
class Interval:
    """Something from one time to another; ``words`` say what it is."""

    kind: Happening
    begin: float
    end: float
    words: str


@dataclass(frozen=True)
class Rejection:
    """Share of a sensor's updates that were rejected since the instant before."""

    time: float
    share: float


@dataclass(frozen=True)
class Lane:
    """One row of the strip."""

    name: str
    intervals: tuple[Interval, ...]
    rejections: tuple[Rejection, ...] = ()

    def words_at(self, time: float) -> str:
        """Say what there is at a time, such as ``gnss outage``; empty where there is nothing but updates."""
        said = [
            interval.kind if interval.kind != "requirement" else "holds"
            for interval in self.intervals
            if interval.kind != "updates" and interval.begin <= time <= interval.end
        ]
        said += [
            f"with {_percent(rejection.share)} of its updates rejected"
            for rejection in self.rejections
            if rejection.time == time
        ]
        words = " and ".join(dict.fromkeys(said))
        return words if self.name == MANOEUVRES else f"{self.name} {words}" if said else ""


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def lanes(content: RunAnalysis, times: Array) -> list[Lane]:
    """List the rows of the strip: each sensor, manoeuvres, each requirement that holds over time."""
    return [*_sensors(content), *_manoeuvres(content), *_requirements(content, times)]


def _sensors(content: RunAnalysis) -> Iterable[Lane]:
    if content.filter is None:
        return
    label, times, outages = content.filter.label, content.filter.times, content.history.outages
    faults = content.manifest.model.faults or ()
    for sensor in content.filter.sensors:
        name = humanize(sensor.name)
        intervals = _updates(sensor, times, label)
        intervals += [
            Interval("outage", begin, end, f"outage of {name}: {_span(begin, end, label)}")
            for begin, end in outages.get(sensor.name, ())
        ]
        intervals += [
            Interval("fault", float(times[fault.first]), float(times[fault.last]), f"{fault.kind} of {name}, "
                     f"{fault.component}: {_span(float(times[fault.first]), float(times[fault.last]), label)}")
            for fault in faults if fault.sensor == sensor.name and fault.last < len(times)
        ]  # fmt: skip
        yield Lane(name, tuple(intervals), rejections(sensor, times))


def rejections(sensor: SensorConsistency, times: Array) -> tuple[Rejection, ...]:
    """Return the shares that are more than what the gate rejects all along."""
    asked = np.nan_to_num(sensor.accepted + sensor.rejected)
    known = asked > 0.0
    shares = np.divide(np.nan_to_num(sensor.rejected), asked, out=np.zeros_like(asked), where=known)
    least = max(NOTABLE, 2.0 * float(np.median(shares[known]))) if known.any() else NOTABLE
    return tuple(Rejection(float(times[k]), float(shares[k])) for k in np.flatnonzero(shares >= least))


def _updates(sensor: SensorConsistency, times: Array, label: str) -> list[Interval]:
    asked = np.nan_to_num(sensor.accepted + sensor.rejected)
    listed = []
    for begin, end in _runs(asked > 0.0):
        count, rejected = float(asked[begin:end].sum()), float(np.nan_to_num(sensor.rejected[begin:end]).sum())
        first, last = float(times[max(begin - 1, 0)]), float(times[end - 1])
        refused = f", {_percent(rejected / count)} rejected" if rejected else ""
        words = f"{humanize(sensor.name)}: {count:,.0f} updates{refused}, {_span(first, last, label)}"
        listed.append(Interval("updates", first, last, words))
    return listed


def _manoeuvres(content: RunAnalysis) -> Iterable[Lane]:
    columns = content.history.columns
    if not {"heading [deg]", "altitude [m]", "speed [m/s]"} <= set(columns):
        return
    label, times = next(iter(columns.items()))
    unit = label.partition(" [")[2].removesuffix("]")
    seconds = times * {"min": 60.0, "h": 3600.0}.get(unit, 1.0)
    moving = columns["speed [m/s]"] > MOVING
    turning = np.abs(np.gradient(columns["heading [deg]"], seconds)) > TURNING
    upward = np.gradient(columns["altitude [m]"], seconds)
    rows: list[tuple[Happening, NDArray[np.bool_]]] = [
        ("turn", turning & moving), ("climb", (upward > CLIMBING) & moving), ("descent", (upward < -CLIMBING) & moving),
    ]  # fmt: skip
    intervals = [
        Interval(kind, float(times[begin]), float(times[end - 1]), f"{kind}: "
                 f"{_span(float(times[begin]), float(times[end - 1]), label)}")
        for kind, known in rows for begin, end in _runs(known)
    ]  # fmt: skip
    if intervals:
        yield Lane(MANOEUVRES, tuple(intervals))


def _requirements(content: RunAnalysis, times: Array) -> Iterable[Lane]:
    for row in requirement_rows(content.summary, "shown", content.time_unit):
        holds = np.isin(np.arange(len(times)), row.entry.epochs)
        intervals = tuple(
            Interval("requirement", float(times[begin]), float(times[end - 1]), f"{row.words}: {row.entry.finding}")
            for begin, end in _runs(holds)
        )
        if intervals:
            yield Lane(f"requirement {row.number}", tuple(intervals))


def _runs(known: NDArray[np.bool_]) -> Sequence[tuple[int, int]]:
    """Return first and one past the last place of each run of true values.

    >>> _runs(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def _span(begin: float, end: float, label: str) -> str:
    return period(begin, end, label)
