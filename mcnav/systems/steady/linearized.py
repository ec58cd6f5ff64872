"""The linearized navigator of a steady flight: equations of variation of `mcnav.systems.steady.navigator`.

About the truth, with h, x and y the errors of radius, range and cross range (arc lengths at the radius r of the flight)
and df the error of the measured force along the true local axes,

    h'' = (rate^2 + 2 mu / r^3) h + 2 rate x' - df_z          (left out when the altitude is slaved)
    x'' = df_x - (g_eff / r) x - 2 rate h'
    y'' = df_y - (g_eff / r + rate^2) y.

Along the track the natural period is 2 pi sqrt(r / g_eff), across it 2 pi sqrt(r / g), and upwards there is none.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.numerics.integration import integrate
from mcnav.systems.steady.truth import Error, SteadyFlight

TOLERANCES: Final = (1e-11, 1e-12)


def force_errors(flight: SteadyFlight, time: float) -> Array:
    """Compute the error of the measured force along the true local x, y, z per unit of each error, shape (3, 18)."""
    felt, angle = flight.effective_gravity, flight.rate * time
    sine, cosine = np.sin(angle), np.cos(angle)
    first, later = flight.drifted(np.array(time))
    errors = np.zeros((3, len(Error)))
    errors[0, [Error.MISALIGNMENT, Error.GYRO_DRIFT]] = -felt, -felt * time
    errors[1, [Error.ROLL_MISALIGNMENT, Error.AZIMUTH_MISALIGNMENT]] = -felt * cosine, felt * sine
    errors[1, Error.ROLL_DRIFT] = -felt * (first * cosine + later * sine)
    errors[1, Error.AZIMUTH_DRIFT] = felt * (first * sine - later * cosine)
    errors[1, Error.BIAS_Y] = 1.0
    if flight.level:
        sine, cosine = 0.0, 1.0  # the accelerometers go with the vertical
    along, down = (cosine, -sine), (sine, cosine)  # the instruments' x and z along the local x and z
    for source, size_x, size_z in ((Error.BIAS_X, 1.0, 1.0), (Error.SCALE_FACTOR_X, felt * sine, -felt * cosine)):
        errors[[0, 2], source] = np.multiply(along, size_x)
        errors[[0, 2], source + 2] = np.multiply(down, size_z)
    return errors


def linearize(flight: SteadyFlight, times: Array) -> Array:
    """Compute the partial derivatives of the navigation errors at some times, shape (n, 6, 18); SI.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s, rising, within the flight.
    """
    radius, rate = flight.radius, flight.rate
    stiffness = flight.effective_gravity / radius
    vertical = rate**2 + 2.0 * flight.earth.gravitational_parameter / radius**3
    sources = len(Error)

    def rates(time: float, state: Array) -> Array:
        e = state.reshape(6, sources)
        force = force_errors(flight, time)
        change = np.empty_like(e)
        change[:3] = e[3:]
        change[3] = 0.0 if flight.slaved else vertical * e[0] + 2.0 * rate * e[4] - force[2]
        change[4] = force[0] - stiffness * e[1] - 2.0 * rate * e[3]
        change[5] = force[1] - (stiffness + rate**2) * e[2]
        return change.ravel()

    start = np.zeros((6, sources))
    lifted = 0.0 if flight.slaved else 1.0
    for row, source in enumerate((Error.ALTITUDE, Error.RANGE, Error.CROSS_RANGE)):
        start[row, source] = start[row + 3, source + 3] = lifted if row == 0 else 1.0
    start[5, Error.AZIMUTH_MISALIGNMENT] = flight.speed
    solution = integrate(rates, (0.0, float(times[-1])), start.ravel(), TOLERANCES, t_eval=times)
    share = flight.earth.radius / radius  # ranges are told at the earth's radius
    scale = np.array([1.0, share, share, 1.0, share, share])
    return np.asarray(solution.y.T.reshape(-1, 6, sources) * scale[:, None])
