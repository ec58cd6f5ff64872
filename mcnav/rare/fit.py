"""Where lines are expected to enter the event: the fits of the half-spaces, and the linear model where there is none.

Lines of half-spaces that share their points enter where the linear model has the first of them, later by what is
fitted; those with too few lines for a fit, later by a shift that is common to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.proposal import Proposal


@dataclass(frozen=True)
class Fit:
    """Half-spaces with the proposal of the lines of each.

    Attributes
    ----------
    facets : Facets
    proposals : sequence of Proposal
    few : ndarray of bool, shape (facets,)
        Which have too few lines for a fit: they enter where the linear model has it, shifted.
    shift : float
        How much later those enter.
    """

    facets: Facets
    proposals: Sequence[Proposal]
    few: NDArray[np.bool_]
    shift: float = 0.0

    @classmethod
    def plain(cls, facets: Facets) -> Fit:
        """Return lines from the standard normal, which enter where the linear model has it."""
        d = facets.directions.shape[1] - 1
        few = np.arange(len(facets.distances)) < (facets.foreseen if facets.shared else 0)
        return cls(facets, [Proposal.plain(d, float(distance)) for distance in facets.distances], few)

    def entry(self, facet: int, across: Array) -> Array:
        """Return the entries of lines at v of one facet, shape (n,)."""
        few = self.few[facet]
        later = self.facets.distances[facet] + self.shift if few else self.proposals[facet].entry(across)
        return np.asarray(self.moved(facet, across) + later)

    def moved(self, facet: int, across: Array) -> Array:
        """Return how much later lines at v of a half-space that shares its points enter any by the linear model.

        Later than their own, shape (n,): what is fitted is the rest.
        """
        if not self.facets.shared or facet >= self.facets.foreseen:
            return np.zeros(len(across))
        expected = self.facets.entries(np.full(len(across), facet), self.facets.feet_of(facet, across))
        return np.asarray(expected - self.facets.distances[facet])

    def mass_of_fit(self, facet: int, across: Array, fitted: Array) -> Array:
        """Return the same as `mass` for values of a fit."""
        return self.mass(facet, across, self.moved(facet, across) + fitted)

    def mass(self, facet: int, across: Array, entry: Array) -> Array:
        """Return ``Phi(-t*) pi`` of lines of one facet with their entries, or their begins, shape (n,)."""
        facets, feet = np.full(len(across), facet), self.facets.feet_of(facet, across)
        at = np.maximum(entry, self.facets.starts(facets, feet))
        points = feet + at[:, None] * self.facets.directions[facet]
        return np.asarray(special.ndtr(-at) * self.facets.shares(facets, points))

    def ratio(self, facet: IndexArray, across: Array) -> Array:
        """Return the ratio of the standard normal's density to that of lines at v, each of its facet, shape (n,)."""
        ratio = np.empty(len(facet))
        for j in np.unique(facet):
            ratio[facet == j] = self.proposals[j].ratio(across[facet == j])
        return ratio
