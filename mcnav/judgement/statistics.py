"""Statistics of the innovations of many records at once: size, whiteness, correlation length, mean; errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from mcnav.arrays.types import Array
from mcnav.contract.recorded import GROUPS, FilteredRecord
from mcnav.judgement.simulation import Innovations

LAGS: Final = 40
"""Lags up to which autocorrelations are computed."""


@dataclass(frozen=True)
class SensorStatistics:
    """Statistics of one sensor in R records.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Instants of its measurements, s.
    whitened : ndarray, shape (n, c, R)
        Innovations whitened by what the filter believes.
    """

    times: Array
    whitened: Array

    @property
    def nis(self) -> Array:
        """Mean normalized innovation squared over the number of components, shape (R,)."""
        return np.asarray(np.mean(self.whitened**2, axis=(0, 1)))

    @cached_property
    def autocorrelations(self) -> Array:
        """Autocorrelations of the whitened innovations at lags 1, 2, ..., all components together, shape (l, R)."""
        count = len(self.times)
        power = np.sum(self.whitened**2, axis=(0, 1))
        lags = range(1, min(LAGS, count // 2) + 1)
        products = [np.einsum("ncr,ncr->r", self.whitened[lag:], self.whitened[:-lag]) for lag in lags]
        return np.array([product / power for product in products]).reshape(-1, len(power))

    @property
    def correlation_length(self) -> Array:
        """Time over which innovations are correlated, s, shape (R,): the interval times the sum of autocorrelations.

        The sum ends at the first one below two standard deviations of white noise.
        """
        correlations = self.autocorrelations
        noticed = correlations > 2.0 / np.sqrt(self.whitened.shape[0] * self.whitened.shape[1])
        kept = np.cumprod(noticed, axis=0)
        interval = float(np.median(np.diff(self.times)))
        return np.asarray(interval * np.sum(kept * correlations, axis=0))

    @property
    def means(self) -> Array:
        """Means of the whitened innovations times the root of their number, shape (c, R)."""
        return np.asarray(np.sum(self.whitened, axis=0) / np.sqrt(len(self.times)))


def sensor_statistics(record: FilteredRecord, innovations: Innovations) -> tuple[SensorStatistics, ...]:
    """Whiten the innovations of each sensor by what the filter believes."""
    result = []
    for number in range(len(record.sensors)):
        rows = [n for n, stage in enumerate(record.stages) if stage.sensor == number]
        whitened = np.empty((len(rows), *innovations.values[rows[0]].shape))
        for place, n in enumerate(rows):
            root = np.linalg.cholesky(record.stages[n].covariance)
            whitened[place] = solve_triangular(root, innovations.values[n], lower=True)
        times = np.array([record.stages[n].time for n in rows])
        result.append(SensorStatistics(times, whitened))
    return tuple(result)


def mean_nees(record: FilteredRecord, innovations: Innovations) -> dict[str, Array]:
    """Compute the mean NEES over three of position, velocity and attitude, shape (R,), where a reference has them.

    The covariance of the reference is added to the filter's.
    """
    read = [stage.read_out for stage in record.stages if stage.read_out is not None]
    result = {}
    for number, group in enumerate(GROUPS):
        here = slice(3 * number, 3 * number + 3)
        known = [n for n, each in enumerate(read) if np.all(np.isfinite(each.errors[here]))]
        if not known:
            continue
        total = np.zeros(len(innovations))
        for n in known:
            covariance = read[n].covariance[here, here] + np.diag(read[n].reference[here])
            root = np.linalg.cholesky(covariance)
            total += np.sum(solve_triangular(root, innovations.errors[n, here], lower=True) ** 2, axis=0)
        result[group] = total / (3.0 * len(known))
    return result
