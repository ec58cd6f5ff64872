"""Values of a variable at which a limit is just met, found on linear answers rather than between those of a grid."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.analysis.curve_refinement import refine_curve
from mcnav.analysis.sweep import JustMet, Span, Variable
from mcnav.arrays.types import Array
from mcnav.errors import CampaignError, NumericalError
from mcnav.statistics.bisection import root_between

TOLERANCE: Final = 1e-6
"""Width of the last bracket: a share of the value on a logarithmic axis, of the range on a linear one."""


def find_crossings(
    variable: Variable, margins: Array, margin_at: Callable[[float], float], measure: int, fixed: float | None = None
) -> JustMet:
    """Find where a margin changes its sign, after values have been added where a change may hide.

    Parameters
    ----------
    margins : ndarray, shape (n,)
        At the variable's values; above zero where the limit is exceeded. One that is not finite is skipped.
    margin_at : callable
        Margin at any value; raises `CampaignError` for a value that the key cannot have.
    """
    curve = refine_curve(variable, margins, margin_at)
    signs = list(zip(curve.values.tolist(), curve.margins.tolist(), strict=True))
    values: list[float] = []
    spans: list[Span] = []
    begin: float | None = None
    inside = bool(signs) and signs[0][1] <= 0.0
    for (low, at_low), (high, at_high) in pairwise(signs):
        if (at_low <= 0.0) == (at_high <= 0.0):
            continue
        try:
            values.append(_root(variable, margin_at, (low, at_low), (high, at_high)))
        # a key of whole numbers, or no answer within: the last one that meets the limit
        except (CampaignError, NumericalError):
            values.append(low if at_low <= 0.0 else high)
        if inside:
            spans.append((begin, values[-1]))
        begin, inside = values[-1], not inside
    if inside:
        spans.append((begin, None))
    closest = min(signs, key=lambda sign: abs(sign[1]), default=None)
    return JustMet(measure, fixed, tuple(values), tuple(spans), len(signs), closest, curve.whole)


def words_that_meet(margins: Array, measure: int, fixed: float | None = None) -> JustMet:
    """Find which values that are no numbers meet a limit, by their margins, shape (n,)."""
    met = tuple((float(place), float(place)) for place in np.flatnonzero(margins <= 0.0))
    known = [(float(place), float(margins[place])) for place in np.flatnonzero(np.isfinite(margins))]
    closest = min(known, key=lambda each: abs(each[1]), default=None)
    whole: tuple[Span, ...] = ((None, None),)
    return JustMet(measure, fixed, (), whole if len(met) == len(margins) else met, len(margins), closest)


def _root(
    variable: Variable, margin_at: Callable[[float], float], low: tuple[float, float], high: tuple[float, float]
) -> float:
    width = TOLERANCE if variable.log else TOLERANCE * float(np.ptp(variable.values))
    low, high = (variable.along(low[0]), low[1]), (variable.along(high[0]), high[1])
    begin, end = root_between(lambda place: margin_at(variable.at(place)), low, high, width)
    return variable.at(0.5 * (begin + end))
