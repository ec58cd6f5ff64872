"""Counter-based normal variates: the published words of the generator, moments, and independence of order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.compiled.vectors import LANES, room
from mcnav.sampler.normals import draw_for_samples, draw_normals, philox_words

ONES = 0xFFFFFFFF

KNOWN = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((ONES, ONES, ONES, ONES), (ONES, ONES), (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]
"""Counter, key and words of Philox4x32-10 as published with Random123 (Salmon et al. 2011)."""


def draw(seed: int, sample: int, count: int, stream: int = 1) -> Array:
    found = room(count)
    draw_normals(np.uint64(seed), np.full((1, LANES), sample, dtype=np.uint64), stream, 0, count, found)
    return found[:, 0]


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN)
def test_words_are_the_published_ones(counter: tuple[int, ...], key: tuple[int, ...], words: tuple[int, ...]) -> None:
    found = philox_words(np.array(counter, dtype=np.uint64), np.array(key, dtype=np.uint64))
    assert tuple(int(word) for word in found) == words


def test_variates_are_normal() -> None:
    """Kolmogorov's test at a false-alarm rate of 1e-4, and no correlation with the neighbour in order or in sample."""
    values = np.concatenate([draw(20261122, sample, 1_000) for sample in range(200)])
    assert stats.kstest(values, "norm").pvalue > 1e-4
    limit = float(stats.norm.isf(0.5e-4)) / np.sqrt(len(values))
    assert abs(np.mean(values[1:] * values[:-1])) < limit
    assert abs(np.mean(values[1_000:] * values[:-1_000])) < limit


def test_a_variate_depends_on_its_counter_alone() -> None:
    longer = draw(7, 2**40 + 3, 11)
    np.testing.assert_array_equal(draw(7, 2**40 + 3, 6), longer[:6])
    for other in (draw(8, 2**40 + 3, 11), draw(7, 2**40 + 4, 11), draw(7, 3, 11), draw(7, 2**40 + 3, 11, stream=2)):
        assert not np.any(other == longer)


def test_variates_are_those_of_box_and_muller() -> None:
    """Four of each block of words, by numpy's functions: within eight units of single precision of the radius.

    Some ten roundings, of half a unit each: of the logarithm, whose error the root halves, and of sine and cosine.
    """
    found, key = draw(7, 2**40 + 3, 2_000), np.array([7, 0], dtype=np.uint64)
    for block in range(500):
        counter = np.array([block, 0, 3, 2**8 ^ 2**16], dtype=np.uint64)  # the stream is 1
        a, b, c, d = (int(word) for word in philox_words(counter, key))
        for half, whole in enumerate((a << 32 | b, c << 32 | d)):
            radius = np.sqrt(-2.0 * np.log(((whole >> 24) + 0.5) * 2.0**-40))
            turns = (whole & 0xFFFFFF) * 2.0**-24
            expected = radius * np.array([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)])
            first = 4 * block + 2 * half
            np.testing.assert_allclose(found[first : first + 2], expected, rtol=0.0, atol=8.0 * 2.0**-23 * radius)


def test_variates_are_the_same_wherever_a_block_begins_and_in_every_lane() -> None:
    samples = np.arange(5, 5 + LANES, dtype=np.uint64).reshape(1, LANES)
    whole = room(40)
    draw_normals(np.uint64(7), samples, 3, 0, 40, whole)
    for first in range(8):
        for count in range(9):
            block = room(count + 1)
            draw_normals(np.uint64(7), samples, 3, first, count, block)
            np.testing.assert_array_equal(block[:count], whole[first : first + count])
            assert not block[count:].any()
    for lane in (0, LANES - 1):
        np.testing.assert_array_equal(whole[:, lane], draw(7, 5 + lane, 40, stream=3))


def test_variates_of_any_number_of_samples_are_those_of_their_lanes() -> None:
    samples = np.array([0, 7, 2**40, *range(100, 163)], dtype=np.uint64)
    drawn = draw_for_samples(1966, samples, 0x3001, 5, 70)
    for sample, column in zip(samples[[0, 2, 31, 32, 65]], drawn.T[[0, 2, 31, 32, 65]], strict=True):
        np.testing.assert_array_equal(column, draw(1966, int(sample), 75, 0x3001)[5:])
