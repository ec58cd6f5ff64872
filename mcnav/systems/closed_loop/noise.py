"""Noise of a loop's samples by counter: generators keyed by seed and sample, one for each stream.

The streams are what enters the steps with the processes at the start, each sensor, and each correction, so that a
sensor more leaves the others' noise as it was. Samples have the same bits in any chunk and any worker.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray

PROCESSES: Final = 0x636C_0000
"""Stream of the processes: the highest word of the counter, apart from the streams of other systems."""

SENSORS: Final = PROCESSES + 0x1000
CORRECTIONS: Final = PROCESSES + 0x2000

BLOCK: Final = 256
"""Numbers that are drawn of a sample's stream at once."""


class Noise:
    """Standard normal variates of some samples, each stream in its own order; or shares of them, shape (n,)."""

    def __init__(self, seed: int, index: IndexArray, shares: Array | None = None) -> None:
        self._shares = shares
        self._keys = [np.array([seed, int(each)], dtype=np.uint64) for each in index]
        self._generators: dict[int, list[np.random.Generator]] = {}
        self._drawn: dict[int, Array] = {}

    def draw(self, stream: int, count: int) -> Array:
        """Draw the next numbers of a stream for every sample, shape (count, n)."""
        left = self._drawn.get(stream)
        if left is None or left.shape[1] < count:
            fresh = self._fresh(stream, max(count, BLOCK))
            left = fresh if left is None else np.concatenate([left, fresh], axis=1)
        self._drawn[stream] = left[:, count:]
        drawn = np.ascontiguousarray(left[:, :count].T)
        return drawn if self._shares is None else drawn * self._shares

    def _fresh(self, stream: int, count: int) -> Array:
        generators = self._generators.get(stream)
        if generators is None:
            words = np.array([0, 0, 0, stream], dtype=np.uint64)
            generators = [np.random.Generator(np.random.Philox(counter=words, key=key)) for key in self._keys]
            self._generators[stream] = generators
        fresh = np.empty((len(generators), count))
        for row, generator in zip(fresh, generators, strict=True):
            generator.standard_normal(out=row)
        return fresh


class NoNoise:
    """Zeros in place of `Noise`."""

    def __init__(self, count: int) -> None:
        self._count = count

    def draw(self, stream: int, count: int) -> Array:
        """Return zeros, shape (count, n)."""
        return np.zeros((count, self._count))
