"""Where lines are laid by points of the event: the axes and moments of those in the cell of a half-space.

Points of the event that are distributed as normals within it (`mcnav.rare.levels`) lie on lines in the distribution
that their weights have, ``phi(v) w(v) / P``: its mean and covariance are those of the best normal proposal (cross
entropy; Rubinstein, 1999). Of a covariance estimated from n points in k dimensions noise alone puts eigenvalues between
``(1 - sqrt(k / n))^2`` and ``(1 + sqrt(k / n))^2`` (Marchenko and Pastur, 1967): axes are turned to the eigenvectors
beyond, and the spread along all others is one. Where correlations are noise, the axes stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.levels import Levels
from mcnav.rare.proposal import NARROWEST, WIDEST, Proposal

CORRELATED: Final = 6.0
"""Points of chains that are worth one independent point."""

FEWEST: Final = 20
"""Independent points from which moments are taken."""

SIGNIFICANT: Final = 3.0
"""Standard errors by which a variance must differ from one."""

FOLLOWED: Final = 24
"""Points of a cell whose lines are followed in the pilot, besides two for each dimension."""


@dataclass(frozen=True)
class Moments:
    """Mean and spread of the lines of one cell, shape (d - 1,), in the axes of its basis."""

    mean: Array
    spread: Array

    def applied(self, proposal: Proposal) -> Proposal:
        """Return a proposal with these moments and its own fit."""
        return replace(proposal, mean=self.mean, spread=self.spread)


@dataclass(frozen=True)
class Informed:
    """Half-spaces whose axes are those of points of the event, with what they say of their lines.

    Attributes
    ----------
    facets : Facets
    moments : list of Moments or None
        Of the lines of each half-space; none where too few points are in its cell.
    shares : ndarray, shape (facets,)
        Probability of each cell as a share of the event's.
    facet, across : ndarray, shapes (n,), (n, d - 1)
        Lines through some of the points.
    """

    facets: Facets
    moments: list[Moments | None]
    shares: Array
    facet: IndexArray
    across: Array


def inform(facets: Facets, levels: Levels) -> Informed:
    """Sort points of the event into cells, and turn the axes of each.

    Moments are those of every second simulation, and lines through points of the others: they judge the moments.
    """
    cells, count = facets.cells(levels.points), len(facets.distances)
    bases, dimensions = facets.bases.copy(), facets.directions.shape[1] - 1
    moments: list[Moments | None] = [None] * count
    facet, across = [], []
    for j in range(count):
        mine = cells == j
        others = mine & (levels.simulation % 2 == 1)
        if not np.sum(levels.weights[mine]) > 0.0:
            continue
        weights = levels.weights[mine & ~others]
        independent = float(np.sum(weights)) ** 2 / (CORRELATED * max(float(np.sum(weights**2)), 1e-300))
        if independent >= FEWEST and dimensions and np.sum(levels.weights[others]) > 0.0:
            lines = levels.points[mine & ~others] @ bases[j]
            turn, moments[j] = _moments(lines, weights / np.sum(weights), independent)
            bases[j] = bases[j] @ turn
        else:
            others = mine
        heaped = np.cumsum(levels.weights[others]) / np.sum(levels.weights[others])
        wanted = min(len(heaped), FOLLOWED + 2 * dimensions)
        chosen = np.minimum(np.searchsorted(heaped, (np.arange(wanted) + 0.5) / wanted), len(heaped) - 1)
        facet.append(np.full(wanted, j))
        across.append(levels.points[others][chosen] @ bases[j])
    shares = np.asarray(np.bincount(cells, levels.weights, count), dtype=float)
    return Informed(facets.with_bases(bases), moments, shares, np.concatenate(facet), np.vstack(across))


def _moments(lines: Array, weights: Array, independent: float) -> tuple[Array, Moments]:
    """Return how the basis is turned, shape (d - 1, d - 1), and the moments in it."""
    dimensions = lines.shape[1]
    noise = np.sqrt(dimensions / independent)
    mean = weights @ lines
    covariance = np.einsum("n,ni,nj->ij", weights, lines - mean, lines - mean)
    turn, variances, single = np.eye(dimensions), np.diagonal(covariance).copy(), np.sqrt(2.0 / independent)
    sigmas = np.sqrt(variances)
    if np.any(_beyond(np.linalg.eigvalsh(covariance / np.outer(sigmas, sigmas)), noise)):
        values, vectors = np.linalg.eigh(covariance)
        far = _beyond(values, noise)
        turn = np.linalg.qr(np.hstack([vectors[:, far], np.eye(dimensions)]))[0]
        variances = np.append(values[far], np.ones(dimensions - np.count_nonzero(far)))
    else:
        variances[np.abs(variances - 1.0) < SIGNIFICANT * single] = 1.0
    square = float(mean @ mean)
    kept = max(0.0, 1.0 - float(np.sum(variances)) / independent / square) if square > 0.0 else 0.0
    return turn, Moments(kept * mean @ turn, np.clip(np.sqrt(variances), NARROWEST, WIDEST))


def _beyond(values: Array, noise: float) -> NDArray[np.bool_]:
    """Return which eigenvalues noise alone does not explain."""
    return np.asarray((values > (1.0 + noise) ** 2) | (values < max(1.0 - noise, 0.0) ** 2))
