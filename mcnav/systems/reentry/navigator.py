"""The navigator in the form of the report: NASA TN D-1772, eqs. (5), (9), (10), in polar coordinates.

This is the reference path. Truth and indicated motion are integrated together, one sample at a time, by DOP853 with a
restart at every kink of the truth. The ensemble path (`mcnav.systems.reentry.ensemble.kernel`) shares none of
these equations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, uncontracted
from mcnav.numerics.dop853 import LEFT, REACHED, advance, integrate_compiled
from mcnav.numerics.integration import Diverged
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.instruments import Error, indicated_force, measured_force
from mcnav.systems.reentry.outputs import SCALE
from mcnav.systems.reentry.truth import ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE, Trajectory, motion, truth_force

TOLERANCES: Final = (RELATIVE_TOLERANCE, np.tile(ABSOLUTE_TOLERANCE, 2))

LOWEST_RADIUS: Final = 0.01 * EARTH_RADIUS
"""An indicated position nearer to the earth's centre than this (m) ends the simulation."""

LIMITS: Final = np.array([[-np.inf] * 4 + [LOWEST_RADIUS] + [-np.inf] * 3, [np.inf] * 8])
"""Limits of the truth and an indicated state: m, rad, m/s, rad/s."""


@compiled
def joint_rates(
    time: float, state: Array, coefficients: Array, on: float, errors: Array, start: float, theta_axes: float
) -> Array:
    """Compute rates of the truth (first four) and of n indicated states (four each), NASA TN D-1772, eqs. (1)-(9)."""
    rates = np.empty(4 + 4 * errors.shape[0])
    actual = state[:4]
    force_x, force_z = truth_force(actual, coefficients)
    motion(actual, force_x, force_z, rates[:4])
    for run in range(errors.shape[0]):
        own = slice(4 + 4 * run, 8 + 4 * run)
        indicated = state[own]
        # eqs. (6)-(8), (9) and (5)
        measured_x, measured_z = measured_force(force_x, force_z, actual[1] - theta_axes, time - start, errors[run])
        indicated_x, indicated_z = indicated_force(on * measured_x, on * measured_z, indicated[1] - theta_axes)
        motion(indicated, indicated_x, indicated_z, rates[own])
    return rates


@uncontracted
def _advance(
    args: Any, bound: float, relative: float, absolute: Array, limits: Array, step: float, times: Array, states: Array
) -> tuple[int, int, float]:
    """Take steps of `joint_rates`; see `mcnav.numerics.dop853.advance`."""
    return advance(joint_rates, args, bound, relative, absolute, limits, step, times, states)


def indicated_start(actual: Array, errors: Array) -> Array:
    """Add the initial errors to the actual state: the indicated start, shape (4,) (NASA TN D-1772, eq. 10).

    Range and range-rate errors are arc lengths at the radius of the start.
    """
    radius = actual[0]
    offsets = [
        errors[Error.ALTITUDE],
        errors[Error.RANGE] / radius,
        errors[Error.ALTITUDE_RATE],
        errors[Error.RANGE_RATE] / radius,
    ]
    return np.asarray(actual + offsets, dtype=float)


def navigation_error(actual: Array, indicated: Array) -> Array:
    """Subtract actual from indicated: altitude, range and their rates at the earth's radius, m and m/s."""
    return np.asarray((indicated - actual) * SCALE, dtype=float)


def simulate_indicated(
    trajectory: Trajectory,
    errors: Array,
    start: float,
    theta_axes: float,
    watch: Callable[[Array, Array], None] = lambda times, states: None,
) -> Array:
    """Simulate one sample along a truth: its final navigation errors.

    Parameters
    ----------
    errors : ndarray, shape (sources,)
        In the order of `Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.
    start : float
        Start of navigation, s from the first point of the truth.
    theta_axes : float
        Range angle at which the reference axes are horizontal and vertical, rad.
    watch : callable
        Called with the integrator's steps, also of a flight that diverges: times, shape (m,), s from the
        first point of the truth; actual and indicated states, shape (8, m).

    Returns
    -------
    ndarray, shape (4,)
        Altitude, range, altitude rate, range rate: m, m/s.

    Raises
    ------
    Diverged
        When the indicated position comes near the earth's centre, or the integration breaks down.
    """
    actual = trajectory.departure(start)
    state = np.concatenate([actual, indicated_start(actual, errors)])
    alone = np.ascontiguousarray(errors)[None]
    if not np.all(np.isfinite(state)) or state[4] <= LOWEST_RADIUS:
        raise Diverged(f"the indicated radius starts at {state[4]:.6g} m")
    for begin, end, phase in trajectory.navigated(start):
        args = (phase.coefficients, float(phase.accelerometers_on), alone, start, theta_axes)
        shared = trajectory.shared(begin, phase, state)
        steps = integrate_compiled(_advance, (begin, end), shared, TOLERANCES, LIMITS, args)
        watch(steps.times, steps.states.T)
        state = steps.states[-1]
        if steps.status == LEFT:
            raise Diverged(f"the indicated position fell to {LOWEST_RADIUS / 1e3:.0f} km from the earth's centre")
        if steps.status != REACHED:
            raise Diverged(f"the integration broke down at {steps.times[-1]:.1f} s: its steps became too small")
    return navigation_error(state[:4], state[4:])
