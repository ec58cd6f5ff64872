"""Normal variates by counter: any of them is computed from its seed, sample, stream and number alone.

The counter-based generator is Philox4x32-10 (Salmon, Moraes, Dror and Shaw 2011), and a pair of its 64 bits makes two
normal variates by the transformation of Box and Muller.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.physics.jit import compiled, inlined

_LOW: Final = np.uint64(0xFFFFFFFF)
_HALF: Final = np.uint64(32)
_FIRST: Final = np.uint64(0xD2511F53)
_SECOND: Final = np.uint64(0xCD9E8D57)
_FIRST_KEY: Final = np.uint64(0x9E3779B9)
_SECOND_KEY: Final = np.uint64(0xBB67AE85)
_MANTISSA: Final = np.uint64(11)
_UNIT: Final = 2.0**-53

IMU_STREAM: Final = 1
"""Stream of the instruments' processes."""


@inlined
def philox(
    a: np.uint64, b: np.uint64, c: np.uint64, d: np.uint64, first: np.uint64, second: np.uint64
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Compute four words of 32 bits from a counter of four words and a key of two."""
    for _ in range(10):
        one, two = _FIRST * a, _SECOND * c
        a, b, c, d = (two >> _HALF) ^ b ^ first, two & _LOW, (one >> _HALF) ^ d ^ second, one & _LOW
        first, second = (first + _FIRST_KEY) & _LOW, (second + _SECOND_KEY) & _LOW
    return a, b, c, d


@compiled
def draw_normals(seed: np.uint64, sample: np.uint64, stream: int, out: Array) -> None:
    """Fill an array with the first normal variates of a sample's stream."""
    key, index = np.uint64(seed), np.uint64(sample)
    first, second = key & _LOW, key >> _HALF
    low, high = index & _LOW, (index >> _HALF) ^ (np.uint64(stream) << np.uint64(16))
    pairs = (len(out) + 1) // 2
    for pair in range(pairs):
        number = np.uint64(pair)
        a, b, c, d = philox(number & _LOW, number >> _HALF, low, high, first, second)
        radius = np.sqrt(-2.0 * np.log((((a << _HALF | b) >> _MANTISSA) + np.uint64(1)) * _UNIT))
        angle = 2.0 * np.pi * (((c << _HALF | d) >> _MANTISSA) * _UNIT)
        out[2 * pair] = radius * np.cos(angle)
        if 2 * pair + 1 < len(out):
            out[2 * pair + 1] = radius * np.sin(angle)


@compiled
def philox_words(counter: NDArray[np.uint64], key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Compute the words of one counter, shape (4,), and key, shape (2,)."""
    return np.array(philox(counter[0], counter[1], counter[2], counter[3], key[0], key[1]))
