"""Unscented transform: a covariance from a few samples."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.higher_order import principal_directions
from mcnav.linear.partials import Propagate, simulate_or_raise


def unscented_covariance(propagate: Propagate, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Compute mean and covariance of the final errors by the scaled unscented transform.

    Sigma points at ``sqrt(n)`` standard deviations (alpha 1, beta 2, kappa 0) over the sources that have a dispersion,
    in units of their standard deviations. The mean is right to second order. The covariance is exact for a linear
    system; quadratic terms enter with up to n/2 times their share, a conservative error. Means have shape (sources,)
    and (outputs,), covariances (sources, sources) and (outputs, outputs), SI. Raises `SimulationFailed` when a sigma
    point fails.
    """
    directions = principal_directions(covariance)
    rank = directions.shape[1]
    if rank == 0:
        value = simulate_or_raise(propagate, mean[None, :])[0]
        return value, np.zeros((len(value), len(value)))
    axes = np.sqrt(rank) * np.eye(rank)
    points = np.vstack([np.zeros(rank), axes, -axes])
    mean_weights = np.append(0.0, np.full(2 * rank, 0.5 / rank))
    covariance_weights = np.append(2.0, mean_weights[1:])  # beta at the mean
    values = simulate_or_raise(propagate, mean + points @ directions.T)
    transformed_mean = mean_weights @ values
    departures = values - transformed_mean
    return transformed_mean, departures.T @ (covariance_weights[:, None] * departures)
