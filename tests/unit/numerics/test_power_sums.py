"""Sums of powers: those of plain arrays bit for bit, added up as they come, without a copy of the histories."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.contract.power_sums import sums_of
from mcnav.numerics.power_sums import sum_powers, sum_powers_about_zero


def plain_sums(histories: Array, pivot: Array) -> Array:
    """Sum powers by arrays of all products."""
    away = histories - pivot
    rows, columns = np.triu_indices(pivot.shape[1])
    powers = (away, away[:, :, rows] * away[:, :, columns], away * away * away, (away * away) * (away * away))
    return np.concatenate([power.sum(axis=0) for power in powers], axis=1)


@pytest.mark.parametrize(("samples", "epochs", "outputs"), [(100, 61, 9), (7, 3, 1), (1, 1, 4), (0, 5, 2)])
def test_same_bits_as_plain_arrays(samples: int, epochs: int, outputs: int) -> None:
    generator = np.random.default_rng(1)
    histories, pivot = generator.normal(size=(samples, epochs, outputs)), generator.normal(size=(epochs, outputs))
    found = sum_powers(histories, pivot)
    assert found.count == samples
    assert found.sums.shape == (epochs, sums_of(outputs))
    np.testing.assert_array_equal(found.sums, plain_sums(histories, pivot))


def test_samples_that_are_not_known_throughout_count_for_nothing() -> None:
    histories = np.random.default_rng(2).normal(size=(10, 4, 2))
    histories[3, 1, 0], histories[7, 2, 1] = np.nan, np.inf
    found = sum_powers_about_zero(histories)
    assert found.count == 8
    np.testing.assert_array_equal(found.sums, plain_sums(np.delete(histories, (3, 7), axis=0), np.zeros((4, 2))))


def test_nothing_of_the_histories_is_held_twice() -> None:
    """Products of all outputs would take several times the memory of the histories, in each thread of a run."""
    histories = np.ones((2_000, 61, 9))
    sum_powers_about_zero(histories[:1])  # compiled
    tracemalloc.start()
    try:
        sum_powers_about_zero(histories)
        assert tracemalloc.get_traced_memory()[1] < histories.nbytes / 4
    finally:
        tracemalloc.stop()
