"""Instants of aiding: those of an interval, or a list, less outages; and times that are the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.entries.context import FileContext
from mcnav.systems.ins.scenario import Navigation

MOST_MEASUREMENTS: Final = 50_000
"""Measurements of all sensors together: each is an update of every sample's filter."""

MOST_OUTAGES: Final = 100
"""Largest number of a sensor's outages: each adds epochs."""

DECIMALS: Final = 9
"""Decimals of an instant in s: sensors that measure at one instant have the same one to the last bit."""

SHORTEST_INTERVAL: Final = 1e-3
"""Shortest interval between measurements, s."""

SAME: Final = 1e-9
"""Difference of two times that are the same, over the largest: many are computed, not written."""

KEYS: Final = ("interval", "instants", "begin", "end", "outages")


def same_times(navigation: Navigation) -> float:
    """Return the difference within which two times of a navigation are the same, s."""
    return SAME * max(abs(navigation.start), abs(navigation.end))


def within(times: Array, begin: float, end: float, tolerance: float) -> NDArray[np.bool_]:
    """Select times from a begin, included, to an end, not included."""
    return np.asarray((times >= begin - tolerance) & (times < end - tolerance))


def seconds(time: float) -> str:
    """Write a time for a message.

    >>> seconds(3600.0)
    '3600 s'
    """
    return f"{time:.10g} s"


def read_instants(
    entry: Mapping[str, Any], navigation: Navigation, key: str, context: FileContext
) -> tuple[Array, tuple[tuple[float, float], ...]]:
    """Read the instants of a sensor's measurements, shape (u,), s, and its outages; mistakes go to the context."""
    before = len(context.problems)
    outages = _read_outages(entry.get("outages", []), f"{key}.outages", context)
    given = [name for name in ("interval", "instants") if name in entry]
    times = np.zeros(0)
    if len(given) != 1:
        came = "has interval and instants" if given else "has no instants of measurements"
        context.problem(key, f'{came}; expected interval = "1 s", or instants = ["600 s", "1200 s"]')
    elif given[0] == "interval":
        times = _of_interval(entry, navigation, key, context)
    else:
        for name in ("begin", "end"):
            if name in entry:
                context.problem(f"{key}.{name}", "limits an interval; leave it out with instants")
        times = _of_list(entry["instants"], navigation, f"{key}.instants", context)
    if len(context.problems) > before:
        return np.zeros(0), ()
    for begin, end in outages:
        times = times[~within(times, begin, end, same_times(navigation))]
    return times, outages


def _of_interval(entry: Mapping[str, Any], navigation: Navigation, key: str, context: FileContext) -> Array:
    """Read the instants of an interval: from begin on, or from an interval after the start of navigation on.

    Those at the start of navigation and before it are left out, as in a list.
    """
    interval = context.quantity(entry["interval"], "s", f"{key}.interval")
    begin = context.quantity(entry["begin"], "s", f"{key}.begin") if "begin" in entry else navigation.start
    end = context.quantity(entry["end"], "s", f"{key}.end") if "end" in entry else navigation.end
    if interval is None or begin is None or end is None:
        return np.zeros(0)
    came, start, lasts = entry["interval"], navigation.start, navigation.end - navigation.start
    until = min(end, navigation.end)
    count = (until - max(begin, start)) / max(interval, SHORTEST_INTERVAL)
    if interval < SHORTEST_INTERVAL:
        context.problem(f"{key}.interval", f"got {came!r}; expected at least {seconds(SHORTEST_INTERVAL)}")
    elif interval > lasts + same_times(navigation):
        context.problem(f"{key}.interval", f"got {came!r}; navigation lasts {seconds(lasts)}")
    elif "end" in entry and end <= begin:
        after = f"begin of {seconds(begin)}" if "begin" in entry else f"start of navigation at {seconds(begin)}"
        context.problem(f"{key}.end", f"got {entry['end']!r}; expected a time after the {after}")
    elif count > MOST_MEASUREMENTS:
        context.problem(f"{key}.interval", f"got {came!r}; {_too_many(count)}")
    elif count >= 0.0:
        slack = same_times(navigation) / interval
        first = max(0.0, np.floor((start - begin) / interval + slack) + 1.0)
        last = np.floor((until - begin) / interval + slack)
        times = np.round(begin + interval * np.arange(first, last + 1.0), DECIMALS)
        return np.asarray(np.minimum(times, navigation.end))
    return np.zeros(0)


def _of_list(entry: object, navigation: Navigation, key: str, context: FileContext) -> Array:
    """Read instants one by one; those beyond the navigation are left out."""
    if not isinstance(entry, list) or not entry:
        context.problem(key, 'expected a list of times such as ["600 s", "1200 s"]')
        return np.zeros(0)
    before = len(context.problems)
    read = (context.quantity(each, "s", f"{key} #{number}") for number, each in enumerate(entry, start=1))
    times = np.array([time for time in read if time is not None])
    if len(context.problems) > before:
        return np.zeros(0)
    first, last = (float(time) for time in navigation.truth.times[[0, -1]])
    wrong = np.flatnonzero((times < first - same_times(navigation)) | (times > last + same_times(navigation)))
    falling = np.flatnonzero(np.diff(times) <= same_times(navigation))
    if len(wrong):
        number = int(wrong[0])
        context.problem(
            f"{key} #{number + 1}", f"got {entry[number]!r}; the trajectory is from {seconds(first)} to {seconds(last)}"
        )
    elif len(falling):
        number = int(falling[0]) + 1
        context.problem(f"{key} #{number + 1}", f"got {entry[number]!r}; expected a later one than {entry[number - 1]}")
    times = np.round(times, DECIMALS)
    inside = (times > navigation.start + same_times(navigation)) & (times <= navigation.end + same_times(navigation))
    return np.asarray(np.minimum(times[inside], navigation.end))


def _read_outages(entry: object, key: str, context: FileContext) -> tuple[tuple[float, float], ...]:
    expected = 'expected pairs of begin and end such as [["1200 s", "1500 s"]]'
    if not isinstance(entry, list):
        context.problem(key, expected)
        return ()
    if len(entry) > MOST_OUTAGES:
        context.problem(key, f"got {len(entry)}; expected at most {MOST_OUTAGES}")
        return ()
    outages = []
    for number, pair in enumerate(entry, start=1):
        at = f"{key} #{number}"
        if not isinstance(pair, list) or len(pair) != 2:
            context.problem(at, expected)
            return ()
        begin, end = (context.quantity(each, "s", at) for each in pair)
        if begin is None or end is None:
            continue
        if end <= begin:
            context.problem(at, f"got {pair[0]!r} to {pair[1]!r}; expected an end after its begin")
        outages.append((begin, end))
    return tuple(sorted(outages))


def check_count(count: int, context: FileContext) -> None:
    """Add a mistake when all sensors together measure too often."""
    if count > MOST_MEASUREMENTS:
        context.problem("aiding", _too_many(count))


def _too_many(count: float) -> str:
    return f"{count:,.0f} measurements; at most {MOST_MEASUREMENTS:,} of all sensors can be simulated"
