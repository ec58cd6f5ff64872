"""Small probabilities that normal variables lie beyond limits, without the cancellation of one minus a large one.

Variables are taken in turn: with the first one within its limits, those that follow are beyond theirs with a
probability that depends on it,

    P = P(|y_1| > l_1) + integral over |y_1| <= l_1 of p(y_1) P(others beyond | y_1) dy_1

by Gauss and Legendre's rule. All terms are positive.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array

NODES: Final = 240
"""Number of nodes of the rule, within `REACH` sigmas."""

REACH: Final = 14.0
MOST: Final = 3
"""Variables that are taken in turn, at most."""

SINGULAR: Final = 1e-6
"""Conditional sigma over a variable's own below which the rule's nodes do not resolve a step."""


def probability_beyond_box(mean: Array, covariance: Array, limits: Array) -> float:
    """Compute the probability that at least one of up to three normal variables lies beyond ``+-limits``.

    NaN for more of them, and for those that determine each other.

    >>> round(probability_beyond_box(np.zeros(2), np.eye(2), np.full(2, 5.0)) * 1e6, 5)
    1.14661
    """
    chosen = np.diag(covariance) > 0.0
    if np.any(np.abs(mean[~chosen]) > limits[~chosen]):
        return 1.0
    mean, covariance, limits = mean[chosen], covariance[np.ix_(chosen, chosen)], limits[chosen]
    if not len(mean):
        return 0.0
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    if len(mean) > MOST or np.linalg.eigvalsh(correlation)[0] < SINGULAR**2:
        return math.nan
    # y = mean + L z, z taken in turn
    factor = np.linalg.cholesky(covariance)

    def beyond(row: int, shift: Array) -> Array:
        """Return the probability of the variables from one on, of given shifts of their means, shape (..., n)."""
        centre, scale = mean[row] + shift[..., row], factor[row, row]
        tails = special.ndtr((-limits[row] - centre) / scale) + special.ndtr((centre - limits[row]) / scale)
        if row + 1 == len(mean):
            return np.asarray(tails)
        z, weights = _nodes((-limits[row] - centre) / scale, (limits[row] - centre) / scale)
        following = beyond(row + 1, shift[..., None, :] + z[..., None] * factor[:, row])
        return np.asarray(tails + np.sum(weights * following, axis=-1))

    return float(beyond(0, np.zeros(len(mean))))


def probability_beyond_distance(mean: Array, covariance: Array, distance: float) -> float:
    """Compute the probability that up to three normal variables lie farther from zero than a distance.

    NaN for more of them.

    >>> round(probability_beyond_distance(np.zeros(2), np.eye(2), 5.0) * 1e6, 5)
    3.72665
    """
    if len(mean) > MOST:
        return math.nan
    variances, axes = np.linalg.eigh(covariance)
    centres, scales = axes.T @ mean, np.sqrt(np.maximum(variances, 0.0))
    fixed = scales <= SINGULAR * max(float(scales.max(initial=0.0)), 1e-300)
    rest = distance**2 - float(np.sum(centres[fixed] ** 2))
    if rest < 0.0:
        return 1.0
    centres, scales = centres[~fixed][::-1], scales[~fixed][::-1]
    if not len(centres):
        return 0.0

    def beyond(axis: int, square: Array) -> Array:
        """Return the probability of the axes from one on to lie beyond the root of squares, shape (...)."""
        limit, centre, scale = np.sqrt(square), centres[axis], scales[axis]
        low, high = (-limit - centre) / scale, (limit - centre) / scale
        tails = special.ndtr(low) + special.ndtr(-high)
        if axis + 1 == len(centres):
            return np.asarray(tails)
        z, weights = _nodes(low, high)
        left = np.maximum(square[..., None] - (centre + scale * z) ** 2, 0.0)
        return np.asarray(tails + np.sum(weights * beyond(axis + 1, left), axis=-1))

    return float(beyond(0, np.asarray(rest)))


def _nodes(low: Array, high: Array) -> tuple[Array, Array]:
    """Return nodes between two ends, shape (..., n), and their weights times the normal density."""
    low, high = np.maximum(low, -REACH), np.minimum(high, REACH)
    nodes, weights = _rule()
    half = np.maximum(0.5 * (high - low), 0.0)[..., None]
    z = 0.5 * (high + low)[..., None] + half * nodes
    return z, half * weights * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)


@cache
def _rule() -> tuple[Array, Array]:
    nodes, weights = special.roots_legendre(NODES)
    return nodes, weights
