"""The ensemble kernel of a steady flight: deviations in cartesian inertial axes, thousands of samples side by side.

With p the actual position, d = p_i - p that of a sample from it, and dm its force error, the navigator with an altitude
of its own obeys Encke's form of NASA TN D-1772, eqs. (5)-(9),

    d'' = g(p + d) - g(p) + dm.

One whose altitude is slaved keeps |p_i| = r, and moves as a point on that sphere under the measured force m:
``p_i'' = -(|p_i'|^2 / r^2) p_i + m - (m . p_i) p_i / r^2``. As the actual force is g_eff p / r, and |d|^2 = -2 p . d,

    d'' = -rate^2 d - (2 p'.d' + d'.d') p_i / r^2 + (g_eff / r) (-d + (|d|^2 / 2 r^2) p_i) + dm - (dm . p_i) p_i / r^2.

Both give exactly zero without errors. Neither shares an equation with the spherical coordinates of the reference path.
The scheme is the classical Runge-Kutta one of fourth order. Samples go through in blocks of `LANES`, in one flat array
``row * LANES + lane``: deviation (3), its rate (3), misalignment (3), drift (3), biases (3), scale factors (3), the
smallest component along the actual position, then the stage's state (6) and the step's sum (6).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.physics.jit import compiled, inlined
from mcnav.physics.lanes import half_turn
from mcnav.physics.reentry.ensemble.kernel import LANES, SMALLEST_COMPONENT
from mcnav.physics.steady.truth import Error, SteadyFlight

_ROWS: Final = 31
_TINY: Final = 1e-200


@inlined
def _turned(
    x: float, y: float, z: float, turn_x: float, turn_y: float, turn_z: float
) -> tuple[float, float, float]:  # fmt: skip
    """Change a vector by turning its axes by a rotation vector: 2 q0 (q x v) + 2 q x (q x v), with the quaternion q."""
    angle = np.sqrt(turn_x * turn_x + turn_y * turn_y + turn_z * turn_z)
    sine, cosine = half_turn(angle)
    share = sine / (angle + _TINY)
    qx, qy, qz = share * turn_x, share * turn_y, share * turn_z
    cx, cy, cz = qy * z - qz * y, qz * x - qx * z, qx * y - qy * x
    return (
        2.0 * (cosine * cx + qy * cz - qz * cy),
        2.0 * (cosine * cy + qz * cx - qx * cz),
        2.0 * (cosine * cz + qx * cy - qy * cx),
    )


@inlined
def _local(x: float, y: float, z: float, st: float, ct: float, sc: float, cc: float) -> tuple[float, float, float]:
    """Resolve a vector in the instruments' axes at the start along those at a position: along, across, down."""
    flat = ct * z - st * x  # down, but for the angle across
    return x * ct + z * st, y * cc + flat * sc, flat * cc - y * sc


@inlined
def _instrument(force: float, change: float, bias: float, scale: float) -> float:
    """Compute the output of an accelerometer less the actual force on it."""
    return change + bias + scale * (force + change + bias)


@inlined
def _advance(block: Array, nodes: Array, first: int, step: float, constants: Array, slaved: bool, level: bool) -> None:
    """Carry a block through steps of which the first has a number.

    ``nodes``, shape (n, 3, 4), are at each stage sine and cosine of the range angle and the two times of
    `SteadyFlight.drifted`.
    """
    radius, rate, felt, mu = constants
    inverse, inverse_square = 1.0 / radius, 1.0 / (radius * radius)
    stiffness, pull = mu * inverse * inverse_square, felt * inverse
    speed = radius * rate
    for number in range(nodes.shape[0]):
        for i in range(6 * LANES):
            block[19 * LANES + i] = block[i]
            block[25 * LANES + i] = 0.0
        for stage in range(4):
            place = (stage + 1) // 2
            sine, cosine, early, late = nodes[number, place]
            time = (first + number + 0.5 * place) * step
            weight = step / 6.0 if stage == 0 or stage == 3 else step / 3.0
            reach = step if stage == 2 else 0.5 * step
            px, pu = radius * sine, radius * cosine
            for i in range(LANES):
                dx, dy, du = block[19 * LANES + i], block[20 * LANES + i], block[21 * LANES + i]
                vx, vy, vu = block[22 * LANES + i], block[23 * LANES + i], block[24 * LANES + i]
                ix, iy, iu = px + dx, dy, pu + du
                flat = np.sqrt(ix * ix + iu * iu)
                whole = np.sqrt(flat * flat + iy * iy)
                st, ct, sc, cc = ix / flat, iu / flat, iy / whole, flat / whole
                roll, drift, azimuth = block[9 * LANES + i], block[10 * LANES + i], block[11 * LANES + i]
                fx, fy, fz = felt * sine, 0.0, -felt * cosine
                cx, cy, cz = _turned(
                    fx, fy, fz,
                    block[6 * LANES + i] + roll * early - azimuth * late,
                    block[7 * LANES + i] + drift * time,
                    block[8 * LANES + i] + roll * late + azimuth * early,
                )  # fmt: skip
                if level:  # into the indicated local directions, where the accelerometers are
                    fx, fy, fz = _local(fx, fy, fz, st, ct, sc, cc)
                    cx, cy, cz = _local(cx, cy, cz, st, ct, sc, cc)
                ex = _instrument(fx, cx, block[12 * LANES + i], block[15 * LANES + i])
                ey = _instrument(fy, cy, block[13 * LANES + i], block[16 * LANES + i])
                eu = -_instrument(fz, cz, block[14 * LANES + i], block[17 * LANES + i])
                if level:  # and back to inertial ones
                    ex, ey, eu = (
                        ex * ct + st * (eu * cc - ey * sc),
                        ey * cc + eu * sc,
                        -ex * st + ct * (eu * cc - ey * sc),
                    )
                square = dx * dx + dy * dy + du * du
                if slaved:
                    faster = 2.0 * speed * (vx * cosine - vu * sine) + vx * vx + vy * vy + vu * vu
                    radial = (0.5 * pull * square - faster - (ex * ix + ey * iy + eu * iu)) * inverse_square
                    back = rate * rate + pull
                    ax, ay, au = (
                        ex + radial * ix - back * dx,
                        ey + radial * iy - back * dy,
                        eu + radial * iu - back * du,
                    )
                else:
                    q = (2.0 * (px * dx + pu * du) + square) * inverse_square
                    cube = (1.0 + q) * np.sqrt(np.abs(1.0 + q))
                    share = q * (3.0 + q * (3.0 + q)) / (cube * (1.0 + cube))
                    ax = ex + stiffness * (share * ix - dx)
                    ay = ey + stiffness * (share * iy - dy)
                    au = eu + stiffness * (share * iu - du)
                block[25 * LANES + i] += weight * vx
                block[26 * LANES + i] += weight * vy
                block[27 * LANES + i] += weight * vu
                block[28 * LANES + i] += weight * ax
                block[29 * LANES + i] += weight * ay
                block[30 * LANES + i] += weight * au
                block[19 * LANES + i] = block[i] + reach * vx
                block[20 * LANES + i] = block[LANES + i] + reach * vy
                block[21 * LANES + i] = block[2 * LANES + i] + reach * vu
                block[22 * LANES + i] = block[3 * LANES + i] + reach * ax
                block[23 * LANES + i] = block[4 * LANES + i] + reach * ay
                block[24 * LANES + i] = block[5 * LANES + i] + reach * au
        for i in range(6 * LANES):
            block[i] += block[25 * LANES + i]
        sine, cosine = nodes[number, 2, 0], nodes[number, 2, 1]
        for i in range(LANES):
            along = 1.0 + (sine * block[i] + cosine * block[2 * LANES + i]) * inverse
            block[18 * LANES + i] = min(block[18 * LANES + i], along)


@compiled
def _simulate(
    deviations: Array, equipment: Array, nodes: Array, first: int, step: float, constants: Array, slaved: bool,
    level: bool, component: Array,
) -> None:  # fmt: skip
    block = np.empty(_ROWS * LANES)
    for begin in range(0, deviations.shape[0], LANES):
        count = min(LANES, deviations.shape[0] - begin)
        block[:] = 0.0
        for lane in range(count):
            for row in range(6):
                block[row * LANES + lane] = deviations[begin + lane, row]
            for row in range(12):
                block[(6 + row) * LANES + lane] = equipment[begin + lane, row]
            block[18 * LANES + lane] = component[begin + lane]
        _advance(block, nodes, first, step, constants, slaved, level)
        for lane in range(count):
            for row in range(6):
                deviations[begin + lane, row] = block[row * LANES + lane]
            component[begin + lane] = block[18 * LANES + lane]


def _start(flight: SteadyFlight, errors: Array) -> Array:
    """Compute the deviations X, Y, U and their rates at the start, formed without cancellation, shape (n, 6)."""
    radius, rate = flight.radius, flight.rate
    lifted = 0.0 if flight.slaved else 1.0
    altitude, altitude_rate = lifted * errors[:, Error.ALTITUDE], lifted * errors[:, Error.ALTITUDE_RATE]
    theta, cross = errors[:, Error.RANGE] / radius, errors[:, Error.CROSS_RANGE] / radius
    azimuth = errors[:, Error.AZIMUTH_MISALIGNMENT]
    faster = errors[:, Error.RANGE_RATE] / radius - 2.0 * rate * np.sin(0.5 * azimuth) ** 2
    across = rate * np.sin(azimuth) + errors[:, Error.CROSS_RANGE_RATE] / radius
    st, ct, sc, cc = np.sin(theta), np.cos(theta), np.sin(cross), np.cos(cross)
    fallen = 2.0 * np.sin(0.5 * theta) ** 2 + 2.0 * ct * np.sin(0.5 * cross) ** 2  # 1 - cos theta cos cross
    whole = radius + altitude
    return np.column_stack(
        [
            whole * cc * st,
            whole * sc,
            altitude - whole * fallen,
            altitude * rate + whole * (faster - (rate + faster) * fallen - across * sc * st) + altitude_rate * cc * st,
            whole * across * cc + altitude_rate * sc,
            -whole * ((rate + faster) * cc * st + across * sc * ct) + altitude_rate * cc * ct,
        ]
    )


def _errors_at(flight: SteadyFlight, time: float, deviations: Array) -> Array:
    """Compute the navigation errors from deviations at a time, formed without cancellation, shape (n, 6)."""
    radius, rate, arc = flight.radius, flight.rate, flight.earth.radius
    sine, cosine = np.sin(rate * time), np.cos(rate * time)
    x, cross, u, vx, vy, vu = deviations.T
    east, up = x * cosine - u * sine, x * sine + u * cosine
    faster_east, faster_up = vx * cosine - vu * sine, vx * sine + vu * cosine
    flat = np.hypot(radius + up, east)
    whole = np.hypot(flat, cross)
    altitude = (2.0 * radius * up + up * up + east * east + cross * cross) / (radius + whole)
    shift, lifted = np.arctan2(east, radius + up), np.arctan2(cross, flat)
    s, c = np.sin(shift), np.cos(shift)
    outwards = (radius * rate + faster_east) * s + faster_up * c
    theta_rate = ((faster_east - rate * up) * c - (faster_up + rate * east) * s) / flat
    cross_rate = (vy * np.cos(lifted) - outwards * np.sin(lifted)) / whole
    altitude_rate = outwards * np.cos(lifted) + vy * np.sin(lifted)
    if flight.slaved:  # what is left of them is the scheme's error, and the navigator has them from its altimeter
        altitude, altitude_rate = np.zeros_like(altitude), np.zeros_like(altitude_rate)
    return np.column_stack([altitude, arc * shift, arc * lifted, altitude_rate, arc * theta_rate, arc * cross_rate])


def simulate_ensemble(flight: SteadyFlight, errors: Array, steps: int) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate many samples: their final navigation errors.

    Parameters
    ----------
    errors : ndarray, shape (n, 18)
        In the order of `mcnav.physics.steady.truth.Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.
    steps : int
        Equal steps of the scheme.

    Returns
    -------
    outcome : ndarray, shape (n, 6)
        Altitude, range, cross range and their rates: m, m/s.
    valid : ndarray of bool, shape (n,)
        False for a sample that came within `mcnav.physics.reentry.ensemble.kernel.SMALLEST_COMPONENT` of where the
        shared grid is too coarse and angles could wrap, or that is not finite: fly it on the reference path.
    """
    histories, valid = simulate_histories(flight, errors, steps, np.array([steps]))
    return histories[:, 0], valid


def simulate_histories(
    flight: SteadyFlight, errors: Array, steps: int, stops: IndexArray
) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate many samples: their navigation errors at some of the steps.

    Parameters
    ----------
    errors : ndarray, shape (n, 18)
    steps : int
        As for `simulate_ensemble`.
    stops : ndarray of int, shape (m,)
        Rising, from 0 (the start) to ``steps`` (the end).

    Returns
    -------
    histories : ndarray, shape (n, m, 6)
    valid : ndarray of bool, shape (n,)
        As for `simulate_ensemble`, until the last stop.
    """
    errors = np.asarray(errors, dtype=float)
    halves = np.linspace(0.0, flight.duration, 2 * steps + 1)
    angles = halves * flight.rate
    known = np.column_stack([np.sin(angles), np.cos(angles), *flight.drifted(halves)])
    nodes = np.stack([known[0:-1:2], known[1::2], known[2::2]], axis=1)
    turns = [Error.ROLL_MISALIGNMENT, Error.MISALIGNMENT, Error.AZIMUTH_MISALIGNMENT]
    drifts = [Error.ROLL_DRIFT, Error.GYRO_DRIFT, Error.AZIMUTH_DRIFT]
    equipment = np.ascontiguousarray(np.hstack([errors[:, turns], errors[:, drifts], errors[:, Error.BIAS_X :]]))
    equipment[:, [0, 3]] *= -1.0
    deviations = np.ascontiguousarray(_start(flight, errors))
    shifts = errors[:, [Error.RANGE, Error.CROSS_RANGE]] / flight.radius
    within = (np.abs(shifts) < 0.5 * np.pi).all(axis=1)  # a start farther round would come out wrapped
    component = np.where(within, 1.0 + deviations[:, 2] / flight.radius, -1.0)
    constants = np.array([flight.radius, flight.rate, flight.effective_gravity, flight.earth.gravitational_parameter])
    step = flight.duration / steps
    histories, reached = np.empty((len(errors), len(stops), 6)), 0
    for number, stop in enumerate(stops):
        ahead = nodes[reached:stop]
        _simulate(deviations, equipment, ahead, reached, step, constants, flight.slaved, flight.level, component)
        histories[:, number] = _errors_at(flight, flight.duration * stop / steps, deviations)
        reached = int(stop)
    return histories, (component >= SMALLEST_COMPONENT) & np.isfinite(histories).all(axis=(1, 2))
