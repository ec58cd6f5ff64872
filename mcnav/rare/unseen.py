"""Noise that the linear model does not see: how far it scatters the entries of lines.

What noise adds to the linear outcomes is among the coordinates of a line. What is left of the noise of a flight k, such
as a product with another error, changes its outputs by ``a_k + G_k u``, found by flights with a few noises; of lines in
the direction alpha it moves the entries by

    e_k(v) = (n . a_k + n . G_k (beta alpha + B v)) / (n . grad alpha),      variance s^2(v)

so that with the hazard h the mean probability of lines at v is that of an entry at ``t* - h s^2(v) / 2``, and the
logarithm of a single one has the variance ``h^2 s^2(v)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.rare.facets import Facets, Outputs
from mcnav.rare.flights import Flown
from mcnav.rare.limits import Limit, side_towards

FEWEST, MOST, FLIGHTS = 6, 40, 300
"""Noises that flights are compared with, and flights for them, about."""

MANY: Final = 40
NEAREST: Final = 8
"""Dimensions above which flights go along so many half-spaces in place of along each error."""

STEP: Final = 2.0
"""Step of differences, in standard deviations."""


@dataclass(frozen=True)
class UnseenNoise:
    """Changes of the outputs by each noise, shape (K, outputs), and of their gradients, shape (K, outputs, d).

    ``gradient`` is the mean gradient, shape (outputs, d).
    """

    changes: Array
    tilts: Array
    gradient: Array

    @classmethod
    def measure(cls, flown: Flown, facets: Facets, linear: Outputs) -> UnseenNoise:
        """Measure it by flights without errors and with each error, with the same noises.

        In many dimensions flights go along the nearest half-spaces alone: gradients change by them, and are the linear
        model's otherwise.
        """
        dimensions = facets.directions.shape[1]
        if dimensions > MANY:
            return cls._along(flown, facets, linear)
        points = np.vstack([np.zeros(dimensions), STEP * np.eye(dimensions)])
        noises = int(np.clip(FLIGHTS // len(points), FEWEST, MOST))
        outputs = np.stack([flown.outcomes()(points) for _ in range(noises)])
        gradients = (outputs[:, 1:] - outputs[:, :1]).swapaxes(1, 2) / STEP
        here = outputs[:, 0]
        return cls(here - here.mean(axis=0), gradients - gradients.mean(axis=0), gradients.mean(axis=0))

    @classmethod
    def _along(cls, flown: Flown, facets: Facets, linear: Outputs) -> UnseenNoise:
        axes = facets.directions[np.argsort(facets.distances, kind="stable")[:NEAREST]]
        points, identity = np.vstack([np.zeros(axes.shape[1]), STEP * axes]), STEP * np.eye(axes.shape[1])
        outputs = np.stack([flown.outcomes()(points) for _ in range(FLIGHTS // len(points))])
        slopes = (outputs[:, 1:] - outputs[:, :1]).swapaxes(1, 2) / STEP
        tilts = (slopes - slopes.mean(axis=0)) @ np.linalg.pinv(axes.T)
        here = outputs[:, 0]
        return cls(here - here.mean(axis=0), tilts, (linear(identity) - linear(-identity)).T / (2.0 * STEP))

    def scatter(self, facets: Facets, j: int, limit: Limit) -> tuple[Array, Array]:
        """Return ``e_k(0)``, shape (K,), and its derivatives by v, shape (K, d - 1), of the lines of a half-space.

        Scaled so that the mean square is the variance. Zero where it is not known.
        """
        direction, basis = facets.directions[j], facets.bases[j]
        normal = side_towards(limit, self.gradient @ direction)
        noises = len(self.changes)
        slope = float(normal @ self.gradient @ direction)
        if not (slope > 0.0 and np.isfinite(self.tilts).all() and np.isfinite(self.changes).all()):
            return np.zeros(noises), np.zeros((noises, basis.shape[1]))
        scale = np.sqrt(noises / (noises - 1.0)) / slope
        tilts = np.einsum("o,kod->kd", normal, self.tilts)
        at = np.einsum("o,ko->k", normal, self.changes) + facets.distances[j] * (tilts @ direction)
        return scale * at, scale * tilts @ basis
