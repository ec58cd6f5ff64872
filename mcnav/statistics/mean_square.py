"""Intervals of mean squares, such as mean NEES and NIS, at many epochs at once.

The sum of n squares of d independent normal components, all of one variance, over that variance is chi-square with n d
degrees of freedom. Where the components differ, or are not normal, the mean varies more, and has the degrees of freedom
of the chi-square variable with its relative standard error s::

    N = min(n d, 2 / s²)                                  (Satterthwaite, Biometrics Bulletin 2, 1946, 110)

with s enlarged by the ratio of Student's quantile to the normal one, because it is estimated.

Of matched components, 95 % intervals were measured to cover 95 to 97 % with 20 samples or more. Of three components of
variances 4, 1 and 1 they cover 94 % with 20 samples, of variances 16, 1 and 1 they cover 92 % with 20, 94 % with 50.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array

FEWEST: Final = 20
"""Smallest number of independent samples for an interval."""


def mean_square_intervals(mean: Array, standard_error: Array, count: Array, freedom: Array, confidence: float) -> Array:
    """Return two-sided intervals, shape (..., 2), of the expected values of means of squares.

    Parameters
    ----------
    mean, standard_error : ndarray
        Estimates from the samples; an interval without a finite standard error is (0, inf).
    count : ndarray
        Independent samples.
    freedom : ndarray
        Degrees of freedom of the sum of matched components.

    >>> matched = mean_square_intervals(np.array([4.0]), np.array([0.0]), np.array([1000]), np.array([4000]), 0.95)
    >>> matched.round(3).tolist()
    [[3.83, 4.181]]
    """
    mean, count, freedom = np.broadcast_arrays(mean, count, freedom)
    known = np.isfinite(mean) & np.isfinite(standard_error) & (count >= FEWEST)
    tail = 0.5 - 0.5 * confidence
    several = np.where(known, count, FEWEST)
    enlarged = special.stdtrit(several - 1.0, 1.0 - tail) / special.ndtri(1.0 - tail)
    relative = np.where(known & (mean > 0.0), standard_error, 0.0) / np.where(mean > 0.0, mean, 1.0) * enlarged
    degrees = np.minimum(freedom, 2.0 / np.maximum(relative, np.sqrt(2.0 / np.maximum(freedom, 1.0))) ** 2)
    degrees = np.where(known, np.maximum(degrees, 1e-300), 1.0)
    low, high = mean * degrees / special.chdtri(degrees, tail), mean * degrees / special.chdtri(degrees, 1.0 - tail)
    return np.stack([np.where(known, low, 0.0), np.where(known, high, np.inf)], axis=-1)


def mean_square_bounds(expected: float, freedom: Array, confidence: float) -> Array:
    """Return where means of squares of matched components lie, shape (..., 2), by the degrees of freedom of their sums.

    >>> mean_square_bounds(15.0, np.array(1500.0), 0.95).round(4).tolist()
    [13.9456, 16.0923]
    """
    tail = 0.5 - 0.5 * confidence
    some = np.maximum(freedom, 1.0)
    bounds = np.stack([special.chdtri(some, 1.0 - tail), special.chdtri(some, tail)], axis=-1)
    return np.asarray(np.where(np.asarray(freedom)[..., None] > 0.0, expected * bounds / some[..., None], np.nan))


def share_intervals(share: Array, count: Array, confidence: float) -> Array:
    """Return exact two-sided intervals, shape (..., 2), of probabilities from shares of samples (Clopper and Pearson).

    The number of samples may be that of independent ones only, and need not be whole.
    """
    known = np.isfinite(share) & (count > 0)
    trials = np.where(known, count, 1.0)
    hits = np.where(known, share, 0.0) * trials
    tail, missed = 0.5 - 0.5 * confidence, trials - hits
    low = np.where(hits > 0.0, special.betaincinv(np.maximum(hits, 1e-9), missed + 1.0, tail), 0.0)
    high = np.where(missed > 0.0, special.betaincinv(hits + 1.0, np.maximum(missed, 1e-9), 1.0 - tail), 1.0)
    return np.stack([np.where(known, low, 0.0), np.where(known, high, 1.0)], axis=-1)


def share_bounds(probability: float, count: float, confidence: float) -> tuple[float, float]:
    """Return the shares between which so many independent samples lie with a confidence, or more.

    >>> share_bounds(0.5, 10, 0.95)
    (0.2, 0.8)
    """
    if count < 1.0:
        return 0.0, 1.0
    trials, tail = int(count), 0.5 - 0.5 * confidence

    def below(hits: int) -> float:
        return float(special.bdtr(hits, trials, probability))

    low = bisect_right(range(trials + 1), tail, key=below)
    high = bisect_left(range(trials + 1), 1.0 - tail, key=below)
    return low / trials, min(high, trials) / trials
