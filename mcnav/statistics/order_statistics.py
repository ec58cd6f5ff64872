"""Bounds of a quantile from order statistics: exact for every continuous distribution and sample size.

The number of n independent samples below the quantile x_q is binomial (n, q), so that the k-th smallest of them lies at
or above x_q with probability ``P(Bin(n, q) <= k - 1)`` (Wilks, 1941; David and Nagaraja, *Order Statistics*, 2003,
section 7.1). Ranks count from one.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from mcnav._types import Array


def samples_for_upper_bound(quantile: float, confidence: float, exceedances: int = 0) -> int:
    """Return the smallest sample size whose largest sample but ``exceedances`` bounds a quantile from above.

    Examples
    --------
    >>> [samples_for_upper_bound(q, 0.90) for q in (0.99, 0.9973, 0.99865)], samples_for_upper_bound(0.95, 0.95)
    ([230, 852, 1705], 59)
    """
    _check(quantile, confidence)
    low = exceedances
    high = max(1, math.ceil(math.log1p(-confidence) / math.log(quantile)))
    while special.bdtrc(exceedances, high, 1.0 - quantile) < confidence:
        low, high = high, 2 * high
    while high - low > 1:  # the probability of more exceedances rises with the sample size
        middle = (low + high) // 2
        if special.bdtrc(exceedances, middle, 1.0 - quantile) >= confidence:
            high = middle
        else:
            low = middle
    return high


def upper_rank(count: int, quantile: float, confidence: float) -> int | None:
    """Return the rank of the smallest order statistic that bounds a quantile from above; none with too few samples.

    >>> upper_rank(229, 0.99, 0.90), upper_rank(230, 0.99, 0.90), upper_rank(10_000, 0.99, 0.90)
    (None, 230, 9914)
    """
    _check(quantile, confidence)
    if count < 1 or special.bdtr(count - 1, count, quantile) < confidence:
        return None
    low, high = 0, count
    while high - low > 1:
        middle = (low + high) // 2
        if special.bdtr(middle - 1, count, quantile) >= confidence:
            high = middle
        else:
            low = middle
    return high


def lower_rank(count: int, quantile: float, confidence: float) -> int | None:
    """Return the rank of the largest order statistic that bounds a quantile from below; none with too few samples.

    The mirror image of `upper_rank`: the k-th smallest is the (n + 1 - k)-th largest.
    """
    rank = upper_rank(count, 1.0 - quantile, confidence)
    return None if rank is None else count + 1 - rank


def upper_bound(values: Array, quantile: float, confidence: float) -> float:
    """Bound a quantile of independent samples, shape (n,), from above; infinite with too few samples."""
    rank = upper_rank(len(values), quantile, confidence)
    return float("inf") if rank is None else float(np.partition(values, rank - 1)[rank - 1])


def lower_bound(values: Array, quantile: float, confidence: float) -> float:
    """Bound a quantile from below, as `upper_bound`; minus infinity with too few samples."""
    rank = lower_rank(len(values), quantile, confidence)
    return float("-inf") if rank is None else float(np.partition(values, rank - 1)[rank - 1])


def _check(quantile: float, confidence: float) -> None:
    for name, value in (("quantile", quantile), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise ValueError(f"{name} must lie between 0 and 1; got {value!r}")
