"""Overlapping Allan deviation of a record, with intervals, and that of a fitted model, with its band.

With clusters of m readings, τ = m Δ, the Allan variance is half the mean square of the differences of the means of
neighbouring clusters. Of the processes it is

    white noise              N²/τ
    rate random walk         K² τ/3
    flicker noise            (2 ln 2/π) B²
    quantization             3 Q²/τ²
    Gauss-Markov process     (2 σ² T/τ) [1 − (T/2τ)(3 − 4 exp(−τ/T) + exp(−2τ/T))]

An estimate from M overlapping differences with the autocovariances γ_k has ``edf = M² γ_0² / Σ_k (M − |k|) γ_k²``
equivalent degrees of freedom; γ_k is that of the fitted model, from its spectrum over blocks of an eighth of a cluster.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.fft import dct
from scipy.stats import chi2, norm

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.identification.processes import (
    FLICKER,
    GAUSS_MARKOV,
    QUANTIZATION,
    RATE_RANDOM_WALK,
    WHITE,
    Grid,
    Model,
)

PER_DECADE: Final = 6
"""Cluster times in a decade."""

FEWEST: Final = 4
"""Clusters of the longest cluster time."""

OVERLAP: Final = 8
"""Positions in a cluster at which differences are taken; more tell next to nothing."""

FLOOR: Final = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Allan deviation of flicker noise over its bias instability B, 0.664."""

LAGS: Final = 4096
"""Autocovariances of the differences that are computed, in blocks."""


@dataclass(frozen=True)
class AllanDeviation:
    """Overlapping Allan deviation at some cluster times, k of them; arrays of shape (k,).

    Attributes
    ----------
    times : ndarray
        Cluster times τ, s.
    deviations, low, high : ndarray
        Deviation and its 95 % interval, in the unit of the readings.
    model, model_low, model_high : ndarray
        That of the fitted model and its 95 % band, from the likelihood's curvature.
    """

    times: Array
    deviations: Array
    low: Array
    high: Array
    model: Array
    model_low: Array
    model_high: Array

    def beside(self, model: Model, logs: Array, covariance: Array) -> AllanDeviation:
        """Return the same estimates beside another model; parameters as those of `allan_deviation`."""
        return replace(self, **model_curve(model, logs, covariance, self.times))


def allan_deviation(readings: Array, interval: float, model: Model, logs: Array, covariance: Array) -> AllanDeviation:
    """Compute the overlapping Allan deviation of readings, shape (n,), and of a model beside it.

    Parameters
    ----------
    logs, covariance : ndarray, shapes (p,), (p, p)
        Logarithms of the model's parameters, and their covariance.
    """
    count = len(readings)
    exponents = np.arange(0.0, np.log10(count / FEWEST), 1.0 / PER_DECADE)
    sizes = np.unique(np.round(10.0**exponents).astype(int))
    angles = np.concatenate([[0.0], np.cumsum(readings - readings.mean())])
    estimates = np.array([_variance(angles, size) for size in sizes])
    freedom = np.array([_freedom(model, logs, interval, count, size) for size in sizes])
    return AllanDeviation(
        sizes * interval,
        np.sqrt(estimates),
        np.sqrt(estimates * freedom / chi2.ppf(0.975, freedom)),
        np.sqrt(estimates * freedom / chi2.ppf(0.025, freedom)),
        **model_curve(model, logs, covariance, sizes * interval),
    )


def model_curve(model: Model, logs: Array, covariance: Array, times: Array) -> dict[str, Array]:
    """Compute the Allan deviation of a model at cluster times, with its band, as `AllanDeviation` names them."""
    curve = np.sqrt([model_variance(model, logs, time) for time in times])
    slopes = 0.5 * _slopes(model, logs, times)
    reach = float(norm.ppf(0.975)) * np.sqrt(transformed_variances(slopes, covariance))
    return {"model": curve, "model_low": curve * np.exp(-reach), "model_high": curve * np.exp(reach)}


def _variance(angles: Array, size: int) -> float:
    """Return the Allan variance of clusters of so many readings, in units of the readings."""
    every = max(1, size // OVERLAP)
    differences = angles[2 * size :: every] - 2.0 * angles[size:-size:every] + angles[: -2 * size : every]
    return float(0.5 * np.mean(np.square(differences, out=differences)) / size**2)


def _freedom(model: Model, logs: Array, interval: float, count: int, size: int) -> float:
    """Compute the equivalent degrees of freedom by the model's autocovariances of the differences."""
    block = max(1, size // OVERLAP)
    per_cluster, blocks = round(size / block), count // block
    number = max(blocks - 2 * per_cluster + 1, 1)
    angles = Grid(block * interval, LAGS, np.arange(0.5, LAGS))
    squared = 4.0 * np.sin(per_cluster * angles.half) ** 4 / (np.sin(angles.half) * per_cluster) ** 2
    lags = dct(squared * model.variances(angles, logs)[0], type=3)[: min(number, LAGS)]
    weights = np.where(np.arange(len(lags)) > 0, 2.0, 1.0) * (number - np.arange(len(lags)))
    return float(number**2 * lags[0] ** 2 / np.sum(weights * lags**2))


def model_variance(model: Model, logs: Array, time: float) -> float:
    """Compute the Allan variance of a model at a cluster time, s."""
    total, place = 0.0, 0
    for process in model.processes:
        squared = float(np.exp(2.0 * logs[place]))
        if process is WHITE:
            total += squared / time
        elif process is RATE_RANDOM_WALK:
            total += squared * time / 3.0
        elif process is FLICKER:
            total += FLOOR**2 * squared
        elif process is QUANTIZATION:
            total += 3.0 * squared / time**2
        elif process is GAUSS_MARKOV:
            total += squared * _gauss_markov(time / float(np.exp(logs[place + 1])))
        place += len(process.parameters)
    return total


def _gauss_markov(ratio: float) -> float:
    """Return the Allan variance over σ² by τ/T; by a series where the difference cancels."""
    if ratio < 1e-3:
        return 2.0 / 3.0 * ratio * (1.0 - 0.75 * ratio)
    return float(2.0 / ratio * (1.0 - (3.0 - 4.0 * np.exp(-ratio) + np.exp(-2.0 * ratio)) / (2.0 * ratio)))


def _slopes(model: Model, logs: Array, times: Array) -> Array:
    """Return the derivatives of the logarithm of the variance by the parameters' logarithms, shape (k, p)."""
    step = 1e-4
    columns = []
    for place in range(len(logs)):
        moved = np.zeros(len(logs))
        moved[place] = step
        ahead, behind = (
            np.array([model_variance(model, logs + sign * moved, time) for time in times]) for sign in (1.0, -1.0)
        )
        columns.append(np.log(ahead / behind) / (2.0 * step))
    return np.stack(columns, axis=1)
