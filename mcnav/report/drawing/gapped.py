"""Quantities that are not known at every epoch: their curves, areas and upward axes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.report.drawing.marks import Axis, Band, Line, Mark, Points, Series
from mcnav.report.drawing.ticks import limits

WIDE: Final = 8.0
"""Largest over smallest value from which on an axis is logarithmic."""

USUAL: Final = 1.5
"""Largest distance of neighbouring epochs of a curve, over the median one."""


def upward(label: str, unit: str, reach: Array) -> Axis:
    """Return the upward axis of values that are not negative: logarithmic where they differ much."""
    positive = reach[np.isfinite(reach) & (reach > 0.0)]
    log = bool(positive.size and positive.max() > WIDE * positive.min())
    low, high = ends_around(reach, log)
    return Axis(label, unit, log, low, high)


def ends_around(reach: Array, log: bool) -> tuple[float, float]:
    """Return the ends of an axis around values that are not negative."""
    low, high = limits(reach, log, 0.06)
    return max(low, 0.0), high


def curve(series: Series, times: Array, values: Array) -> list[Mark]:
    """Return a curve, and points where a value has no neighbour to be joined to."""
    known = np.isfinite(values)
    beside = np.append(False, known[:-1]) | np.append(known[1:], False)
    alone = known & ~beside
    marks: list[Mark] = [Line(series, times, values, 1.7)]
    return [*marks, Points(series.of_kind("dot"), times[alone], values[alone], 4.0)] if alone.any() else marks


def known_ends(ends: Array) -> NDArray[np.bool_]:
    """Return whether both ends of each interval are known."""
    return np.asarray(np.isfinite(ends).all(axis=1))


def _runs(known: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of consecutive true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def areas(series: Series, times: Array, ends: Array, opacity: float = 1.0) -> list[Mark]:
    """Return the areas between the ends of intervals, with gaps where there are none."""
    return [Band(series, times[run], ends[run, 0], ends[run, 1], opacity) for run in _runs(known_ends(ends))]


def steps(series: Series, times: Array, ends: Array, part: IndexArray) -> Mark:
    """Return the area between the ends of intervals at some epochs, each since the one before."""
    begins = np.append(times[max(part[0] - 1, 0)], times[part[:-1]])
    across = np.column_stack([begins, times[part]]).ravel()
    return Band(series, across, np.repeat(ends[part, 0], 2), np.repeat(ends[part, 1], 2))


def stretches(times: Array, known: NDArray[np.bool_]) -> list[IndexArray]:
    """Split the epochs at which something is known where the next one is later than usual.

    A sensor with fewer updates than there are epochs is not known at each.
    """
    places = np.flatnonzero(known)
    gaps = np.diff(times[places])
    usual = float(np.median(gaps)) if gaps.size else 0.0
    return [piece for piece in np.split(places, np.flatnonzero(gaps > USUAL * usual) + 1) if piece.size]
