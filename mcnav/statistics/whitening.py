"""Whitening: the range of a possibly singular covariance, and coordinates in which it is the identity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.statistics.chi_square import LEVELS

RANK_TOLERANCE: Final = 1e-9
"""Eigenvalues of the correlation matrix below this share of the largest count as zero."""


@dataclass(frozen=True)
class Whitening:
    """Coordinates ``u = x W`` with ``W^T C W = I``.

    Attributes
    ----------
    matrix : ndarray, shape (k, rank)
        W.
    directions : ndarray, shape (k, rank)
        W for variables that are in units of their standard deviations.
    complement : ndarray, shape (k, k - rank)
        Directions, for variables in units of their standard deviations (in their own where those are zero), in which C
        has no dispersion; orthonormal.
    """

    matrix: Array
    directions: Array
    complement: Array

    @property
    def rank(self) -> int:
        """Dimension of the range of C."""
        return int(self.matrix.shape[1])

    @property
    def radii(self) -> Array:
        """Squared radii of the ellipsoids of probabilities `LEVELS`, shape (levels,); empty without dispersion."""
        return np.array([special.chdtri(self.rank, 1.0 - level) for level in LEVELS if self.rank])


def whitening(covariance: Array) -> Whitening:
    """Whiten a positive semidefinite covariance by its eigenvectors, in units of the standard deviations.

    Rows of zeros are variables without dispersion.

    >>> whitening(np.array([[4.0, 0.0], [0.0, 0.0]])).matrix
    array([[0.5],
           [0. ]])
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    values, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    positive = values > RANK_TOLERANCE * max(values[-1], 0.0)
    directions = vectors[:, positive] / np.sqrt(values[positive])
    return Whitening(scale[:, None] * directions, directions, vectors[:, ~positive])


def leaves_range(of: Whitening, covariance: Array, sample: Array) -> bool:
    """Return whether a sample covariance has dispersion where another covariance, also given whitened, has none."""
    if of.complement.shape[1] == 0:
        return False
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.divide(1.0, sigma, out=np.ones_like(sigma), where=sigma > 0.0)
    outside = transform(of.complement.T, sample * np.outer(scale, scale))
    size = float(np.max(np.diag(sample) * scale**2, initial=0.0))
    return bool(np.trace(outside) > RANK_TOLERANCE * size)
