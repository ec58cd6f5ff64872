"""Skewness and kurtosis of one quantity, with errors that hold for the design that drew the samples."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.statistics.chunked import stretches
from mcnav.statistics.estimates import Estimate, block_sums


def skewness(values: Array, blocks: IndexArray, fewest: float = 2) -> Estimate:
    """Skewness ``mean(z^3)`` of the standardised values; zero without dispersion.

    Its error is the jackknife's, leaving out one independent block at a time: at a few hundred samples the influence
    function's own is too small.

    Parameters
    ----------
    values : ndarray, shape (n,)
    blocks : ndarray of int, shape (n,)
    fewest : float
        See `mcnav.statistics.estimates.blocked_mean`.
    """
    return skewness_and_kurtosis(values, blocks, fewest)[0]


def excess_kurtosis(values: Array, blocks: IndexArray, fewest: float = 2) -> Estimate:
    """Excess kurtosis ``mean(z^4) - 3``; zero without dispersion; error and parameters as those of `skewness`."""
    return skewness_and_kurtosis(values, blocks, fewest)[1]


def _skewness(m1: Array, m2: Array, m3: Array, m4: Array) -> Array:
    """Of raw moments."""
    variance = m2 - m1 * m1
    return np.asarray((m3 - 3.0 * m1 * m2 + 2.0 * m1 * m1 * m1) / (variance * np.sqrt(variance)))


def _excess_kurtosis(m1: Array, m2: Array, m3: Array, m4: Array) -> Array:
    """Of raw moments."""
    variance = m2 - m1 * m1
    return np.asarray((m4 - 4.0 * m1 * m3 + 3.0 * m1 * m1 * (2.0 * m2 - m1 * m1)) / (variance * variance) - 3.0)


_MEASURES: Final = (_skewness, _excess_kurtosis)


def skewness_and_kurtosis(values: Array, blocks: IndexArray, fewest: float = 2) -> tuple[Estimate, Estimate]:
    """Both at once, from one pass over the values; see `skewness` and `excess_kurtosis`."""
    centred = values - np.mean(values)
    sigma = float(np.sqrt(np.mean(centred**2)))
    if not sigma > 0.0:
        none = Estimate(0.0, 0.0, float(max(len(values) - 1, 0)))
        return none, none
    z = centred / sigma
    square = z * z
    sizes = block_sums(np.ones(len(z)), blocks)
    sums = np.empty((4, len(sizes)))
    for total, power in zip(sums, (z, square, square * z, square * square), strict=True):
        total[:] = block_sums(power, blocks)
    return _of_sums(sums, sizes, fewest)


def _of_sums(sums: Array, sizes: Array, fewest: float) -> tuple[Estimate, Estimate]:
    """From the blocks' sums of the first four powers, shape (4, blocks), and the numbers of their samples."""
    whole, count = sums.sum(axis=1), sizes.sum()
    number = sums.shape[1]
    values = [float(measure(*(whole / count))) for measure in _MEASURES]
    if number < max(2, fewest):
        return Estimate(values[0], float("inf"), 0.0), Estimate(values[1], float("inf"), 0.0)
    departures, squares = np.zeros(2), np.zeros(2)
    for part in stretches(number):
        left = (whole[:, None] - sums[:, part]) / (count - sizes[part])
        for i, measure in enumerate(_MEASURES):
            departure = measure(*left) - values[i]
            departures[i] += departure.sum()
            squares[i] += (departure * departure).sum()
    spread = np.maximum(squares - departures**2 / number, 0.0)
    errors = np.sqrt((number - 1.0) / number * spread)
    return Estimate(values[0], float(errors[0]), number - 1.0), Estimate(values[1], float(errors[1]), number - 1.0)


def shape_of_sums(sums: Array, sizes: Array, fewest: float = 2) -> tuple[Estimate, Estimate]:
    """As `skewness_and_kurtosis`, from the blocks' sums of the first four powers, shape (4, b), and their sizes."""
    mean, square = sums[:2].sum(axis=1) / sizes.sum()
    if not square - mean**2 > 0.0:
        none = Estimate(0.0, 0.0, float(max(sizes.sum() - 1.0, 0.0)))
        return none, none
    return _of_sums(sums, sizes, fewest)


def skewness_error_of_normal(count: int) -> float:
    """Standard deviation of the skewness of so many independent normal samples.

    ``6 (n - 2) / ((n + 1) (n + 3))`` is its variance, exactly (Fisher, 1930).
    """
    return math.sqrt(6.0 * (count - 2.0) / ((count + 1.0) * (count + 3.0)))


def kurtosis_error_of_normal(count: int) -> float:
    """Standard deviation of the kurtosis of so many independent normal samples.

    ``24 n (n - 2) (n - 3) / ((n + 1)^2 (n + 3) (n + 5))`` is its variance, exactly (Fisher, 1930).
    """
    n = float(count)
    return math.sqrt(24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0)))
