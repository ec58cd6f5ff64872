"""Unscented transform (filterpy): a covariance from a few samples."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.higher_order import principal_directions
from mcnav.linear.partials import Propagate, SimulationFailed, simulate_or_raise


def unscented_covariance(propagate: Propagate, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Compute mean and covariance of the final errors by the scaled unscented transform.

    Sigma points at ``sqrt(n)`` standard deviations (alpha 1, beta 2, kappa 0) over the sources that have a dispersion,
    in units of their standard deviations. The mean is right to second order. The covariance is exact for a linear
    system; quadratic terms enter with up to n/2 times their share, a conservative error. Means have shape (sources,)
    and (outputs,), covariances (sources, sources) and (outputs, outputs), SI. Raises `SimulationFailed` when a sigma
    point fails.
    """
    from filterpy.kalman import MerweScaledSigmaPoints, unscented_transform  # slow to import: half a second

    directions = principal_directions(covariance)  # of the range: sigma points need a definite matrix
    rank = directions.shape[1]
    if rank == 0:
        value = simulate_or_raise(propagate, mean[None, :])[0]
        return value, np.zeros((len(value), len(value)))
    points = MerweScaledSigmaPoints(rank, alpha=1.0, beta=2.0, kappa=0.0)
    errors = mean + points.sigma_points(np.zeros(rank), np.eye(rank)) @ directions.T
    try:
        transformed_mean, transformed = unscented_transform(simulate_or_raise(propagate, errors), points.Wm, points.Wc)
    except np.linalg.LinAlgError as failure:
        raise SimulationFailed(f"the sigma points have no covariance: {failure}") from None
    return np.asarray(transformed_mean), np.asarray(transformed)
