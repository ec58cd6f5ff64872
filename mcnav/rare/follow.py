"""Lines that are followed: each enters the event somewhere, and flies one point beyond its entry, and some before.

With t* where the line enters, t' is a standard normal beyond it, whose flight says whether the event goes on there.
Each line has noise of its own, where there is any.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.fit import Fit
from mcnav.rare.flights import Flown, Places
from mcnav.rare.lines import Crossings, crossings

END: Final = 3.5
"""Distance beyond the farthest entry expected to which a line is followed."""

LATE: Final = 1.0
"""Distance behind a half-space of the linear model from which its entry contradicts it."""

BETWEEN: Final = 4
"""One line in so many is flown at a point before its entry as well."""

NEAR: Final = 0.05
"""Distance before its entry at which a point of the event counts as beyond: as far as entries are inexact."""

UNLIKELY: Final = 0.05
"""Share of the estimate that a line would carry from which on too few like it are drawn to be sure of any."""


@dataclass(frozen=True)
class Lines:
    """Lines that were followed.

    Facet, v, entry, whether a flight beyond it fails, and the share of that flight's point that is the facet's, shape
    (n,); entries as points with their noise; points before the entry of a line that fail as well; flights to find the
    entries.
    """

    facet: IndexArray
    across: Array
    entry: Array
    beyond: Array
    share: Array
    points: Places
    before: Places
    begin: Array
    flights: int

    def weights(self, fit: Fit) -> Array:
        """Return ``ratio(v) Phi(-t*) pi``, zero where the flight beyond the entry is not in the event, shape (n,)."""
        ratio = fit.ratio(self.facet, self.across)
        return np.asarray(ratio * special.ndtr(-self.entry) * self.beyond * self.share)


@dataclass(frozen=True)
class Follower:
    """Flights, the margins that the linear model expects of points, shape (n, d), and where draws come from."""

    flown: Flown
    expected: Callable[[Array], Array]
    generator: np.random.Generator

    def crossed(self, fit: Fit, facet: IndexArray, across: Array, noise: IndexArray) -> tuple[Crossings, Array]:
        """Return the entries of lines, each with its noise, and their begins, shape (n,)."""
        facets, number = fit.facets, len(facet)
        feet, along = facets.feet(facet, across), facets.directions[facet]
        nearest = float(np.min([proposal.constant for proposal in fit.proposals]))
        ends = np.full(number, max(nearest, float(np.min(facets.distances))) + END)
        begins = np.maximum(facets.starts(facet, feet), -ends)
        guesses = np.empty(number)
        for j in np.unique(facet):
            guesses[facet == j] = fit.entry(int(j), across[facet == j])
        guesses = np.where((guesses > 0.0) & (guesses < ends), guesses, facets.distances[facet])
        step = 1e-4
        at = feet + facets.distances[facet][:, None] * along
        slopes = (self.expected(at + step * along) - self.expected(at - step * along)) / (2.0 * step)
        return crossings(self.flown, noise, feet, along, guesses, slopes, begins, ends), begins

    def moved_out(self, facets: Facets) -> Facets:
        """Move half-spaces of the linear model whose axes enter the event by `LATE` later, or never, away from it.

        Where they are expected, as of an output that saturates, their cells would hide the ways to fail beyond.
        """
        if facets.shared:
            return facets
        linear, d = np.arange(facets.foreseen), facets.directions.shape[1]
        entry = self.crossed(
            Fit.plain(facets), linear, np.zeros((len(linear), d - 1)), self.flown.new_noise(len(linear))
        )[0].at  # fmt: skip
        distances, expected = facets.distances.copy(), facets.distances[linear]
        distances[linear] = np.where(entry > expected + LATE, np.minimum(entry, expected + END), expected)
        return replace(facets, distances=distances)

    def follow(self, fit: Fit, facet: IndexArray, across: Array, check: bool = True) -> Lines:
        """Follow lines, and fly a point beyond the entry of each, if that is checked, and before that of some."""
        facets, number, noise = fit.facets, len(facet), self.flown.new_noise(len(facet))
        feet, along = facets.feet(facet, across), facets.directions[facet]
        entered_at, begins = self.crossed(fit, facet, across, noise)
        entry = entered_at.at
        uniform = self.generator.random((number, 2))
        entered = np.isfinite(entry)
        beyond, some = np.zeros(number), entered & (np.arange(number) % BETWEEN == 0)
        t = -special.ndtri(uniform[:, 0] * special.ndtr(-entry))
        shared_at = np.where(entered, t if check else entry, 0.0)
        share = facets.shares(facet, feet + shared_at[:, None] * along)
        if check:
            tails = feet[entered] + t[entered, None] * along[entered]
            beyond[entered] = ~(self.flown(tails, noise[entered]) <= 0.0)
        begin = np.maximum(begins, 0.5 * entry)[some]
        t = begin + uniform[some, 1] * (entry[some] * (1.0 - 1e-2) - begin)
        follows = np.asarray(t > begins[some])
        earlier = Places(feet[some][follows] + t[follows, None] * along[some][follows], noise[some][follows])
        before = earlier[~(self.flown(earlier.points, earlier.noise) <= 0.0)]
        entries = Places(feet + np.where(entered, entry, 0.0)[:, None] * along, noise)
        return Lines(facet, across, entry, beyond, share, entries, before, begins, entered_at.flights)

    def left_out(self, fit: Fit, carried: Array, places: Places) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which points of the event lie on no line, and which on few lines of the estimate, both shape (n,).

        The line of the first enters later; that of the others is so heavy that few or none like it were drawn.

        Parameters
        ----------
        carried : ndarray, shape (facets,)
            Share of the estimate that a line of each half-space has for each unit of its weight.
        """
        facets = fit.facets
        cells = facets.cells(places.points)
        across = np.einsum("nij,ni->nj", facets.bases[cells], places.points)
        along = np.einsum("nd,nd->n", places.points, facets.directions[cells])
        entry = self.crossed(fit, cells, across, places.noise)[0].at
        entered = np.isfinite(entry)
        share = facets.shares(cells, facets.points(cells, across, np.where(entered, entry, 0.0)))
        weights = special.ndtr(-entry) * share * carried[cells] * fit.ratio(cells, across)
        late = entry > along + NEAR
        return np.asarray(late), np.asarray(~late & (weights > UNLIKELY))
