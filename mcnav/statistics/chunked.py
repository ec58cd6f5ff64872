"""Sums over many samples, a stretch at a time: intermediate arrays stay in the processor's cache."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.whitening import Whitening

STRETCH: Final = 32_768
"""Samples of a stretch; ten columns take 2.6 MB."""

MOST_NUMBERS: Final = 4_194_304
"""Numbers of a stretch with many columns, 34 MB."""


def stretches(samples: int) -> Iterator[slice]:
    """Slice samples into stretches of `STRETCH`, in order."""
    return (slice(begin, begin + STRETCH) for begin in range(0, samples, STRETCH))


def stretches_of_blocks(begins: IndexArray, samples: int, columns: int = 1) -> Iterator[tuple[slice, slice]]:
    """Slice samples into stretches of whole blocks, of about `STRETCH` samples each, in order.

    With many columns they have about `MOST_NUMBERS` numbers. The blocks are given by the first sample of each; yields
    the samples and the blocks of each stretch.

    >>> [(rows.stop, own.stop) for rows, own in stretches_of_blocks(np.array([0, 30_000, 60_000]), 90_000)]
    [(30000, 1), (60000, 2), (90000, 3)]
    """
    ends, length = np.append(begins[1:], samples), min(STRETCH, MOST_NUMBERS // columns)
    first = 0
    while first < len(begins):
        last = max(int(np.searchsorted(ends, begins[first] + length, side="right")), first + 1)
        yield slice(int(begins[first]), int(ends[last - 1])), slice(first, last)
        first = last


def scatter(values: Array) -> Array:
    """Sum the products about the mean, ``sum (x - m)(x - m)^T``, shape (k, k), of samples of shape (n, k)."""
    mean = values.mean(axis=0)
    total = np.zeros((values.shape[1], values.shape[1]))
    for stretch in stretches(len(values)):
        centred = values[stretch] - mean
        total += centred.T @ centred
    return total


def squared_distances(values: Array, centre: Array, given: Whitening) -> Array:
    """Compute squared distances from a centre in whitened coordinates, shape (n,), of samples of shape (n, k)."""
    distances = np.empty(len(values))
    for stretch in stretches(len(values)):
        distances[stretch] = np.sum((given.matrix.T @ (values[stretch] - centre).T) ** 2, axis=0)
    return distances


@dataclass
class RunningScatter:
    """Number, mean and scatter of observations that are added in parts (Chan, Golub and LeVeque, 1983).

    The scatter is ``sum (x - m)(x - m)^T``, shape (k, k).
    """

    count: int = 0
    mean: Array = field(default_factory=lambda: np.zeros(1))
    scatter: Array = field(default_factory=lambda: np.zeros((1, 1)))

    def add(self, values: Array) -> None:
        """Add observations, shape (k, n)."""
        number, mean = values.shape[1], values.mean(axis=1)
        centred = values - mean[:, None]
        away, whole = mean - self.mean, self.count + number
        self.scatter = self.scatter + centred @ centred.T + np.outer(away, away) * (self.count * number / whole)
        self.mean = self.mean + away * (number / whole)
        self.count = whole
