"""The navigator of a steady flight in spherical coordinates: the reference path, one sample at a time.

NASA TN D-1772, eqs. (5)-(10), with a coordinate across the track added, of which the report's plane has none:

    r''         = r cross'^2 + r theta'^2 cos^2 cross - f_z - mu / r^2      (left out when the altitude is slaved)
    r theta''   = f_x / cos cross - 2 r' theta' + 2 r theta' cross' tan cross
    r cross''   = f_y - 2 r' cross' - r theta'^2 sin cross cos cross

with the forces (f_x, f_y, f_z) that the instruments measure, along the indicated directions. No frequency is put in:
the Schuler oscillation is what these equations do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, uncontracted
from mcnav.numerics.dop853 import LEFT, REACHED, advance, integrate_compiled
from mcnav.numerics.integration import Diverged
from mcnav.systems.steady.truth import Error, SteadyFlight, navigation_error

TOLERANCES: Final = (1e-12, np.array([1e-6, 1e-14, 1e-14, 1e-9, 1e-17, 1e-17]))
"""DOP853's, for r, theta, cross and their rates: m, rad, m/s, rad/s."""

RADIUS: Final = 0
ACROSS: Final = 2
"""Places in the state."""

LOWEST_SHARE: Final = 0.01
"""An indicated position nearer to the earth's centre than this share of the actual radius ends the simulation."""

STEEPEST: Final = 1.5
"""Across the track (rad) the coordinates end at the pole of the great circle; so far from it they still serve."""


@compiled
def misaligned(force: Array, turn: Array) -> Array:
    """Turn the axes of a vector by a rotation vector (rad), shape (3,): Rodrigues' formula."""
    angle = np.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
    if angle == 0.0:
        return force.copy()
    axis = turn / angle
    cosine, sine = np.cos(angle), np.sin(angle)
    along = (1.0 - cosine) * (axis[0] * force[0] + axis[1] * force[1] + axis[2] * force[2])
    turned = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turned[i] = cosine * force[i] + sine * (axis[j] * force[k] - axis[k] * force[j]) + along * axis[i]
    return turned


@compiled
def resolved(force: Array, theta: float, cross: float) -> Array:
    """Resolve a vector along, across (right) and down at a position from the instruments' axes, shape (3,)."""
    ahead = np.cos(theta) * force[0] + np.sin(theta) * force[2]
    down = np.cos(theta) * force[2] - np.sin(theta) * force[0]  # in the plane of the great circle
    result = np.empty(3)
    result[0] = ahead
    result[1] = np.cos(cross) * force[1] + np.sin(cross) * down
    result[2] = np.cos(cross) * down - np.sin(cross) * force[1]
    return result


@compiled
def indicated_rates(
    time: float, state: Array, errors: Array, radius: float, rate: float, force: float, mu: float, slaved: bool,
    level: bool,
) -> Array:  # fmt: skip
    """Compute the rates of (r, theta, cross, r', theta', cross') of the indicated motion, shape (6,)."""
    # the actual force, g_eff upwards, in the instruments' axes at the start
    angle = rate * time
    felt = np.array([force * np.sin(angle), 0.0, -force * np.cos(angle)])
    first, later = time, 0.0  # how long the gyros have drifted about their first axes, and a quarter turn on
    if level and rate != 0.0:
        first, later = np.sin(angle) / rate, (1.0 - np.cos(angle)) / rate
    # turn of the axes: misalignment and integral of the drifts
    roll, azimuth = -errors[10], errors[11]
    turn = np.array(
        [
            -errors[7] + roll * first - azimuth * later,
            errors[6] + errors[9] * time,
            errors[8] + roll * later + azimuth * first,
        ]
    )
    r, theta, cross, r_rate, theta_rate, cross_rate = state
    felt = misaligned(felt, turn)
    if level:
        felt = resolved(felt, theta, cross)
    # accelerometers: (f + bias) (1 + scale factor)
    measured = (felt + errors[12:15]) * (1.0 + errors[15:18])
    if not level:
        measured = resolved(measured, theta, cross)
    # spherical coordinates: r'' = r (cross'^2 + theta'^2 cos^2 cross) + f_up - mu / r^2, and those of the angles
    rates = np.empty(6)
    rates[0], rates[1], rates[2], rates[3] = r_rate, theta_rate, cross_rate, 0.0
    if not slaved:
        rates[3] = r * (cross_rate**2 + (theta_rate * np.cos(cross)) ** 2) - measured[2] - mu / (r * r)
    along = (measured[0] / np.cos(cross) - 2.0 * r_rate * theta_rate) / r
    rates[4] = along + 2.0 * theta_rate * cross_rate * np.tan(cross)
    rates[5] = (measured[1] - 2.0 * r_rate * cross_rate) / r - theta_rate**2 * np.sin(cross) * np.cos(cross)
    return rates


@uncontracted
def _advance(
    args: Any, bound: float, relative: float, absolute: Array, limits: Array, step: float, times: Array, states: Array
) -> tuple[int, int, float]:
    """Take steps of `indicated_rates`; see `mcnav.numerics.dop853.advance`."""
    return advance(indicated_rates, args, bound, relative, absolute, limits, step, times, states)


def indicated_start(flight: SteadyFlight, errors: Array) -> Array:
    """Add the initial errors to the actual state: the indicated start, shape (4,) (NASA TN D-1772, eq. 10).

    The start's velocity is known along the platform's axes: an azimuth misalignment turns it, as a missile launched
    into the wrong direction (the seed's Problem 1).
    """
    azimuth, radius = errors[Error.AZIMUTH_MISALIGNMENT], flight.radius
    lifted = 0.0 if flight.slaved else 1.0
    return np.array(
        [
            radius + lifted * errors[Error.ALTITUDE],
            errors[Error.RANGE] / radius,
            errors[Error.CROSS_RANGE] / radius,
            lifted * errors[Error.ALTITUDE_RATE],
            flight.rate * np.cos(azimuth) + errors[Error.RANGE_RATE] / radius,
            flight.rate * np.sin(azimuth) + errors[Error.CROSS_RANGE_RATE] / radius,
        ]
    )


def simulate_indicated(
    flight: SteadyFlight, errors: Array, watch: Callable[[Array, Array], None] = lambda times, states: None
) -> Array:
    """Simulate one sample along a truth: its final navigation errors.

    Parameters
    ----------
    errors : ndarray, shape (18,)
        In the order of `Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.
    watch : callable
        Called with the integrator's steps, also of a flight that diverges: times, shape (m,), s; states, shape (6, m).

    Raises
    ------
    Diverged
        When the indicated position comes near the earth's centre or the great circle's pole, or breaks down.
    """
    limits = np.array([[-np.inf] * 6, [np.inf] * 6])
    limits[0, RADIUS], limits[:, ACROSS] = LOWEST_SHARE * flight.radius, (-STEEPEST, STEEPEST)
    start = indicated_start(flight, errors)
    if not np.all((limits[0] <= start) & (start <= limits[1])):
        raise Diverged(f"the indicated flight starts at radius {start[0]:.6g} m, {start[2]:.3g} rad across the track")
    whole, earth = np.ascontiguousarray(errors), flight.earth.gravitational_parameter
    args = (whole, flight.radius, flight.rate, flight.effective_gravity, earth, flight.slaved, flight.level)
    steps = integrate_compiled(_advance, (0.0, flight.duration), start, TOLERANCES, limits, args)
    watch(steps.times, steps.states.T)
    last = steps.states[-1]
    if steps.status == LEFT:
        across = abs(last[ACROSS]) / STEEPEST > limits[0, RADIUS] / last[RADIUS]  # the limit that is met, to rounding
        where = "the pole of the great circle" if across else "the earth's centre"
        raise Diverged(f"the indicated position came near {where} at {steps.times[-1]:.0f} s")
    if steps.status != REACHED:
        raise Diverged(f"the integration broke down at {steps.times[-1]:.1f} s: its steps became too small")
    return navigation_error(flight, last)
