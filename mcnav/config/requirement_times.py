"""Epochs at which a requirement holds: ``after``, ``during`` or ``at`` a time.

Errors of all samples are known at the epochs of a scenario, so that a requirement holds at each epoch in its span. The
time of ``at``, and begin and end of ``after`` and ``during``, become epochs of the system; the time of ``at`` in a
class of the user's must be one of its own epochs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.config.schema import OUTAGES, AcceptTable, CircularTable, QuantileTable
from mcnav.contract.questions import Question, reason_against
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.systems.histories import first_and_last
from mcnav.systems.ins.tables.instants import DECIMALS, SAME, seconds, within

KEYS: Final = ("after", "during", "at")

OUTAGE: Final = 'give one outages = [["300 s", "420 s"]]'
"""Remedy where a requirement holds during outages and no sensor has any."""


@dataclass(frozen=True)
class RequirementEpochs:
    """Epochs at which a requirement holds.

    Attributes
    ----------
    words : str
        Such as ``from 600 s on``.
    numbers : tuple of int
        Rising, from zero, the start.
    """

    words: str
    numbers: tuple[int, ...]


def with_epochs(scenario: Scenario, table: AcceptTable) -> Scenario:
    """Return a scenario whose epochs contain the times at which requirements hold, where they can be added."""
    entries = [entry for kind in (table.quantile, table.cep, table.r95, table.sep) for entry in kind]
    asked = sorted({round(time, DECIMALS) for entry in entries for time in _bounds(entry)})
    times = scenario.reading_times if asked else np.zeros(0)
    far = [
        time for time in asked
        if len(times) and times[0] < time < times[-1] and np.abs(times - time).min() > _tolerance(times)
    ]  # fmt: skip
    return scenario.with_epochs(tuple(far)) if far else scenario


def _bounds(entry: QuantileTable | CircularTable) -> tuple[float, ...]:
    """Return the times that a requirement names, s: of a span its begin, and an instant just before its end."""
    if isinstance(entry.during, list):
        return first_and_last(*entry.during)
    return tuple(time for time in (entry.at, entry.after) if time is not None)


def read_epochs(
    entry: QuantileTable | CircularTable, scenario: Scenario, key: str, context: FileContext
) -> RequirementEpochs | None:
    """Read the epochs of a requirement, none for the end alone; mistakes are added to the context."""
    given = [name for name in KEYS if getattr(entry, name) is not None]
    if not given:
        return None
    at = f"{key}.{given[0]}"
    if len(given) > 1:
        context.problem(key, f"has {' and '.join(given)}; expected one of them")
    elif not len(scenario.reading_times):
        reason = reason_against(Question.OVER_TIME, scenario.parts) or "the epochs of the system have no unit of time"
        context.problem(at, reason)
    elif given[0] == "after":
        return _after(scenario, entry.after or 0.0, at, context)
    elif given[0] == "at":
        return _at(scenario, entry.at or 0.0, at, context)
    else:
        return _during(scenario, entry.during or OUTAGES, at, context)
    return None


def _tolerance(times: Array) -> float:
    """Return the difference within which two times of a scenario are the same, s."""
    return SAME * float(np.abs(times[[0, -1]]).max())


def _after(scenario: Scenario, time: float, key: str, context: FileContext) -> RequirementEpochs | None:
    times = scenario.reading_times
    if not _within_flight(times, time, key, context):
        return None
    return _found(f"from {seconds(time)} on", times >= time - _tolerance(times))


def _at(scenario: Scenario, time: float, key: str, context: FileContext) -> RequirementEpochs | None:
    times = scenario.reading_times
    if not _within_flight(times, time, key, context):
        return None
    nearest = int(np.argmin(np.abs(times - time)))
    if abs(times[nearest] - time) > _tolerance(times):
        later = int(np.searchsorted(times, time))
        neighbours = f"{seconds(times[later - 1])} or {seconds(times[later])}"
        context.problem(key, f"got {seconds(time)}, which lies between two epochs; expected {neighbours}")
        return None
    return RequirementEpochs(f"at {seconds(time)}", (nearest,))


def _during(scenario: Scenario, entry: str | list[float], key: str, context: FileContext) -> RequirementEpochs | None:
    times = scenario.reading_times
    if isinstance(entry, str):
        spans, words = list(scenario.outages), "during outages"
        if not spans and any(problem.key.startswith("aiding") for problem in context.problems):
            return None  # the sensor that may have one was not read
        if not spans:
            context.problem(key, f"got {entry!r}; no sensor has an outage during navigation: {OUTAGE}")
            return None
    else:
        begin, end = entry
        if not all(_within_flight(times, item, key, context) for item in entry):
            return None
        if not begin < end:
            context.problem(key, f"got {seconds(begin)} to {seconds(end)}; expected an end after its begin")
            return None
        spans, words = [(begin, end)], f"from {seconds(begin)} to {seconds(end)}"
    inside = np.zeros(len(times), dtype=bool)
    for begin, end in spans:
        epochs = within(times, begin, end, _tolerance(times))
        if not epochs.any():
            apart = seconds(float(np.max(np.diff(times))))
            came = f"{seconds(begin)} to {seconds(end)}"
            context.problem(key, f"no epoch lies within {came}; errors are known at epochs that are {apart} apart")
            return None
        inside |= epochs
    return _found(words, inside)


def _within_flight(times: Array, time: float, key: str, context: FileContext) -> bool:
    first, last = float(times[0]), float(times[-1])
    if first - _tolerance(times) <= time <= last + _tolerance(times):
        return True
    context.problem(key, f"got {seconds(time)}; navigation is from {seconds(first)} to {seconds(last)}")
    return False


def _found(words: str, inside: NDArray[np.bool_]) -> RequirementEpochs:
    return RequirementEpochs(words, tuple(np.flatnonzero(inside).tolist()))
