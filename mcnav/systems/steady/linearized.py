"""The linearized navigator of a steady flight: equations of variation of `mcnav.systems.steady.navigator`.

About the truth, with h, x and y the errors of radius, range and cross range (arc lengths at the radius r of the flight)
and df the error of the measured force along the true local axes,

    h'' = (rate^2 + 2 mu / r^3) h + 2 rate x' - df_z          (left out when the altitude is slaved)
    x'' = df_x - (g_eff / r) x - 2 rate h'
    y'' = df_y - (g_eff / r + rate^2) y.

Along the track the natural period is 2 pi sqrt(r / g_eff), across it 2 pi sqrt(r / g), and upwards there is none.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.timeline import Start, Timeline
from mcnav.linear.engine.propagate import propagate
from mcnav.numerics.integration import integrate
from mcnav.systems.steady.truth import Error, SteadyFlight
from mcnav.systems.variations import Variations

TOLERANCES: Final = (1e-11, 1e-12)

MOST_GROWTH: Final = 9.0
"""Logarithm of the factor by which errors may grow before integration starts again: S keeps all but four digits."""

STATES: Final = int(Error.MISALIGNMENT)
"""States; the first sources are their errors at the start, one each."""


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


def fly_timeline(flight: SteadyFlight, times: Array) -> Timeline:
    """Return the timeline of the navigation errors: h, x, y and their rates, ranges as arc lengths at the radius r.

    Outputs are ranges at the earth's radius. Its instants are the start and some times.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s, rising, within the flight.
    """
    share = flight.earth.radius / flight.radius
    scale = np.diag([1.0, share, share, 1.0, share, share])
    start = np.zeros((STATES, len(Error) + 1))
    lifted = 0.0 if flight.slaved else 1.0
    for row, source in enumerate((Error.ALTITUDE, Error.RANGE, Error.CROSS_RANGE)):
        start[row, source] = start[row + 3, source + 3] = lifted if row == 0 else 1.0
    start[5, Error.AZIMUTH_MISALIGNMENT] = flight.speed
    return _integrate(flight, np.union1d(0.0, times)).timeline(
        Start(start), lambda position, time: scale, refined=lambda more: fly_timeline(flight, np.union1d(times, more))
    )


def _integrate(flight: SteadyFlight, times: Array) -> Variations:
    """Integrate the equations of variation, again from each time on before which errors may have grown much."""
    radius = flight.radius
    growth = 0.0 if flight.slaved else np.sqrt(2.0 * flight.earth.gravitational_parameter / radius**3 + flight.rate**2)
    again = np.zeros(len(times), dtype=np.bool_)
    begin = 0.0
    for place, time in enumerate(times[:-1].tolist()):
        if growth * (times[place + 1] - begin) > MOST_GROWTH and time > begin:
            again[place], begin = True, time
    by_state, by_constant = np.empty((len(times), STATES, STATES)), np.zeros((len(times), STATES, len(Error) + 1))
    for first, last in pairwise([0, *np.flatnonzero(again).tolist(), len(times) - 1]):
        by_source = _integrate_between(flight, times[first : last + 1])
        after = slice(first + (first > 0), last + 1)
        by_state[after] = by_source[first > 0 :, :, :STATES]
        by_constant[after, :, STATES:-1] = by_source[first > 0 :, :, STATES:]
    return Variations(times, by_state, by_constant, again)


def _integrate_between(flight: SteadyFlight, times: Array) -> Array:
    """Integrate six columns of the state, then those of what acts during the flight, shape (n, 6, 18)."""
    radius, rate = flight.radius, flight.rate
    stiffness = flight.effective_gravity / radius
    vertical = rate**2 + 2.0 * flight.earth.gravitational_parameter / radius**3

    def rates(time: float, state: Array) -> Array:
        e = state.reshape(STATES, len(Error))
        force = force_errors(flight, time)
        change = np.empty_like(e)
        change[:3] = e[3:]
        change[3] = 0.0 if flight.slaved else vertical * e[0] + 2.0 * rate * e[4] - force[2]
        change[4] = force[0] - stiffness * e[1] - 2.0 * rate * e[3]
        change[5] = force[1] - (stiffness + rate**2) * e[2]
        return change.ravel()

    begin = np.eye(STATES, len(Error)).ravel()
    if len(times) == 1:
        return begin.reshape(1, STATES, len(Error))
    solution = integrate(rates, (float(times[0]), float(times[-1])), begin, TOLERANCES, t_eval=times)
    return np.asarray(solution.y.T.reshape(-1, STATES, len(Error)))


def linearize(flight: SteadyFlight, times: Array) -> Array:
    """Compute the partial derivatives of the navigation errors at some times, shape (n, 6, 18); SI.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s, rising, within the flight.
    """
    timeline = fly_timeline(flight, times)
    return propagate(timeline, None, timeline.positions(times)).partials[:, :, :-1]
