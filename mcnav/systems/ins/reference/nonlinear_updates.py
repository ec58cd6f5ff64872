"""Filters that look at more than one point: the iterated update, and sigma points.

What a navigator at another state would predict is asked of a function of its state and estimates, which returns the
innovation, predicted less measured, and its response to the errors e of the filter's states.

**Iterated** (Bell and Cathey 1993, *The iterated Kalman filter update as a Gauss-Newton method*): the response is taken
at the corrected state, until the correction c no longer changes::

    c <- K (y(c) + H(c) c)        K = P H^T (H P H^T + R)^-1

**Sigma points** e_j, the 2n columns of +-L with P = L L^T, about the estimate as in Brossard, Barrau and Bonnabel
(2020), *A code for unscented Kalman filtering on manifolds*, but at a distance of one sigma. L is Cholesky's, for
errors in inertial axes in the order of the states: other roots are other points. Each is integrated from its own state
with readings compensated by its own estimates, and has the error e'_j of the estimate, integrated alike, after the
step; Q is the process noise of the linear system::

    m = sum(e'_j) / 2        P <- sum(e'_j e'_j^T) / 2 + m m^T + Q

The term m m^T makes the variance of a square, along an axis, that of a normal variable's. The estimate is not moved by
m. In an update, y and y_j are the innovations of the estimate and of the points, d_j = y_j - y, with the same moments::

    c = K (y + m)        P <- P - K S K^T        K S = -sum(e_j d_j^T) / 2        S = sum(d_j d_j^T) / 2 + m m^T + R
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.numerics.extended_poses import logarithm
from mcnav.systems.ins.filter.model import ITERATIONS, NAVIGATION, SETTLED, SINGULAR
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY
from mcnav.systems.ins.reference.collocation import NODES
from mcnav.systems.ins.reference.earth_fixed_errors import FilterSteps
from mcnav.systems.ins.reference.filtered_navigator import FilteredNavigator, Update
from mcnav.systems.ins.reference.mechanization import matrices

Measure: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""Innovation, shape (c,), and response, shape (c, 9 + q), at a state, shape (10,), and estimates, shape (q,)."""

WEIGHT: Final = 0.5
"""Weight of a sigma point at a distance of one sigma."""


def iterate(navigator: FilteredNavigator, measure: Measure, variances: Array, threshold: float) -> Update:
    """Update by iterated linear responses, if the first innovation's normalized square is within a threshold."""
    covariance, noise = navigator.filter.P, np.diag(variances)
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    first: Array | None = None
    change = np.zeros(len(covariance))
    for _ in range(ITERATIONS):
        innovation, response = measure(*navigator.corrected(change))
        own = response @ covariance @ response.T + noise
        if first is None:
            first = np.asarray(np.linalg.solve(np.linalg.cholesky(own), innovation))
            if not first @ first <= threshold:
                return Update(first, own, np.zeros(response.T.shape), False)
        gain = np.linalg.solve(own, response @ covariance).T
        before, change = change, gain @ (innovation + response @ change)
        if np.all(np.abs(change - before) <= SETTLED * sigmas):
            break
    left = np.eye(len(gain)) - gain @ response
    after = left @ covariance @ left.T + gain @ noise @ gain.T
    navigator.filter.P = 0.5 * (after + after.T)
    navigator.correct(change)
    assert first is not None
    return Update(first, own, gain, True)


def sigma_points(covariance: Array, from_inertial: Array) -> Array:
    """Return the errors of 2n sigma points, shape (2n, n), of a covariance that may be singular.

    Parameters
    ----------
    from_inertial : ndarray, shape (n, n)
        From errors in inertial axes to those of the covariance.
    """
    to_inertial = np.linalg.inv(from_inertial)
    left = to_inertial @ covariance @ to_inertial.T
    least, root = SINGULAR * np.diag(left), np.zeros_like(left)
    for c in range(len(left)):
        if left[c, c] > least[c]:
            root[c:, c] = left[c:, c] / np.sqrt(left[c, c])
            left = left - np.outer(root[:, c], root[:, c])
    rows = (from_inertial @ root).T
    return np.concatenate([rows, -rows])


def moments(differences: Array) -> tuple[Array, Array]:
    """Return the mean of what sigma points differ by from the estimate, shape (2n, c), and its covariance, (c, c)."""
    mean = WEIGHT * differences.sum(axis=0)
    return mean, WEIGHT * differences.T @ differences + np.outer(mean, mean)


def update_by_sigma_points(
    navigator: FilteredNavigator, measure: Measure, variances: Array, threshold: float
) -> Update:
    """Update by sigma points, if the normalized square of the mean innovation is within a threshold."""
    covariance = navigator.filter.P
    errors = sigma_points(covariance, navigator.from_inertial())
    central = measure(navigator.state, navigator.estimates)[0]
    apart = np.array([measure(*navigator.corrected(error))[0] for error in errors]) - central
    mean, own = moments(apart)
    mean, own = central + mean, own + np.diag(variances)
    cross = -WEIGHT * errors.T @ apart
    whitened = np.asarray(np.linalg.solve(np.linalg.cholesky(own), mean))
    if not whitened @ whitened <= threshold:
        return Update(whitened, own, np.zeros(cross.shape), False)
    gain = np.asarray(np.linalg.solve(own, cross.T).T)
    after = covariance - gain @ own @ gain.T
    navigator.filter.P = 0.5 * (after + after.T)
    navigator.correct(gain @ mean)
    return Update(whitened, own, gain, True)


def advance_by_sigma_points(
    navigator: FilteredNavigator, measured: Array, begins: Array, durations: Array, steps: FilterSteps, until: float
) -> None:
    """Integrate the indicated state and the sigma points over n steps, as `FilteredNavigator.advance` does."""
    begun = sigma_points(navigator.filter.P, navigator.from_inertial())
    points = [navigator.corrected(sigma_point) for sigma_point in begun]
    elapsed = (begins - navigator.estimated_at)[:, None] + durations[:, None] * NODES
    duration = until - navigator.estimated_at
    decay = np.exp(-navigator.model.decay_rates * duration)
    navigator.filter.P = np.zeros_like(navigator.filter.P)
    navigator.advance(measured, begins, durations, steps, until)  # leaves the process noise alone
    errors = np.empty((len(points), navigator.model.size))
    ends = np.empty((len(points), len(navigator.state)))
    for place, (state, estimates) in enumerate(points):
        readings = navigator.compensation.compensate(measured, estimates, elapsed)
        ends[place] = navigator.integrate(state, readings, begins, durations)[-1]
        errors[place, NAVIGATION:] = navigator.model.flexed(decay * estimates, duration) - navigator.estimates
    turns = matrices(navigator.state[None, :4])[0] @ np.swapaxes(matrices(ends[:, :4]), -1, -2)
    for place, turn in enumerate(turns):
        logarithm(turn, errors[place, ATTITUDE])
    errors[:, VELOCITY] = navigator.state[4:7] - ends[:, 4:7]
    errors[:, POSITION] = navigator.state[7:] - ends[:, 7:]
    navigator.filter.P = moments(errors)[1] + navigator.filter.P
