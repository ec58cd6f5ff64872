"""Second and third derivatives of the final errors, and their corrections of mean and covariance.

In independent standard normals u, with ``s = mean + L u`` and ``L L^T = S``, expand each output as

    y_i = y_0 + g_i u + 1/2 u^T H_i u + 1/6 T_i u u u.

For normal errors the mean and covariance are then, with every term of the fourth order in sigma,

    mean_i  = y_0 + 1/2 tr H_i,
    cov_ij  = g_i g_j + 1/2 tr(H_i H_j) + 1/2 (g_i c_j + c_i g_j),        c_i = sum_k T_i[., k, k],

and the third central moment of the quadratic part is ``3 g H g + tr H^3``. In the sources' own terms the first
correction is ``1/2 tr(H_i S H_j S)``, the mean's ``1/2 tr(H_i S)``. The cubic term is of the same order as the
quadratic one: a prediction without it has the covariance wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.partials import Propagate, simulate_or_raise

STEP: Final = 0.5
"""Step of the differences in sigmas: derivatives are averaged over the errors' own range."""


@dataclass(frozen=True)
class SecondOrder:
    """Derivatives along the principal directions of the start covariance, per sigma; r is its rank.

    ``centre`` are the outputs of the mean errors. Gradients have shape (outputs, r), hessians (outputs, r, r), and
    ``thirds``, the third derivatives ``T_i[a, b, b]``, (outputs, r, r).
    """

    centre: Array
    gradients: Array
    hessians: Array
    thirds: Array

    @property
    def cubic(self) -> Array:
        """Third derivatives contracted over two of their three directions, c, shape (outputs, r)."""
        return np.asarray(self.thirds.sum(axis=2))

    @property
    def mean_shift(self) -> Array:
        """Correction of the mean by curvature, shape (outputs,)."""
        return np.asarray(0.5 * np.trace(self.hessians, axis1=1, axis2=2))

    @property
    def quadratic(self) -> Array:
        """Correction of the covariance by second derivatives, shape (outputs, outputs)."""
        return np.asarray(0.5 * np.tensordot(self.hessians, self.hessians, ((1, 2), (2, 1))))

    @property
    def third_order(self) -> Array:
        """Correction of the covariance by third derivatives, shape (outputs, outputs)."""
        half = 0.5 * self.gradients @ self.cubic.T
        return np.asarray(half + half.T)

    @property
    def added_by_pairs(self) -> Array:
        """Correction of each variance by pairs of directions, of which it is the sum, shape (outputs, r, r)."""
        third = self.gradients[:, :, None] * self.thirds
        return np.asarray(0.5 * (self.hessians**2 + third + third.swapaxes(1, 2)))

    @property
    def along_axes(self) -> tuple[Array, Array]:
        """Gradients and second derivatives of each output along the axes of its own hessian, shapes (outputs, r)."""
        curvatures, axes = np.linalg.eigh(self.hessians)
        return np.einsum("iab,ia->ib", axes, self.gradients), curvatures

    @property
    def skewness(self) -> Array:
        """Skewness of each output's quadratic part, shape (outputs,); zero without dispersion."""
        g, h = self.gradients, self.hessians
        third = 3.0 * np.einsum("ia,iab,ib->i", g, h, g) + np.einsum("iab,iba->i", h @ h, h)
        variance = np.sum(g**2, axis=1) + np.diag(self.quadratic)
        return np.asarray(np.divide(third, variance**1.5, out=np.zeros_like(third), where=variance > 0.0))


def principal_directions(covariance: Array) -> Array:
    """Compute L with ``L L^T`` equal to a start covariance, a column for each dimension of its range, (sources, r)."""
    sigma = np.sqrt(np.diag(covariance))
    active = np.flatnonzero(sigma > 0.0)
    correlation = covariance[np.ix_(active, active)] / np.outer(sigma[active], sigma[active])
    if np.array_equal(correlation, np.eye(len(active))):
        return np.asarray(np.diag(sigma)[:, active])  # independent sources are their own directions
    values, vectors = np.linalg.eigh(correlation)
    positive = values > 1e-12 * values[-1]
    directions = np.zeros((len(sigma), int(positive.sum())))
    directions[active] = sigma[active][:, None] * vectors[:, positive] * np.sqrt(values[positive])
    return directions


def second_order(propagate: Propagate, mean: Array, covariance: Array, step: float = STEP) -> SecondOrder:
    """Compute derivatives of the final errors by central differences in one batch of ``2 r^2 + 2 r + 1`` samples.

    The mean, shape (sources,), and the covariance are those of the start errors, SI; the step is in sigmas. Raises
    `SimulationFailed` when a sample fails.
    """
    directions = principal_directions(covariance)
    rank = directions.shape[1]
    unit = step * np.eye(rank)
    pairs = list(combinations(range(rank), 2))
    points = np.zeros((1 + 4 * rank + 4 * len(pairs), rank))
    points[1 : 1 + 4 * rank] = np.kron(unit, np.array([[1.0], [-1.0], [2.0], [-2.0]]))
    first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
    for sign, (one, other) in enumerate(((step, step), (step, -step), (-step, step), (-step, -step))):
        rows = np.arange(1 + 4 * rank + sign, len(points), 4)
        points[rows, first], points[rows, second] = one, other
    simulated = simulate_or_raise(propagate, mean + points @ directions.T)
    del points
    centre, outputs = simulated[0], simulated.shape[1]
    along = simulated[1 : 1 + 4 * rank].reshape(rank, 4, outputs) - centre
    mixed = simulated[1 + 4 * rank :].reshape(len(pairs), 4, outputs) - centre
    plus, minus, two_plus, two_minus = along.transpose(1, 0, 2)
    gradients = (8.0 * (plus - minus) - (two_plus - two_minus)) / (12.0 * step)
    hessians = np.zeros((rank, rank, outputs))
    hessians[range(rank), range(rank)] = (16.0 * (plus + minus) - (two_plus + two_minus)) / (12.0 * step**2)
    thirds = np.zeros((rank, rank, outputs))
    thirds[range(rank), range(rank)] = (two_plus - 2.0 * plus + 2.0 * minus - two_minus) / (2.0 * step**3)
    for (a, b), (both, first, second, neither) in zip(pairs, mixed, strict=True):
        hessians[a, b] = hessians[b, a] = (both - first - second + neither) / (4.0 * step**2)
        thirds[a, b] = (both + first - 2.0 * plus[a] - second - neither + 2.0 * minus[a]) / (2.0 * step**3)
        thirds[b, a] = (both + second - 2.0 * plus[b] - first - neither + 2.0 * minus[b]) / (2.0 * step**3)
    return SecondOrder(centre, gradients.T, hessians.transpose(2, 0, 1), thirds.transpose(2, 0, 1))
