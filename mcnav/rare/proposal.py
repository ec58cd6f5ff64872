"""Proposal for lines: a normal distribution fitted to a few of them.

On a line at v, a standard normal, the probability is ``w(v) = Phi(-t*(v))``. With the fit
``t*(v) = c + b . v + sum_k q_k v_k^2`` and the hazard ``h = phi(c) / Phi(-c)``, the lines that matter are distributed
as ``phi(v) w(v)``, nearly a normal with

    variance  s_k^2 = 1 / (1 + 2 h q_k),    mean  m_k = -h b_k s_k^2

(the curvatures q are those of second-order reliability; Breitung, 1984). Lines are drawn from it, and a share `PLAIN`
of them from the standard normal, so that the ratio of densities is never larger than 1 / `PLAIN`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array

PLAIN: Final = 0.2
NARROWEST, WIDEST, FARTHEST = 0.4, 4.0, 6.0
"""Limits of the standard deviations, and of the size of the mean."""

RIDGE: Final = 0.05
"""Weight that keeps the coefficients of a fit small, but for the constant and the common curvature."""


@dataclass(frozen=True)
class Proposal:
    """Mean and standard deviations of a normal, shape (d - 1,), and the fit ``c, b, q`` of the crossings."""

    mean: Array
    spread: Array
    constant: float
    gradient: Array
    curvature: Array

    @classmethod
    def plain(cls, dimensions: int, distance: float) -> Proposal:
        """Return the standard normal, with lines that enter at one distance."""
        none = np.zeros(dimensions)
        return cls(none, np.ones(dimensions), distance, none, none)

    @classmethod
    def fitted(cls, across: Array, entries: Array, distance: float) -> Proposal:
        """Fit the entries of lines at v, shape (n, d - 1); those that do not enter are left out."""
        dimensions = across.shape[1]
        finite = np.isfinite(entries)
        if np.count_nonzero(finite) < 8 or not dimensions:
            return cls.plain(dimensions, distance)
        v, t = across[finite], entries[finite]
        square = np.sum(v**2, axis=1)
        columns = [np.ones(len(v)), (square - dimensions) / np.sqrt(2.0 * dimensions)]
        matrix = np.column_stack([*columns, v, v**2 - square[:, None] / dimensions])
        penalty = np.where(np.arange(matrix.shape[1]) < 2, 1e-6, RIDGE)
        normal = matrix.T @ matrix + np.diag(penalty)
        solved = np.linalg.solve(normal, matrix.T @ t)
        common = solved[1] / np.sqrt(2.0 * dimensions)
        gradient, rest = solved[2 : 2 + dimensions], solved[2 + dimensions :]
        curvature = common + rest - np.mean(rest)
        constant = float(solved[0]) - common * dimensions
        return cls.of_fit(constant, gradient, curvature)

    @classmethod
    def of_fit(cls, constant: float, gradient: Array, curvature: Array) -> Proposal:
        """Return the normal of a fit."""
        hazard = hazard_at(constant)
        precision = np.clip(1.0 + 2.0 * hazard * curvature, WIDEST**-2, NARROWEST**-2)
        mean = -hazard * gradient / precision
        mean *= min(1.0, FARTHEST / max(float(np.linalg.norm(mean)), 1e-300))
        return cls(mean, precision**-0.5, constant, gradient, curvature)

    def with_scatter(self, at: Array, by: Array) -> Proposal:
        """Return that of entries at ``t* - h s^2(v) / 2``, with ``s^2`` the mean square of ``at + by @ v``.

        Products in s^2 are left out; shapes (K,) and (K, d - 1).
        """
        half = 0.5 * hazard_at(self.constant)
        return Proposal.of_fit(
            self.constant - half * float(np.mean(at**2)),
            self.gradient - 2.0 * half * np.mean(at[:, None] * by, axis=0),
            self.curvature - half * np.mean(by**2, axis=0),
        )

    def improved(self, normal: Array, mass: Callable[[Array, Array], Array]) -> tuple[Proposal, float]:
        """Match mean and variance to the lines that matter by the fit, and return the variation that is left.

        ``normal`` are standard normals, shape (n, d - 1); ``mass`` returns the probability w(v) of lines at v with
        their entries, shape (n,). The moments are those of ``phi(v) w(v)`` with the fitted t*, by importance sampling
        (cross-entropy; Rubinstein, 1999). The variation is the squared coefficient of the weights of lines laid so.
        """
        best = self
        variation = math.inf
        trial = self
        for _ in range(4):
            v = trial.draw((np.arange(len(normal)) + 0.5) / len(normal), normal)
            weights = trial.ratio(v) * mass(v, trial.entry(v))
            total = float(np.sum(weights))
            if not total > 0.0:
                break
            left = float(np.var(weights) / np.mean(weights) ** 2)
            if left < variation:
                best, variation = trial, left
            share = weights / total
            mean = share @ v
            mean *= min(1.0, FARTHEST / max(float(np.linalg.norm(mean)), 1e-300))
            spread = np.clip(np.sqrt(share @ (v - mean) ** 2), NARROWEST, WIDEST)
            trial = replace(trial, mean=mean, spread=spread)
        return best, variation

    def draw(self, uniform: Array, normal: Array) -> Array:
        """Return v from uniforms, shape (n,), and standard normals, shape (n, d - 1)."""
        return np.asarray(np.where(uniform[:, None] < PLAIN, normal, self.mean + self.spread * normal))

    def ratio(self, across: Array) -> Array:
        """Return the ratio of the standard normal's density to that of the lines, shape (n,)."""
        scaled = (across - self.mean) / self.spread
        log = 0.5 * np.sum(across**2 - scaled**2, axis=1) - np.sum(np.log(self.spread))
        return np.asarray(1.0 / (PLAIN + (1.0 - PLAIN) * np.exp(np.minimum(log, 700.0))))

    def entry(self, across: Array) -> Array:
        """Return the fitted t* at v, shape (n,)."""
        return np.asarray(self.constant + across @ self.gradient + across**2 @ self.curvature)


def hazard_at(distance: float) -> float:
    """Return the hazard ``phi(c) / Phi(-c)``."""
    return float(np.exp(-0.5 * distance**2 - special.log_ndtr(-distance)) / np.sqrt(2.0 * np.pi))
