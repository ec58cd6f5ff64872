"""Values added to those of a sweep until no crossing of a limit can hide between neighbouring ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, isnan, log
from typing import Final

import numpy as np

from mcnav.analysis.sweep import Variable
from mcnav.arrays.types import Array
from mcnav.errors import CampaignError

WIDEST: Final = log(2.0)
"""Widest distance of neighbouring values on a logarithmic axis: a factor of two."""

FEWEST: Final = 16
"""Intervals, at least, into which a linear axis is divided."""

BEND: Final = 1e-3
"""Departure of a margin, a logarithm, from the straight line between neighbouring values that is not followed up."""

CAUTION: Final = 2.0
"""Departures from the straight line that must fit between a curve and its limit, or the interval is divided."""

MOST_ADDED: Final = 400
"""Values added to a curve."""


@dataclass(frozen=True)
class Curve:
    """Margins at values along a variable.

    Attributes
    ----------
    values, margins : ndarray, shape (n,)
        Rising values, given and added; a margin is above zero where the limit is exceeded.
    whole : bool
        Whether no crossing can hide between neighbours: the curve's bend is below `BEND`, or fits `CAUTION` times
        between the curve and its limit. False where `MOST_ADDED` did not suffice, or a value in between has no answer.
    """

    values: Array
    margins: Array
    whole: bool


def refine_curve(variable: Variable, margins: Array, margin_at: Callable[[float], float]) -> Curve:
    """Add values between those of a variable, by halving of intervals.

    An interval is halved if it is wide (`WIDEST`, `FEWEST`), or if its ends are on one side of the limit and the curve
    may reach the other side in between: it departs from the straight line by up to ``h^2 |f''| / 8``, with the second
    derivative taken from the divided differences of neighbouring values.

    Parameters
    ----------
    margins : ndarray, shape (n,)
        At the variable's values. One that is NaN is skipped.
    margin_at : callable
        Margin at any value; raises `CampaignError` for a value that the key cannot have.
    """
    known = {
        variable.along(float(value)): float(margin)
        for value, margin in zip(variable.values, margins, strict=True)
        if not isnan(margin)
    }
    widest = WIDEST if variable.log else float(np.ptp(variable.values)) / FEWEST
    closed: set[tuple[float, float]] = set()
    given = {variable.along(float(value)): float(value) for value in variable.values}
    added = 0
    while True:
        waiting = [
            open_interval
            for open_interval in _open_intervals(known, widest * (1.0 + 1e-9))
            if open_interval not in closed
        ]
        if not waiting or added >= MOST_ADDED:
            break
        for low, high in waiting[: MOST_ADDED - added]:
            middle = 0.5 * (low + high)
            margin = np.nan
            if low < middle < high:
                try:
                    margin = margin_at(variable.at(middle))
                except CampaignError:
                    margin = np.nan
            added += 1
            if isnan(margin):
                closed.add((low, high))
            else:
                known[middle] = margin
    places = sorted(known)
    values = np.array([given.get(place, variable.at(place)) for place in places])
    return Curve(values, np.array([known[place] for place in places]), not waiting and not closed)


def _open_intervals(known: dict[float, float], widest: float) -> list[tuple[float, float]]:
    """List the intervals that are too wide, or in which two crossings may hide."""
    places = sorted(known)
    second = dict.fromkeys(places, 0.0)
    for left, place, right in zip(places, places[1:], places[2:], strict=False):
        slopes = (known[place] - known[left]) / (place - left), (known[right] - known[place]) / (right - place)
        curvature = 2.0 * abs(slopes[1] - slopes[0]) / (right - left)
        second[place] = curvature if isfinite(curvature) else 0.0  # beside a value of zero, whose margin is infinite
    intervals = []
    for low, high in pairwise(places):
        bend = max(0.125 * (high - low) ** 2 * second[each] for each in (low, high))
        near = min(abs(known[low]), abs(known[high]))
        hides = (known[low] <= 0.0) == (known[high] <= 0.0) and bend > BEND and near < CAUTION * bend
        if high - low > widest or hides:
            intervals.append((low, high))
    return intervals
