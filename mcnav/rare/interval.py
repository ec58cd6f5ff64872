"""Interval of a small probability from the weights of lines."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.statistics.estimates import blocked_mean

ROOTS: Final = 0.002
"""Relative error of the estimate by the tolerance of the crossings."""


def weights_interval(weights: Array, checks: int, confidence: float) -> tuple[float, float, float]:
    """Return the mean of weights, shape (n,), and the ends of its interval.

    The interval is Student's, or Hall's where skewness widens it (`mcnav.statistics.estimates`), of the relative error,
    on the scale of the logarithm below the estimate. The ends are widened, as root of the sum of squares, by the error of the crossings, and the lower
    one by the share of the lines' tails that so many checks beyond crossings cannot see, one in their number.
    """
    estimate = blocked_mean(weights, np.arange(len(weights)))
    value = estimate.value
    if not value > 0.0:
        return 0.0, 0.0, 0.0
    low, high = estimate.interval(confidence)
    down, up = 1.0 - low / value, high / value - 1.0
    unseen = 1.0 / checks if checks else 1.0
    down = math.sqrt(down**2 + ROOTS**2 + unseen**2)
    up = math.sqrt(up**2 + ROOTS**2)
    return value, value * max(0.0, 1.0 - down, 0.0), value * (1.0 + up)
