"""Linear covariance over time: sigmas, the filter's own, and the variance that each cause contributes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.linear import LinearSystem

NOMINAL: Final = "nominal_errors"
"""Name of the cause of a mean error that a system has without any error."""


@dataclass(frozen=True)
class Moments:
    """Mean and covariance of the errors at m times, after updates.

    Attributes
    ----------
    times : ndarray, shape (m,)
    mean, covariance : ndarray, shapes (m, outputs) and (m, outputs, outputs)
        SI.
    nominal : ndarray, shape (m, outputs), optional
        Part of the mean that a flight without errors has; none where there is none.
    origin : ndarray, shape (m, outputs), optional
        See `mcnav.contract.linear.LinearSystem`.
    """

    times: Array
    mean: Array
    covariance: Array
    nominal: Array | None = None
    origin: Array | None = None


@dataclass(frozen=True)
class LinearCovariance:
    """Linear covariance at r readings.

    Attributes
    ----------
    readings : LinearSystem
    mean, covariance : ndarray, shapes (r, outputs) and (r, outputs, outputs)
        Moments of the errors, SI.
    sigma : ndarray, shape (r, outputs)
        SI.
    sigma_filter : ndarray, shape (r, outputs), or None
        As the navigator's filter states them.
    variances : mapping of str to ndarray, shape (r, outputs)
        Contribution of each source and process that has any, by name.
    correlations : ndarray, shape (r, outputs)
        Contribution of correlations between sources; with the others it adds up to the variance.
    means : mapping of str to ndarray, shape (r, outputs)
        Mean error that the mean of each source causes, of those that have one, by name; and the nominal errors.
    attributed : mapping of str to ndarray, shape (r, outputs)
        ``variances`` with half of what correlations add, ``P_ij (P S)_ij`` of a source: they add up to the variance.
    """

    readings: LinearSystem
    mean: Array
    covariance: Array
    sigma: Array
    sigma_filter: Array | None
    variances: Mapping[str, Array]
    correlations: Array
    means: Mapping[str, Array] = field(default_factory=dict)
    attributed: Mapping[str, Array] = field(default_factory=dict)

    @property
    def settled(self) -> IndexArray:
        """Numbers of the readings after the updates of their times, one for each time."""
        return np.array([number for number, update in enumerate(self.readings.updates) if update != "before"])

    @property
    def moments(self) -> Moments:
        """Moments after the updates of each time."""
        at = self.settled
        nominal, origin = (None if each is None else each[at] for each in (self.readings.nominal, self.readings.origin))
        return Moments(self.readings.times[at], self.mean[at], self.covariance[at], nominal, origin)


def covariance_over_time(
    readings: LinearSystem, sources: tuple[str, ...], mean: Array, covariance: Array
) -> LinearCovariance:
    """Propagate the moments of the sources, ``C(t) = P S P^T + sum Q_j``, and split its diagonal over causes.

    Parameters
    ----------
    sources : tuple of str
        Names.
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Mean and covariance S of the sources.
    """
    partials = readings.partials
    by_source = partials**2 * np.diag(covariance)
    variances = {
        name: by_source[:, :, number] for number, name in enumerate(sources) if covariance[number, number] > 0.0
    }
    correlations = transformed_variances(partials, covariance) - by_source.sum(axis=2)
    attributed = variances
    if np.any(covariance != np.diag(np.diag(covariance))):
        crossed = partials * (partials @ covariance)
        attributed = {name: crossed[:, :, number] for number, name in enumerate(sources) if name in variances}
    noise = {name: np.diagonal(added, axis1=1, axis2=2) for name, added in readings.processes.items()}
    variances, attributed = variances | noise, attributed | noise
    total = correlations + sum(variances.values(), np.zeros(partials.shape[:2]))
    own = None if readings.own is None else np.sqrt(np.maximum(np.diagonal(readings.own, axis1=1, axis2=2), 0.0))
    whole = readings.covariance(covariance)
    sigma = np.sqrt(np.maximum(total, 0.0))
    means = {name: partials[:, :, number] * mean[number] for number, name in enumerate(sources) if mean[number]}
    whole_mean = partials @ mean
    if readings.nominal is not None and np.any(readings.nominal):
        means[NOMINAL], whole_mean = readings.nominal, whole_mean + readings.nominal
    return LinearCovariance(readings, whole_mean, whole, sigma, own, variances, correlations, means, attributed)
