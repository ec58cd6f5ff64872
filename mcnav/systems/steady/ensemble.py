"""The ensemble kernel of a steady flight: deviations in cartesian inertial axes, thousands of samples side by side.

With p the actual position, d = p_i - p that of a sample from it, and dm its force error, the navigator with an altitude
of its own obeys Encke's form of NASA TN D-1772, eqs. (5)-(9),

    d'' = g(p + d) - g(p) + dm.

One whose altitude is slaved keeps |p_i| = r, and moves as a point on that sphere under the measured force m:
``p_i'' = -(|p_i'|^2 / r^2) p_i + m - (m . p_i) p_i / r^2``. As the actual force is g_eff p / r, and |d|^2 = -2 p . d,

    d'' = -rate^2 d - (2 p'.d' + d'.d') p_i / r^2 + (g_eff / r) (-d + (|d|^2 / 2 r^2) p_i) + dm - (dm . p_i) p_i / r^2.

Both give exactly zero without errors. Neither shares an equation with the spherical coordinates of the reference path.
The scheme is DOP853's of eighth order (Hairer, Norsett and Wanner, 1993) with equal steps. Twelve stages are worth it:
24 steps in two hours of cruise leave 4e-8 of the dispersion, where the classical scheme of fourth order left 5e-8 after
823 steps, at eight times the cost.

Errors between the steps are those of the polynomial of eighth degree through d, d' and d'' at three nodes
(`mcnav.numerics.hermite`). With the highest rate at which a deviation changes, `highest_rate`, and steps h, it is off
by ``1.6e-7 (rate h)^9`` of the largest deviation at most, and its velocity by ``7.4e-6 (rate h)^8`` of ``rate`` times
that: 1.1e-9 and 9e-8 for 24 steps in 2.8 hours of cruise.

Samples go through in blocks of `LANES`, in one flat array ``row * LANES + lane``: deviation (3), its rate (3),
misalignment (3), drift (3), biases (3), scale factors (3), the smallest component along the actual position. Further
arrays hold the deviation and its rate at a stage, the accelerations of the stages, and the last three nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled, inlined
from mcnav.compiled.lanes import SMALLEST_COMPONENT, angle_of_half, half_turn
from mcnav.compiled.shapes import check_numbers, check_shape
from mcnav.numerics.hermite import interpolation_weights
from mcnav.systems.steady.truth import Error, SteadyFlight

LANES: Final = 64
"""Samples that go through the kernel side by side: 61 rows of them fit in a first-level cache of 32 kB."""

_ROWS: Final = 19
_TINY: Final = 1e-200

STAGES: Final = DOP853.n_stages
ORDER: Final = DOP853.order
TIMES: Final = np.append(DOP853.C, 1.0)
RATES: Final = np.vstack([DOP853.A, DOP853.B])
PLACES: Final = RATES @ DOP853.A
"""Times of the stages and of the step's end, as shares of the step; weights of the stages' accelerations in the rates
and in the deviations at these times."""


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
def _reach_stage(s: int, step: float, block: Array, stage: Array, forces: Array) -> None:
    """Compute deviations and rates at stage s: ``x + c_s h v + h^2 sum (A^2)_sj a_j`` and ``v + h sum A_sj a_j``.

    With the acceleration a_j of each earlier stage this is a Runge-Kutta method for ``x' = v, v' = a`` with the rates
    v_j eliminated. The step's end is one more stage, whose weights are b and b^T A.
    """
    reach = TIMES[s] * step
    for i in range(LANES):
        for row in range(3):
            stage[row * LANES + i] = block[row * LANES + i] + reach * block[(3 + row) * LANES + i]
            stage[(3 + row) * LANES + i] = block[(3 + row) * LANES + i]
    for j in range(s):
        place, speed_up = PLACES[s, j] * step * step, RATES[s, j] * step
        if place == 0.0 and speed_up == 0.0:
            continue
        at = 3 * j * LANES
        for i in range(LANES):
            fx, fy, fu = forces[at + i], forces[at + LANES + i], forces[at + 2 * LANES + i]
            stage[i] += place * fx
            stage[LANES + i] += place * fy
            stage[2 * LANES + i] += place * fu
            stage[3 * LANES + i] += speed_up * fx
            stage[4 * LANES + i] += speed_up * fy
            stage[5 * LANES + i] += speed_up * fu


@inlined
def _force_errors(
    felt: float, time: float, node: tuple[float, float, float, float], ix: float, iy: float, iu: float, block: Array,
    i: int, level: bool,
) -> tuple[float, float, float]:  # fmt: skip
    """Compute the force error dm of lane i at an indicated position, in inertial axes X, Y, U.

    The axes of the accelerometers are turned by the misalignment and the drifts, ``turn = m + integral of d``. Their
    outputs have biases and scale factors; on a level platform they lie along the indicated local directions.
    """
    sine, cosine, early, late = node
    flat = np.sqrt(ix * ix + iu * iu)
    whole = np.sqrt(flat * flat + iy * iy)
    st, ct, sc, cc = ix / flat, iu / flat, iy / whole, flat / whole
    roll, drift, azimuth = block[9 * LANES + i], block[10 * LANES + i], block[11 * LANES + i]
    # the actual force, g_eff upwards (Z is down), and what turned axes make of it
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
    return ex, ey, eu


@inlined
def _accelerate(
    s: int, time: float, node: tuple[float, float, float, float], constants: Array, slaved: bool, level: bool,
    block: Array, stage: Array, forces: Array,
) -> None:  # fmt: skip
    """Compute the accelerations d'' of stage s, by the equations of the module docstring."""
    radius, rate, felt, mu = constants
    inverse, inverse_square = 1.0 / radius, 1.0 / (radius * radius)
    stiffness, pull, speed = mu * inverse * inverse_square, felt * inverse, radius * rate
    sine, cosine = node[0], node[1]
    px, pu = radius * sine, radius * cosine
    at = 3 * s * LANES
    for i in range(LANES):
        # d, d' and p_i = p + d
        dx, dy, du = stage[i], stage[LANES + i], stage[2 * LANES + i]
        vx, vy, vu = stage[3 * LANES + i], stage[4 * LANES + i], stage[5 * LANES + i]
        ix, iy, iu = px + dx, dy, pu + du
        ex, ey, eu = _force_errors(felt, time, node, ix, iy, iu, block, i, level)
        square = dx * dx + dy * dy + du * du
        if slaved:
            # [g_eff |d|^2 / 2 r - (2 p'.d' + d'.d') - dm.p_i] p_i / r^2 - (rate^2 + g_eff / r) d + dm
            faster = 2.0 * speed * (vx * cosine - vu * sine) + vx * vx + vy * vy + vu * vu
            radial = (0.5 * pull * square - faster - (ex * ix + ey * iy + eu * iu)) * inverse_square
            back = rate * rate + pull
            ax, ay, au = (
                ex + radial * ix - back * dx,
                ey + radial * iy - back * dy,
                eu + radial * iu - back * du,
            )
        else:
            # Encke: (mu / r^3) [(1 - (1 + q)^(-3/2)) p_i - d] + dm, with q = (2 p.d + d.d) / r^2
            q = (2.0 * (px * dx + pu * du) + square) * inverse_square
            cube = (1.0 + q) * np.sqrt(np.abs(1.0 + q))
            share = q * (3.0 + q * (3.0 + q)) / (cube * (1.0 + cube))
            ax = ex + stiffness * (share * ix - dx)
            ay = ey + stiffness * (share * iy - dy)
            au = eu + stiffness * (share * iu - du)
        forces[at + i], forces[at + LANES + i], forces[at + 2 * LANES + i] = ax, ay, au
        # the smallest component of p_i along p, as a share of r
        along = 1.0 + (sine * dx + cosine * du) * inverse
        block[18 * LANES + i] = min(block[18 * LANES + i], along)


@inlined
def _keep_node(number: int, block: Array, forces: Array, kept: Array) -> None:
    """Keep deviation, rate and acceleration at a node among those of the last three."""
    at = (number % 3) * 9 * LANES
    for i in range(6 * LANES):
        kept[at + i] = block[i]
    for i in range(3 * LANES):
        kept[at + 6 * LANES + i] = forces[i]


@inlined
def _interpolate(last: int, weights: Array, kept: Array, between: Array) -> None:
    """Compute deviations and rates at a time, with the weights of the three nodes of which the last has a number."""
    for i in range(6 * LANES):
        between[i] = 0.0
    for node in range(3):
        at = ((last + 1 + node) % 3) * 9 * LANES
        for part in range(2):
            d, v, a = weights[part, 3 * node], weights[part, 3 * node + 1], weights[part, 3 * node + 2]
            for i in range(3 * LANES):
                x = d * kept[at + i] + v * kept[at + 3 * LANES + i] + a * kept[at + 6 * LANES + i]
                between[3 * part * LANES + i] += x


@inlined
def _read_out(
    sine: float, cosine: float, constants: Array, arc: float, slaved: bool, between: Array, errors: Array
) -> None:  # fmt: skip
    """Compute the navigation errors from deviations at a time, formed without cancellation."""
    radius, rate = constants[0], constants[1]
    for i in range(LANES):
        x, cross, u = between[i], between[LANES + i], between[2 * LANES + i]
        vx, vy, vu = between[3 * LANES + i], between[4 * LANES + i], between[5 * LANES + i]
        # along the track and upwards at the actual position
        east, up = x * cosine - u * sine, x * sine + u * cosine
        faster_east, faster_up = vx * cosine - vu * sine, vx * sine + vu * cosine
        # the indicated position: its distance, and the angles to it along and across the track
        ahead = radius + up
        flat = np.sqrt(ahead * ahead + east * east)
        whole = np.sqrt(flat * flat + cross * cross)
        per_flat, per_whole = 1.0 / flat, 1.0 / whole
        s, c, s_lifted, c_lifted = east * per_flat, ahead * per_flat, cross * per_whole, flat * per_whole
        outwards = (radius * rate + faster_east) * s + faster_up * c
        errors[LANES + i] = arc * angle_of_half(east / (flat + ahead))
        errors[2 * LANES + i] = arc * angle_of_half(cross / (whole + flat))
        errors[4 * LANES + i] = arc * (((faster_east - rate * up) * c - (faster_up + rate * east) * s) * per_flat)
        errors[5 * LANES + i] = arc * ((vy * c_lifted - outwards * s_lifted) * per_whole)
        if slaved:  # what is left of them is the scheme's error, and the navigator has them from its altimeter
            errors[i], errors[3 * LANES + i] = 0.0, 0.0
        else:
            errors[i] = (2.0 * radius * up + up * up + east * east + cross * cross) / (radius + whole)
            errors[3 * LANES + i] = outwards * c_lifted + vy * s_lifted


@compiled
def _simulate(
    start: Array, equipment: Array, nodes: Array, step: float, constants: Array, arc: float, slaved: bool, level: bool,
    component: Array, last: IndexArray, weights: Array, directions: Array, outputs: IndexArray, histories: Array,
) -> None:  # fmt: skip
    """Carry samples through the steps, LANES at a time, and read out their errors; components are updated.

    Parameters
    ----------
    nodes : ndarray, shape (steps + 1, stages, 4)
        Sine and cosine of the range angle, and the two times of `SteadyFlight.drifted`.
    last : ndarray of int, shape (m,)
        Node with which each time can be interpolated, rising.
    weights : ndarray, shape (m, 2, 9)
        Of `interpolation_weights`.
    directions : ndarray, shape (m, 2)
        Sine and cosine of the range angle at each time.
    outputs : ndarray of int, shape (k,)
    histories : ndarray, shape (n, m, k)
        Where the errors are put.
    """
    block, stage, forces = np.empty(_ROWS * LANES), np.empty(6 * LANES), np.empty(3 * STAGES * LANES)
    kept, between, errors = np.empty(27 * LANES), np.empty(6 * LANES), np.empty(6 * LANES)
    steps = nodes.shape[0] - 1
    for begin in range(0, start.shape[0], LANES):
        count, time = min(LANES, start.shape[0] - begin), 0
        block[:] = 0.0
        for lane in range(count):
            for row in range(6):
                block[row * LANES + lane] = start[begin + lane, row]
            for row in range(12):
                block[(6 + row) * LANES + lane] = equipment[begin + lane, row]
            block[18 * LANES + lane] = component[begin + lane]
        for number in range(steps + 1):
            for s in range(STAGES):
                _reach_stage(s, step, block, stage, forces)
                node = (nodes[number, s, 0], nodes[number, s, 1], nodes[number, s, 2], nodes[number, s, 3])
                _accelerate(
                    s, (number + TIMES[s]) * step, node, constants, slaved, level, block, stage, forces
                )  # fmt: skip
                if number == steps:  # the last node needs no more than its own acceleration
                    break
            _keep_node(number, block, forces, kept)
            while time < last.shape[0] and last[time] == number:
                _interpolate(number, weights[time], kept, between)
                _read_out(directions[time, 0], directions[time, 1], constants, arc, slaved, between, errors)
                for lane in range(count):
                    for column in range(outputs.shape[0]):
                        histories[begin + lane, time, column] = errors[outputs[column] * LANES + lane]
                time += 1
            if number < steps:
                _reach_stage(STAGES, step, block, stage, forces)
                for i in range(6 * LANES):
                    block[i] = stage[i]
        for lane in range(count):
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


def highest_rate(flight: SteadyFlight) -> float:
    """Compute a bound of the rates at which small deviations swing or grow, rad/s.

    Those of the equations of variation (`mcnav.systems.steady.linearized`), at most ``sqrt(mu / r^3)`` with an altitude
    that is slaved and ``sqrt(rate^2 + 2 mu / r^3)`` without, and ``rate`` by which their axes turn.
    """
    stiffness = flight.earth.gravitational_parameter / flight.radius**3
    return float(flight.rate + np.sqrt(stiffness if flight.slaved else flight.rate**2 + 2.0 * stiffness))


def simulate_ensemble(flight: SteadyFlight, errors: Array, steps: int) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate many samples: their final navigation errors, shape (n, 6).

    For the rest see `simulate_histories`, of which they are the last.
    """
    histories, valid = simulate_histories(flight, errors, steps, np.ones(1))
    return histories[:, 0], valid


def simulate_histories(
    flight: SteadyFlight, errors: Array, steps: int, shares: Array, outputs: Sequence[int] = range(6)
) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate many samples: their navigation errors at some times.

    Parameters
    ----------
    errors : ndarray, shape (n, 18)
        In the order of `mcnav.systems.steady.truth.Error`: m, m/s, rad, rad/s, m/s^2, dimensionless.
    steps : int
        Equal steps of the scheme, at least 2.
    shares : ndarray, shape (m,)
        Times as shares of the flight, rising, from 0 to 1. Between the steps errors are interpolated.
    outputs : sequence of int, length k
        Among altitude, range, cross range and their rates.

    Returns
    -------
    histories : ndarray, shape (n, m, k)
        m, m/s.
    valid : ndarray of bool, shape (n,)
        False for a sample that came within `mcnav.compiled.lanes.SMALLEST_COMPONENT` of where the
        shared grid is too coarse and angles could wrap, or that is not finite: fly it on the reference path.
    """
    errors, chosen = np.asarray(errors, dtype=float), np.asarray(outputs, dtype=np.int64)
    check_shape("errors", errors, (None, len(Error)))
    check_numbers("outputs", chosen, 6)
    if steps < 2 or np.any(np.diff(shares, prepend=0.0, append=1.0) < 0.0):
        raise ValueError("expected at least 2 steps, and shares that rise from 0 to 1")
    step = flight.duration / steps
    times = step * (np.arange(steps + 1)[:, None] + TIMES[:STAGES])
    angles = times * flight.rate
    nodes = np.stack([np.sin(angles), np.cos(angles), *flight.drifted(times)], axis=2)
    turns = [Error.ROLL_MISALIGNMENT, Error.MISALIGNMENT, Error.AZIMUTH_MISALIGNMENT]
    drifts = [Error.ROLL_DRIFT, Error.GYRO_DRIFT, Error.AZIMUTH_DRIFT]
    equipment = np.ascontiguousarray(np.hstack([errors[:, turns], errors[:, drifts], errors[:, Error.BIAS_X :]]))
    equipment[:, [0, 3]] *= -1.0
    start = np.ascontiguousarray(_start(flight, errors))
    shifts = errors[:, [Error.RANGE, Error.CROSS_RANGE]] / flight.radius
    within = (np.abs(shifts) < 0.5 * np.pi).all(axis=1)  # a start farther round would come out wrapped
    component = np.where(within, 1.0 + start[:, 2] / flight.radius, -1.0)
    constants = np.array([flight.radius, flight.rate, flight.effective_gravity, flight.earth.gravitational_parameter])
    last = np.clip(np.ceil(shares * steps), 2, steps).astype(np.int64)
    weights = interpolation_weights(shares * steps - (last - 1), step)
    actual = flight.rate * flight.duration * shares
    directions = np.column_stack([np.sin(actual), np.cos(actual)])
    histories = np.empty((len(errors), len(shares), len(chosen)))
    _simulate(
        start, equipment, nodes, step, constants, flight.earth.radius, flight.slaved, flight.level, component, last,
        weights, directions, chosen, histories,
    )  # fmt: skip
    return histories, (component >= SMALLEST_COMPONENT) & np.isfinite(histories).all(axis=(1, 2))
