"""Time stamps of a record: in seconds from the first, rising, with what was noticed of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.files.lines import place_of_row
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import Values
from mcnav.physics.units import UnitError, conversion

FACTORS: Final = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""Units per second of stamps that are integers."""

WEEK: Final = 604_800.0
"""Seconds of a week, in which GPS seconds begin anew."""

GPS_EPOCH: Final = 315_964_800
"""1980-01-06, in s since 1970 without leap seconds."""

GAP: Final = 1.5
"""Steps above this many intervals are gaps."""

ROUNDED: Final = 1e-4
"""Share of the interval by which a rounded one may be off at the end of the record."""

MOST_DECIMALS: Final = 18
"""Decimals of seconds that are kept: more overflow where all stamps are zero."""

VARYING: Final = 0.01
"""Share of the interval by which nine steps of ten may vary before it is said."""


@dataclass(frozen=True)
class Stamps:
    """Time stamps in seconds.

    Attributes
    ----------
    time : ndarray, shape (n,)
        From the first, s.
    start : float
        The first, as it is recorded, s.
    """

    time: Array
    start: float


def rows(count: int) -> str:
    """Write a number of rows.

    >>> rows(1), rows(2000)
    ('1 row', '2,000 rows')
    """
    return f"{count:,} row{'' if count == 1 else 's'}"


def seconds_of(path: Path, values: Values, unit: str, name: str) -> Stamps:
    """Convert stamps to seconds from the first; integers lose no digit.

    Raises `LogError` where they are no numbers, one is missing, or the unit is none of time.
    """
    if values.dtype == object:
        message = f"got {str(values[0])[:40]!r}; expected times in s or dates"
        raise LogError(path, message, f"{place_of_row(path, 0)}, {name}")
    if len(values) and values.dtype.kind == "f":
        _refuse_missing(path, values, name)
    if values.dtype.kind in "iu" and unit in FACTORS:
        whole = values.astype(np.int64)
        first = int(whole[0])
        return Stamps((whole - first) / FACTORS[unit], first / FACTORS[unit])
    try:
        factor = conversion(unit, "s")
    except UnitError as wrong:
        raise LogError(path, str(wrong), f"units.{name}") from None
    numbers = values.astype(float) * factor
    # the rounding of large stamps is no jitter: 2.4e-7 s of those since 1970
    rounding = 2.0 * np.spacing(np.max(np.abs(numbers))) if len(numbers) else 1.0
    decimals = int(np.floor(-np.log10(rounding)))
    return Stamps(np.round(numbers - numbers[0], min(max(decimals, 0), MOST_DECIMALS)), float(numbers[0]))


def _refuse_missing(path: Path, values: Values, name: str) -> None:
    missing = np.flatnonzero(~np.isfinite(values))
    if len(missing):
        more = f" ({rows(len(missing))} like it)" if len(missing) > 1 else ""
        raise LogError(path, f"has no time{more}; leave the row out", f"{place_of_row(path, missing[0])}, {name}")


def unwrapped(stamps: Stamps) -> tuple[Stamps, tuple[str, ...]]:
    """Continue seconds of the week over its end, with a note."""
    steps = np.diff(stamps.time)
    ends = np.flatnonzero((steps < 0.0) & (np.abs(steps + WEEK) < WEEK / 100.0))
    if not len(ends) or np.any(np.delete(steps, ends) < 0.0):
        return stamps, ()
    carried = np.zeros(len(stamps.time))
    carried[ends + 1] = WEEK
    time = stamps.time + np.cumsum(carried)
    return Stamps(time, stamps.start), (f"the week of GPS time ends after {time[ends[0]]:.9g} s, where seconds go on",)


def refuse_falling(path: Path, time: Array, name: str, remedy: str) -> None:
    """Raise `LogError` where a time falls."""
    falls = np.flatnonzero(np.diff(time) < 0.0)
    if len(falls):
        row = int(falls[0])
        more = f"; {len(falls):,} do" if len(falls) > 1 else ""
        raise LogError(
            path, f"got {time[row + 1]:.9g} s from the start after {time[row]:.9g} s{more}; times must rise{remedy}",
            f"{place_of_row(path, row + 1)}, {name}",
        )  # fmt: skip


def repeated(path: Path, time: Array, same: NDArray[np.bool_], name: str, remedy: str) -> NDArray[np.bool_]:
    """Select rows whose time repeats that of the row before, and which are the same as that one.

    Raises `LogError` where a time repeats with other values.

    Parameters
    ----------
    same : ndarray of bool, shape (n - 1,)
        Whether a row has the values of the row before.
    """
    again = np.diff(time) == 0.0
    other = np.flatnonzero(again & ~same)
    if len(other):
        raise LogError(
            path, f"repeats the time of the row before, {time[other[0]]:.9g} s from the start, with other values "
            f"({rows(len(other))} of {len(time):,}); keep one row a time{remedy}",
            f"{place_of_row(path, other[0] + 1)}, {name}",
        )  # fmt: skip
    return np.concatenate([[False], again])


def interval_of(path: Path, time: Array, name: str) -> float:
    """Return the nominal interval, s: the mean of the steps that are no gaps, rounded where stamps are."""
    if len(time) < 2:
        raise LogError(path, f"has {rows(len(time))}; expected at least two", name)
    steps = np.diff(time)
    kept = steps[steps <= GAP * np.median(steps)]
    mean = float(np.mean(kept))
    rounded = float(f"{mean:.6g}")
    return rounded if abs(rounded - mean) * len(time) < ROUNDED * mean else mean


def notes_of_steps(time: Array, interval: float) -> tuple[str, ...]:
    """Say what gaps there are, and how steps vary."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * interval)
    notes: list[str] = []
    if len(gaps):
        longest = gaps[np.argmax(steps[gaps])]
        missing = int(np.sum(np.round(steps[gaps] / interval) - 1.0))
        many = "a gap" if len(gaps) == 1 else f"{len(gaps):,} gaps, the longest"
        notes.append(f"{many} of {steps[longest]:.4g} s after {time[longest]:.9g} s; {rows(missing)} missing")
    kept = np.delete(steps, gaps)
    low, high = np.quantile(kept, [0.05, 0.95]) if len(kept) else (interval, interval)
    if high - low > 2.0 * VARYING * interval:
        notes.append(f"steps vary: nine of ten are from {low:.4g} to {high:.4g} s, the median is {interval:.4g} s")
    return tuple(notes)
