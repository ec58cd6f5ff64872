"""Interval of a small probability from the weights of lines, and whether weights are too few to have one."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.estimates import Estimate

ROOTS: Final = 0.003
"""Relative error of the estimate by the tolerance of the crossings and by the few lines that set the interval.

With it 95 % intervals were measured to hold as `mcnav docs rare-events` says; without it they hold in 94 %.
"""

RELIABLE: Final = 0.7
"""Tail index of weights up to which their mean settles with thousands of them (Vehtari and others, 2024)."""

FEWEST, PRIOR = 5, 10
"""Weights from which a tail index is fitted, and weights that its prior is worth."""


def weights_interval(weights: Array, cells: IndexArray, confidence: float) -> tuple[float, float, float]:
    """Return the mean of weights, shape (n,), and the ends of its interval.

    Weights are ``n / n_j`` times those of the n_j lines of cell j, so that their mean is the sum of the means of cells.
    The interval is Student's, or Hall's where skewness widens it (`mcnav.statistics.estimates`), with the square of
    `ROOTS` added. The lower end is never closer to the estimate than the share of the lines' tails that one check for
    each line cannot see, one in their number.
    """
    estimate = stratified_mean(weights, cells)
    value = estimate.value
    if not value > 0.0:
        return 0.0, 0.0, 0.0
    low, high = estimate.interval(confidence)
    down, up = math.hypot(1.0 - low / value, ROOTS), math.hypot(high / value - 1.0, ROOTS)
    return value, value * max(0.0, 1.0 - max(down, 1.0 / len(weights))), value * (1.0 + up)


def stratified_mean(weights: Array, cells: IndexArray) -> Estimate:
    """Estimate a mean from strata, each of at least two draws.

    With d the deviations from the mean of each stratum, ``V_j = n_j / (n_j - 1) sum d^2 / n^2``; the squared standard
    error is their sum, with ``(sum V_j)^2 / sum (V_j^2 / (n_j - 1))`` degrees of freedom (Satterthwaite, 1946), and the
    asymmetry is ``sum d^3`` over ``(sum d^2)^(3/2)``. With one stratum it is `mcnav.statistics.estimates.blocked_mean`.
    """
    counts = np.bincount(cells)
    used = counts > 0
    deviations = weights - (np.bincount(cells, weights) / np.maximum(counts, 1))[cells]
    squares = np.bincount(cells, deviations**2)[used]
    freedom = counts[used] - 1.0
    variances = counts[used] / freedom * squares / len(weights) ** 2
    total = float(np.sum(variances))
    if not total > 0.0:
        return Estimate(float(np.mean(weights)), 0.0, float(np.sum(freedom)))
    degrees = total**2 / float(np.sum(variances**2 / freedom))
    asymmetry = float(np.sum(deviations**3) / np.sum(squares) ** 1.5)
    return Estimate(float(np.mean(weights)), float(np.sqrt(total)), degrees, asymmetry)


def tail_index(weights: Array) -> float:
    """Return the index k of the generalised Pareto distribution of the largest weights, shape (n,).

    Moments of weights exist up to the order 1 / k: beyond `RELIABLE` their mean does not settle, whatever their scatter
    is, since the heaviest were not drawn. It is fitted to the largest ``min(n / 5, 3 sqrt(n))`` by Zhang and Stephens
    (2009), with ten more at 1/2, as of Pareto-smoothed importance sampling (Vehtari and others, 2024). Infinite with
    fewer than `FEWEST`.
    """
    ordered = np.sort(weights)
    number = int(min(0.2 * len(ordered), 3.0 * math.sqrt(len(ordered))))
    if number < FEWEST:
        return math.inf
    excess = ordered[-number:] - ordered[-number - 1]
    candidates = 30 + int(math.sqrt(number))
    quartile = float(excess[max(int(0.25 * number + 0.5), 1) - 1])
    if not quartile > 0.0:
        return math.inf
    steps = 1.0 - np.sqrt(candidates / (np.arange(candidates) + 0.5))
    slopes = 1.0 / excess[-1] + steps / (3.0 * quartile)
    indices = np.mean(np.log1p(-slopes[:, None] * excess), axis=1)
    likelihoods = number * (np.log(-slopes / indices) - indices - 1.0)
    slope = float(special.softmax(likelihoods) @ slopes)
    index = float(np.mean(np.log1p(-slope * excess)))
    return (index * number + 0.5 * PRIOR) / (number + PRIOR)
