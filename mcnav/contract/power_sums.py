"""Sums of powers of errors at many epochs: what chunks of samples add up to the moments of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array


def sums_of(outputs: int) -> int:
    """Count the sums of an epoch: of first, second (upper triangle by rows), third and fourth powers.

    >>> sums_of(4)
    22
    """
    return 3 * outputs + outputs * (outputs + 1) // 2


@dataclass(frozen=True)
class PowerSums:
    """Sums of powers of samples' errors about a pivot, at every epoch; those of chunks add up.

    Attributes
    ----------
    pivot : ndarray, shape (m, k)
        The errors of a perfect system. The mean lies within a sigma or so of it, so that central moments lose no
        more than a digit.
    sums : ndarray, shape (m, sums_of(k))
    """

    count: int
    pivot: Array
    sums: Array

    def __add__(self, other: PowerSums) -> PowerSums:
        return PowerSums(self.count + other.count, self.pivot, self.sums + other.sums)

    @property
    def mean(self) -> Array:
        """Mean error, shape (m, k)."""
        return np.asarray(self.pivot + self._offset)

    @property
    def covariance(self) -> Array:
        """Second central co-moments over count - 1, shape (m, k, k)."""
        offset = self._offset
        central = self._second - self.count * offset[:, :, None] * offset[:, None, :]
        return np.asarray(central / (self.count - 1))

    @property
    def mean_powers(self) -> tuple[Array, Array]:
        """Mean second and fourth powers about the pivot, each of shape (m, k)."""
        return self._squares, np.asarray(self.sums[:, -self._outputs :] / self.count)

    @property
    def third(self) -> Array:
        """Mean third power about the mean, shape (m, k)."""
        offset, second = self._offset, self._squares
        return np.asarray(self._cubes - 3.0 * offset * second + 2.0 * offset**3)

    @property
    def fourth(self) -> Array:
        """Mean fourth power about the mean, shape (m, k)."""
        offset, second = self._offset, self._squares
        fourth = self.mean_powers[1]
        return np.asarray(fourth - 4.0 * offset * self._cubes + 6.0 * offset**2 * second - 3.0 * offset**4)

    @property
    def _outputs(self) -> int:
        return int(self.pivot.shape[1])

    @property
    def _offset(self) -> Array:
        return np.asarray(self.sums[:, : self._outputs] / self.count)

    @property
    def _second(self) -> Array:
        outputs = self._outputs
        full = np.empty((len(self.sums), outputs, outputs))
        rows, columns = np.triu_indices(outputs)
        full[:, rows, columns] = full[:, columns, rows] = self.sums[:, outputs : -2 * outputs]
        return full

    @property
    def _squares(self) -> Array:
        outputs = self._outputs
        return np.asarray(self._second[:, range(outputs), range(outputs)] / self.count)

    @property
    def _cubes(self) -> Array:
        return np.asarray(self.sums[:, -2 * self._outputs : -self._outputs] / self.count)
