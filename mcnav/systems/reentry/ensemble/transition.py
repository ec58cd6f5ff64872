"""The linear response of the navigator: what a small deviation becomes, along the truth, in cartesian axes.

A perfect navigator moves along a *reference* ``r``: the truth itself, or, where the accelerometers are switched off
above an altitude, what the missing forces leave of it. A deviation from the reference obeys, to first order,

    delta'' = G delta + U,        G = (mu / r^3) (3 r r^T / r^2 - 1),

with ``U`` a constant error of the accelerometers that are on. Its solution, ``delta = M c + N U``, has two tables: the
transition matrix ``M(t)`` from the start of navigation, and ``N(t)``, the response to unit biases along X and Z.
They are integrated with truth and reference by DOP853, phase by phase; every sample of a campaign shares them.

Axes: X horizontal (east), Y up and Z down at the range angle of the reference axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.numerics.dense_output import DenseOutput
from mcnav.numerics.elements import stack_elements
from mcnav.numerics.integration import integrate
from mcnav.physics.constants import GRAVITATIONAL_PARAMETER
from mcnav.systems.reentry.truth import Phase, Trajectory, motion, truth_force

COLUMNS: Final = 6
"""Start deviation X, Y (m), its rates (m/s); constant accelerometer errors along X, Z (m/s^2)."""

_OF_COLUMNS: Final = np.array([1.0, 1.0, 1e3, 1e3, 1e6, 1e6])
_OF_STATES: Final = [1e-5, 1e-12, 1e-8, 1e-15, 1e-5, 1e-5, 1e-8, 1e-8]
TOLERANCES: Final = (
    1e-12,
    np.concatenate([_OF_STATES, *[1e-10 * _OF_COLUMNS] * 2, *[1e-13 * _OF_COLUMNS] * 2]),
)
"""DOP853's tolerances for truth (polar), reference and response: m, rad, m/s, rad/s, per unit of each column."""


@compiled
def axis_force(state: Array, coefficients: Array, theta_axes: float) -> tuple[float, float]:
    """Compute specific force on the vehicle along the reference axes X (east) and Z (down), m/s^2, at a polar state."""
    force_x, force_z = truth_force(state, coefficients)
    sine, cosine = np.sin(state[1] - theta_axes), np.cos(state[1] - theta_axes)
    return force_x * cosine - force_z * sine, force_x * sine + force_z * cosine


@compiled
def response_rates(time: float, state: Array, coefficients: Array, on: float, theta_axes: float) -> Array:
    """Compute the rates of truth (4, polar), reference (X, Y and rates) and response (4 x 6, by rows), shape (32,)."""
    rates = np.empty(8 + 4 * COLUMNS)
    force_x, force_z = truth_force(state[:4], coefficients)
    motion(state[:4], force_x, force_z, rates[:4])
    along_x, along_z = axis_force(state[:4], coefficients, theta_axes)
    # reference: r'' = f - mu r / |r|^3, with f where the accelerometers are on
    x, y = state[4], state[5]
    square = x * x + y * y
    stiffness = GRAVITATIONAL_PARAMETER / (square * np.sqrt(square))
    rates[4], rates[5] = state[6], state[7]
    rates[6] = on * along_x - stiffness * x
    rates[7] = -on * along_z - stiffness * y
    response, change = state[8:].reshape(4, COLUMNS), rates[8:].reshape(4, COLUMNS)
    for column in range(COLUMNS):
        # each column of the response: delta'' = (mu / r^3) (3 r (r.delta) / r^2 - delta)
        along = 3.0 * (x * response[0, column] + y * response[1, column]) / square
        change[0, column] = response[2, column]
        change[1, column] = response[3, column]
        change[2, column] = stiffness * (along * x - response[0, column])
        change[3, column] = stiffness * (along * y - response[1, column])
    # and of the biases: + U along X, and along Z, which is down
    change[2, 4] += on
    change[3, 5] -= on
    return rates


@dataclass(frozen=True)
class Tables:
    """Reference, force and response at some times, rotated into the reference's own east and up.

    Attributes
    ----------
    radius : ndarray, shape (n,)
        Of the reference, m.
    force : ndarray, shape (n, 2)
        Specific force that acts on accelerometers that are on, along the reference axes X and Z, m/s^2.
    response : ndarray, shape (n, 2, 6)
        Position deviation east and up (m) by columns of `COLUMNS`.
    push : ndarray, shape (n, 4, 2)
        What an acceleration east or up adds per second to the start deviation that would lead here:
        ``M^-1 [0; 1]``, s and dimensionless.
    push_axes : ndarray, shape (n, 4, 2)
        The same for accelerations along the reference axes X and Z.
    """

    radius: Array
    force: Array
    response: Array
    push: Array
    push_axes: Array


@dataclass(frozen=True)
class Response:
    """The finished integration.

    Attributes
    ----------
    start, end : float
        Start of navigation and end of the flight, s from the first point of the truth.
    theta_axes : float
        Range angle of the reference axes, rad.
    first, last : ndarray, shape (4,)
        Polar state of the reference at start and end, the range angle counted from the reference axes.
    nominal : ndarray, shape (4,)
        Polar state of the reference less that of the truth at the end; exactly zero where the two are one.
    final : ndarray, shape (4, 6)
        Response at the end: deviation east, up and its rates in these directions, by columns of `COLUMNS`.
    steps, radii : ndarray, shape (n,)
        Ends of the integrator's steps, s: a kink of the truth is always among them. Radius of the reference there, m.
    stretches : tuple of (float, Phase, DenseOutput)
        End of each phase (s), the phase, and the dense output within it.
    """

    start: float
    end: float
    theta_axes: float
    first: Array
    last: Array
    nominal: Array
    final: Array
    steps: Array
    radii: Array
    stretches: tuple[tuple[float, Phase, DenseOutput], ...]

    def at(self, times: Array) -> Tables:
        """Evaluate the tables at rising times within the flight (s), shape (n,)."""
        states, forces = self._states(times)
        radius = np.hypot(states[:, 4], states[:, 5])
        to_local = _to_local(np.arctan2(states[:, 4], states[:, 5]))
        by_axes = states[:, 8:20].reshape(-1, 2, COLUMNS)  # positions X, Y
        # M is symplectic: with M = [A B; C D] the last two columns of its inverse are [-B^T; A^T]
        push = np.concatenate([-by_axes[:, :, 2:4].swapaxes(1, 2), by_axes[:, :, 0:2].swapaxes(1, 2)], axis=1)
        return Tables(radius, forces, to_local @ by_axes, push @ to_local.swapaxes(1, 2), push * np.array([1.0, -1.0]))

    def deviations(self, times: Array) -> tuple[Array, Array, Array]:
        """Tabulate what turns c and biases into navigation errors at rising times (s), shape (n,).

        Returns
        -------
        response : ndarray, shape (n, 4, 6)
            As `final`, at each time.
        reference, nominal : ndarray, shape (n, 4)
            As `last` and `nominal`, at each time.
        """
        states, _ = self._states(times)
        truth = states[:, :4] - [0.0, self.theta_axes, 0.0, 0.0]
        on_truth = all(phase.accelerometers_on for _, phase, _ in self.stretches)
        reference = truth
        if not on_truth:
            reference = np.array([_polar(state[4:8], near[1]) for state, near in zip(states, truth, strict=True)])
        by_axes = states[:, 8:].reshape(-1, 2, 2, COLUMNS)  # position and rate, along X and Y
        response = _to_local(reference[:, 1])[:, None] @ by_axes
        return response.reshape(-1, 4, COLUMNS), reference, reference - truth

    def _states(self, times: Array) -> tuple[Array, Array]:
        """Evaluate states of `response_rates`, shape (n, 32), and forces as in `Tables`, at rising times."""
        cuts = np.searchsorted(times, [end for end, _, _ in self.stretches])
        cuts[-1] = len(times)
        states, forces = np.empty((len(times), 8 + 4 * COLUMNS)), np.empty((len(times), 2))
        begin = 0
        for cut, (_, phase, solution) in zip(cuts, self.stretches, strict=True):
            if cut > begin:
                states[begin:cut] = solution(times[begin:cut]).T
                if phase.accelerometers_on:
                    _forces(states[begin:cut], phase.coefficients, self.theta_axes, forces[begin:cut])
                else:
                    forces[begin:cut] = 0.0
                begin = cut
        return states, forces


def _to_local(angle: Array) -> Array:
    """Form the matrices that turn components along X and Y into east and up at polar angles, shape (n, 2, 2)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return stack_elements([[cosine, -sine], [sine, cosine]])


@compiled
def _forces(states: Array, coefficients: Array, theta_axes: float, forces: Array) -> None:
    for row in range(len(states)):
        forces[row, 0], forces[row, 1] = axis_force(states[row, :4], coefficients, theta_axes)


def linear_response(trajectory: Trajectory, start: float, theta_axes: float) -> Response:
    """Integrate truth, reference and response from the start of navigation (s) to the end.

    Parameters
    ----------
    start, theta_axes : float
        Start of navigation, s from the first point of the truth; range angle of the reference axes, rad.
    """
    actual = trajectory.departure(start)
    first = actual - [0.0, theta_axes, 0.0, 0.0]
    state = np.concatenate([actual, _cartesian(first), np.eye(4, COLUMNS).ravel()])
    stretches, steps, radii = [], [np.array([start])], [first[:1]]
    for begin, end, phase in trajectory.navigated(start):
        if begin > start:
            state[:4] = phase.solution(begin)
        args = (phase.coefficients, float(phase.accelerometers_on), theta_axes)
        solution = integrate(response_rates, (begin, end), state, TOLERANCES, args, dense_output=True)
        if solution.status != 0:
            raise ArithmeticError(f"the linear response broke down at {solution.t[-1]:.1f} s: {solution.message}")
        state = solution.y[:, -1].copy()
        stretches.append((end, phase, solution.sol))
        steps.append(solution.t[1:])
        radii.append(np.hypot(solution.y[4, 1:], solution.y[5, 1:]))
    truth = trajectory.state(trajectory.final_time) - [0.0, theta_axes, 0.0, 0.0]
    on_truth = all(phase.accelerometers_on for _, phase, _ in stretches)
    last = truth if on_truth else _polar(state[4:8], truth[1])
    final = state[8:].reshape(2, 2, COLUMNS)  # position and rate, along X and Y
    return Response(
        start,
        trajectory.final_time,
        theta_axes,
        first,
        last,
        last - truth,
        np.concatenate(_to_local(last[1]) @ final),
        np.concatenate(steps),
        np.concatenate(radii),
        tuple(stretches),
    )


def _cartesian(polar: Array) -> Array:
    """Convert a polar state whose angle counts from the reference axes to X, Y and rates."""
    radius, angle, radius_rate, angle_rate = polar
    sine, cosine, across = np.sin(angle), np.cos(angle), radius * angle_rate
    return np.array(
        [radius * sine, radius * cosine, radius_rate * sine + across * cosine, radius_rate * cosine - across * sine]
    )


def _polar(cartesian: Array, near: float) -> Array:
    """Convert X, Y and rates to a polar state, its angle within half a turn of another one (rad)."""
    x, y, rate_x, rate_y = cartesian
    radius = np.hypot(x, y)
    angle = np.arctan2(x, y)
    angle += 2.0 * np.pi * np.rint((near - angle) / (2.0 * np.pi))
    return np.array([radius, angle, (x * rate_x + y * rate_y) / radius, (y * rate_x - x * rate_y) / (radius * radius)])
