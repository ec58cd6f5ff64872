"""Normal variates of numpy's generators, bit for bit, compiled: those of many samples at once, from any place on.

The words of a stream come from Philox4x64-10 (Salmon, Moraes, Dror and Shaw 2011), four from each value of its counter,
and normal variates from these by the ziggurat of 256 layers (Marsaglia and Tsang 2000), as in
``numpy.random.Generator(Philox(counter=[0, 0, 0, stream], key=[seed, sample])).standard_normal()``. What a generator
remembers is how many words it has used.

Everything that these functions contain is in this file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.compiled.jit import uncontracted

_FIRST: Final = np.uint64(0xD2E7470EE14C6C93)
_SECOND: Final = np.uint64(0xCA5A826395121157)
"""Multipliers of the rounds."""

_FIRST_KEY: Final = np.uint64(0x9E3779B97F4A7C15)
_SECOND_KEY: Final = np.uint64(0xBB67AE8584CAA73B)
"""Additions of a round to the key: the golden ratio, and the root of three less one."""

ROUNDS: Final = 10

_TAIL: Final = 3.6541528853610088
_INVERSE_TAIL: Final = 0.27366123732975828
"""Beginning of the lowest layer's tail, and its inverse."""

_AREA: Final = 0.004928673233974652
"""Area of a layer, as numpy has it."""

_HEIGHT_ROUNDED_UP: Final = 38
"""Layer whose height numpy has one unit of the last digit above the rounded one."""


def compute_layers() -> tuple[Array, NDArray[np.uint64], Array]:
    """Compute numpy's 256 layers of ``f(x) = exp(-x^2/2)``: widths x, thresholds k and heights f(x).

    From the tail inwards ``f(x_i) = A / x_{i+1} + f(x_{i+1})``, with the same area A for all. The threshold of a layer
    is the share ``x_{i-1} / x_i`` of it beneath the curve, times 2^52; widths are over 2^52. Layer 0 has the tail.
    Exponentials and logarithms are rounded from more digits, so that they do not depend on the platform's library.
    """
    edges, heights = [_TAIL], [_exponential(-0.5 * _TAIL * _TAIL)]
    for layer in range(254, 0, -1):
        edge = math.sqrt(-2.0 * float(Decimal(_AREA / edges[0] + heights[0]).ln()))
        height = _exponential(-0.5 * edge * edge)
        edges.insert(0, edge)
        heights.insert(0, math.nextafter(height, 1.0) if layer == _HEIGHT_ROUNDED_UP else height)
    base = _AREA / heights[-1]
    shares = [_TAIL / base, 0.0, *(inner / outer for inner, outer in pairwise(edges))]
    thresholds = np.array([round(share * 2.0**52) for share in shares], dtype=np.uint64)
    return np.array([base, *edges]) / 2.0**52, thresholds, np.array([1.0, *heights])


def _exponential(power: float) -> float:
    return float(Decimal(power).exp())


_WIDTHS, _INSIDE, _HEIGHTS = compute_layers()

_LAYER: Final = np.uint64(0xFF)
_MANTISSA: Final = np.uint64(0x000FFFFFFFFFFFFF)
_ONE: Final = np.uint64(1)
_EIGHT: Final = np.uint64(8)
_NINE: Final = np.uint64(9)
_ELEVEN: Final = np.uint64(11)
_UNIT: Final = 1.0 / 9007199254740992.0

SPARE: Final = 16
"""Variates of which one needs a second word, or less: words are computed many at once, and seldom twice."""


@intrinsic
def _upper_half(context: Any, one: Any, other: Any) -> Any:
    """Return the upper 64 bits of the product of two words."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        wide = _wide(given[0].type)
        product = builder.mul(*(builder.zext(each, wide) for each in given))
        return builder.trunc(builder.lshr(product, wide(64)), given[0].type)

    return types.uint64(types.uint64, types.uint64), generate


def _wide(word: Any) -> Any:
    return type(word)(128)


_upper: Callable[[np.uint64, np.uint64], np.uint64] = _upper_half  # a type checker takes the context for an argument


@uncontracted
def _compute_words(
    seed: np.uint64, sample: np.uint64, stream: np.uint64, first: int, words: NDArray[np.uint64]
) -> None:
    """Compute words from a value of the counter on, four from each."""
    for block in range(len(words) // 4):
        a, b, c, d = np.uint64(first + block), np.uint64(0), np.uint64(0), stream
        key, other = seed, sample
        for _ in range(ROUNDS):
            one, one_up = _FIRST * a, _upper(_FIRST, a)
            two, two_up = _SECOND * c, _upper(_SECOND, c)
            a, b, c, d = two_up ^ b ^ key, two, one_up ^ d ^ other, one
            key, other = key + _FIRST_KEY, other + _SECOND_KEY
        words[4 * block], words[4 * block + 1], words[4 * block + 2], words[4 * block + 3] = a, b, c, d


@uncontracted
def _draw(seed: np.uint64, samples: NDArray[np.uint64], stream: np.uint64, used: NDArray[np.int64], out: Array) -> None:
    size = 4 * ((out.shape[0] + out.shape[0] // SPARE + 8) // 4)
    words = np.empty(size, dtype=np.uint64)
    for s in range(len(samples)):
        begin = used[s] - used[s] % 4  # number of the first of the words at hand
        place = used[s] % 4
        _compute_words(seed, samples[s], stream, begin // 4 + 1, words)
        for row in range(out.shape[0]):
            while True:  # until a variate is accepted
                if place == size:
                    begin, place = begin + size, 0
                    _compute_words(seed, samples[s], stream, begin // 4 + 1, words)
                word = words[place]
                place += 1
                layer = np.int64(word & _LAYER)
                mantissa = (word >> _NINE) & _MANTISSA
                x = np.float64(mantissa) * _WIDTHS[layer]
                x = -x if (word >> _EIGHT) & _ONE else x
                if mantissa < _INSIDE[layer]:  # of a hundred 99
                    break
                accepted = False
                while True:  # a wedge needs one more number, a try of the tail two
                    if place == size:
                        begin, place = begin + size, 0
                        _compute_words(seed, samples[s], stream, begin // 4 + 1, words)
                    u = np.float64(words[place] >> _ELEVEN) * _UNIT
                    place += 1
                    if layer > 0:
                        height = (_HEIGHTS[layer - 1] - _HEIGHTS[layer]) * u + _HEIGHTS[layer]
                        accepted = height < np.exp(-0.5 * x * x)
                        break
                    if place == size:
                        begin, place = begin + size, 0
                        _compute_words(seed, samples[s], stream, begin // 4 + 1, words)
                    v = np.float64(words[place] >> _ELEVEN) * _UNIT
                    place += 1
                    beyond, height = -_INVERSE_TAIL * np.log1p(-u), -np.log1p(-v)
                    if height + height > beyond * beyond:
                        x = -(_TAIL + beyond) if (mantissa >> _EIGHT) & _ONE else _TAIL + beyond
                        accepted = True
                        break
                if accepted:
                    break
            out[row, s] = x
        used[s] = begin + place


def draw_normals(seed: int, samples: NDArray[np.uint64], stream: int, used: NDArray[np.int64], count: int) -> Array:
    """Draw the next normal variates of a stream for every sample, shape (count, n).

    Parameters
    ----------
    samples : ndarray of uint64, shape (n,)
    used : ndarray of int, shape (n,)
        Words of the stream that each sample has used; these variates' are added.
    """
    out = np.empty((count, len(samples)))
    if used.shape != samples.shape:
        raise ValueError(f"got {len(samples)} samples, and {used.shape} numbers of words")
    _draw(np.uint64(seed), np.ascontiguousarray(samples), np.uint64(stream), used, out)
    return out
