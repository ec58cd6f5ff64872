"""The linearized navigator: partial derivatives of NASA TN D-1772, eqs. (11)-(13), by variational equations.

Truth, zero-error indicated motion and the sensitivities to every error are integrated together by DOP853, phase by
phase, in polar coordinates. Where the accelerometers are always on, the zero-error indicated motion is the truth.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.compiled.jit import compiled
from mcnav.constants import GRAVITATIONAL_PARAMETER
from mcnav.numerics.integration import integrate
from mcnav.systems.reentry.instruments import Error, indicated_force, measured_force, measured_force_partials
from mcnav.systems.reentry.navigator import joint_rates, navigation_error
from mcnav.systems.reentry.outputs import SCALE
from mcnav.systems.reentry.truth import Trajectory, truth_force

SOURCES: Final = len(Error)
_NO_ERRORS: Final = np.zeros((1, SOURCES))
TOLERANCES: Final = (1e-11, 1e-12)


@compiled
def variational_rates(
    time: float, state: Array, coefficients: Array, on: float, no_errors: Array, start: float, theta_axes: float
) -> Array:
    """Compute the rates of truth (4), zero-error indicated state (4) and sensitivities (4 x sources, by rows).

    With e = (r_e, theta_e, r_e', theta_e') and (df_x, df_z) the variation of the indicated force,
    ``r_e'' = (theta'^2 + 2 mu / r^3) r_e + 2 r theta' theta_e' - df_z`` and
    ``r theta_e'' = df_x - theta'' r_e - 2 theta' r_e' - 2 r' theta_e'``.
    """
    rates = np.empty(state.size)
    joint = joint_rates(time, state[:8], coefficients, on, no_errors, start, theta_axes)
    for i in range(8):
        rates[i] = joint[i]
    actual, indicated = state[:4], state[4:8]
    elapsed, angle = time - start, indicated[1] - theta_axes
    force_x, force_z = truth_force(actual, coefficients)
    # indicated force without errors, and its partial derivatives by each
    measured_x, measured_z = measured_force(force_x, force_z, actual[1] - theta_axes, elapsed, no_errors[0])
    indicated_x, indicated_z = indicated_force(on * measured_x, on * measured_z, angle)
    radius, _, radius_rate, angle_rate = indicated
    angle_acceleration = rates[7]
    stiffness = angle_rate * angle_rate + 2.0 * GRAVITATIONAL_PARAMETER / radius**3

    sensitivity, change = state[8:].reshape(4, SOURCES), rates[8:].reshape(4, SOURCES)
    by_error = np.empty((2, SOURCES))
    measured_force_partials(measured_x, measured_z, elapsed, by_error)
    for source in range(SOURCES):
        altitude, shift, altitude_rate, shift_rate = sensitivity[:, source]
        # df_x, df_z: turned by the indicated range angle's error, too
        turned_x, turned_z = indicated_force(on * by_error[0, source], on * by_error[1, source], angle)
        change_x = turned_x + indicated_z * shift
        change_z = turned_z - indicated_x * shift
        change[0, source] = altitude_rate
        change[1, source] = shift_rate
        change[2, source] = stiffness * altitude + 2.0 * radius * angle_rate * shift_rate - change_z
        change[3, source] = (
            change_x - angle_acceleration * altitude - 2.0 * angle_rate * altitude_rate - 2.0 * radius_rate * shift_rate
        ) / radius
    return rates


def _stretches(
    trajectory: Trajectory, start: float, theta_axes: float, dense: bool
) -> Iterator[tuple[float, float, Any]]:
    """Integrate phase by phase: begin, end (s) and scipy's solution of `variational_rates` of each."""
    actual = trajectory.departure(start)
    sensitivity = np.zeros((4, SOURCES))
    sensitivity[:, :4] = np.diag([1.0, 1.0 / actual[0], 1.0, 1.0 / actual[0]])
    state = np.concatenate([actual, actual, sensitivity.ravel()])
    for begin, end, phase in trajectory.navigated(start):
        args = (phase.coefficients, float(phase.accelerometers_on), _NO_ERRORS, start, theta_axes)
        shared = np.concatenate([trajectory.shared(begin, phase, state[:8]), state[8:]])
        solution = integrate(variational_rates, (begin, end), shared, TOLERANCES, args, dense_output=dense)
        if solution.status != 0:
            raise ArithmeticError(f"the variational equations broke down at {solution.t[-1]:.1f} s: {solution.message}")
        yield begin, end, solution
        state = solution.y[:, -1]


def linearize(trajectory: Trajectory, start: float, theta_axes: float) -> tuple[Array, Array]:
    """Compute the partial derivatives of the final errors, and the final errors without any error.

    Parameters
    ----------
    start, theta_axes : float
        Start of navigation, s from the first point of the truth; range angle of the reference axes, rad.

    Returns
    -------
    partials : ndarray, shape (4, sources)
        The matrix P of NASA TN D-1772, eq. (13); rows altitude, range, altitude rate, range rate (m, m/s), columns in
        the order of `mcnav.systems.reentry.instruments.Error`.
    nominal : ndarray, shape (4,)
        Final errors of a perfect system: zero unless the accelerometers are switched off above an altitude.
    """
    *_, (_, _, last) = _stretches(trajectory, start, theta_axes, dense=False)
    state = last.y[:, -1]
    return SCALE[:, None] * state[8:].reshape(4, SOURCES), navigation_error(state[:4], state[4:8])


def linearize_throughout(trajectory: Trajectory, start: float, theta_axes: float, times: Array) -> tuple[Array, Array]:
    """Compute partial derivatives of the errors at times of the flight.

    Parameters
    ----------
    trajectory, start, theta_axes
        As those of `linearize`.
    times : ndarray, shape (n,)
        Between the start of navigation and the end, s from the first point of the truth.

    Returns
    -------
    partials : ndarray, shape (n, 4, sources)
    indicated : ndarray, shape (n, 4)
        Polar states that a perfect system indicates.
    """
    partials, indicated = np.empty((len(times), 4, SOURCES)), np.empty((len(times), 4))
    for begin, end, solution in _stretches(trajectory, start, theta_axes, dense=True):
        within = (begin <= times) & (times <= end)
        if within.any():
            states = solution.sol(times[within])
            partials[within], indicated[within] = states[8:].T.reshape(-1, 4, SOURCES), states[4:8].T
    return np.asarray(SCALE[:, None] * partials), indicated
