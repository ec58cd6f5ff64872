"""Schedule of a loop: instants, the steps that lead to each, and what happens there.

The order at one instant is: propagate, event, a phase that begins, measurements in their order, corrections, guidance,
reading.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import suggestion
from mcnav.systems.closed_loop.declarations import Measurement, Phase, Trigger
from mcnav.systems.closed_loop.structure import phases_of

MOST_STEPS: Final = 1_000_000
MOST_INSTANTS: Final = 200_000

SAME: Final = 1e-9
"""Share of the flight within which two instants are one."""


@dataclass(frozen=True)
class Instant:
    """An instant: steps of equal length that lead to it from the one before, and what happens at it.

    Its phase is the number of one that begins at it.
    """

    time: float
    begin: float
    steps: int
    measurements: tuple[int, ...] = ()
    corrections: tuple[int, ...] = ()
    guide: bool = False
    epoch: bool = False
    phase: int | None = None

    @property
    def length(self) -> float:
        """Length of a step, s."""
        return (self.time - self.begin) / self.steps if self.steps else 0.0

    def step_times(self) -> Array:
        """Begin of each step, s."""
        return np.asarray(self.begin + self.length * np.arange(self.steps), dtype=float)


def read_schedule(instance: Any, name: str, measurements: tuple[Measurement, ...]) -> tuple[Instant, ...]:
    """Arrange the instants of a user's object from zero to its end, or to the latest that its trigger allows.

    Raises `ScenarioError` when a time is wrong.
    """
    end = instance.end
    last = _time(end.latest if isinstance(end, Trigger) else end, f"{name}.end", "a time, or Trigger(function, latest)")
    cycle = None if instance.cycle is None else _time(instance.cycle, f"{name}.cycle", "a time, or None")
    intervals = [
        _time(measurement.interval, measurement.name, "an interval")
        for measurement in measurements
        if measurement.interval is not None
    ]
    steps = [instance.step, cycle, min(intervals, default=None)]
    step = next((_time(step, f"{name}.step", "a time") for step in steps if step is not None), None)
    if step is None:
        raise ScenarioError("type", f"{name}.step is needed where there is neither cycle nor interval of a measurement")
    if last / step > MOST_STEPS:
        raise ScenarioError(
            "type", f"{name}.step: the flight would have {last / step:.3g} steps; at most {MOST_STEPS:,}"
        )
    at: dict[str, Array] = {"cycle": _multiples(step if cycle is None else cycle, last, f"{name}.cycle")}
    at["cycle"] = np.append(0.0, at["cycle"])
    for measurement in measurements:
        listed = None if measurement.instants is None else np.array(measurement.instants, dtype=float)
        if listed is not None and (listed.ndim != 1 or not np.isfinite(listed).all() or np.any(listed < 0.0)):
            raise ScenarioError(
                "type", f"{name}.measurements: instants of {measurement.name} must be times from zero on"
            )
        times = _multiples(measurement.interval, last, measurement.name) if listed is None else np.sort(listed)
        at[f"measure {measurement.name}"] = times[_within_phases(measurement, phases_of(instance, name), times, name)]
    for correction in instance.corrections:
        by_trigger = isinstance(correction.at, Trigger)
        time = _time(
            correction.at.latest if by_trigger else correction.at,
            correction.name,
            "a time, or Trigger(function, latest)",
            0.0,
        )
        at[f"{'latest' if by_trigger else 'correct'} {correction.name}"] = np.array([time])
    for phase in phases_of(instance, name)[1:]:
        triggered = isinstance(phase.begins, Trigger)
        time = _time(phase.begins.latest if isinstance(phase.begins, Trigger) else phase.begins, phase.name, "a time")
        at[f"{'latest' if triggered else 'begin'} {phase.name}"] = np.array([time])
    same = SAME * last
    merged = np.unique(np.concatenate([*at.values(), [0.0, last]]))
    merged = merged[np.append(True, np.diff(merged) > same) & (merged <= last + same)]
    merged[-1] = last
    if len(merged) > MOST_INSTANTS:
        raise ScenarioError("type", f"{name} would have {len(merged):,} instants; at most {MOST_INSTANTS:,}")

    def falls(key: str) -> list[bool]:
        """Tell at which instants something happens."""
        times = at.get(key, np.zeros(0))
        following = np.searchsorted(times, merged - same)
        happens: list[bool] = (np.append(times, np.inf)[following] <= merged + same).tolist()
        return happens

    # by instant, and within one in the order of the user's lists
    measured = _numbers_by_instant([falls(f"measure {measurement.name}") for measurement in measurements], len(merged))
    corrected = _numbers_by_instant([falls(f"correct {named.name}") for named in instance.corrections], len(merged))
    begun = _numbers_by_instant([falls(f"begin {phase.name}") for phase in instance.phases], len(merged))
    return tuple(
        Instant(
            time, begin, int(np.ceil((time - begin) / step * (1.0 - SAME))), measured[number], corrected[number],
            on_cycle or cycle is None, on_cycle or time == last, next(iter(begun[number]), None),
        )
        for number, (begin, time, on_cycle) in enumerate(
            zip([0.0, *merged[:-1].tolist()], merged.tolist(), falls("cycle"), strict=True)
        )
    )  # fmt: skip


def _numbers_by_instant(happens: list[list[bool]], instants: int) -> list[tuple[int, ...]]:
    """Return at each instant the numbers of what happens at it; ``happens`` has a row for each number."""
    if not happens:
        return [()] * instants
    return [tuple(np.flatnonzero(column).tolist()) for column in np.transpose(happens)]


def _within_phases(measurement: Measurement, phases: tuple[Phase, ...], times: Array, name: str) -> NDArray[np.bool_]:
    """Tell which times lie in the phases of a measurement: from a begin on until the next one."""
    if not measurement.phases:
        return np.ones(len(times), dtype=bool)
    known, where = [phase.name for phase in phases], f"{name}.measurements: {measurement.name}"
    begins = [0.0 if phase.begins is None else phase.begins for phase in phases] + [np.inf]
    within = np.zeros(len(times), dtype=bool)
    for phase in [measurement.phases] if isinstance(measurement.phases, str) else measurement.phases:
        if phase not in known:
            raise ScenarioError(
                "type", f"{where} measures in {phase!r}, which is no phase{suggestion(str(phase), known)}"
            )
        begin, end = begins[known.index(phase) : known.index(phase) + 2]
        if isinstance(begin, Trigger) or isinstance(end, Trigger):
            told = f"{phase} begins or ends by a trigger, at another time in each sample"
            raise ScenarioError("type", f"{where}: {told}; a measurement is limited to phases between given times")
        same = SAME * max(times[-1], 1.0) if len(times) else 0.0
        within |= (times >= begin - same) & (times < end - same)
    return within


def _time(value: Any, where: str, expected: str, least: float = 1e-12) -> float:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not least <= value < np.inf:
        raise ScenarioError("type", f"{where} must be {expected} in seconds, {least:g} or more; got {value!r:.60}")
    return float(value)


def _multiples(interval: float | None, last: float, where: str) -> Array:
    assert interval is not None
    count = int(np.floor(last / interval * (1.0 + SAME)))
    if count > MOST_INSTANTS:
        raise ScenarioError("type", f"{where}: there would be {count:,} instants; at most {MOST_INSTANTS:,}")
    return interval * np.arange(1.0, count + 1.0)
