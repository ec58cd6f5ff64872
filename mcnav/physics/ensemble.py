"""The ensemble kernel: Encke's form of the navigator, thousands of samples along one shared truth.

The truth does not depend on the navigation errors. In cartesian inertial axes the navigator of NASA TN D-1772,
eqs. (5)-(9), is ``r_i'' = -mu r_i / |r_i|^3 + m``, where the measured force ``m`` of a sample depends on time and on
its equipment errors alone. The deviation ``delta = r_i - r`` therefore obeys

    delta'' = g(r + delta) - g(r) + (m - f)

with ``g(r + delta) - g(r) = (mu / r^3) [F (r + delta) - delta]``, ``F = 1 - (1 + q)^(-3/2)`` and
``q = (2 r . delta + delta . delta) / r^2`` (Encke; Battin's form of F has no cancellation). No errors give
exactly zero.

Axes: X horizontal (east) and Y up at the reference range angle. Samples go through the kernel in blocks of `LANES`,
held in one flat array ``row * LANES + lane`` (rows: see `_load`), so that each statement of the inner loop is one
vector operation and nothing is allocated. The scheme is Nyström's of fourth order for ``y'' = F(t, y)`` on the nodes of
`mcnav.physics.grid`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.constants import EARTH_RADIUS
from mcnav.physics.grid import Grid
from mcnav.physics.jit import compiled, inlined

Array = NDArray[np.float64]

LANES: Final = 64
"""Samples that go through the kernel side by side."""

_ROWS: Final = 11

SMALLEST_COMPONENT: Final = 0.3
"""A sample whose indicated position, resolved along the actual one, falls below this share of the actual radius has
left the kernel's validity: the shared grid is too coarse for its gravity, and its range angle could wrap."""

TURNS_PER_RADIAN: Final = 0.5 / np.pi


@inlined
def half_turn(angle: float) -> tuple[float, float]:
    """Sine and cosine of half an angle (up to a common sign), by Taylor series after reduction: 1e-15 absolute.

    Written out because the library's functions would break the vector loop.
    """
    half = np.pi * (angle * TURNS_PER_RADIAN - np.rint(angle * TURNS_PER_RADIAN))
    z = half * half
    sine = half * (
        1 + z * (-1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * (1 / 362880 + z * (-1 / 39916800 + z * (
            1 / 6227020800 + z * (-1 / 1307674368000 + z * (1 / 355687428096000 - z / 121645100408832000))))))))
    )  # fmt: skip
    cosine = 1 + z * (-1 / 2 + z * (1 / 24 + z * (-1 / 720 + z * (1 / 40320 + z * (-1 / 3628800 + z * (
        1 / 479001600 + z * (-1 / 87178291200 + z * (1 / 20922789888000 + z * (
            -1 / 6402373705728000 + z / 2432902008176640000)))))))))  # fmt: skip
    return sine, cosine


@inlined
def gravity_difference(
    delta_x: float, delta_y: float, position_x: float, position_y: float, inverse_square: float, stiffness: float
) -> tuple[float, float]:
    """g(r + delta) - g(r), m/s^2, with 1 / r^2 and mu / r^3 given."""
    indicated_x, indicated_y = position_x + delta_x, position_y + delta_y
    q = (delta_x * (indicated_x + position_x) + delta_y * (indicated_y + position_y)) * inverse_square
    cube = (1.0 + q) * np.sqrt(np.abs(1.0 + q))
    share = q * (3.0 + q * (3.0 + q)) / (cube * (1.0 + cube))
    return stiffness * (share * indicated_x - delta_x), stiffness * (share * indicated_y - delta_y)


@inlined
def force_error(
    force_x: float, force_down: float, on: float, turn: float,
    bias_x: float, bias_z: float, scale_x: float, scale_z: float,
) -> tuple[float, float]:  # fmt: skip
    """Measured less actual force along X and Y (up), m/s^2: NASA TN D-1772, eqs. (6)-(8), in the reference axes.

    ``turn`` is the platform's misalinement; cos(turn) - 1 is formed as -2 sin^2(turn / 2).
    """
    sine_half, cosine_half = half_turn(turn)
    sine, versine = 2.0 * sine_half * cosine_half, 2.0 * sine_half * sine_half
    turned_x = force_down * sine - force_x * versine
    turned_down = -force_x * sine - force_down * versine
    error_x = turned_x + bias_x + scale_x * (force_x + turned_x + bias_x)
    error_down = turned_down + bias_z + scale_z * (force_down + turned_down + bias_z)
    off = on - 1.0
    return on * error_x + off * force_x, -(on * error_down + off * force_down)


@compiled
def _load(block: Array, errors: Array, first: Array) -> None:
    """Fill a block from errors (n <= LANES, 10) at the first state; lanes beyond n fly without errors.

    Rows: deviation X, Y; its rates; misalinement, drift, biases x, z, scale factors x, z; smallest component so far.
    """
    radius, angle, radius_rate, angle_rate = first
    speed = radius * angle_rate
    block[:] = 0.0
    for lane in range(errors.shape[0]):
        altitude, arc, altitude_rate, arc_rate = errors[lane, :4]
        shift = arc / radius
        chord, middle = 2.0 * np.sin(0.5 * shift), angle + 0.5 * shift
        up_x, up_y = np.sin(angle + shift), np.cos(angle + shift)  # east is (up_y, -up_x)
        faster = radius * (arc_rate / radius) + altitude * (angle_rate + arc_rate / radius)
        turn_x, turn_y = chord * np.cos(middle), -chord * np.sin(middle)  # change of the upward unit vector
        block[lane] = altitude * up_x + radius * turn_x
        block[LANES + lane] = altitude * up_y + radius * turn_y
        block[2 * LANES + lane] = altitude_rate * up_x + radius_rate * turn_x + faster * up_y + speed * turn_y
        block[3 * LANES + lane] = altitude_rate * up_y + radius_rate * turn_y - faster * up_x - speed * turn_x
        within_reach = abs(shift) < 0.5 * np.pi  # a start farther round would come out wrapped
        block[10 * LANES + lane] = (1.0 + altitude / radius) * np.cos(shift) if within_reach else -1.0
        for row in range(4, 10):
            block[row * LANES + lane] = errors[lane, row]


@compiled
def _advance(block: Array, steps: Array, stages: Array) -> None:
    """Carry a block through all steps of the grid."""
    for step in range(steps.shape[0]):
        h, elapsed, on = steps[step]
        x0, y0, square0, stiff0, fx0, fd0 = stages[step, 0]
        x1, y1, square1, stiff1, fx1, fd1 = stages[step, 1]
        x2, y2, square2, stiff2, fx2, fd2 = stages[step, 2]
        half, eighth, halved_square, sixth, mean = 0.5 * h, 0.125 * h * h, 0.5 * h * h, h * h / 6.0, h / 6.0
        for i in range(LANES):
            dx, dy, vx, vy = block[i], block[LANES + i], block[2 * LANES + i], block[3 * LANES + i]
            turn, drift = block[4 * LANES + i] + block[5 * LANES + i] * elapsed, block[5 * LANES + i]
            ux, uz, sx, sz = block[6 * LANES + i], block[7 * LANES + i], block[8 * LANES + i], block[9 * LANES + i]
            gx, gy = gravity_difference(dx, dy, x0, y0, square0, stiff0)
            ex, ey = force_error(fx0, fd0, on, turn, ux, uz, sx, sz)
            ax0, ay0 = gx + ex, gy + ey
            gx, gy = gravity_difference(
                dx + half * vx + eighth * ax0, dy + half * vy + eighth * ay0, x1, y1, square1, stiff1
            )
            ex, ey = force_error(fx1, fd1, on, turn + drift * half, ux, uz, sx, sz)
            ax1, ay1 = gx + ex, gy + ey
            gx, gy = gravity_difference(
                dx + h * vx + halved_square * ax1, dy + h * vy + halved_square * ay1, x2, y2, square2, stiff2
            )
            ex, ey = force_error(fx2, fd2, on, turn + drift * h, ux, uz, sx, sz)
            dx += h * vx + sixth * (ax0 + 2.0 * ax1)
            dy += h * vy + sixth * (ay0 + 2.0 * ay1)
            block[i] = dx
            block[LANES + i] = dy
            block[2 * LANES + i] = vx + mean * (ax0 + 4.0 * ax1 + gx + ex)
            block[3 * LANES + i] = vy + mean * (ay0 + 4.0 * ay1 + gy + ey)
            block[10 * LANES + i] = min(block[10 * LANES + i], 1.0 + square2 * (x2 * dx + y2 * dy))


@compiled
def _store(block: Array, last: Array, outcome: Array, component: Array) -> None:
    """Navigation errors at the last state (NASA TN D-1772, eq. 10), formed from the deviation without cancellation."""
    radius, angle, radius_rate, angle_rate = last
    sine, cosine = np.sin(angle), np.cos(angle)
    speed = radius * angle_rate
    for lane in range(outcome.shape[0]):
        x, y = block[lane], block[LANES + lane]
        vx, vy = block[2 * LANES + lane], block[3 * LANES + lane]
        east, up = x * cosine - y * sine, x * sine + y * cosine
        faster_east, faster_up = vx * cosine - vy * sine, vx * sine + vy * cosine
        q = (up * (2.0 * radius + up) + east * east) / (radius * radius)
        altitude = radius * q / (1.0 + np.sqrt(1.0 + q))
        shift = np.arctan2(east, radius + up)
        s, c, versine = np.sin(shift), np.cos(shift), 2.0 * np.sin(0.5 * shift) ** 2
        outcome[lane, 0] = altitude
        outcome[lane, 1] = EARTH_RADIUS * shift
        outcome[lane, 2] = faster_up * c + faster_east * s + speed * s - radius_rate * versine
        across = faster_east * c - faster_up * s - speed * versine - radius_rate * s
        outcome[lane, 3] = EARTH_RADIUS * (across - altitude * angle_rate) / (radius + altitude)
        component[lane] = block[10 * LANES + lane]


@compiled
def _fly(
    errors: Array, steps: Array, stages: Array, first: Array, last: Array, outcome: Array, component: Array
) -> None:
    block = np.empty(_ROWS * LANES)
    for begin in range(0, errors.shape[0], LANES):
        end = min(begin + LANES, errors.shape[0])
        _load(block, errors[begin:end], first)
        _advance(block, steps, stages)
        _store(block, last, outcome[begin:end], component[begin:end])


def fly_ensemble(grid: Grid, errors: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Final navigation errors of many samples.

    Parameters
    ----------
    grid : Grid
        The shared truth.
    errors : ndarray, shape (n, 10)
        In the order of `mcnav.physics.instruments.Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.

    Returns
    -------
    outcome : ndarray, shape (n, 4)
        Altitude, range, altitude rate, range rate: m, m/s.
    valid : ndarray of bool, shape (n,)
        False for a sample that came within `SMALLEST_COMPONENT` or is not finite: fly it on the reference path.
    """
    errors = np.ascontiguousarray(errors, dtype=float)
    outcome, component = np.empty((len(errors), 4)), np.empty(len(errors))
    _fly(errors, grid.steps, grid.stages, grid.first, grid.last, outcome, component)
    return outcome, (component >= SMALLEST_COMPONENT) & np.isfinite(outcome).all(axis=1)
