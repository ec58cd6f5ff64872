"""Records of the reference engine's filters: consistency with the truth at the epochs, and counts of each sensor.

A record has the columns of `mcnav.contract.filter_record.FilterSchema`: NEES by group, the lower triangle of the
covariance of the outputs, whether each output's error is within one and three sigmas, errors and variances of the other
states, and five counts of each sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from mcnav.arrays.products import map_covariances
from mcnav.arrays.types import Array
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import OUTPUTS
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel

SINGULAR: Final = 1e-12
"""Smallest eigenvalue of a correlation matrix that is not rounding; a covariance says nothing along its direction."""

COUNTS: Final = 5
"""Counts of a sensor: sum of NIS, accepted, rejected, sum of lagged products, products."""


OUTPUT_GROUPS: Final = (slice(0, 3), slice(3, 6), slice(6, 9))
"""Outputs of position, velocity and attitude."""


class SensorCounts:
    """Counts of the updates of one sensor since an epoch."""

    def __init__(self) -> None:
        self.counts = np.zeros(COUNTS)
        self._before: Array | None = None

    def add(self, whitened: Array, accepted: bool) -> None:
        """Count an update by its whitened innovation."""
        self.counts[0] += whitened @ whitened
        self.counts[1 if accepted else 2] += 1.0
        if self._before is not None:
            self.counts[3] += whitened @ self._before / len(whitened)
            self.counts[4] += 1.0
        self._before = whitened

    def read(self) -> Array:
        """Return the counts and begin anew."""
        counts, self.counts = self.counts, np.zeros(COUNTS)
        return counts


def normalized_errors(errors: ErrorModel, deviation: Array, covariance: Array, to_outputs: Array) -> Array:
    """Compute the NEES of each group of states.

    The groups are all estimated states, navigation, position, velocity and attitude as they are in the outputs to first
    order, and, if there are any, the other estimated states.

    Parameters
    ----------
    deviation : ndarray, shape (9 + q,)
        True values of the filter's states, whose estimates have been taken away.
    covariance : ndarray, shape (9 + q, 9 + q)
    to_outputs : ndarray, shape (9, 9)
        Map of psi, dv, dr to the outputs.

    Raises
    ------
    LinAlgError
        When the covariance is not positive semidefinite, but for rounding.
    """
    estimated = np.setdiff1d(np.arange(errors.size), errors.considered)
    outputs = to_outputs @ deviation[:NAVIGATION]
    mapped = map_covariances(to_outputs, covariance[:NAVIGATION, :NAVIGATION])
    result = [
        _normalized(deviation[each], covariance[np.ix_(each, each)]) for each in (estimated, estimated[:NAVIGATION])
    ]
    result += [_normalized(outputs[output_group], mapped[output_group, output_group]) for output_group in OUTPUT_GROUPS]
    others = estimated[NAVIGATION:]
    if len(others):
        result.append(_normalized(deviation[others], covariance[np.ix_(others, others)]))
    return np.array(result)


def _normalized(deviation: Array, covariance: Array) -> float:
    """Compute the squared norm of a deviation by a covariance, which may be singular."""
    variances = np.diag(covariance)
    if not np.all(variances >= 0.0):
        raise LinAlgError("the covariance has negative variances")
    sigmas = np.sqrt(variances)
    known = sigmas > 0.0
    scaled = covariance[np.ix_(known, known)] / np.outer(sigmas[known], sigmas[known])
    values, vectors = np.linalg.eigh(scaled)
    if not np.all(values > -SINGULAR):
        raise LinAlgError("the covariance is not positive semidefinite")
    kept = values > SINGULAR
    along = vectors[:, kept].T @ (deviation[known] / sigmas[known])
    return float(np.sum(along**2 / values[kept]))


def record_row(
    nees: Array, covariance: Array, errors: Array, state_errors: Array, state_variances: Array, counts: Sequence[Array]
) -> Array:
    """Assemble a record.

    Parameters
    ----------
    covariance : ndarray, shape (9, 9)
        Of the outputs.
    errors : ndarray, shape (9,)
        Navigation errors.
    state_errors, state_variances : ndarray, shape (q,)
    counts : sequence of ndarray, shape (5,)
        Of each sensor.
    """
    sigmas = np.sqrt(np.diag(covariance))
    within = [(np.abs(errors) <= factor * sigmas).astype(float) for factor in (1.0, 3.0)]
    rows, columns = np.tril_indices(len(OUTPUTS))
    return np.concatenate([nees, covariance[rows, columns], *within, state_errors, state_variances, *counts])
