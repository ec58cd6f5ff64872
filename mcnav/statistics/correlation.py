"""Interval of a correlation coefficient, on Fisher's scale with an error that supposes no distribution."""

from __future__ import annotations

import math
from typing import Final

from mcnav.statistics.estimates import Estimate

ROUNDING: Final = 1e-12
"""Departure of a correlation from one, or from another, that is rounding."""


def fisher_interval(correlation: Estimate, confidence: float) -> tuple[float, float]:
    """Return the two-sided interval of a correlation.

    With r the estimate, whose standard error s is that of its influence function (of normal samples
    ``(1 - r^2) / sqrt(n)``; of others it has their fourth moments), and q the quantile of Student's t, widened where
    the influence is skewed as in `mcnav.statistics.estimates`,

        tanh(artanh r - q s / (1 - r^2))  to  tanh(artanh r + q s / (1 - r^2)),

    a scale on which the error of normal samples does not depend on r (Fisher, 1921). At a level of 5 % it was measured
    to miss correlations of 0, 0.9 and -0.99, within 0.3 %, in 4.4 to 5.6 % of campaigns with 100 to 1,000 normal
    samples and, with Student's t of five degrees of freedom, in 7.8 % with 100, 6.8 % with 200 and 5.6 % with 1,000, at
    most.
    """
    value = correlation.value
    spare = 1.0 - value * value
    if spare < ROUNDING:
        ends = math.copysign(1.0, value), value
        return min(ends), max(ends)
    low, high = correlation.reach_of_skewness(confidence)
    half = correlation.half_width(confidence)
    if not math.isfinite(half):
        return -1.0, 1.0
    centre = math.atanh(value)
    return math.tanh(centre - max(half, low) / spare), math.tanh(centre + max(half, high) / spare)
