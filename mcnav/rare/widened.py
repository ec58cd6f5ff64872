"""Flights with all errors widened: what fails away from the half-spaces, its probability, and the power of the search.

A flight has ``u = s z`` with standard normals z and a factor s, uniform in `FACTORS`. A half-space ``n . u > b`` fails
it with the probability ``Phi(-b / s)`` in any number of dimensions d: of 300 flights ten lie beyond 4.75 sigmas. With
r = |u|, the ratio of the density of standard normals to that of the flights is

    w(r) = f(r) / mean_s [ f(r / s) / s ],      f the density of a chi variable with d degrees of freedom,

so that the mean of w over the flights that fail somewhere is the probability of failing there. It scatters little where
the distance from the nominal decides, as outside of a ball in many errors, which no half-space describes. Near a
half-space, flights are few in many errors and weigh much: of a probability that lies there their scatter says nothing.
Where they must stand for the whole event, a share a = `SHIFTED` of them is therefore drawn about the nearest points
``b_j n_j`` of the m half-spaces that are known, and w is the balance heuristic's (Veach and Guibas, 1995),

    1 / w(u) = (1 - a) / w(r) + a / m sum_j exp(b_j n_j . u - b_j^2 / 2)

The search finds a half-space at b in no particular direction with the probability

    1 - product_i [ 1 - C(b / r_i) ],      C(x) = I((d - 1) / 2, 1 / 2; 1 - x^2) / 2      (share of directions within)

over the flights i that do not fail, or fail unforeseen: one that fails as foreseen shows nothing of a second reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.flights import Flown, Places
from mcnav.rare.interval import RELIABLE, tail_index, weights_interval

FACTORS: Final = (1.2, 3.5)
"""Least and largest factor: up to where errors are still of the size that a model is made for."""

STRATA: Final = 8
"""Groups of flights with similar factors."""

SHIFTED: Final = 0.25
"""Share of the flights about half-spaces, where there are such."""

NODES: Final = 200
"""Factors by which the density of the flights is summed."""


@dataclass(frozen=True)
class Widened:
    """Flights with widened errors.

    Attributes
    ----------
    places : Places
        Their n points and noise.
    weights : ndarray, shape (n,)
        Ratios of the standard normals' density to that of the flights.
    failed, foreseen : ndarray of bool, shape (n,)
        Which lie beyond the limit, or have no result; and of which a model expects it.
    seen : ndarray of bool, shape (n,)
        Which have a result.
    """

    places: Places
    weights: Array
    failed: NDArray[np.bool_]
    foreseen: NDArray[np.bool_]
    seen: NDArray[np.bool_]

    def heaviest(self, number: int, share: float = 0.0) -> IndexArray:
        """Return the numbers of those that fail, with a result, that stand for most probability, shape (n,).

        More than that number where more are needed for a share of the probability of all.
        """
        failures = np.flatnonzero(self.failed & self.seen)
        failures = failures[np.argsort(-self.weights[failures], kind="stable")]
        heaped = np.cumsum(self.weights[failures])
        enough = int(np.searchsorted(heaped, share * heaped[-1])) + 1 if len(heaped) else 0
        return np.asarray(failures[: max(number, enough)])

    def power(self, probability: float) -> float:
        """Return the probability of finding a half-space of so much probability, in no particular direction."""
        points = self.places.points
        distance, dimensions = float(-special.ndtri(probability)), points.shape[1]
        showing = self.seen & ~(self.failed & self.foreseen)
        radii = np.linalg.norm(points[showing], axis=1)
        if dimensions == 1:
            shares = np.where(radii > distance, 0.5, 0.0)
        else:
            square = np.clip(1.0 - (distance / np.maximum(radii, distance)) ** 2, 0.0, 1.0)
            shares = 0.5 * special.betainc(0.5 * (dimensions - 1.0), 0.5, square)
        return float(-np.expm1(np.sum(np.log1p(-shares))))

    def probability(self, some: NDArray[np.bool_], confidence: float) -> tuple[float, float, float]:
        """Return the probability of points as some of the flights have, shape (n,), and the ends of its interval."""
        weights = np.where(some, self.weights, 0.0)
        strata = np.arange(len(weights)) * STRATA // len(weights)
        largest = float(np.max(weights))
        if not largest > 0.0:
            return 0.0, 0.0, 0.0
        value, low, high = weights_interval(weights / largest, strata, confidence)
        return largest * value, largest * low, largest * high

    def counted(self, some: NDArray[np.bool_]) -> float:
        """Return how many independent points of equal weight such a probability is worth.

        None where the tail of their weights shows that the heaviest were not drawn.
        """
        weights = self.weights[some]
        if not len(weights) or RELIABLE < tail_index(weights) < math.inf:
            return 0.0
        return float(np.sum(weights) ** 2 / np.sum(weights**2))


def draw_everywhere(count: int, facets: Facets, generator: np.random.Generator) -> tuple[Array, Array]:
    """Draw points with widened errors and about half-spaces, shape (count, d), and return their weights, (count,)."""
    shifted, number = int(SHIFTED * count), len(facets.distances)
    nearest = facets.distances[:, None] * facets.directions
    widened = draw_widened(count - shifted, nearest.shape[1], generator)
    about = nearest[np.arange(shifted) * number // shifted] + generator.standard_normal((shifted, nearest.shape[1]))
    points = np.vstack([widened, about])
    densities = special.logsumexp(points @ nearest.T - 0.5 * facets.distances**2, axis=1) - math.log(number)
    of_widened = math.log(1.0 - SHIFTED) - np.log(ratio(points))
    return points, np.asarray(np.exp(-np.logaddexp(of_widened, math.log(SHIFTED) + densities)))


def draw_widened(count: int, dimensions: int, generator: np.random.Generator) -> Array:
    """Draw points, shape (count, d), with factors in strata."""
    factors = FACTORS[0] + (FACTORS[1] - FACTORS[0]) * (np.arange(count) + generator.random(count)) / count
    return np.asarray(factors[:, None] * generator.standard_normal((count, dimensions)))


def ratio(points: Array) -> Array:
    """Return the ratio of the standard normals' density to that of the flights at points, shape (n, d)."""
    dimensions = points.shape[1]
    squares = np.sum(points**2, axis=1)
    factors = FACTORS[0] + (FACTORS[1] - FACTORS[0]) * (np.arange(NODES) + 0.5) / NODES
    exponents = 0.5 * squares[:, None] * (1.0 - factors**-2) - dimensions * np.log(factors)
    return np.asarray(np.exp(-special.logsumexp(exponents, axis=1) + math.log(NODES)))


def fly_widened(flown: Flown, points: Array, weights: Array, foreseen: NDArray[np.bool_]) -> Widened:
    """Fly points with their weights, each with noise of its own."""
    places = Places(points, flown.new_noise(len(points)))
    margins = flown(places.points, places.noise)
    return Widened(places, weights, ~(margins <= 0.0), foreseen, ~np.isnan(margins))
