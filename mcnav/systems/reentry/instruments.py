"""The inertial instruments: accelerometers on a misaligned, drifting platform (NASA TN D-1772, eqs. 6-8).

The platform holds the reference axes, the local horizontal and vertical at range angle ``theta_axes``; its misalignment
is ``Theta_a = Theta_a0 + Theta_a' (t - t_s)``. Errors come as one array in the order of `Error`.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled


class Error(IntEnum):
    """Position of each initial-condition and equipment error in an array of errors (the columns of P)."""

    ALTITUDE = 0
    RANGE = 1
    ALTITUDE_RATE = 2
    RANGE_RATE = 3
    MISALIGNMENT = 4
    GYRO_DRIFT = 5
    BIAS_X = 6
    BIAS_Z = 7
    SCALE_FACTOR_X = 8
    SCALE_FACTOR_Z = 9
    CROSS_AXIS_X = 10
    CROSS_AXIS_Z = 11


@compiled
def measured_force(force_x: float, force_z: float, angle: float, elapsed: float, errors: Array) -> tuple[float, float]:
    """Compute the outputs of the two accelerometers, m/s^2.

    With ``a = -angle + Theta_a0 + Theta_a' elapsed`` the axes feel ``f_xa = f_x cos a + f_z sin a`` and
    ``f_za = -f_x sin a + f_z cos a``, and the outputs are ``(f_xa + U_x)(1 + S_x)`` and ``(f_za + U_z)(1 + S_z)``. The
    report has no cross-axis sensitivity; ``K_x f_za`` and ``K_z f_xa`` add to its outputs.

    Parameters
    ----------
    force_x, force_z : float
        Actual specific force, local horizontal (east) and vertical (down), m/s^2.
    angle : float
        Actual range angle less that of the reference axes, theta - theta_axes, rad.
    elapsed : float
        Time since the start of navigation, s.
    errors : ndarray, shape (sources,)
        In the order of `Error`.
    """
    turn = -angle + errors[Error.MISALIGNMENT] + errors[Error.GYRO_DRIFT] * elapsed
    cosine, sine = np.cos(turn), np.sin(turn)
    along_x = force_x * cosine + force_z * sine
    along_z = -force_x * sine + force_z * cosine
    measured_x = (along_x + errors[Error.BIAS_X]) * (1.0 + errors[Error.SCALE_FACTOR_X])
    measured_z = (along_z + errors[Error.BIAS_Z]) * (1.0 + errors[Error.SCALE_FACTOR_Z])
    return measured_x + errors[Error.CROSS_AXIS_X] * along_z, measured_z + errors[Error.CROSS_AXIS_Z] * along_x


@compiled
def measured_force_partials(along_x: float, along_z: float, elapsed: float, partials: Array) -> None:
    """Write the partial derivatives of `measured_force` by the errors, at none, into an array of shape (2, sources).

    Parameters
    ----------
    along_x, along_z : float
        Outputs without errors, m/s^2.
    elapsed : float
        Time since the start of navigation, s.
    """
    partials[:] = 0.0
    partials[0, Error.MISALIGNMENT], partials[1, Error.MISALIGNMENT] = along_z, -along_x
    partials[0, Error.GYRO_DRIFT], partials[1, Error.GYRO_DRIFT] = along_z * elapsed, -along_x * elapsed
    partials[0, Error.BIAS_X] = partials[1, Error.BIAS_Z] = 1.0
    partials[0, Error.SCALE_FACTOR_X], partials[1, Error.SCALE_FACTOR_Z] = along_x, along_z
    partials[0, Error.CROSS_AXIS_X], partials[1, Error.CROSS_AXIS_Z] = along_z, along_x


@compiled
def indicated_force(measured_x: float, measured_z: float, angle: float) -> tuple[float, float]:
    """Resolve the measured force along the indicated horizontal and vertical (down), m/s^2 (TN D-1772, eq. 9).

    ``angle`` is the indicated range angle less that of the reference axes, theta_i - theta_axes, rad.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return measured_x * cosine + measured_z * sine, -measured_x * sine + measured_z * cosine
