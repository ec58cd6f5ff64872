"""The largest of the quantiles of many sizes, such as that of a position error at each of many times.

A quantile is at most a multiple of the root mean square (`largest_over_rms`): most laws are left out by it. Of the
others those are left out whose probability to stay within the largest quantile so far is as large as the wanted one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.normal_size import size_quantiles
from mcnav.statistics.size_tails import agree, principal_axes, size_tails

BOUND: Final = 1.05
"""Allowance on the largest quantile over rms of a normal vector's length: that with equal sigmas along some axes."""


def largest_quantiles(
    means: Array, covariances: Array, probability: float, known: Array, instead: float | None = None
) -> tuple[Array, IndexArray]:
    """Compute the largest quantile of the sizes of m normal vectors, in each of g groups, and the vector that has it.

    Parameters
    ----------
    means, covariances : ndarray, shapes (g, m, d), (g, m, d, d)
    known : ndarray, shape (g,)
        The result where no quantile is larger; NaN where no vector has finite moments.
    instead : float, optional
        As in `mcnav.statistics.normal_size.size_quantiles`.

    Returns
    -------
    ndarray, shape (g,)
    ndarray of int, shape (g,)
        Where none is larger than what is known, the vector with the largest mean square.

    >>> variances = np.array([[[[1.0]], [[4.0]], [[9.0]]]])
    >>> largest_quantiles(np.array([[[0.0], [9.0], [0.0]]]), variances, 0.5, np.zeros(1))
    (array([9.]), array([1]))
    """
    squares = np.trace(covariances, axis1=2, axis2=3) + np.einsum("gmi,gmi->gm", means, means)
    promise = np.where(np.isfinite(squares), squares, -np.inf)
    reach = largest_over_rms(means.shape[2], probability, bool(means.any())) * np.sqrt(np.maximum(promise, 0.0))
    largest, worst = np.where(np.isneginf(promise).all(axis=1), np.nan, known), np.argmax(promise, axis=1)
    possible = reach > largest[:, None]
    while possible.any():
        groups = np.flatnonzero(possible.any(axis=1))
        best = np.argmax(np.where(possible, promise, -np.inf), axis=1)[groups]
        quantiles = size_quantiles(means[groups, best], covariances[groups, best], probability, instead)
        larger = quantiles > largest[groups]
        largest[groups[larger]], worst[groups[larger]] = quantiles[larger], best[larger]
        possible[groups, best] = False
        possible &= reach > largest[:, None]
        left = np.nonzero(possible)
        within = _within(means[left], covariances[left], largest[left[0]])
        possible[left], promise[left] = ~(within >= probability), -within
    return largest, worst


def largest_over_rms(dimensions: int, probability: float, offset: bool) -> float:
    """Return what a quantile of the size of a normal vector is at most, over its root mean square.

    Without a mean that is so of a vector with equal sigmas along some of its axes. A mean is beside the largest
    quantile about it.

    >>> largest_over_rms(1, 0.9973, False) > 3.0
    True
    """
    axes = np.arange(1, dimensions + 1)
    most = BOUND * float(np.sqrt(special.chdtri(axes, 1.0 - probability) / axes).max())
    return float(np.hypot(1.0, most)) if offset else most


def _within(means: Array, covariances: Array, sizes: Array) -> Array:
    """Return the probabilities that sizes of normal vectors are up to these, shape (n,).

    They are -1, so that a quantile is computed, where two routes disagree.
    """
    within = np.zeros(len(sizes))
    for rows, variances, centres, fixed in principal_axes(means, covariances):
        tails, others = (np.array(size_tails(variances, centres, fixed, sizes[rows], path)) for path in (0, 1))
        within[rows] = np.where(agree(tails, others), tails[0], -1.0)
    return within
