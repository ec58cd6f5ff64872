"""Scrambled Sobol nets: the points of `scipy.stats.qmc.Sobol`, without the import of `scipy.stats` (half a second).

A net is a linear map of the bits of a point's number: the direction numbers of Joe and Kuo (2008), which scipy brings
along as a table, times a random lower triangular matrix (Matousek, 1998), and a random digital shift.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy
from numpy.typing import NDArray

from mcnav.arrays.types import Array

_DIRECTIONS: Final = Path(scipy.__file__).parent / "stats" / "_sobol_direction_numbers.npz"

Bits = NDArray[np.unsignedinteger[Any]]


def scrambled_net(generator: np.random.Generator, dimensions: int, begin: int, end: int, bits: int = 30) -> Array:
    """Draw points [begin, end) of a scrambled net, shape (end - begin, dimensions), in [0, 1).

    Parameters
    ----------
    generator : numpy.random.Generator
        Spawns the generator of the scrambling.
    bits : int
        Binary digits of a coordinate, at most 64; a net has 2**bits points.
    """
    (stream,) = generator.spawn(1)
    word: Any = np.uint32 if bits <= 32 else np.uint64
    places = np.arange(bits, dtype=word)
    shift = stream.integers(2, size=(dimensions, bits), dtype=word) @ (word(1) << places)
    mixing = np.tril(stream.integers(2, size=(dimensions, bits, bits), dtype=word))
    mixing[:, places, places] = 1
    count = max(1, (end - 1).bit_length())
    aligned = _directions(dimensions, count).astype(word) << places[::-1][:count]
    digits = aligned[:, :, None] >> places[::-1] & word(1)  # highest first
    mixed = (digits.astype(float) @ mixing.astype(float).swapaxes(1, 2)).astype(word) & word(1)
    columns = (mixed << places[::-1]).sum(axis=2, dtype=word).T
    # Gray code: from one point to the next a single digit changes, that of the lowest one of the number
    numbers = np.arange(begin + 1, end)
    lowest = np.log2(numbers & -numbers).astype(int)
    gray = begin ^ begin >> 1
    first = shift.copy()
    for k in range(gray.bit_length()):
        first ^= columns[k] * word(gray >> k & 1)
    steps = np.concatenate([first[None], columns[lowest]])
    return np.asarray(np.bitwise_xor.accumulate(steps, axis=0) * (1.0 / 2**bits))


@cache
def _directions(dimensions: int, count: int) -> Bits:
    """Compute the first direction numbers of each dimension, shape (dimensions, count); number k has k + 1 digits."""
    with np.load(_DIRECTIONS) as table:
        polynomials, starts = table["poly"][:dimensions].tolist(), table["vinit"][:dimensions].tolist()
    bits = np.ones((dimensions, count), dtype=np.uint64)
    for row, polynomial, start in zip(bits[1:], polynomials[1:], starts[1:], strict=True):
        degree = polynomial.bit_length() - 1
        numbers = start[:degree]
        for k in range(degree, count):
            number = numbers[k - degree]
            for back in range(1, degree + 1):
                number ^= (numbers[k - back] << back) * (polynomial >> degree - back & 1)
            numbers.append(number)
        row[:] = numbers[:count]
    return bits
