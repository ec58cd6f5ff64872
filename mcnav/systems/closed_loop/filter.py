"""The navigator's error-state Kalman filter: F, Q and H from the loop's own linear system, gains, covariance.

Its states are f = T X: navigation errors x_hat - x of what it estimates, and minus the value of what it considers. With
S, which moves X by a state of the filter at a fixed truth, F = T A S, Q = sum believed^2 (T G) (T G)^T, H = -Y S, where
A and G are the derivatives of a map by X and by what enters, and Y those of an innovation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import suggestion
from mcnav.systems.closed_loop.declarations import Filter
from mcnav.systems.closed_loop.sizes import Sizes
from mcnav.systems.closed_loop.structure import Structure


@dataclass(frozen=True)
class FilterStates:
    """States of a filter: places in X of the estimates that it corrects, their counterparts, and what it considers."""

    estimates: NDArray[np.intp]
    counterparts: NDArray[np.intp]
    considered: NDArray[np.intp]
    size: int
    own_gains: bool

    @property
    def estimated(self) -> int:
        """States that are estimated; the first ones."""
        return len(self.estimates)

    @property
    def count(self) -> int:
        """All states."""
        return len(self.estimates) + len(self.considered)

    @cached_property
    def reading(self) -> Array:
        """T, shape (count, size)."""
        matrix = np.zeros((self.count, self.size))
        rows = np.arange(self.estimated)
        matrix[rows, self.estimates], matrix[rows, self.counterparts] = 1.0, -1.0
        matrix[self.estimated + np.arange(len(self.considered)), self.considered] = -1.0
        return matrix

    @cached_property
    def moving(self) -> Array:
        """S, shape (size, count)."""
        matrix = np.zeros((self.size, self.count))
        matrix[self.estimates, np.arange(self.estimated)] = 1.0
        matrix[self.considered, self.estimated + np.arange(len(self.considered))] = -1.0
        return matrix

    def of_errors(self, state: Array, entering: Array) -> tuple[Array, Array]:
        """Return F = T A S, shape (count, count, 1), and T G, shape (count, k, 1), of a map's derivatives A and G."""
        return (self.reading @ state @ self.moving)[:, :, None], (self.reading @ entering)[:, :, None]

    def start_covariance(self, structure: Structure, believed: Sizes) -> Array:
        """Compute the filter's covariance at the start, shape (count, count)."""
        moved = self.reading @ structure.start_partials
        processes = self.reading[:, structure.markov.whole]
        return np.asarray(moved @ believed.start @ moved.T + (processes * believed.markov_at_start**2) @ processes.T)

    def seen(self, x: Array, nominal: Array, structure: Structure) -> Array:
        """Return X as the navigator sees it, shape (size, n): its estimates for the truth, what it cannot know nominal.

        Parameters
        ----------
        nominal : ndarray, shape (size,)
        """
        result = x.copy()
        for block in (structure.truth, structure.parameters, structure.markov):
            result[block.whole] = nominal[block.whole, None]
        places, counterparts = structure.pairs
        result[counterparts] = x[places]
        return result


def read_filter(given: Any, name: str, structure: Structure) -> FilterStates | None:
    """Read the states of a filter; none without one. Raises `ScenarioError` when it names what there is not."""
    if given is None:
        return None
    if not isinstance(given, Filter):
        raise ScenarioError("type", f"{name}.filter must be a Filter of mcnav; got {given!r:.80}")
    if given.gains not in ("own", "nominal"):
        raise ScenarioError("type", f"{name}.filter: gains are 'own' or 'nominal'; got {given.gains!r:.40}")
    wanted = structure.estimate.names if given.estimates is None else tuple(given.estimates)
    known = (*structure.parameters.names, *structure.markov.names)
    for names, possible, what in (
        (wanted, structure.estimate.names, "estimates"), (tuple(given.considers), known, "considers"),
    ):  # fmt: skip
        for each in names:
            if each not in possible:
                raise ScenarioError("type", f"{name}.filter: {what} {each!r}{suggestion(str(each), possible)}")
    both = set(given.considers) & set(wanted)
    if both:
        raise ScenarioError("type", f"{name}.filter: {both.pop()} is estimated; it cannot be considered, too")
    places, counterparts = structure.pairs
    chosen = [
        number
        for quantity, place in structure.estimate.places()
        if quantity.name in wanted
        for number in range(place.start - structure.estimate.begin, place.stop - structure.estimate.begin)
    ]
    considered = [
        number
        for block in (structure.parameters, structure.markov)
        for quantity, place in block.places()
        if quantity.name in given.considers
        for number in range(place.start, place.stop)
    ]
    return FilterStates(
        places[chosen], counterparts[chosen], np.array(considered, dtype=np.intp), structure.size, given.gains == "own"
    )
