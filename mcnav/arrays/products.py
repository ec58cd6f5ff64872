"""Products of covariances: the only ones of the form ``M P M'`` of the package.

Kernels of samples, reference engines, and what is named in ``tests/unit/arrays/test_products.py`` have their own.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array

ROUNDED: Final = 1e-14
"""Share of the variance that a sum would have without cancellation, up to which its own is rounding.

Each of its two products of nine terms has nine units of rounding, 2e-15 together; the covariance's entries, which add
up steps and updates, have some more.
"""


def transform(matrix: Array, covariance: Array) -> Array:
    """Compute ``M P M'``, symmetric to the last bit, of shapes (..., r, n), (..., n, n).

    >>> transform(np.array([[1.0, 2.0]]), np.diag([9.0, 4.0]))
    array([[25.]])
    """
    product = matrix @ covariance @ matrix.swapaxes(-1, -2)
    return np.asarray(0.5 * (product + product.swapaxes(-1, -2)))


def transformed_variances(matrix: Array, covariance: Array) -> Array:
    """Compute the diagonal of ``M P M'``, shape (..., r).

    >>> transformed_variances(np.array([[1.0, 2.0], [0.0, 3.0]]), np.diag([9.0, 4.0]))
    array([25., 36.])
    """
    return np.asarray(np.sum((matrix @ covariance) * matrix, axis=-1))


def step(covariance: Array, transition: Array, noise: Array, rows: slice = slice(None)) -> Array:
    """Compute the covariance after a step, ``F P F' + Q``; what rounding leaves asymmetric, an update makes even.

    Parameters
    ----------
    rows : slice
        Rows and columns of Q that are given; the others are zero.
    """
    product = transition @ covariance @ transition.swapaxes(-1, -2)
    product[..., rows, rows] += noise
    return np.asarray(product)


def update(covariance: Array, cross: Array, gain: Array, response: Array, variances: Array) -> Array:
    """Compute the covariance after an update with any gain: Joseph's form, ``(I - K H) P (I - K H)' + K R K'``.

    It is computed as ``N - (N H' - K R) K'`` with ``N = (I - K H) P``, whose products are small.

    Parameters
    ----------
    cross, gain, response, variances : ndarray, shapes (..., m, f), (..., f, m), (m, f), (..., m)
        H P, K, H and the diagonal of R.
    """
    half = covariance - gain @ cross
    beside = half @ response.T
    beside -= gain * variances[..., None, :]
    half -= beside @ gain.swapaxes(-1, -2)
    product = half + half.swapaxes(-1, -2)
    product *= 0.5
    return np.asarray(product)


def innovation_covariance(covariance: Array, response: Array) -> tuple[Array, Array]:
    """Compute ``H P`` and ``H P H'``, of shapes (..., n, n), (..., m, n)."""
    cross = response @ covariance
    return cross, np.asarray(cross @ response.swapaxes(-1, -2))


def sum_of_transforms(matrices: Array, covariances: Array | None, factors: Array | None) -> Array:
    """Compute ``sum_k Z_k Q_k Z_k'`` with large products.

    Parameters
    ----------
    matrices : ndarray, shape (o, k, r)
        Z, beside each other.
    covariances, factors : ndarray, shapes (k, r, r), (k, r, c)
        Q, or G with ``Q = G G'``: one of both.

    Returns
    -------
    ndarray, shape (o, o)
    """
    right = covariances if factors is None else factors
    assert right is not None
    beside = np.empty((*matrices.shape[:2], right.shape[2]))
    np.matmul(matrices.transpose(1, 0, 2), right, out=beside.transpose(1, 0, 2))
    halves = beside.reshape(len(matrices), -1)
    if factors is not None:
        return np.asarray(halves @ halves.T)
    total = halves @ matrices.reshape(len(matrices), -1).T
    return np.asarray(0.5 * (total + total.T))


def map_covariances(maps: Array, covariances: Array) -> Array:
    """Compute ``M P M'``; rows and columns of variances that are rounding are zero.

    Parameters
    ----------
    maps, covariances : ndarray, shapes (..., r, n), (..., n, n)

    Returns
    -------
    ndarray, shape (..., r, r)

    Examples
    --------
    Two errors that are one, and their difference:

    >>> map_covariances(np.array([[1.0, 0.0], [3.0, -0.3]]), np.array([[0.01, 0.1], [0.1, 1.0]]))
    array([[0.01, 0.  ],
           [0.  , 0.  ]])
    """
    mapped = maps @ covariances @ maps.swapaxes(-1, -2)
    variances = np.maximum(np.diagonal(covariances, axis1=-2, axis2=-1), 0.0)
    sizes = (np.abs(maps) @ np.sqrt(variances)[..., None])[..., 0]
    kept = np.diagonal(mapped, axis1=-2, axis2=-1) > ROUNDED * sizes**2
    return np.asarray(np.where(kept[..., :, None] & kept[..., None, :], mapped, 0.0))
