"""Test of a linear trend of the readings: what −2 log L gains by one, and how often it gains as much without.

The cosine transform of a ramp is known, so that its slope is a weighted mean of the lowest coefficients, and the model
is fitted anew to what is left. Where few ordinates decide on the variance of the lowest ones, the gain has no known
law: records are simulated from the fitted model, and each is fitted with and without a trend in the same way, until ten
of them gain as much as the record does (Besag and Clifford 1991). Such p-values are those of a Monte Carlo test of the
fitted model, however few the ordinates.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import t as student

from mcnav.arrays.types import Array
from mcnav.identification.likelihood import Maximum, information, maximize_many
from mcnav.identification.processes import Model
from mcnav.identification.spectrum import Bands, Record

CLEAR: Final = 0.2
"""P-value by Student's t from which nothing is simulated: it errs to the small side."""

ENOUGH: Final = 10
NEAR: Final = 1e-4
"""Decrement of −2 log L at which a maximum is reached."""

MOST: Final = 499
"""Records are simulated until so many gain as much, and at most so many."""

AT_ONCE: Final = 50
"""Records that are simulated and fitted at once."""

HOPELESS: Final = 1e-6
"""P-value by Student's t below which nothing is simulated, either: no error of it saves the model."""


def ramp_coefficients(count: int, interval: float, kept: int) -> Array:
    """Compute the first coefficients of the cosine transform of 0, 1, 2 … intervals, shape (kept,).

    ``−√(2/n) cos(ω/2) / (2 sin²(ω/2))`` times the interval for odd j, zero for even j.
    """
    order = np.arange(1.0, kept + 1.0)
    half = 0.5 * np.pi * order / count
    odd = -np.sqrt(2.0 / count) * np.cos(half) / (2.0 * np.sin(half) ** 2)
    return np.where(order % 2 == 1, odd * interval, 0.0)


def trend_p_value(model: Model, bands: Bands, best: Maximum, record: Record) -> tuple[float, float]:
    """Compute the p-value of a linear trend, and its slope per second.

    Parameters
    ----------
    bands, best : Bands, Maximum
        Of the record, and the model's maximum.
    """
    ramp = ramp_coefficients(record.count, record.interval, len(record.lowest))
    start = np.array([best.deviance]), best.logs[None]
    gains, slopes = _gains(model, bands, bands.sums[None], *start, record.lowest[None], ramp)
    gain, slope = float(gains[0]), float(slopes[0])
    quick = _quick_p_value(model, bands, best, gain)
    if not HOPELESS < quick < CLEAR:
        return quick, slope
    generator = np.random.default_rng(0)
    variances, _ = model.variances(bands.grid, best.logs)
    simulated, as_large = 0, 0
    while simulated < MOST:
        count = min(AT_ONCE, MOST - simulated)
        low, sums = _simulate(generator, variances, bands.numbers, len(ramp), count)
        logs = np.repeat(best.logs[None], count, axis=0)
        logs, deviances = maximize_many(model, bands.grid, bands.numbers, sums, logs, converged=NEAR)
        larger = np.cumsum(_gains(model, bands, sums, deviances, logs, low, ramp)[0] >= gain)
        if as_large + larger[-1] >= ENOUGH:
            simulated += 1 + int(np.searchsorted(larger, ENOUGH - as_large))
            return max(ENOUGH / simulated, quick), slope
        simulated, as_large = simulated + count, as_large + int(larger[-1])
    return max((as_large + 1.0) / (MOST + 1.0), quick), slope


def _simulate(
    generator: np.random.Generator, variances: Array, numbers: Array, kept: int, count: int
) -> tuple[Array, Array]:
    """Draw records: their lowest coefficients, shape (count, kept), and sums of the bands, shape (count, m)."""
    low, sums = np.empty((count, kept)), np.empty((count, len(numbers)))
    for number in range(count):
        low[number] = np.sqrt(variances[:kept]) * generator.standard_normal(kept)
        sums[number] = variances * generator.gamma(0.5 * numbers, 2.0)
    sums[:, :kept] = low**2
    return low, sums


def _gains(
    model: Model, bands: Bands, sums: Array, deviances: Array, logs: Array, coefficients: Array, ramp: Array
) -> tuple[Array, Array]:
    """Compute what −2 log L of records gains by a trend, and its slopes; both are fitted in turn until a slope rests.

    Parameters
    ----------
    sums, deviances, logs : ndarray, shapes (k, m), (k,), (k, parameters)
        Of the bands, and of the records' maxima without a trend.
    coefficients : ndarray, shape (k, kept)
    """
    kept, slopes, least, logs = len(ramp), np.zeros(len(sums)), deviances.copy(), logs.copy()
    going = np.arange(len(sums))
    for _ in range(20):
        weights = ramp / model.variances(bands.grid, logs[going])[0][:, :kept]
        previous = slopes[going]
        slopes[going] = np.sum(weights * coefficients[going], axis=1) / (weights @ ramp)
        rest = sums[going]
        rest[:, :kept] = (coefficients[going] - slopes[going, None] * ramp) ** 2
        logs[going], least[going] = maximize_many(model, bands.grid, bands.numbers, rest, logs[going], converged=NEAR)
        going = going[np.abs(slopes[going] - previous) > 1e-2 * np.abs(slopes[going])]
        if not len(going):
            break
    return np.maximum(deviances - least, 0.0), slopes


def _quick_p_value(model: Model, bands: Bands, best: Maximum, gain: float) -> float:
    """Compute a p-value by Student's t: with v ordinates a likelihood ratio is ``(v + 1) log(1 + t²/v)``.

    v is twice the information on the variance of the lowest ordinate.
    """
    variances, slopes = model.variances(bands.grid, best.logs)
    lowest = slopes[0] / variances[0]
    spread = float(lowest @ np.linalg.pinv(information(model, bands, best.logs), rcond=1e-10) @ lowest)
    freedom = max(2.0 / spread, 1.0)
    statistic = np.sqrt(freedom * np.expm1(min(gain / (freedom + 1.0), 500.0)))
    return float(2.0 * student.sf(statistic, freedom))
