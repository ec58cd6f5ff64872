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

from mcnav._types import Array
from mcnav.identification.likelihood import Maximum, information, maximize
from mcnav.identification.processes import Model
from mcnav.identification.spectrum import Bands, Record

CLEAR: Final = 0.2
"""P-value by Student's t from which nothing is simulated: it errs to the small side."""

ENOUGH: Final = 10
NEAR: Final = 1e-4
"""Decrement of −2 log L at which a maximum is reached."""

MOST: Final = 499
"""Records are simulated until so many gain as much, and at most so many."""

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
    kept = len(record.lowest)
    ramp = ramp_coefficients(record.count, record.interval, kept)
    coefficients = record.lowest
    gain, slope = _gain(model, bands, best, coefficients, ramp)
    quick = _quick_p_value(model, bands, best, gain)
    if not HOPELESS < quick < CLEAR:
        return quick, slope
    generator = np.random.default_rng(0)
    variances, _ = model.variances(bands.grid, best.logs)
    as_large = 0
    for simulated in range(1, MOST + 1):
        low = np.sqrt(variances[:kept]) * generator.standard_normal(kept)
        sums = variances * generator.gamma(0.5 * bands.numbers, 2.0)
        sums[:kept] = low**2
        drawn = Bands(bands.grid, bands.numbers, sums)
        null = maximize(model, drawn, best.logs, converged=NEAR)
        as_large += _gain(model, drawn, null, low, ramp)[0] >= gain
        if as_large == ENOUGH:
            return max(as_large / simulated, quick), slope
    return max((as_large + 1.0) / (MOST + 1.0), quick), slope


def _gain(model: Model, bands: Bands, best: Maximum, coefficients: Array, ramp: Array) -> tuple[float, float]:
    """Return what −2 log L gains by a trend, and its slope; both are fitted in turn until the slope rests."""
    kept, logs, slope, deviance = len(ramp), best.logs, 0.0, best.deviance
    for _ in range(20):
        weight = ramp / model.variances(bands.grid, logs)[0][:kept]
        previous, slope = slope, float(weight @ coefficients / (weight @ ramp))
        sums = bands.sums.copy()
        sums[:kept] = (coefficients - slope * ramp) ** 2
        trended = maximize(model, Bands(bands.grid, bands.numbers, sums), logs, converged=NEAR)
        logs, deviance = trended.logs, trended.deviance
        if abs(slope - previous) <= 1e-2 * abs(slope):
            break
    return max(best.deviance - deviance, 0.0), slope


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
