"""Noise of a loop's samples by counter: normal variates by seed, sample and stream (`mcnav.sampler.normals`).

The streams are what enters the steps with the processes at the start, each sensor, and each correction, so that a
sensor more leaves the others' noise as it was. Samples have the same bits in any chunk and any worker.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.normals import draw_for_samples

PROCESSES: Final = 0x1000
SENSORS: Final = 0x2000
CORRECTIONS: Final = 0x3000
"""Streams of the processes, of the first sensor and of the first correction; those of the others follow."""

BLOCK: Final = 256
"""Numbers that are drawn of a sample's stream at once."""


class Noise:
    """Standard normal variates of some samples, each stream in its own order; or shares of them, shape (n,)."""

    def __init__(self, seed: int, index: IndexArray, shares: Array | None = None) -> None:
        self._shares, self._seed, self._samples = shares, seed, np.asarray(index).astype(np.uint64)
        self._reached: dict[int, int] = {}
        self._drawn: dict[int, Array] = {}

    def draw(self, stream: int, count: int) -> Array:
        """Draw the next numbers of a stream for every sample, shape (count, n); they must not be changed."""
        left = self._drawn.get(stream)
        if left is None or len(left) < count:
            first, more = self._reached.get(stream, 0), max(count, BLOCK)
            fresh = draw_for_samples(self._seed, self._samples, stream, first, more)
            self._reached[stream] = first + more
            left = fresh if left is None or not len(left) else np.concatenate([left, fresh])
        self._drawn[stream] = left[count:]
        return left[:count] if self._shares is None else left[:count] * self._shares


class NoNoise:
    """Zeros in place of `Noise`."""

    def __init__(self, count: int) -> None:
        self._count = count

    def draw(self, stream: int, count: int) -> Array:
        """Return zeros, shape (count, n)."""
        return np.zeros((count, self._count))
