"""Skewness and kurtosis of one quantity, with standard errors that hold for the sampling design."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.chunked import stretches
from mcnav.statistics.estimates import Estimate


def _skewness(m1: Array, m2: Array, m3: Array, m4: Array) -> Array:
    """Compute the skewness from raw moments."""
    variance = m2 - m1 * m1
    return np.asarray((m3 - 3.0 * m1 * m2 + 2.0 * m1 * m1 * m1) / (variance * np.sqrt(variance)))


def _excess_kurtosis(m1: Array, m2: Array, m3: Array, m4: Array) -> Array:
    """Compute the excess kurtosis from raw moments."""
    variance = m2 - m1 * m1
    return np.asarray((m4 - 4.0 * m1 * m3 + 3.0 * m1 * m1 * (2.0 * m2 - m1 * m1)) / (variance * variance) - 3.0)


_MEASURES: Final = (_skewness, _excess_kurtosis)


def power_sums(values: Array, begins: IndexArray) -> Array:
    """Sum the first four powers of the standardised values over blocks, shape (4, blocks)."""
    centred = values - np.mean(values)
    sigma = float(np.sqrt(np.mean(centred**2)))
    z = centred / sigma if sigma > 0.0 else centred
    square = z * z
    sums = np.empty((4, len(begins)))
    for total, power in zip(sums, (z, square, square * z, square * square), strict=True):
        total[:] = power if len(begins) == len(values) else np.add.reduceat(power, begins)
    return sums


def shape_of_sums(sums: Array, counts: Array, fewest: float = 2) -> tuple[Estimate, Estimate]:
    """Estimate skewness and excess kurtosis from block sums of powers; zero without dispersion.

    The errors are the jackknife's, leaving out one block at a time: at a few hundred samples those of the influence
    function are too small. They are infinite with fewer than ``fewest`` blocks, and where all dispersion is in one. The
    sums have shape (4, blocks) and any
    origin and unit; ``counts`` are the samples in each block, shape (blocks,).
    """
    whole, count, number = sums.sum(axis=1), counts.sum(), sums.shape[1]
    if not whole[1] / count - (whole[0] / count) ** 2 > 0.0:
        constant = Estimate(0.0, 0.0, float(max(count - 1.0, 0.0)))
        return constant, constant
    values = [float(measure(*(whole / count))) for measure in _MEASURES]
    if number < max(2, fewest):
        return Estimate(values[0], float("inf"), 0.0), Estimate(values[1], float("inf"), 0.0)
    departures, squares = np.zeros(2), np.zeros(2)
    for stretch in stretches(number):
        left = (whole[:, None] - sums[:, stretch]) / (count - counts[stretch])
        for i, measure in enumerate(_MEASURES):
            with np.errstate(divide="ignore", invalid="ignore"):  # without one block there may be no dispersion
                departure = measure(*left) - values[i]
            departures[i] += departure.sum()
            squares[i] += (departure * departure).sum()
    if not np.isfinite(squares).all():
        return Estimate(values[0], float("inf"), 0.0), Estimate(values[1], float("inf"), 0.0)
    spread = np.maximum(squares - departures**2 / number, 0.0)
    errors = np.sqrt((number - 1.0) / number * spread)
    return Estimate(values[0], float(errors[0]), number - 1.0), Estimate(values[1], float(errors[1]), number - 1.0)
