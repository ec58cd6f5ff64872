"""The linearized navigator: the timeline of NASA TN D-1772, eqs. (11)-(13), by variational equations.

Truth, zero-error indicated motion and the sensitivities to every error are integrated together by DOP853, phase by
phase, in polar coordinates. Where the accelerometers are always on, the zero-error indicated motion is the truth.

X is the error of the polar state, as `DEVIATIONS` have it. A navigator that starts later has other axes, and other
drift: with the axes turned by an angle, x = X cos + Z sin and z = -X sin + Z cos, biases turn as vectors and factors of
a force along one axis that another feels as products of two; drift that counts from t_s on is a misalignment of -t_s
times the drift less than one that counts from the first point on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.contract.timeline import Start, Timeline
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.starts import start_times
from mcnav.numerics.integration import integrate
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.instruments import Error, indicated_force, measured_force, measured_force_partials
from mcnav.systems.reentry.navigator import joint_rates, navigation_error
from mcnav.systems.reentry.outputs import SCALE, FurtherOutput, append_errors, append_partials
from mcnav.systems.reentry.truth import Trajectory, truth_force
from mcnav.systems.variations import Variations

SOURCES: Final = len(Error)
_NO_ERRORS: Final = np.zeros((1, SOURCES))
TOLERANCES: Final = (1e-11, 1e-12)


@compiled
def variational_rates(
    time: float, state: Array, coefficients: Array, on: float, told: bool, no_errors: Array, start: float,
    theta_axes: float,
) -> Array:  # fmt: skip
    """Compute the rates of truth (4), zero-error indicated state (4) and sensitivities (4 x sources, by rows).

    The zero-error state moves as the truth does where it is ``told``, else as the accelerometers, if they are on, say.

    With e = (r_e, theta_e, r_e', theta_e') and (df_x, df_z) the variation of the indicated force,
    ``r_e'' = (theta'^2 + 2 mu / r^3) r_e + 2 r theta' theta_e' - df_z`` and
    ``r theta_e'' = df_x - theta'' r_e - 2 theta' r_e' - 2 r' theta_e'``.
    """
    rates = np.empty(state.size)
    joint = joint_rates(time, state[:8], coefficients, on, no_errors, start, theta_axes)
    for i in range(8):
        rates[i] = joint[i % 4] if told else joint[i]
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
    trajectory: Trajectory, start: float, theta_axes: float, told: bool
) -> Iterator[tuple[float, float, Any]]:
    """Integrate phase by phase: begin, end (s) and scipy's solution of `variational_rates` of each."""
    actual = trajectory.departure(start)
    sensitivity = np.zeros((4, SOURCES))
    sensitivity[:, :4] = np.diag(start_arcs(actual) / SCALE)
    state = np.concatenate([actual, actual, sensitivity.ravel()])
    for begin, end, phase in trajectory.navigated(start):
        args = (phase.coefficients, float(phase.accelerometers_on), told, _NO_ERRORS, start, theta_axes)
        shared = np.concatenate([trajectory.shared(begin, phase, state[:8]), state[8:]])
        solution = integrate(variational_rates, (begin, end), shared, TOLERANCES, args, dense_output=True)
        if solution.status != 0:
            raise ArithmeticError(f"the variational equations broke down at {solution.t[-1]:.1f} s: {solution.message}")
        yield begin, end, solution
        state = solution.y[:, -1]


def start_arcs(actual: Array) -> Array:
    """Return by how much each initial error moves its output: arcs at the radius of the start, shape (..., 4)."""
    share = EARTH_RADIUS / actual[..., 0]
    return np.stack([np.ones_like(share), share] * 2, axis=-1)


@dataclass(frozen=True)
class LinearNavigator:
    """The navigator linearized about a perfect one, from a start on.

    Attributes
    ----------
    start, theta_axes : float
        Start of navigation, s from the first point of the truth; range angle of the reference axes, rad.
    further : tuple of FurtherOutput
        Outputs after the errors of the polar state.
    told : bool
        Whether the perfect navigator is where the truth is, also where its accelerometers are switched off: later
        starts are then starts of the same one.
    """

    trajectory: Trajectory
    start: float
    theta_axes: float
    further: tuple[FurtherOutput, ...] = ()
    told: bool = False

    @cached_property
    def _solution(self) -> tuple[tuple[float, float, Any], ...]:
        return tuple(_stretches(self.trajectory, self.start, self.theta_axes, self.told))

    def states(self, times: Array) -> Array:
        """Evaluate truth, indicated motion and sensitivities at times, shape (n, 8 + 4 sources)."""
        ends = np.array([end for _, end, _ in self._solution[:-1]])
        numbers, states = np.searchsorted(ends, times), np.empty((len(times), 8 + 4 * SOURCES))
        for number in np.unique(numbers):
            within = numbers == number
            states[within] = self._solution[number][2].sol(times[within]).T
        return states

    def timeline(self, times: Array, axes: str = "trajectory") -> Timeline:
        """Return the timeline with some times among its instants, besides the start.

        Parameters
        ----------
        times : ndarray, shape (n,)
            s from the first point of the truth, none before the start.
        axes : str
            ``trajectory``: a navigator that starts later has the same reference axes; ``start``: it is aligned then.
        """
        instants = np.union1d(self.start, times)
        states = self.states(instants)
        actual, indicated = states[:, :4], states[:, 4:8]
        by_source = SCALE[:, None] * states[:, 8:].reshape(-1, 4, SOURCES)
        arcs = start_arcs(actual)
        by_constant = np.zeros((len(instants), 4, SOURCES + 1))
        by_constant[:, :, 4:-1], by_constant[:, :, -1] = by_source[:, :, 4:], navigation_error(actual, indicated)

        def begin(position: int) -> Start:
            partials = np.zeros((4, SOURCES + 1))
            partials[:, :4] = np.diag(arcs[position])
            turn = actual[position, 1] - self.theta_axes if axes == "start" else 0.0
            return Start(partials, constants=constants_of_start(turn, instants[position] - self.start))

        return Variations(instants, by_source[:, :, :4] / arcs[0], by_constant).timeline(
            begin(0),
            lambda position, time: append_partials(self.further, np.eye(4), indicated[position]),
            begin,
            lambda more: self.timeline(np.union1d(times, more), axes),
        )

    def read(self, times: Array) -> tuple[Array, Array]:
        """Compute partial derivatives of the outputs, and a perfect navigator's outputs, at times.

        Returns
        -------
        partials : ndarray, shape (n, outputs, sources)
            The matrix P of NASA TN D-1772, eq. (13); columns in the order of `Error`.
        nominal : ndarray, shape (n, outputs)
            Zero unless the accelerometers are switched off above an altitude.
        """
        timeline, states = self.timeline(times), self.states(times)
        partials = propagate(timeline, None, timeline.positions(times)).partials[:, :, :-1]
        deviations = navigation_error(states[:, :4], states[:, 4:8])
        if all(phase.accelerometers_on for phase in self.trajectory.phases):
            deviations = np.zeros_like(deviations)  # but for rounding
        return partials, append_errors(self.further, deviations, states[:, :4])

    def final_partials(self, starts: Array, axes: str) -> Array:
        """Compute the partial derivatives of the final outputs for starts at times, shape (n, outputs, sources)."""
        final = self.trajectory.final_time
        timeline = self.timeline(np.append(starts, final), axes)
        readout = timeline.readout(timeline.end, final)
        return start_times(timeline, timeline.end, readout, timeline.positions(starts)).partials[:, :, :-1]


def constants_of_start(turn: float, elapsed: float) -> Array:
    """Return what a start makes of the sources, with axes turned by an angle, rad, and a time, s, after the first one.

    Shape (sources + 1, sources + 1), from errors of this start to those that act alike from the first one on.
    """
    constants = np.eye(SOURCES + 1)
    constants[Error.MISALIGNMENT, Error.GYRO_DRIFT] = -elapsed
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])  # from new axes to old ones
    biases = [Error.BIAS_X, Error.BIAS_Z]
    constants[np.ix_(biases, biases)] = turned
    factors = [Error.SCALE_FACTOR_X, Error.CROSS_AXIS_X, Error.CROSS_AXIS_Z, Error.SCALE_FACTOR_Z]
    constants[np.ix_(factors, factors)] = np.kron(turned, turned)
    return constants
