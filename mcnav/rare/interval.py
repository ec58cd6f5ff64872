"""Interval of a small probability from the weights of lines."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.statistics.estimates import blocked_mean

ROOTS: Final = 0.002
"""Relative error of the estimate by the tolerance of the crossings."""


def weights_interval(weights: Array, checks: int, confidence: float) -> tuple[float, float, float]:
    """Return the mean of weights, shape (n,), and the ends of its interval.

    The interval is Student's, or Hall's where skewness widens it (`mcnav.statistics.estimates`). Neither end is closer
    to the estimate than the error of the crossings, nor the lower one than the share of the lines' tails that so many
    checks beyond crossings cannot see, one in their number.
    """
    estimate = blocked_mean(weights, np.arange(len(weights)))
    value = estimate.value
    if not value > 0.0:
        return 0.0, 0.0, 0.0
    low, high = estimate.interval(confidence)
    unseen = 1.0 / checks if checks else 1.0
    return value, min(low, value * (1.0 - max(ROOTS, unseen))), max(high, value * (1.0 + ROOTS))
