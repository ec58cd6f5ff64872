"""Normal variates by counter: any of them is computed from its seed, sample, stream and number alone.

The counter-based generator is Philox4x32-10 (Salmon, Moraes, Dror and Shaw 2011). By the transformation of Box and
Muller each half of its 128 bits makes two normal variates: 40 bits their radius, which is at most 7.54 and would exceed
this once in 2e12 pairs, and 24 bits their direction. They are computed in single precision, to 1e-6 of the radius.
"""

from __future__ import annotations

from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, inlined, uncontracted, uncontracted_subroutine
from mcnav.compiled.vectors import LANES, Vector, bits, doubles, fma, load, narrow, room, store, widen

_LOW: Final = np.uint64(0xFFFFFFFF)
_HALF: Final = np.uint64(32)
_FIRST: Final = np.uint64(0xD2511F53)
_SECOND: Final = np.uint64(0xCD9E8D57)
_FIRST_KEY: Final = np.uint64(0x9E3779B9)
_SECOND_KEY: Final = np.uint64(0xBB67AE85)
_DIRECTION: Final = np.uint64(0xFFFFFF)
"""Bits of a word that make a direction; the others of the word belong to the radius."""

_TO_TOP: Final = np.uint64(20)
_TO_BELOW: Final = np.uint64(12)
_TO_TURNS: Final = np.uint64(28)
"""Places from a word to the top of a mantissa, to what is below a word there, and from a direction to the top."""

_BELOW: Final = np.uint64(0xFF000)
_MIDDLE: Final = np.uint64(0x800)
"""Bits of the mantissa below the first word's, and half of the last of them."""

_ONE: Final = np.uint64(0x3FF0000000000000)
"""Bits of 1.0; with a mantissa, of a number from 1 to 2."""

_HALF_ROOT: Final = np.uint64(0x3FE6A09E667F3BCD)
"""Bits of the square root of a half."""

_FRACTION: Final = np.uint64(0x000FFFFFFFFFFFFF)
_PLACES: Final = np.uint64(52)
_INTEGER: Final = np.uint64(0x4330000000000000)
"""Bits of 2^52; with an integer in the mantissa, of their sum."""

_OFFSET: Final = 2.0**52 + 1023.0
"""Excess of the bits of an exponent, as a mantissa of 2^52, over the exponent."""

_LN2: Final = float(np.log(2.0))


@inlined
def philox(
    a: np.uint64, b: np.uint64, c: np.uint64, d: np.uint64, first: np.uint64, second: np.uint64
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Compute four words of 32 bits from a counter of four words and a key of two."""
    # of what stands above the 32 bits of a word nothing is used
    # ten rounds: two products of 32 bits, whose halves and the key are mixed
    for _ in range(10):
        one, two = _FIRST * (a & _LOW), _SECOND * (c & _LOW)
        a, b, c, d = (two >> _HALF) ^ b ^ first, two, (one >> _HALF) ^ d ^ second, one
        first, second = first + _FIRST_KEY, second + _SECOND_KEY
    return a & _LOW, b & _LOW, c & _LOW, d & _LOW


_ARTANH: Final = tuple(1 / (2 * n + 1) for n in range(5))
_SINE: Final = tuple((-1) ** n / factorial(2 * n + 1) for n in range(6))
_COSINE: Final = tuple((-1) ** n / factorial(2 * n) for n in range(7))
"""Coefficients of Taylor series in the square: of artanh(x) / x, sin(x) / x and cos(x)."""


@inlined
def _series(z: Vector, coefficients: tuple[float, ...]) -> Vector:
    """Sum a power series."""
    total = 0.0 * z + coefficients[-1]
    for n in range(len(coefficients) - 2, -1, -1):
        total = fma(total, z, coefficients[n])
    return total


@inlined
def _log(u: Vector) -> Vector:
    """Compute the natural logarithm of doubles in (0, 1) in single precision.

    With ``u = m 2^e`` and m between 1 / sqrt(2) and sqrt(2), ``log(m) = 2 artanh((m - 1) / (m + 1))``.
    """
    shifted = bits(u) + (_ONE - _HALF_ROOT)
    mantissa = doubles((shifted & _FRACTION) + _HALF_ROOT)
    exponent = narrow(doubles((shifted >> _PLACES) | _INTEGER) - _OFFSET)
    above = narrow(mantissa - 1.0)
    f = above / (above + 2.0)
    return fma(exponent, _LN2, (f + f) * _series(f * f, _ARTANH))


@inlined
def _circle(t: Vector) -> tuple[Vector, Vector]:
    """Compute cosine and sine of t turns, t in [0, 1), in single precision: by those of half of the angle less pi."""
    a = np.pi * (t - 0.5)
    z = a * a
    sine, cosine = a * _series(z, _SINE), _series(z, _COSINE)
    twice = sine + sine
    return fma(twice, sine, -1.0), -twice * cosine


@inlined
def _pair(one: Vector, other: Vector) -> tuple[Vector, Vector]:
    """Compute two normal variates from two words."""
    # 40 bits as a number in (0, 1), 24 as a direction; radius sqrt(-2 log u)
    uniform = doubles(one << _TO_TOP | (other >> _TO_BELOW & _BELOW) | _MIDDLE | _ONE) - 1.0
    radius = np.sqrt(-2.0 * _log(uniform))
    cosine, sine = _circle(narrow(doubles((other & _DIRECTION) << _TO_TURNS | _ONE) - 1.0))
    return widen(radius * cosine), widen(radius * sine)


@uncontracted_subroutine
def draw_normals(seed: np.uint64, samples: NDArray[np.uint64], stream: int, first: int, count: int, out: Array) -> None:
    """Draw normal variates of LANES samples.

    Parameters
    ----------
    samples : ndarray of uint64, shape (1, LANES)
    first, count : int
        Number of the first of a stream's variates, and how many.
    out : ndarray, shape (count, LANES)
        Or more rows.
    """
    key, index = np.uint64(seed), load(samples, 0)
    low, high = index & _LOW, (index >> _HALF) ^ (np.uint64(stream) << np.uint64(16))
    for block in range(first // 4, (first + count + 3) // 4):
        # four variates of one counter: its lower words count, its upper ones are sample and stream
        number = np.uint64(block)
        a, b, c, d = philox(number & _LOW, number >> _HALF, low, high, key & _LOW, key >> _HALF)
        row = 4 * block - first
        x, y = _pair(a, b)
        if row >= 0:
            store(out, row, x)
        if row + 1 >= 0 and row + 1 < count:
            store(out, row + 1, y)
        x, y = _pair(c, d)
        if row + 2 >= 0 and row + 2 < count:
            store(out, row + 2, x)
        if row + 3 < count:
            store(out, row + 3, y)


def draw_for_samples(seed: int, samples: NDArray[np.uint64], stream: int, first: int, count: int) -> Array:
    """Draw normal variates of any number of samples, shape (count, n): those of `draw_normals`.

    Parameters
    ----------
    samples : ndarray of uint64, shape (n,)
        Indices of the samples, below 2^48.
    stream : int
        Below 2^16.
    first, count : int
        Number of the first of a stream's variates, and how many.
    """
    drawn = np.empty((count, len(samples)))
    _fill(np.uint64(seed), samples, stream, first, np.zeros((1, LANES), dtype=np.uint64), room(count), drawn)
    return drawn


@uncontracted
def _fill(
    seed: np.uint64,
    samples: NDArray[np.uint64],
    stream: int,
    first: int,
    indices: NDArray[np.uint64],
    lanes: Array,
    drawn: Array,
) -> None:
    """Draw variates of LANES samples at a time; the last ones repeat a sample."""
    for begin in range(0, len(samples), LANES):
        size = min(LANES, len(samples) - begin)
        for lane in range(LANES):
            indices[0, lane] = samples[begin + min(lane, size - 1)]
        draw_normals(seed, indices, stream, first, len(drawn), lanes)
        for row in range(len(drawn)):
            for lane in range(size):
                drawn[row, begin + lane] = lanes[row, lane]


@compiled
def philox_words(counter: NDArray[np.uint64], key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Compute the words of one counter, shape (4,), and key, shape (2,)."""
    return np.array(philox(counter[0], counter[1], counter[2], counter[3], key[0], key[1]))
