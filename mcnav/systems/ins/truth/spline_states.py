"""States along splines of position and attitude, at many instants: by compiled code, as scipy's splines have them.

A trajectory of an hour with a hundred rows a second has 720,000 nodes, at which scipy's functions and numpy's take a
microsecond for each of some twenty operations.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import inlined, uncontracted
from mcnav.systems.ins.earth import gravitation

SMALL: Final = 0.5
"""Rotation vector, rad, up to which the series of `_shares` has an error below 1e-16."""


@inlined
def _evaluate(coefficients: Array, j: int, axis: int, s: float) -> tuple[float, float, float]:
    """Evaluate a polynomial and its first two derivatives, with the operations in the order of scipy's."""
    value = first = second = 0.0
    degree = coefficients.shape[0] - 1
    power = before = twice_before = 1.0
    for n in range(degree + 1):
        coefficient = coefficients[degree - n, j, axis]
        value = value + coefficient * power
        if n >= 1:
            first = first + coefficient * before * n
        if n >= 2:
            second = second + coefficient * twice_before * (n * (n - 1))
            twice_before = twice_before * s
        if n >= 1:
            before = before * s
        power = power * s
    return value, first, second


@inlined
def _shares(square: float) -> tuple[float, float, float]:
    """Compute ``sin(a) / a``, ``(1 - cos(a)) / a^2`` and ``(a - sin(a)) / a^3`` of the square of an angle."""
    if square < SMALL * SMALL:
        third = 1 / 6 - square * (1 / 120 - square * (1 / 5040 - square * (
            1 / 362880 - square * (1 / 39916800 - square * (1 / 6227020800)))))  # fmt: skip
        half = 1 / 2 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square * (
            1 / 3628800 - square * (1 / 479001600 - square * (1 / 87178291200))))))  # fmt: skip
        return 1.0 - square * third, half, third
    angle = np.sqrt(square)
    sine, half_sine = np.sin(angle), np.sin(0.5 * angle)
    return sine / angle, 2.0 * half_sine * half_sine / square, (angle - sine) / (square * angle)


@uncontracted
def states_of_splines(
    constants: Array, since: Array, instants: Array, of_position: IndexArray, position: Array, knots: Array,
    of_attitude: IndexArray, vectors: Array, marks: Array, turns: Array, out_position: Array, out_velocity: Array,
    axes: Array, force: Array, rate: Array,
) -> None:  # fmt: skip
    """Compute the states of a body, as `mcnav.systems.ins.truth.trajectory.TruthStates` has them.

    Parameters
    ----------
    constants : ndarray
        Of the earth.
    since, instants : ndarray, shape (n,)
        Times since the earth-fixed axes were inertial ones, and in the trajectory's time, s.
    of_position, of_attitude : ndarray of int, shape (n,)
        Numbers of the intervals in which the instants lie.
    position, vectors : ndarray, shapes (d, k, 3), (4, l, 3)
        Coefficients of the earth-fixed position, and of the rotation vector in an interval, highest power first.
    knots, marks : ndarray, shapes (k + 1,), (l + 1,)
        Boundaries of the intervals, s.
    turns : ndarray, shape (l + 1, 3, 3)
        From body to earth-fixed axes at these.
    """
    spin = constants[3]
    turn, place, speed, change = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    vector, of_vector = np.empty(3), np.empty(3)
    for n in range(len(instants)):
        j, k = of_position[n], of_attitude[n]
        for a in range(3):
            place[a], speed[a], change[a] = _evaluate(position, j, a, instants[n] - knots[j])
            vector[a], of_vector[a], _ = _evaluate(vectors, k, a, instants[n] - marks[k])
        x, y, z = vector[0], vector[1], vector[2]
        sine, half, third = _shares(x * x + y * y + z * z)
        # I + sin(a) / a [v] + (1 - cos(a)) / a^2 [v]^2
        turn[0, 0], turn[1, 1] = 1.0 - half * (y * y + z * z), 1.0 - half * (x * x + z * z)
        turn[2, 2] = 1.0 - half * (x * x + y * y)
        turn[0, 1], turn[1, 0] = half * x * y - sine * z, half * x * y + sine * z
        turn[0, 2], turn[2, 0] = half * x * z + sine * y, half * x * z - sine * y
        turn[1, 2], turn[2, 1] = half * y * z - sine * x, half * y * z + sine * x
        u, v, w = of_vector[0], of_vector[1], of_vector[2]
        p, q, r = y * w - z * v, z * u - x * w, x * v - y * u
        rate[n, 0] = u - half * p + third * (y * r - z * q)
        rate[n, 1] = v - half * q + third * (z * p - x * r)
        rate[n, 2] = w - half * r + third * (x * q - y * p)
        sine, cosine = np.sin(spin * since[n]), np.cos(spin * since[n])
        gx, gy, gz = gravitation(constants, place[0], place[1], place[2])
        cx, cy = speed[0] - spin * place[1], speed[1] + spin * place[0]  # carried along by the earth
        fx, fy = change[0] - spin * (speed[1] + cy) - gx, change[1] + spin * (speed[0] + cx) - gy
        fz = change[2] - gz
        for a in range(3):
            first = turns[k, 0, 0] * turn[0, a] + turns[k, 0, 1] * turn[1, a] + turns[k, 0, 2] * turn[2, a]
            second = turns[k, 1, 0] * turn[0, a] + turns[k, 1, 1] * turn[1, a] + turns[k, 1, 2] * turn[2, a]
            polar = turns[k, 2, 0] * turn[0, a] + turns[k, 2, 1] * turn[1, a] + turns[k, 2, 2] * turn[2, a]
            rate[n, a] += polar * spin
            force[n, a] = first * fx + second * fy + polar * fz
            axes[n, 0, a], axes[n, 1, a] = cosine * first - sine * second, sine * first + cosine * second
            axes[n, 2, a] = polar
        out_position[n, 0] = cosine * place[0] - sine * place[1]
        out_position[n, 1] = sine * place[0] + cosine * place[1]
        out_position[n, 2] = place[2]
        out_velocity[n, 0], out_velocity[n, 1] = cosine * cx - sine * cy, sine * cx + cosine * cy
        out_velocity[n, 2] = speed[2]


def intervals(knots: Array, times: Array) -> NDArray[np.int64]:
    """Return the numbers of the intervals in which times lie; the first and the last one have no outer end."""
    result = np.searchsorted(knots, times, side="right") - 1
    return np.clip(result, 0, len(knots) - 2).astype(np.int64)
