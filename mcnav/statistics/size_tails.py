"""Tails of the sizes of normal vectors with known principal axes, by two routes: see `mcnav.statistics.normal_size`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.errors import NumericalError
from mcnav.statistics.generalized_chi_square import tail

AGREEMENT: Final = 1e-6
"""Largest difference of the two routes, as a share of the smaller tail: far above what rounding leaves."""

NONE: Final = 1e-14
"""Variance of a principal axis, as a share of the largest, below which there is none."""


def principal_axes(means: Array, covariances: Array) -> Iterator[tuple[IndexArray, Array, Array, Array]]:
    """Yield normal vectors along their principal axes, those that vary along equally many of them together.

    Parameters
    ----------
    means, covariances : ndarray, shapes (n, d), (n, d, d)
        The covariances may be singular.

    Yields
    ------
    rows : ndarray of int, shape (r,)
        Numbers of the vectors.
    variances, centres : ndarray, shapes (r, k)
        In rising order; means.
    fixed : ndarray, shape (r,)
        Size of what the other axes add; NaN where mean or covariance is not finite.
    """
    finite: Any = np.isfinite(means).all(axis=1) & np.isfinite(covariances).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(np.where(finite[:, None, None], covariances, 0.0))
    along = np.einsum("nij,ni->nj", vectors, np.where(finite[:, None], means, np.nan))
    counts = np.sum(values > NONE * np.maximum(values[:, -1:], 0.0), axis=1)
    for count in np.unique(counts):
        rows, still = np.flatnonzero(counts == count), values.shape[1] - int(count)
        fixed = np.linalg.norm(along[rows, :still], axis=1)
        yield rows, values[rows, still:], along[rows, still:], fixed


def size_tails(variances: Array, centres: Array, fixed: Array, sizes: float | Array, path: int) -> tuple[Array, Array]:
    """Return the probabilities of sizes up to these, and beyond, along one of the paths; shapes (n,).

    Parameters
    ----------
    variances, centres, fixed : ndarray, shapes (k,) or (n, k), (n, k), (n,)
        As in `mcnav.statistics.normal_size.NormalSize`, of n vectors.
    sizes : float or ndarray, shape (n,)

    >>> np.array(size_tails(np.ones(2), np.zeros((1, 2)), np.zeros(1), 2.0, 0)).round(6)  # exp(-2)
    array([[0.864665],
           [0.135335]])
    """
    squares = (sizes - fixed) * (sizes + fixed)
    possible = (sizes > 0.0) & (squares > 0.0)
    variances = np.broadcast_to(variances, centres.shape)
    if not centres.shape[1]:
        within = (squares > 0.0).astype(float)
        return within, 1.0 - within
    if centres.shape[1] == 1:
        halves = np.sqrt(np.maximum(squares, 0.0))
        within, beyond = _interval(halves, np.abs(centres[:, 0]), np.sqrt(variances[:, 0]))
        return np.where(possible, within, 0.0), np.where(possible, beyond, 1.0)
    within, beyond = np.zeros(len(squares)), np.ones(len(squares))
    low = squares < (variances + centres**2).sum(axis=1)
    for below, smaller, larger in ((True, within, beyond), (False, beyond, within)):
        rows = np.flatnonzero(possible & (low == below))
        smaller[rows] = tail(variances[rows], centres[rows], squares[rows], below, path)
        larger[rows] = 1.0 - smaller[rows]
    return within, beyond


def _interval(halves: Array, centres: Array, sigmas: Array) -> tuple[Array, Array]:
    """Return the probabilities that normal variables lie within ``+-half``, and beyond."""
    near, far = (halves - centres) / sigmas, (halves + centres) / sigmas
    beyond = special.ndtr(-near) + special.ndtr(-far)
    outside = special.ndtr(near) - special.ndtr(-far)
    inside = 0.5 * (special.erf(near / math.sqrt(2.0)) + special.erf(far / math.sqrt(2.0)))
    return np.where(near < 0.0, outside, inside), np.asarray(beyond)


def agree(tails: Array, others: Array) -> Array:
    """Return where two routes give the same tails, shape (2, n), and these are probabilities."""
    smaller = tails.min(axis=0)
    equal = np.abs(smaller - others.min(axis=0)) <= AGREEMENT * smaller
    return np.asarray(equal & (smaller >= 0.0) & (tails.max(axis=0) <= 1.0))


def refuse(what: str, variances: Array, centres: Array) -> NumericalError:
    """Return the error that says that two routes to something of a vector's size disagree."""
    sigmas = ", ".join(f"{sigma:g}" for sigma in np.sqrt(variances))
    means = ", ".join(f"{centre:g}" for centre in centres)
    return NumericalError(
        f"two ways to compute the {what} of a vector with means {means} and sigmas {sigmas} along its principal "
        "axes disagree"
    )
