"""Epochs at which a requirement holds: ``after``, ``during`` or ``at`` a time of the trajectory.

Errors of all samples are known at the epochs of a navigation, so that a requirement holds at each epoch in its span.
The time of ``at`` becomes an epoch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.config.schema import AcceptTable, CircularTable, QuantileTable
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.systems.ins.scenario import Ins, Navigation, is_ins
from mcnav.systems.ins.tables.instants import DECIMALS, same_times, seconds, within

KEYS: Final = ("after", "during", "at")
OUTAGES: Final = "outages"


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


def with_epochs(scenario: Ins, table: AcceptTable) -> Ins:
    """Return a scenario whose epochs contain the times at which requirements hold."""
    navigation = scenario.navigation
    entries = [entry for kind in (table.quantile, table.cep, table.r95, table.sep) for entry in kind]
    asked = sorted({round(entry.at, DECIMALS) for entry in entries if entry.at is not None})
    times = navigation.times
    far = [
        time for time in asked
        if navigation.start < time < navigation.end and np.abs(times - time).min() > same_times(navigation)
    ]  # fmt: skip
    return Ins(replace(navigation, further=tuple(far))) if far else scenario


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
    elif not is_ins(scenario):
        context.problem(at, "needs a scenario of type ins; other requirements hold at the end")
    elif given[0] == "after":
        return _after(scenario.navigation, entry.after or 0.0, at, context)
    elif given[0] == "at":
        return _at(scenario.navigation, entry.at or 0.0, at, context)
    else:
        return _during(scenario.navigation, entry.during, at, context)
    return None


def _after(navigation: Navigation, time: float, key: str, context: FileContext) -> RequirementEpochs | None:
    if not _navigates(navigation, time, key, context):
        return None
    return _found(f"from {seconds(time)} on", navigation.times >= time - same_times(navigation))


def _at(navigation: Navigation, time: float, key: str, context: FileContext) -> RequirementEpochs | None:
    if not _navigates(navigation, time, key, context):
        return None
    nearest = np.zeros(len(navigation.times), dtype=bool)
    nearest[np.argmin(np.abs(navigation.times - time))] = True
    return _found(f"at {seconds(time)}", nearest)


def _during(navigation: Navigation, entry: object, key: str, context: FileContext) -> RequirementEpochs | None:
    if entry == OUTAGES:
        spans = [
            outage
            for outage in sorted({outage for sensor in navigation.sensors for outage in sensor.outages})
            if outage[0] <= navigation.end and outage[1] > navigation.start
        ]
        if not spans:
            context.problem(key, f"got {entry!r}; no sensor has one within the navigation")
            return None
        words = "during outages"
    elif isinstance(entry, list) and len(entry) == 2:
        ends = [context.quantity(each, "s", f"{key} #{number}") for number, each in enumerate(entry, start=1)]
        if any(each is None or not _navigates(navigation, each, key, context) for each in ends):
            return None
        begin, end = (each or 0.0 for each in ends)
        if not begin < end:
            context.problem(key, f"got {entry[0]!r} to {entry[1]!r}; expected an end after its begin")
            return None
        spans, words = [(begin, end)], f"from {seconds(begin)} to {seconds(end)}"
    else:
        context.problem(key, f'expected a begin and an end such as ["1200 s", "1500 s"], or "{OUTAGES}"')
        return None
    inside = np.zeros(len(navigation.times), dtype=bool)
    for begin, end in spans:
        epochs = within(navigation.times, begin, end, same_times(navigation))
        if not epochs.any():
            apart = seconds(float(np.max(np.diff(navigation.times))))
            came = f"{seconds(begin)} to {seconds(end)}"
            context.problem(key, f"no epoch lies within {came}; errors are known at epochs that are {apart} apart")
            return None
        inside |= epochs
    return _found(words, inside)


def _navigates(navigation: Navigation, time: float, key: str, context: FileContext) -> bool:
    tolerance = same_times(navigation)
    if navigation.start - tolerance <= time <= navigation.end + tolerance:
        return True
    span = f"{seconds(navigation.start)} to {seconds(navigation.end)}"
    context.problem(key, f"got {seconds(time)}; navigation is from {span}")
    return False


def _found(words: str, inside: NDArray[np.bool_]) -> RequirementEpochs:
    return RequirementEpochs(words, tuple(np.flatnonzero(inside).tolist()))
