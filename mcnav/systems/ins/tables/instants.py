"""Instants of aiding: those of an interval, or a list, less outages; and times that are the same."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator, WithJsonSchema

from mcnav.arrays.types import Array
from mcnav.entries.context import FileContext
from mcnav.entries.mistakes import Mistake, refuse, told
from mcnav.entries.quantities import UNIT, Duration, Table
from mcnav.physics.units import UnitError, quantity

if TYPE_CHECKING:
    from mcnav.systems.ins.scenario import Navigation

MOST_MEASUREMENTS: Final = 1_000_000
"""Measurements of all sensors together: linear analysis takes some 0.2 ms for each."""

MOST_OUTAGES: Final = 100
"""Largest number of a sensor's outages: each adds epochs."""

DECIMALS: Final = 9
"""Decimals of an instant in s: sensors that measure at one instant have the same one to the last bit."""

SHORTEST_INTERVAL: Final = 1e-3
"""Shortest interval between measurements, s."""

SAME: Final = 1e-9
"""Difference of two times that are the same, over the largest: many are computed, not written."""


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


Span = tuple[float, float]
"""Begin, included, and end, not included, s."""


def _read_list(entry: object) -> Array:
    """Read instants one by one."""
    if not isinstance(entry, list) or not entry:
        raise told('expected a list of times such as ["600 s", "1200 s"]')
    mistakes: list[Mistake] = []
    times = [_read_time(item, number, mistakes) for number, item in enumerate(entry)]
    if mistakes:
        raise refuse(mistakes)
    return np.array(times)


def _read_outages(entry: object) -> tuple[Span, ...]:
    """Read pairs of begin and end."""
    expected = 'expected pairs of begin and end such as [["1200 s", "1500 s"]]'
    if not isinstance(entry, list):
        raise told(expected)
    if len(entry) > MOST_OUTAGES:
        raise told(f"got {len(entry)}; expected at most {MOST_OUTAGES}")
    mistakes: list[Mistake] = []
    outages: list[Span] = []
    for number, pair in enumerate(entry):
        if not isinstance(pair, list) or len(pair) != 2:
            raise refuse([Mistake(expected, (number,))])
        begin, end = (_read_time(entry, number, mistakes) for entry in pair)
        if end <= begin:
            mistakes.append(Mistake(f"got {pair[0]!r} to {pair[1]!r}; expected an end after its begin", (number,)))
        outages.append((begin, end))
    if mistakes:
        raise refuse(mistakes)
    return tuple(sorted(outages))


def _read_time(entry: object, number: int, mistakes: list[Mistake]) -> float:
    """Read an entry of a list; when it is wrong, add the mistake and return NaN."""
    try:
        return quantity(entry, "s")
    except UnitError as wrong:
        mistakes.append(Mistake(str(wrong), (number,)))
        return math.nan


InstantList = Annotated[
    Array,
    PlainValidator(_read_list),
    WithJsonSchema({"type": "array", "items": {UNIT: "s", "examples": ["600 s"]}, "minItems": 1}),
]
Outages = Annotated[
    tuple[Span, ...],
    PlainValidator(_read_outages),
    WithJsonSchema(
        {
            "type": "array",
            "items": {
                "type": "array", "items": {UNIT: "s", "examples": ["1200 s"]}, "minItems": 2, "maxItems": 2,
            },
            "maxItems": MOST_OUTAGES,
        }
    ),
]  # fmt: skip


WAYS: Final = ("interval", "instants", "log")
OF_LOG: Final = ("columns", "units", "log_start", "log_factor")


@dataclass(frozen=True)
class InstantRule:
    """Instants of measurements are those of an interval, which begin and end limit, a list, or a log; see `Rule`."""

    def broken(self, given: Set[str], expected: str) -> Mistake | None:
        """See `Rule`."""
        ways = [name for name in WAYS if name in given]
        if len(ways) != 1:
            came = f"has {' and '.join(ways)}" if ways else "has no times of measurements"
            return Mistake(
                f'{came}; expected one of interval = "1 s", instants = ["600 s", "1200 s"], log = "gnss.pos"'
            )
        limits = [name for name in ("begin", "end") if name in given and "interval" not in ways]
        if limits:
            return Mistake(f"limits an interval; leave it out with {ways[0]}", (limits[0],))
        of_log = [name for name in OF_LOG if name in given and "log" not in ways]
        return Mistake('belongs to a log; expected log = "gnss.pos" beside it', (of_log[0],)) if of_log else None

    @property
    def schema(self) -> Mapping[str, object]:
        """See `Rule`."""
        ways = [{"required": [name]} for name in WAYS]
        limits = {"begin": ["interval"], "end": ["interval"]}
        return {"oneOf": ways, "dependencies": {**limits, **{name: ["log"] for name in OF_LOG}}}


class InstantsTable(Table):
    """Instants of a sensor's measurements, in the trajectory's time."""

    interval: Annotated[
        Duration | None,
        Field(
            description="Time between measurements; without begin, the first is one interval after the start.",
            examples=["1 s"],
        ),
    ] = None
    begin: Annotated[
        Duration | None,
        Field(description="First measurement at an interval, in the trajectory's time.", examples=["600 s"]),
    ] = None
    end: Annotated[
        Duration | None,
        Field(
            description="Last instant of measurements at an interval, in the trajectory's time.", examples=["1200 s"]
        ),
    ] = None
    instants: Annotated[
        InstantList | None,
        Field(description="Instants of measurements in place of an interval, in the trajectory's time."),
    ] = None
    log: Annotated[
        str | None,
        Field(
            description="Recorded sensor beside the campaign file, whose instants and sigmas are taken.",
            examples=["gnss.pos"],
        ),
    ] = None
    columns: Annotated[
        dict[str, str], Field(description='Columns of the log, where names do not tell: time = "tow".')
    ] = Field(default_factory=dict)
    units: Annotated[dict[str, str], Field(description='Units of the log\'s columns: time = "ms".')] = Field(
        default_factory=dict
    )
    log_start: Annotated[
        Duration | None, Field(description="Time of the log's first row, in the trajectory's time.", examples=["0 s"])
    ] = None
    log_factor: Annotated[
        float, Field(gt=0.0, le=1e6, description="Factor of the sigmas of the log.", examples=[2.0])
    ] = 1.0
    outages: Annotated[
        Outages, Field(description="Pairs of begin, included, and end, not included, without measurements.")
    ] = ()


def instants_of(
    table: InstantsTable, entry: Mapping[str, Any], navigation: Navigation, key: str, context: FileContext
) -> Array:
    """Return the instants of a sensor's measurements within a navigation, shape (u,), s.

    Mistakes, which show the entry as it is written, go to the context.
    """
    before = len(context.problems)
    if table.interval is not None:
        times = _of_interval(table, table.interval, entry, navigation, key, context)
    else:
        given = np.zeros(0) if table.instants is None else table.instants
        times = _of_list(given, entry["instants"], navigation, f"{key}.instants", context)
    if len(context.problems) > before:
        return np.zeros(0)
    for begin, end in table.outages:
        times = times[~within(times, begin, end, same_times(navigation))]
    return times


def _of_interval(
    table: InstantsTable, interval: float, entry: Mapping[str, Any], navigation: Navigation, key: str,
    context: FileContext,
) -> Array:  # fmt: skip
    """Return the instants of an interval: from begin on, or from an interval after the start of navigation on.

    Those at the start of navigation and before it are left out, as in a list.
    """
    begin = navigation.start if table.begin is None else table.begin
    end = navigation.end if table.end is None else table.end
    came, start, lasts = entry["interval"], navigation.start, navigation.end - navigation.start
    until = min(end, navigation.end)
    count = (until - max(begin, start)) / max(interval, SHORTEST_INTERVAL)
    if interval < SHORTEST_INTERVAL:
        context.problem(f"{key}.interval", f"got {came!r}; expected at least {seconds(SHORTEST_INTERVAL)}")
    elif interval > lasts + same_times(navigation):
        context.problem(f"{key}.interval", f"got {came!r}; navigation lasts {seconds(lasts)}")
    elif table.end is not None and end <= begin:
        after = f"begin of {seconds(begin)}" if table.begin is not None else f"start of navigation at {seconds(begin)}"
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


def _of_list(times: Array, entry: Sequence[object], navigation: Navigation, key: str, context: FileContext) -> Array:
    """Return instants that are listed; those beyond the navigation are left out."""
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


def check_count(count: int, context: FileContext) -> None:
    """Add a mistake when all sensors together measure too often."""
    if count > MOST_MEASUREMENTS:
        context.problem("aiding", _too_many(count))


def _too_many(count: float) -> str:
    return f"{count:,.0f} measurements; at most {MOST_MEASUREMENTS:,} of all sensors together"
