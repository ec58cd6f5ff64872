"""Noise of a process in transitions of a timeline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.products import sum_of_transforms
from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class Noise:
    """Noise of a process in some transitions of a block, shape (k,) of them.

    Attributes
    ----------
    places : ndarray of int, shape (k,)
        The transitions, rising.
    rows : ndarray of int, shape (r,)
        What it is added to.
    covariance, factor : ndarray, shapes (k, r, r), (k, r, c)
        Either of both, as in `mcnav.contract.timeline.StepNoise`.
    size : float
        By which its covariance is multiplied.
    """

    places: IndexArray
    rows: IndexArray
    covariance: Array | None
    factor: Array | None
    size: float = 1.0

    def between(self, first: int, last: int) -> Noise:
        """Return that of the transitions from the first to before the last, counted from the first."""
        begin, end = np.searchsorted(self.places, (first, last))
        return Noise(
            self.places[begin:end] - first,
            self.rows,
            None if self.covariance is None else self.covariance[begin:end],
            None if self.factor is None else self.factor[begin:end],
            self.size,
        )

    def through(self, weights: Array) -> Array:
        """Compute ``sum_k Z_k Q_k Z_k'``, shape (o, o), with weights Z by transition, shape (transitions, o, n)."""
        chosen = weights.transpose(1, 0, 2)[:, self.places[:, None], self.rows]
        return self.size * sum_of_transforms(chosen, self.covariance, self.factor)
