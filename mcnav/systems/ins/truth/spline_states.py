"""States along splines of position and attitude, at many instants: by compiled code, as scipy's splines have them.

A trajectory of an hour with a hundred rows a second has 720,000 nodes, at which scipy's functions and numpy's take a
microsecond for each of some twenty operations.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
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


class Splines(NamedTuple):
    """Splines of position and attitude.

    Attributes
    ----------
    constants : ndarray
        Of the earth.
    position, vectors : ndarray, shapes (d, k, 3), (4, l, 3)
        Coefficients of the earth-fixed position, and of the rotation vector in an interval, highest power first.
    knots, marks : ndarray, shapes (k + 1,), (l + 1,)
        Boundaries of the intervals, s.
    turns : ndarray, shape (l + 1, 3, 3)
        From body to earth-fixed axes at the marks.
    """

    constants: Array
    position: Array
    knots: Array
    vectors: Array
    marks: Array
    turns: Array


class Instants(NamedTuple):
    """Instants, n of them.

    Attributes
    ----------
    since, times : ndarray, shape (n,)
        Times since the earth-fixed axes were inertial ones, and in the trajectory's time, s.
    of_position, of_attitude : ndarray of int, shape (n,)
        Numbers of the intervals in which they lie.
    """

    since: Array
    times: Array
    of_position: IndexArray
    of_attitude: IndexArray


class SplineStates(NamedTuple):
    """States of a body, as `mcnav.systems.ins.truth.trajectory.TruthStates` has them."""

    position: Array
    velocity: Array
    axes: Array
    force: Array
    rate: Array


@inlined
def _within_interval(x: float, y: float, z: float, half: float, sine: float, turn: Array) -> None:
    """Compute the rotation by a rotation vector v: ``I + sin(a) / a [v] + (1 - cos(a)) / a^2 [v]^2``."""
    turn[0, 0], turn[1, 1] = 1.0 - half * (y * y + z * z), 1.0 - half * (x * x + z * z)
    turn[2, 2] = 1.0 - half * (x * x + y * y)
    turn[0, 1], turn[1, 0] = half * x * y - sine * z, half * x * y + sine * z
    turn[0, 2], turn[2, 0] = half * x * z + sine * y, half * x * z - sine * y
    turn[1, 2], turn[2, 1] = half * y * z - sine * x, half * y * z + sine * x


@inlined
def _force(constants: Array, place: Array, speed: Array, change: Array) -> tuple[float, float, float, float, float]:
    """Compute the force ``r'' + W x (r' + (r' + W x r)) - g``, in e, and the velocity over i along x and y of e."""
    spin = constants[3]
    gx, gy, gz = gravitation(constants, place[0], place[1], place[2])
    cx, cy = speed[0] - spin * place[1], speed[1] + spin * place[0]  # carried along by the earth
    fx, fy = change[0] - spin * (speed[1] + cy) - gx, change[1] + spin * (speed[0] + cx) - gy
    return fx, fy, change[2] - gz, cx, cy


@uncontracted
def states_of_splines(splines: Splines, instants: Instants, out: SplineStates) -> None:
    """Compute the states of a body at instants."""
    constants, turns, spin = splines.constants, splines.turns, splines.constants[3]
    turn, place, speed, change = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    vector, of_vector = np.empty(3), np.empty(3)
    for n in range(len(instants.times)):
        time, j, k = instants.times[n], instants.of_position[n], instants.of_attitude[n]
        for a in range(3):
            place[a], speed[a], change[a] = _evaluate(splines.position, j, a, time - splines.knots[j])
            vector[a], of_vector[a], _ = _evaluate(splines.vectors, k, a, time - splines.marks[k])
        x, y, z = vector[0], vector[1], vector[2]
        sine, half, third = _shares(x * x + y * y + z * z)
        _within_interval(x, y, z, half, sine, turn)
        # rate over e, in the body's axes: v' - (1 - cos(a)) / a^2 v x v' + (a - sin(a)) / a^3 v x (v x v')
        u, v, w = of_vector[0], of_vector[1], of_vector[2]
        p, q, r = y * w - z * v, z * u - x * w, x * v - y * u
        out.rate[n, 0] = u - half * p + third * (y * r - z * q)
        out.rate[n, 1] = v - half * q + third * (z * p - x * r)
        out.rate[n, 2] = w - half * r + third * (x * q - y * p)
        sine, cosine = np.sin(spin * instants.since[n]), np.cos(spin * instants.since[n])
        fx, fy, fz, cx, cy = _force(constants, place, speed, change)
        # column a of the body's axes in e: rate over i, force along it, and the column in i
        for a in range(3):
            first = turns[k, 0, 0] * turn[0, a] + turns[k, 0, 1] * turn[1, a] + turns[k, 0, 2] * turn[2, a]
            second = turns[k, 1, 0] * turn[0, a] + turns[k, 1, 1] * turn[1, a] + turns[k, 1, 2] * turn[2, a]
            polar = turns[k, 2, 0] * turn[0, a] + turns[k, 2, 1] * turn[1, a] + turns[k, 2, 2] * turn[2, a]
            out.rate[n, a] += polar * spin
            out.force[n, a] = first * fx + second * fy + polar * fz
            out.axes[n, 0, a], out.axes[n, 1, a] = cosine * first - sine * second, sine * first + cosine * second
            out.axes[n, 2, a] = polar
        # position and velocity from e to i
        out.position[n, 0] = cosine * place[0] - sine * place[1]
        out.position[n, 1] = sine * place[0] + cosine * place[1]
        out.position[n, 2] = place[2]
        out.velocity[n, 0], out.velocity[n, 1] = cosine * cx - sine * cy, sine * cx + cosine * cy
        out.velocity[n, 2] = speed[2]


def intervals(knots: Array, times: Array) -> NDArray[np.int64]:
    """Return the numbers of the intervals in which times lie; the first and the last one have no outer end."""
    result = np.searchsorted(knots, times, side="right") - 1
    return np.clip(result, 0, len(knots) - 2).astype(np.int64)
