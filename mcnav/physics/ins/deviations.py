"""Navigation errors from deviations in inertial axes, and deviations from initial errors: exact, not to first order.

A sample's state is the rotation from true to indicated axes, a quaternion (scalar first), and the deviations of
velocity and position, all in inertial axes. Without errors all results are exactly zero.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.physics.ins.earth import geodetic
from mcnav.physics.ins.truth import Truth
from mcnav.physics.jit import uncontracted

LOCAL: Final = 15
"""Numbers of a local state: latitude, longitude, altitude; velocity in n; axes from n to i, by rows."""


@uncontracted
def _locate(constants: Array, angle: float, position: Array, velocity: Array, out: Array) -> None:
    """Compute the local state of an inertial position and velocity; the earth has turned by an angle.

    Parameters
    ----------
    position, velocity : ndarray, shape (3,)
    out : ndarray, shape (15,)
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y = cosine * position[0] + sine * position[1], cosine * position[1] - sine * position[0]
    latitude, longitude, altitude = geodetic(constants, x, y, position[2])
    out[0], out[1], out[2] = latitude, longitude, altitude
    sf, cf = np.sin(latitude), np.cos(latitude)
    sl, cl = np.sin(longitude + angle), np.cos(longitude + angle)
    u = velocity[0] + constants[3] * position[1]
    v = velocity[1] - constants[3] * position[0]
    w = velocity[2]
    level = u * cl + v * sl
    out[3] = w * cf - level * sf
    out[4] = v * cl - u * sl
    out[5] = -level * cf - w * sf
    out[6], out[7], out[8] = -sf * cl, -sl, -cf * cl
    out[9], out[10], out[11] = -sf * sl, cl, -cf * sl
    out[12], out[13], out[14] = cf, 0.0, -sf


@uncontracted
def _compare(constants: Array, truth: Array, indicated: Array, turn: Array, out: Array) -> None:
    """Compute the navigation errors from the true and the indicated local state.

    Parameters
    ----------
    truth, indicated : ndarray, shape (15,)
    turn : ndarray, shape (4,)
        Quaternion from true to indicated axes, in i.
    out : ndarray, shape (9,)
        In the order of `mcnav.physics.ins.instruments.OUTPUTS`.
    """
    sine = np.sin(truth[0])
    w = 1.0 - constants[1] * sine * sine
    prime = constants[0] / np.sqrt(w)
    meridian = prime * (1.0 - constants[1]) / w
    along = indicated[1] - truth[1]
    along -= 2.0 * np.pi * np.rint(along / (2.0 * np.pi))
    out[0] = (indicated[0] - truth[0]) * (meridian + truth[2])
    out[1] = along * (prime + truth[2]) * np.cos(truth[0])
    out[2] = truth[2] - indicated[2]
    for i in range(3):
        out[3 + i] = indicated[3 + i] - truth[3 + i]
    a, b, c, d = turn[0], turn[1], turn[2], turn[3]
    rotated = np.empty((3, 3))  # turn applied to the true local axes
    for j in range(3):
        x, y, z = truth[6 + j], truth[9 + j], truth[12 + j]
        p, q, r = 2.0 * (c * z - d * y), 2.0 * (d * x - b * z), 2.0 * (b * y - c * x)
        rotated[0, j] = x + (a * p + (c * r - d * q))
        rotated[1, j] = y + (a * q + (d * p - b * r))
        rotated[2, j] = z + (a * r + (b * q - c * p))
    both = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            both[i, j] = (
                indicated[6 + i] * rotated[0, j] + indicated[9 + i] * rotated[1, j] + indicated[12 + i] * rotated[2, j]
            )
    x, y, z = 0.5 * (both[2, 1] - both[1, 2]), 0.5 * (both[0, 2] - both[2, 0]), 0.5 * (both[1, 0] - both[0, 1])
    size = np.sqrt(x * x + y * y + z * z)
    factor = 1.0
    if size > 0.0:
        factor = np.arctan2(size, 0.5 * (both[0, 0] + both[1, 1] + both[2, 2] - 1.0)) / size
    out[6], out[7], out[8] = factor * x, factor * y, factor * z


@uncontracted
def locate(constants: Array, angles: Array, states: Array, deviations: Array) -> Array:
    """Compute the local states of samples at some epochs, shape (n, m, 15).

    The truth's come from here as well, without deviations: the same instructions give the same bits.

    Parameters
    ----------
    angles : ndarray, shape (m,)
        By which the earth has turned, rad.
    states : ndarray, shape (m, 6)
        True inertial positions and velocities.
    deviations : ndarray, shape (n, m, 6)
        Of velocity and position.
    """
    found = np.empty((len(deviations), len(angles), LOCAL))
    position, velocity = np.empty(3), np.empty(3)
    for row in range(len(deviations)):
        for m in range(len(angles)):
            for r in range(3):
                position[r] = states[m, r] + deviations[row, m, 3 + r]
                velocity[r] = states[m, 3 + r] + deviations[row, m, r]
            _locate(constants, angles[m], position, velocity, found[row, m])
    return found


@uncontracted
def navigation_errors(constants: Array, truth: Array, indicated: Array, turns: Array) -> Array:
    """Compute the navigation errors of samples, shape (n, m, 9), from local states.

    Parameters
    ----------
    truth : ndarray, shape (m, 15)
    indicated : ndarray, shape (n, m, 15)
    turns : ndarray, shape (n, m, 4)
        Quaternions from true to indicated axes, in i.
    """
    found = np.empty((len(indicated), len(truth), 9))
    for row in range(len(indicated)):
        for m in range(len(truth)):
            _compare(constants, truth[m], indicated[row, m], turns[row, m], found[row, m])
    return found


def _multiply(p: Array, q: Array) -> Array:
    """Multiply quaternions, shape (n, 4)."""
    a, u, b, v = p[:, :1], p[:, 1:], q[:, :1], q[:, 1:]
    scalar = a * b - np.sum(u * v, axis=1, keepdims=True)
    return np.hstack([scalar, a * v + b * u + np.cross(u, v)])


def _about(axis: Array, angle: Array) -> Array:
    """Return the quaternions of rotations about an axis, shape (3,) or (n, 3), by angles, shape (n,)."""
    return np.hstack([np.cos(0.5 * angle)[:, None], np.sin(0.5 * angle)[:, None] * axis])


def _rotate(turn: Array, vector: Array) -> Array:
    """Return by how much quaternions, shape (n, 4), change vectors, shape (n, 3), without cancellation."""
    twice = 2.0 * np.cross(turn[:, 1:], vector)
    return np.asarray(turn[:, :1] * twice + np.cross(turn[:, 1:], twice))


def deviate(truth: Truth, time: float, errors: Array) -> tuple[Array, Array, Array]:
    """Compute the states of samples from their initial errors.

    Parameters
    ----------
    errors : ndarray, shape (n, 9)
        In the order of `mcnav.physics.ins.instruments.OUTPUTS`, of which they are the exact inverse.

    Returns
    -------
    turn : ndarray, shape (n, 4)
    velocity, position : ndarray, shape (n, 3)
        Deviations.
    """
    earth, states = truth.earth, truth.states(np.array([time]), "level", time)
    angle = earth.rotation_rate * (time - truth.times[0])
    true = np.hstack([states.position, states.velocity])
    here = locate(earth.constants, np.array([angle]), true, np.zeros((1, 1, 6)))[0, 0]
    latitude, longitude, altitude = here[:3]
    meridian, prime = (float(radius) for radius in earth.curvature_radii(latitude))
    north = errors[:, 0] / (meridian + altitude)
    east = errors[:, 1] / ((prime + altitude) * np.cos(latitude))
    zero = np.zeros(len(errors))
    first = earth.from_geodetic(latitude + zero, longitude + angle + zero, altitude + zero)
    there = earth.from_geodetic(latitude + north, longitude + angle + east, altitude - errors[:, 2])
    position = there - first
    axes = here[6:].reshape(3, 3)
    local = _multiply(_about(np.array([0.0, 0.0, 1.0]), east), _about(-axes[:, 1], north))
    velocity = errors[:, 3:6] @ axes.T
    velocity = velocity + _rotate(local, velocity + axes @ here[3:6])
    velocity[:, 0] -= earth.rotation_rate * position[:, 1]
    velocity[:, 1] += earth.rotation_rate * position[:, 0]
    vector = errors[:, 6:9] @ axes.T
    size = np.linalg.norm(vector, axis=1)
    axis = vector / np.where(size > 0.0, size, 1.0)[:, None]
    return _multiply(local, _about(axis, size)), velocity, position
