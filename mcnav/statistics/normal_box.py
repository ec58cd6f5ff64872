"""Probabilities that normal variables lie within ``+-limits``, and beyond, however small.

Up to three variables are taken in turn: with the first one within its limits, those that follow are beyond theirs with
a probability that depends on it,

    P = P(|y_1| > l_1) + integral over |y_1| <= l_1 of p(y_1) P(others beyond | y_1) dy_1

All terms are positive. Where variables nearly determine each other the integrand steps; the intervals of the quadrature
begin at the steps, so that it may even jump.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.errors import NumericalError
from mcnav.statistics.adaptive_quadrature import integrals

REACH: Final = 14.0
"""Sigmas at which integrals end."""

STEPS: Final = (-6.0, 0.0, 6.0)
"""Sigmas of a step at which intervals begin."""

MOST: Final = 3
"""Variables that are taken in turn, at most."""

SINGULAR: Final = 1e-14
"""Conditional variance over a variable's own that is rounding: the others determine it."""

TINY: Final = 1e-150
"""Sigma of a variable that is determined: its normal distribution is a step."""

ACCURACY: Final = 1e-7
"""Absolute error of the probability of more than three variables, by quasi-Monte Carlo."""

ROUGH: Final = 1e-5
"""Departure of that probability from its bounds above which it is refused."""


def probability_beyond_box(mean: Array, covariance: Array, limits: Array) -> float:
    """Compute the probability that at least one of up to three normal variables lies beyond ``+-limits``.

    NaN for more of them. The covariance may be singular.

    >>> round(probability_beyond_box(np.zeros(2), np.eye(2), np.full(2, 5.0)) * 1e6, 5)
    1.14661
    """
    chosen = np.diag(covariance) > 0.0
    if np.any(np.abs(mean[~chosen]) >= limits[~chosen]):
        return 1.0
    sigma = np.sqrt(np.diag(covariance)[chosen])
    if len(sigma) > MOST:
        return math.nan
    if not len(sigma):
        return 0.0
    correlation = covariance[np.ix_(chosen, chosen)] / np.outer(sigma, sigma)
    centre, limit = mean[chosen] / sigma, limits[chosen] / sigma
    if not (np.isfinite(correlation).all() and np.isfinite(centre).all()):
        return math.nan
    return float(_beyond(centre[None], limit, _factor(correlation))[0])


def normal_box_probability(mean: Array, covariance: Array, limits: Array) -> float:
    """Compute the probability that a normal vector lies within ``+-limits``; its covariance may be singular.

    >>> round(normal_box_probability(np.zeros(2), np.diag([1.0, 0.0]), np.array([1.0, 1.0])), 4)
    0.6827
    """
    varies = np.diag(covariance) > 0.0
    if np.count_nonzero(varies) <= MOST:
        return max(1.0 - probability_beyond_box(mean, covariance, limits), 0.0)
    if np.any(np.abs(mean[~varies]) >= limits[~varies]):
        return 0.0
    from scipy.stats import multivariate_normal  # slow to import: half a second

    sigma = np.sqrt(np.diag(covariance)[varies])
    correlation = covariance[np.ix_(varies, varies)] / np.outer(sigma, sigma)
    centre, half = mean[varies] / sigma, limits[varies] / sigma
    normal = multivariate_normal(centre, correlation, allow_singular=True, seed=1, abseps=ACCURACY, releps=ACCURACY)
    value = float(normal.cdf(half, lower_limit=-half))
    most = 1.0 - probability_beyond_box(centre[:MOST], correlation[:MOST, :MOST], half[:MOST])
    least = most - float(np.sum(special.ndtr(centre[MOST:] - half[MOST:]) + special.ndtr(-half[MOST:] - centre[MOST:])))
    if not least - ROUGH <= value <= most + ROUGH:
        raise NumericalError(f"the probability of a box of {len(centre)} outputs, {value:g}, is not between {least:g} "
                             f"and {most:g}, as those of fewer outputs require")  # fmt: skip
    return min(max(value, 0.0), 1.0)


def _factor(correlation: Array) -> Array:
    """Return a lower triangle L of a correlation matrix L L^T, with zeros below a variable that is determined.

    Raises `NumericalError` for a matrix that is no correlation.
    """
    factor = np.zeros_like(correlation)
    for row in range(len(correlation)):
        remaining = correlation[row:, row] - factor[row:, :row] @ factor[row, :row]
        if remaining[0] > SINGULAR:
            factor[row:, row] = remaining / math.sqrt(remaining[0])
    if np.abs(factor @ factor.T - correlation).max() > math.sqrt(SINGULAR):
        raise NumericalError(f"correlations {correlation.tolist()} are of no normal variables")
    return factor


def _beyond(centres: Array, limits: Array, factor: Array) -> Array:
    """Return the probability of one variable or more beyond its limits, for means of shape (m, n); shape (m,)."""
    scale = max(float(factor[0, 0]), TINY)
    low, high = (-limits[0] - centres[:, 0]) / scale, (limits[0] - centres[:, 0]) / scale
    tails = special.ndtr(low) + special.ndtr(-high)
    if centres.shape[1] == 1:
        return np.asarray(tails)

    def density(numbers: IndexArray, z: Array) -> Array:
        shifted = centres[numbers, None, 1:] + z[..., None] * factor[1:, 0]
        following = _beyond(shifted.reshape(-1, shifted.shape[-1]), limits[1:], factor[1:, 1:])
        return np.asarray(following.reshape(z.shape) * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi))

    begin, end = np.clip(low, -REACH, REACH), np.clip(high, -REACH, REACH)
    places = _steps(centres[:, 1:], limits[1:], factor[1:])
    inner = np.clip(places, begin[:, None], np.maximum(begin, end)[:, None])
    breaks = np.sort(np.concatenate([begin[:, None], inner, np.maximum(begin, end)[:, None]], axis=1), axis=1)
    return np.asarray(tails + integrals(density, breaks))


def _steps(centres: Array, limits: Array, factor: Array) -> Array:
    """Return where the variables that follow pass their limits, in the sigmas of the one before them; shape (m, k).

    Where two follow, also where their limits meet on the line on which they nearly lie.
    """
    slopes, rows = factor[:, 0], np.arange(len(limits))
    edges = [centres * 0.0]
    for row in rows[slopes != 0.0]:
        spread = float(np.linalg.norm(factor[row, 1:]))
        for side in (-1.0, 1.0):
            passed = side * limits[row] - centres[:, row : row + 1]
            edges.extend((passed + steps * spread) / slopes[row] for steps in STEPS)
    if len(limits) == 2 and factor[0, 1] > 0.0:
        along = factor[1, 1] / factor[0, 1]
        slope = slopes[1] - along * slopes[0]
        if slope != 0.0:
            for first, second in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)):
                apart = second * limits[1] - centres[:, 1] - along * (first * limits[0] - centres[:, 0])
                edges.append(apart[:, None] / slope)
    return np.nan_to_num(np.concatenate(edges, axis=1))
