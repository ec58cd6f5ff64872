"""The adjoint of the linearized navigator: partial derivatives for every start time from one backward sweep.

With ``e' = A e + B d`` the linearized navigator of `mcnav.systems.reentry.linearized` along the truth, the matrix
Lambda that carries an error at time t to the end obeys ``Lambda' = -Lambda A``, ``Lambda(t_f) = I``. The effect of
equipment errors that act from t_s on is an integral of Lambda over the same sweep:

- a constant force error along a reference axis: ``int Lambda b_X dt`` and ``int Lambda b_Z dt``;
- force errors proportional to a force component, from which scale factors, cross-axis sensitivities and misalignment
  in *any* axes follow by rotation: ``int Lambda b_i f_j dt`` for i, j in X, Z;
- misalignment that grows from t_s: ``int Lambda (b_X f_Z - b_Z f_X) t dt`` less t_s times the same without t.

The sweep is along the truth. Where the accelerometers are switched off above an altitude, a perfect navigator departs
from the truth by the drag that it misses, which this neglects.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.compiled.jit import compiled
from mcnav.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.numerics.dense_output import DenseOutput
from mcnav.numerics.integration import integrate
from mcnav.systems.reentry.instruments import Error, measured_force
from mcnav.systems.reentry.truth import Trajectory, truth_force

TOLERANCES: Final = (1e-10, 1e-10)

_NO_ERRORS: Final = np.zeros(len(Error))
_COLUMNS: Final = 11
"""Lambda (4), then the integrals: constant X, Z; X f_X, X f_Z, Z f_X, Z f_Z; turn times t."""


@compiled
def adjoint_rates(
    time: float, matrix: Array, actual: Array, coefficients: Array, on: float, theta_axes: float, no_errors: Array
) -> Array:
    """Compute the rates of Lambda and of its integrals, shape (44,), at a time whose truth is given.

    In scaled states (r_e, r_E theta_e, r_e', r_E theta_e'), so that all of Lambda is of one order.
    """
    rates = np.empty(4 * _COLUMNS)
    values, change = matrix.reshape(4, _COLUMNS), rates.reshape(4, _COLUMNS)
    radius, angle, radius_rate, angle_rate = actual
    force_x, force_z = truth_force(actual, coefficients)
    local = angle - theta_axes
    axis_x, axis_z = measured_force(force_x, force_z, local, 0.0, no_errors)
    sine, cosine = np.sin(local), np.cos(local)
    angle_acceleration = (force_x - 2.0 * radius_rate * angle_rate) / radius
    stiffness = angle_rate * angle_rate + 2.0 * GRAVITATIONAL_PARAMETER / radius**3
    scale = EARTH_RADIUS / radius
    for row in range(4):
        by_altitude, by_range, by_altitude_rate, by_range_rate = values[row, :4]
        # Lambda' = -Lambda A, with A that of `variational_rates` in the scaled states
        change[row, 0] = -(by_altitude_rate * stiffness - by_range_rate * scale * angle_acceleration)
        change[row, 1] = -on * (by_altitude_rate * force_x + by_range_rate * scale * force_z) / EARTH_RADIUS
        change[row, 2] = -(by_altitude - by_range_rate * 2.0 * scale * angle_rate)
        coriolis = by_altitude_rate * radius * angle_rate / EARTH_RADIUS - by_range_rate * radius_rate / radius
        change[row, 3] = -(by_range + 2.0 * coriolis)
        # what a force error along reference axis X or Z does to r_e'' and r_E theta_e''
        along_x = on * (by_range_rate * scale * cosine + by_altitude_rate * sine)
        along_z = on * (by_range_rate * scale * sine - by_altitude_rate * cosine)
        change[row, 4] = -along_x
        change[row, 5] = -along_z
        change[row, 6] = -along_x * axis_x
        change[row, 7] = -along_x * axis_z
        change[row, 8] = -along_z * axis_x
        change[row, 9] = -along_z * axis_z
        change[row, 10] = -(along_x * axis_z - along_z * axis_x) * time
    return rates


@dataclass(frozen=True)
class Adjoint:
    """The finished sweep.

    Attributes
    ----------
    theta_axes : float
        Range angle of the fixed reference axes of the sweep, rad.
    sweeps : tuple of (float, DenseOutput)
        Begin of each phase (s), and the dense output within it, in order of time.
    """

    trajectory: Trajectory
    theta_axes: float
    sweeps: tuple[tuple[float, DenseOutput], ...]

    def partials(self, start: float, axes: str = "start") -> Array:
        """Compute partial derivatives of the final errors for navigation that starts at a time (s), shape (4, sources).

        ``axes`` is ``start`` for reference axes aligned at that time, ``trajectory`` for those of the sweep. Gyro drift
        counts from the start of navigation in both. Rows and columns as in
        `mcnav.systems.reentry.linearized.linearize`.
        """
        number = bisect_right([begin for begin, _ in self.sweeps], start) - 1
        values = np.asarray(self.sweeps[max(number, 0)][1](start)).reshape(4, _COLUMNS)
        actual = self.trajectory.state(start)
        carried, constant = values[:, :4], values[:, 4:6]
        products = values[:, 6:10].reshape(4, 2, 2)
        turn = actual[1] - self.theta_axes if axes == "start" else 0.0
        # horizontal and vertical (down) at the new angle: x = X cos + Z sin, z = -X sin + Z cos
        to_new = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        misalignment = products[:, 0, 1] - products[:, 1, 0]
        turned = np.einsum("rij,ai,bj->rab", products, to_new, to_new)  # force errors along a by the force along b
        partials = np.empty((4, len(Error)))
        partials[:, :4] = carried * [1.0, EARTH_RADIUS / actual[0], 1.0, EARTH_RADIUS / actual[0]]
        partials[:, Error.MISALIGNMENT] = misalignment
        partials[:, Error.GYRO_DRIFT] = values[:, 10] - start * misalignment
        partials[:, [Error.BIAS_X, Error.BIAS_Z]] = constant @ to_new.T
        partials[:, Error.SCALE_FACTOR_X], partials[:, Error.SCALE_FACTOR_Z] = turned[:, 0, 0], turned[:, 1, 1]
        partials[:, Error.CROSS_AXIS_X], partials[:, Error.CROSS_AXIS_Z] = turned[:, 0, 1], turned[:, 1, 0]
        return partials


def sweep(trajectory: Trajectory, theta_axes: float) -> Adjoint:
    """Integrate the adjoint once, from the end of a truth back to its first point.

    Parameters
    ----------
    theta_axes : float
        Range angle of the fixed reference axes, rad.
    """
    state = np.zeros((4, _COLUMNS))
    state[:, :4] = np.eye(4)
    flat = state.ravel()
    sweeps = []
    for phase in reversed(trajectory.phases):
        truth, coefficients, on = phase.solution, phase.coefficients, float(phase.accelerometers_on)

        def rates(time: float, matrix: Array, *fixed: object) -> Array:
            known, layer, switched = fixed
            return adjoint_rates(time, matrix, known(time), layer, switched, theta_axes, _NO_ERRORS)  # type: ignore

        solution = integrate(
            rates, (phase.end, phase.start), flat, TOLERANCES, (truth, coefficients, on), dense_output=True
        )
        if solution.status != 0:
            raise ArithmeticError(f"the adjoint broke down at {solution.t[-1]:.1f} s: {solution.message}")
        sweeps.append((phase.start, solution.sol))
        flat = solution.y[:, -1]
    return Adjoint(trajectory, theta_axes, tuple(reversed(sweeps)))
