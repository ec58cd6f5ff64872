"""Noise of a loop's samples by counter: generators keyed by seed and sample, one for each stream.

The streams are what enters the steps with the processes at the start, each sensor, and each correction, so that a
sensor more leaves the others' noise as it was. Samples have the same bits in any chunk and any worker.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.systems.closed_loop.normals import draw_normals

PROCESSES: Final = 0x636C_0000
"""Stream of the processes: the highest word of the counter, apart from the streams of other systems."""

SENSORS: Final = PROCESSES + 0x1000
CORRECTIONS: Final = PROCESSES + 0x2000

BLOCK: Final = 256
"""Numbers that are drawn of a sample's stream at once."""


class Noise:
    """Standard normal variates of some samples, each stream in its own order; or shares of them, shape (n,)."""

    def __init__(self, seed: int, index: IndexArray, shares: Array | None = None) -> None:
        self._shares, self._seed, self._samples = shares, seed, np.asarray(index).astype(np.uint64)
        self._used: dict[int, NDArray[np.int64]] = {}
        self._drawn: dict[int, Array] = {}

    def draw(self, stream: int, count: int) -> Array:
        """Draw the next numbers of a stream for every sample, shape (count, n); they must not be changed."""
        left = self._drawn.get(stream)
        if left is None or len(left) < count:
            used = self._used.setdefault(stream, np.zeros(len(self._samples), dtype=np.int64))
            fresh = draw_normals(self._seed, self._samples, stream, used, max(count, BLOCK))
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
