"""Departure of the final errors from the linear ones, as a polynomial fitted to a few simulations.

In standard normals x along rotated axes, with ``s = mean + A x`` and ``A A^T = S``, the departure of an output from
its linear value is ``d(x) = y(s) - y_0 - P s``. The axes are the right singular vectors of ``P S^(1/2)``, its rows over
the linear sigmas: a thin direction of the ellipsoid bends with the large ones, which come first. Simulations are the
nominal one, ``+-sqrt(3)`` along each axis, ``+-1`` along leading ones, and ``+-sqrt(3)`` along both axes of each pair
of leading axes. With the parts of d that are even and odd in an axis, a polynomial through them has the coefficients ::

    along an axis   b = odd(sqrt 3) / sqrt 3                         of x
                    h = (even(sqrt 3) - d_0) / 3                     of x^2
                    t = (b - odd(1)) / 2                             of x^3 - 3 x
                    q = (h - even(1) + d_0) / 2                      of x^4 - 3 x^2
    of a pair       c = odd-odd / 3                                  of x_i x_j
                    e = (odd-even / sqrt 3 - b_i) / 3                of x_i x_j^2
                    p = (even-even - d_0) / 9 - (h_i + h_j) / 3      of x_i^2 x_j^2

``sqrt(3)`` is the outer node of the Gauss-Hermite rule of three points: with what pairs add, b and 2 h are the mean
slope and curvature over the errors' own range. Written by Hermite polynomials, which are orthogonal for normal errors,
d is ``sum_k a_k He_k``, has the mean a_0, and adds to the covariance of the outputs ::

    cov(y) = C + J J'^T + J' J^T + J' J'^T + sum_k k! a_k a_k^T, over all k of order two and more,

with J the linear slopes along the axes, J' those of d, and C the linear covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.higher_order import principal_directions

NODE: Final = float(np.sqrt(3.0))
"""Outer node of the Gauss-Hermite rule of three points."""

SIGNS: Final = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
"""Of the simulations along both axes of a pair."""

HALVES: Final = 0.5 * np.array([[1.0, -1.0], [1.0, 1.0]])
"""Odd and even part of two simulations to both sides of an axis."""

QUARTERS: Final = 0.25 * np.array([[1, -1, -1, 1], [1, 1, -1, -1], [1, -1, 1, -1], [1, 1, 1, 1]])
"""Parts of `SIGNS` that are odd in both axes, odd in the first, odd in the second, and even in both."""


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
        inner = [sign * axis / NODE for axis in unit[: self.leading] for sign in (1.0, -1.0)]
        both = [first * unit[i] + second * unit[j] for i, j in self.pairs for first, second in SIGNS]
        return np.vstack([np.zeros(self.rank), *along, *inner, *both])


@dataclass(frozen=True)
class DepartureModel:
    """Departure as a polynomial of normals along the axes, by Hermite polynomials He_k.

    Attributes
    ----------
    mean : ndarray, shape (outputs,)
        Mean departure for normal errors.
    slopes, squares : ndarray, shape (r, outputs)
        Of He_1 and He_2 along each axis.
    cubic, quartic : ndarray, shape (leading, outputs)
        Of He_3 and He_4 along each leading axis.
    shared : ndarray, shape (4, pairs, outputs)
        Of ``He_k(x_i) He_l(x_j)`` for each pair: orders 1 and 1, 1 and 2, 2 and 1, 2 and 2.
    """

    axes: RotatedAxes
    mean: Array
    slopes: Array
    squares: Array
    cubic: Array
    quartic: Array
    shared: Array

    @classmethod
    def fit(cls, axes: RotatedAxes, departures: Array) -> DepartureModel:
        """Fit the departures at the nodes, shape (n, outputs)."""
        nominal, rank, leading, outputs = departures[0], axes.rank, axes.leading, departures.shape[1]
        along, inner, both = np.split(departures[1:] - nominal, np.cumsum([2 * rank, 2 * leading]))
        odd, even = HALVES @ along.reshape(rank, 2, outputs).swapaxes(0, 1).reshape(2, -1)
        slopes, squares = odd.reshape(rank, outputs) / NODE, even.reshape(rank, outputs) / 3.0
        odd, even = HALVES @ inner.reshape(leading, 2, outputs).swapaxes(0, 1).reshape(2, -1)
        cubic = 0.5 * (slopes[:leading] - odd.reshape(leading, outputs))
        quartic = 0.5 * (squares[:leading] - even.reshape(leading, outputs))
        i, j = np.array(axes.pairs, dtype=int).reshape(-1, 2).T
        mixed, first, second, fourth = np.einsum("ks,pso->kpo", QUARTERS, both.reshape(len(i), 4, outputs))
        mixed, first, second = mixed / 3.0, (first / NODE - slopes[i]) / 3.0, (second / NODE - slopes[j]) / 3.0
        fourth = fourth / 9.0 - (squares[i] + squares[j]) / 3.0
        for table, places, added in (
            (slopes, i, first), (slopes, j, second), (squares, i, fourth), (squares, j, fourth),
        ):  # fmt: skip
            np.add.at(table, places, added)
        mean = nominal + squares.sum(axis=0) - fourth.sum(axis=0)
        squares[:leading] += 3.0 * quartic
        return cls(axes, mean, slopes, squares, cubic, quartic, np.array([mixed, first, second, fourth]))

    def at(self, normals: Array) -> Array:
        """Evaluate the polynomial at normals, shape (n, r): shape (n, outputs)."""
        squares, (i, j) = normals**2 - 1.0, np.array(self.axes.pairs, dtype=int).reshape(-1, 2).T
        x, x2 = normals[:, : self.axes.leading], squares[:, : self.axes.leading]
        pairs = np.concatenate([x[:, i] * x[:, j], x[:, i] * x2[:, j], x2[:, i] * x[:, j], x2[:, i] * x2[:, j]], axis=1)
        return np.asarray(
            self.mean
            + normals @ self.slopes
            + squares @ self.squares
            + (x**3 - 3.0 * x) @ self.cubic
            + (x**4 - 6.0 * x**2 + 3.0) @ self.quartic
            + pairs @ self.shared.reshape(-1, len(self.mean))
        )

    @property
    def added_covariance(self) -> Array:
        """Covariance of the outputs less the linear one, for normal errors, shape (outputs, outputs)."""
        crossed = self.axes.slopes @ self.slopes
        terms = (self.slopes, 1.0), (self.squares, 2.0), (self.cubic, 6.0), (self.quartic, 24.0)
        of_pairs = zip(self.shared, (1.0, 2.0, 2.0, 4.0), strict=True)
        return np.asarray(crossed + crossed.T + sum(size * table.T @ table for table, size in (*terms, *of_pairs)))
