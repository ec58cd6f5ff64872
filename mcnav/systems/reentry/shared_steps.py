"""Histories of several indicated trajectories along one truth, integrated with the same steps.

The map from the errors at one time to those at a later one is then the same smooth function for all, so that small
differences between the trajectories are accurate to rounding, as NASA TN D-1772, eq. (16), needs of its ten runs.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mcnav.arrays.types import Array
from mcnav.numerics.integration import Diverged, integrate
from mcnav.systems.reentry.navigator import LOWEST_RADIUS, indicated_start, joint_rates
from mcnav.systems.reentry.truth import ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE, Trajectory


def simulate_together(
    trajectory: Trajectory, errors: Array, start: float, theta_axes: float, times: Array
) -> tuple[Array, Array]:
    """Simulate several samples with shared steps: actual and indicated states at chosen times.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        Errors of each sample, in the order of `mcnav.systems.reentry.instruments.Error`, SI.
    start, theta_axes : float
        As for `mcnav.systems.reentry.navigator.simulate_indicated`.
    times : ndarray, shape (m,)
        Rising, s from the first point of the truth, none before the start. The integration stops at each; nothing is
        interpolated.

    Returns
    -------
    actual : ndarray, shape (m, 4)
    indicated : ndarray, shape (m, n, 4)
        Polar states: m, rad, m/s, rad/s.

    Raises
    ------
    Diverged
        When a flight comes near the earth's centre, or the integration breaks down.
    """
    first = trajectory.departure(start)
    state = np.concatenate([first, *(indicated_start(first, row) for row in errors)])
    kept: dict[float, Array] = {start: state}
    tolerance = np.tile(ABSOLUTE_TOLERANCE, 1 + len(errors))
    for begin, end, phase in trajectory.navigated(start):
        state = trajectory.shared(begin, phase, state)
        halts = [begin, *(float(time) for time in times if begin < time < end), end]
        for since, until in pairwise(halts):
            args = (phase.coefficients, float(phase.accelerometers_on), errors, start, theta_axes)
            solution = integrate(joint_rates, (since, until), state, (RELATIVE_TOLERANCE, tolerance), args)
            state = solution.y[:, -1]
            if solution.status != 0 or state[4::4].min(initial=np.inf) < LOWEST_RADIUS:
                raise Diverged(f"a flight of {len(errors)} flown together broke down at {solution.t[-1]:.1f} s")
            kept[until] = state
    if missing := [float(time) for time in times if float(time) not in kept]:
        raise ValueError(f"histories run from {start:g} s to {trajectory.final_time:g} s; got {missing[0]:g} s")
    result = np.array([kept[float(time)] for time in times])
    return result[:, :4], result[:, 4:].reshape(len(times), len(errors), 4)


def speed_and_angle_errors(actual: Array, indicated: Array) -> tuple[Array, Array]:
    """Compute errors of the inertial speed (m/s) and of its flight-path angle (rad), as NASA TN D-1772, figure 3(b).

    Parameters
    ----------
    actual, indicated : ndarray, shape (..., 4)
        Polar states.
    """

    def speed_and_angle(state: Array) -> tuple[Array, Array]:
        across = state[..., 0] * state[..., 3]
        return np.hypot(state[..., 2], across), np.arctan2(state[..., 2], across)

    (speed, angle), (indicated_speed, indicated_angle) = speed_and_angle(actual), speed_and_angle(indicated)
    return indicated_speed - speed, indicated_angle - angle
