"""Flights: outcomes of standard normals, and of noise that is known by its number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.limits import Limit

Outcomes = Callable[[Array, IndexArray], Array]
"""Function of standard normals, shape (n, d), and numbers of the noise, (n,), that returns outputs, (n, outputs)."""

NoisyMargins = Callable[[Array, IndexArray], Array]
"""The same, that returns how far they are beyond the limit, shape (n,)."""

Margins = Callable[[Array], Array]
"""Function of standard normals with noise of one number."""


@dataclass(frozen=True)
class Places:
    """Points in standard normals, shape (n, d), each with the number of its noise, shape (n,)."""

    points: Array
    noise: IndexArray

    def __getitem__(self, rows: NDArray[np.bool_] | IndexArray) -> Places:
        """Return some of them."""
        return Places(self.points[rows], self.noise[rows])

    def __len__(self) -> int:
        return len(self.points)

    def and_also(self, others: Places) -> Places:
        """Return these and others."""
        return Places(np.vstack([self.points, others.points]), np.concatenate([self.noise, others.noise]))


@dataclass
class Flown:
    """Flights with their number; ``failed`` counts those without a result."""

    fly: Outcomes
    limit: Limit
    flights: int = 0
    failed: int = 0
    noise: int = 0

    def __call__(self, points: Array, noise: IndexArray) -> Array:
        """Fly points, and return how far they are beyond the limit, shape (n,)."""
        margin = self.limit.margin(self.fly(points, noise))
        self.flights += len(points)
        self.failed += int(np.count_nonzero(np.isnan(margin)))
        return margin

    def new_noise(self, count: int) -> IndexArray:
        """Return numbers of noise that nothing has had before, shape (count,)."""
        self.noise += count
        return np.arange(self.noise - count, self.noise)

    def outcomes(self) -> Margins:
        """Return the outputs of points that are flown with the same new noise, as a function of points, (n, d)."""
        (number,) = self.new_noise(1)

        def fly(points: Array) -> Array:
            self.flights += len(points)
            return self.fly(points, np.full(len(points), number))

        return fly

    def with_noise(self, number: int) -> Margins:
        """Return the flights with noise of one number."""
        return partial(_with_noise, self, number)


def _with_noise(flown: Flown, number: int, points: Array) -> Array:
    return flown(points, np.full(len(points), number))
