"""Departure of the final errors from the linear ones, as a polynomial fitted to a few simulations.

In standard normals x along rotated axes, with ``s = mean + A x`` and ``A A^T = S``, the departure of an output from
its linear value is ``d(x) = y(s) - y_0 - P s``. The axes are the right singular vectors of ``P S^(1/2)``, its rows over
the linear sigmas: a thin direction of the ellipsoid bends with the large ones, which come first. Simulations are the
nominal one, ``+-sqrt(3)`` along each axis, and ``+-sqrt(3)`` along both axes of each pair of leading axes. They are the
nodes of the Gauss-Hermite rule of three points, so that

    H_ii = (d+ + d- - 2 d_0) / 3,    H_ij = (d++ - d+- - d-+ + d--) / 12,    J'_i = (d+ - d-) / (2 sqrt(3))

are mean curvatures and slopes over the errors' own range. The slopes so hold the third derivatives along each axis; a
third of what the pairs add to them are those along two. For normal errors

    mean = d_0 + 1/2 sum H_ii,    cov(y) = C - J J^T + (J + J') (J + J')^T + 1/2 sum H_ii^2 + sum_(i<j) H_ij^2,

with J the linear slopes along the axes and C the linear covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.higher_order import principal_directions

NODE: Final = float(np.sqrt(3.0))
"""Outer node of the Gauss-Hermite rule of three points."""

SIGNS: Final = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))


@dataclass(frozen=True)
class RotatedAxes:
    """Axes of standard normals in which the outputs' ellipsoid is aligned; r is the rank of the sources' covariance.

    Attributes
    ----------
    mean : ndarray, shape (sources,)
    loadings : ndarray, shape (sources, r)
        A: errors of one sigma along each axis.
    slopes : ndarray, shape (outputs, r)
        J: the linear outputs along each axis.
    leading : int
        Leading axes whose pairs are simulated.
    """

    mean: Array
    loadings: Array
    slopes: Array
    leading: int

    @classmethod
    def of(cls, partials: Array, mean: Array, covariance: Array, sigma: Array, leading: int) -> RotatedAxes:
        """Rotate the axes of a covariance, shape (sources, sources), for outputs with linear sigmas (outputs,)."""
        directions = principal_directions(covariance)
        moving = sigma > 0.0
        scaled = (partials[moving] @ directions) / sigma[moving, None]
        rotation = np.linalg.svd(scaled, full_matrices=True)[2].T
        loadings = directions @ rotation
        return cls(mean, loadings, partials @ loadings, min(leading, loadings.shape[1]))

    @property
    def rank(self) -> int:
        """Number of axes."""
        return int(self.loadings.shape[1])

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The pairs of leading axes."""
        return list(combinations(range(self.leading), 2))

    def errors_at(self, normals: Array) -> Array:
        """Return errors of the sources, shape (n, sources), at normals along the axes, shape (n, r)."""
        return np.asarray(self.mean + normals @ self.loadings.T)

    def normals_of(self, errors: Array) -> Array:
        """Return the normals along the axes, shape (n, r), of errors of the sources, shape (n, sources)."""
        scale = np.linalg.norm(self.loadings, axis=1)
        moving = scale > 0.0
        solved = np.linalg.lstsq(
            self.loadings[moving] / scale[moving, None], ((errors - self.mean)[:, moving] / scale[moving]).T, rcond=None
        )
        return np.asarray(solved[0].T)

    @property
    def nodes(self) -> Array:
        """The normals of the simulations to which the polynomial is fitted, shape (n, r)."""
        unit = NODE * np.eye(self.rank)
        along = [sign * axis for axis in unit for sign in (1.0, -1.0)]
        both = [first * unit[i] + second * unit[j] for i, j in self.pairs for first, second in SIGNS]
        return np.array([np.zeros(self.rank), *along, *both]).reshape(-1, self.rank)


@dataclass(frozen=True)
class DepartureModel:
    """Departure as a polynomial of normals along the axes.

    Attributes
    ----------
    nominal : ndarray, shape (outputs,)
        Departure of the mean errors, d_0.
    slopes : ndarray, shape (r, outputs)
        J' along each axis alone.
    shared_slopes : ndarray, shape (r, outputs)
        What the other axis of a pair adds to a slope on average, added up over the pairs.
    curvatures : ndarray, shape (r, outputs)
        H_ii.
    mixed : ndarray, shape (pairs, outputs)
        H_ij.
    """

    axes: RotatedAxes
    nominal: Array
    slopes: Array
    shared_slopes: Array
    curvatures: Array
    mixed: Array

    @classmethod
    def fit(cls, axes: RotatedAxes, departures: Array) -> DepartureModel:
        """Fit the departures at the nodes, shape (n, outputs)."""
        nominal, rank, outputs = departures[0], axes.rank, departures.shape[1]
        along = departures[1 : 1 + 2 * rank].reshape(rank, 2, outputs)
        both = departures[1 + 2 * rank :].reshape(len(axes.pairs), 4, outputs)
        slopes = (along[:, 0] - along[:, 1]) / (2.0 * NODE)
        shared = np.zeros_like(slopes)
        for (i, j), (upper, outer, inner, lower) in zip(axes.pairs, both, strict=True):
            shared[i] += ((upper + outer - inner - lower) / (4.0 * NODE) - slopes[i]) / 3.0
            shared[j] += ((upper - outer + inner - lower) / (4.0 * NODE) - slopes[j]) / 3.0
        curvatures = (along[:, 0] + along[:, 1] - 2.0 * nominal) / 3.0
        mixed = (both[:, 0] - both[:, 1] - both[:, 2] + both[:, 3]) / 12.0
        return cls(axes, nominal, slopes, shared, curvatures, mixed)

    def at(self, normals: Array) -> Array:
        """Evaluate the polynomial at normals, shape (n, r): shape (n, outputs)."""
        return np.asarray(
            self.nominal
            + normals @ (self.slopes + self.shared_slopes)
            + 0.5 * normals**2 @ self.curvatures
            + _products(normals, self.axes.pairs) @ self.mixed
        )

    @property
    def mean(self) -> Array:
        """Mean departure for normal errors, shape (outputs,)."""
        return np.asarray(self.nominal + 0.5 * self.curvatures.sum(axis=0))

    @property
    def added_covariance(self) -> Array:
        """Covariance of the outputs less the linear one, for normal errors, shape (outputs, outputs)."""
        added = self.slopes + self.shared_slopes
        crossed = self.axes.slopes @ added
        return np.asarray(
            crossed + crossed.T + added.T @ added
            + 0.5 * self.curvatures.T @ self.curvatures + self.mixed.T @ self.mixed
        )  # fmt: skip


def _products(normals: Array, pairs: Sequence[tuple[int, int]]) -> Array:
    return np.array([normals[:, i] * normals[:, j] for i, j in pairs]).reshape(len(pairs), len(normals)).T
