"""Bounds of a quantile from order statistics: exact for every continuous distribution and sample size.

The number of n independent samples below the quantile x_q is binomial (n, q), so that the k-th smallest of them lies at
or above x_q with probability ``P(Bin(n, q) <= k - 1)`` (Wilks, 1941; David and Nagaraja, *Order Statistics*, 2003,
section 7.1). Ranks count from one.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from scipy import special

from mcnav.arrays.types import Array


def upper_rank(count: int, quantile: float, confidence: float) -> int | None:
    """Return the rank of the smallest order statistic that bounds a quantile from above; none with too few samples.

    >>> upper_rank(229, 0.99, 0.90), upper_rank(230, 0.99, 0.90), upper_rank(10_000, 0.99, 0.90)
    (None, 230, 9914)
    """
    for name, value in (("quantile", quantile), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise ValueError(f"{name} must lie between 0 and 1; got {value!r}")
    below = bisect_left(range(count), confidence, key=lambda number: float(special.bdtr(number, count, quantile)))
    return below + 1 if below < count else None


def lower_rank(count: int, quantile: float, confidence: float) -> int | None:
    """Return the rank of the largest order statistic that bounds a quantile from below; none with too few samples.

    The mirror image of `upper_rank`: the k-th smallest is the (n + 1 - k)-th largest.
    """
    rank = upper_rank(count, 1.0 - quantile, confidence)
    return None if rank is None else count + 1 - rank


@dataclass(frozen=True)
class RankedSizes:
    """Sizes, which are not negative, of the successful samples in rising order, and the number of failed ones."""

    values: Array
    failed: int

    @classmethod
    def of(cls, sizes: Array) -> RankedSizes:
        """Rank sizes that are NaN where a sample failed."""
        ranked = np.sort(sizes)  # which puts them last
        successful = len(ranked) - int(np.count_nonzero(np.isnan(ranked)))
        return cls(ranked[:successful], len(ranked) - successful)

    def estimate(self, quantile: float) -> float:
        """Interpolate between the two sizes next to a quantile."""
        if not len(self.values):
            return math.nan
        place = (len(self.values) - 1) * quantile
        below = int(place)
        return float(np.quantile(self.values[below : below + 2], place - below))

    def bounds(self, quantile: float, confidence: float) -> tuple[float, float]:
        """Bound a quantile from below and from above, each with the confidence.

        Failed samples count as smallest below, and as largest above; with too few samples the bounds are zero and
        infinity.
        """
        count = len(self.values) + self.failed
        low, high = lower_rank(count, quantile, confidence), upper_rank(count, quantile, confidence)
        lower = 0.0 if low is None or low <= self.failed else float(self.values[low - self.failed - 1])
        return lower, math.inf if high is None or high > len(self.values) else float(self.values[high - 1])
