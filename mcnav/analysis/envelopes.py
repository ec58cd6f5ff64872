"""Dispersion over time: linear and simulated moments, and percentiles of the stored samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.statistics.mean_square import mean_square_intervals


@dataclass(frozen=True)
class Envelopes:
    """Errors at m epochs, SI.

    Attributes
    ----------
    label : str
        Meaning of the times, as ``name [unit]``.
    times : ndarray, shape (m,)
    events : mapping of str to float
        Named instants, in the unit of the times.
    mean, sigma, linear_mean, linear_sigma : ndarray, shape (m, outputs)
    covariance : ndarray, shape (m, outputs, outputs)
    fourth : ndarray, shape (m, outputs)
        Mean fourth power about the mean.
    percentiles : mapping of str to ndarray, shape (m, outputs)
        Keyed by the level in per cent.
    samples, stored : int
        Numbers of samples behind mean and sigma, and behind the percentiles.
    """

    label: str
    times: Array
    events: Mapping[str, float]
    mean: Array
    sigma: Array
    linear_mean: Array
    linear_sigma: Array
    covariance: Array
    fourth: Array
    percentiles: Mapping[str, Array]
    samples: int
    stored: int

    def sigma_intervals(self, weight: float, confidence: float) -> Array:
        """Return intervals of the simulated sigma, shape (m, outputs, 2), each at a confidence.

        They are roots of intervals of the variance, whose standard error is that of a mean of squares about the mean,
        ``sqrt((m4 - s^4) / n)``; zero and infinite where there are too few samples.

        Parameters
        ----------
        weight : float
            Independent samples that a sample counts for; see `mcnav.analysis.filter_evidence.independent_share`.
        """
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)
        count = self.samples * weight
        error = np.sqrt(np.maximum(self.fourth - variance**2, 0.0) / max(count, 1.0))
        freedom = np.full_like(variance, max(count - 1.0, 0.0))
        intervals = mean_square_intervals(variance, error, np.full_like(variance, count), freedom, confidence)
        return np.sqrt(intervals)


def envelopes_from(
    columns: Mapping[str, Array], described: Mapping[str, Any], outputs: Sequence[Mapping[str, str]]
) -> Envelopes:
    """Build envelopes from the columns of ``epochs.parquet`` and its description; `KeyError` names a missing column."""

    def block(kind: str) -> Array:
        return np.column_stack([columns[f"{kind} {entry['name']} [{entry['unit']}]"] for entry in outputs])

    label = next(iter(columns))
    levels = dict.fromkeys(name.split()[1] for name in columns if name.startswith("percentile "))
    mean, sigma, linear_mean, linear_sigma = map(block, ("mean", "sigma", "linear mean", "linear sigma"))
    percentiles = {level: block(f"percentile {level}") for level in levels}
    fourth = np.column_stack([columns[f"fourth {entry['name']} [({entry['unit']})^4]"] for entry in outputs])
    samples, stored = int(described["samples"]), int(described["stored"])
    return Envelopes(
        label, columns[label], described["events"], mean, sigma, linear_mean, linear_sigma,
        _covariance(columns, sigma, outputs), fourth, percentiles, samples, stored,
    )  # fmt: skip


def _covariance(columns: Mapping[str, Array], sigma: Array, outputs: Sequence[Mapping[str, str]]) -> Array:
    """Build covariance matrices from the columns of pairs, shape (m, outputs, outputs)."""
    covariance = np.zeros((*sigma.shape, sigma.shape[1]))
    for i, one in enumerate(outputs):
        covariance[:, i, i] = sigma[:, i] ** 2
        for j, other in enumerate(outputs[:i]):
            pair = f"{other['name']}, {one['name']} [({other['unit']})({one['unit']})]"
            covariance[:, i, j] = covariance[:, j, i] = columns[f"covariance {pair}"]
    return covariance
