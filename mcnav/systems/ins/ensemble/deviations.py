"""Deviations in inertial axes that have given navigation errors: exact, not to first order.

A sample's state is the rotation from true to indicated axes, a quaternion (scalar first), and the deviations of
velocity and position, all in inertial axes. Without errors all results are exactly zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import inlined, uncontracted
from mcnav.compiled.shapes import check_shape
from mcnav.systems.ins.earth import local_axes
from mcnav.systems.ins.ensemble.readout import true_states
from mcnav.systems.ins.truth.trajectory import Truth

Quaternion = tuple[float, float, float, float]
Vector3 = tuple[float, float, float]


@inlined
def _multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Multiply quaternions."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        a * e - (b * f + c * g + d * h),
        a * f + e * b + (c * h - d * g),
        a * g + e * c + (d * f - b * h),
        a * h + e * d + (b * g - c * f),
    )


@inlined
def _about(x: float, y: float, z: float, angle: float) -> Quaternion:
    """Return the quaternion of a rotation about an axis."""
    sine = np.sin(0.5 * angle)
    return np.cos(0.5 * angle), sine * x, sine * y, sine * z


@inlined
def _rotate(turn: Quaternion, x: float, y: float, z: float) -> Vector3:
    """Return by how much a quaternion changes a vector, without cancellation."""
    a, b, c, d = turn
    p, q, r = 2.0 * (c * z - d * y), 2.0 * (d * x - b * z), 2.0 * (b * y - c * x)
    return a * p + (c * r - d * q), a * q + (d * p - b * r), a * r + (b * q - c * p)


@inlined
def _place(constants: Array, latitude: float, longitude: float, altitude: float) -> Vector3:
    """Compute an earth-fixed position."""
    sine = np.sin(latitude)
    prime = constants[0] / np.sqrt(1.0 - constants[1] * sine * sine)
    level = (prime + altitude) * np.cos(latitude)
    up = (prime * (1.0 - constants[1]) + altitude) * sine
    return level * np.cos(longitude), level * np.sin(longitude), up


@uncontracted
def _deviate(
    constants: Array, here: Array, radii: Array, velocity: Array, axes: Array, errors: Array, states: Array
) -> None:
    """Compute the states of samples, shape (n, 10): quaternions, deviations of velocity and of position.

    Parameters
    ----------
    here, radii, velocity : ndarray, shapes (3,), (2,), (3,)
        True latitude, longitude and altitude; metres of a radian of latitude and of longitude; velocity in n.
    axes : ndarray, shape (3, 3)
        From n to inertial axes.
    """
    spin = constants[3]
    # true position, and velocity in i
    x0, y0, z0 = _place(constants, here[0], here[1], here[2])
    ux, uy, uz = (
        axes[0, 0] * velocity[0] + axes[0, 1] * velocity[1] + axes[0, 2] * velocity[2],
        axes[1, 0] * velocity[0] + axes[1, 1] * velocity[1] + axes[1, 2] * velocity[2],
        axes[2, 0] * velocity[0] + axes[2, 1] * velocity[1] + axes[2, 2] * velocity[2],
    )
    for n in range(len(errors)):
        # deviation of the position; the rotation of the local axes by it
        north, east, down = errors[n, 0] / radii[0], errors[n, 1] / radii[1], errors[n, 2]
        x, y, z = _place(constants, here[0] + north, here[1] + east, here[2] - down)
        x, y, z = x - x0, y - y0, z - z0
        local = _multiply(_about(0.0, 0.0, 1.0, east), _about(-axes[0, 1], -axes[1, 1], -axes[2, 1], north))
        # velocity error in the indicated local axes; with the velocity over the earth, turned, and W x r
        p, q, r = errors[n, 3], errors[n, 4], errors[n, 5]
        vx = axes[0, 0] * p + axes[0, 1] * q + axes[0, 2] * r
        vy = axes[1, 0] * p + axes[1, 1] * q + axes[1, 2] * r
        vz = axes[2, 0] * p + axes[2, 1] * q + axes[2, 2] * r
        p, q, r = _rotate(local, vx + ux, vy + uy, vz + uz)
        states[n, 4], states[n, 5], states[n, 6] = vx + p - spin * y, vy + q + spin * x, vz + r
        states[n, 7], states[n, 8], states[n, 9] = x, y, z
        # the attitude error's rotation, then that of the local axes
        p, q, r = errors[n, 6], errors[n, 7], errors[n, 8]
        x = axes[0, 0] * p + axes[0, 1] * q + axes[0, 2] * r
        y = axes[1, 0] * p + axes[1, 1] * q + axes[1, 2] * r
        z = axes[2, 0] * p + axes[2, 1] * q + axes[2, 2] * r
        size = np.sqrt(x * x + y * y + z * z)
        share = 1.0 / size if size > 0.0 else 1.0
        p, x, y, z = _multiply(local, _about(x * share, y * share, z * share, size))
        states[n, 0], states[n, 1], states[n, 2], states[n, 3] = p, x, y, z


class StartingPoint(NamedTuple):
    """The truth at the start of navigation.

    Attributes
    ----------
    constants : ndarray
        Of the earth.
    here, radii, velocity : ndarray, shapes (3,), (2,), (3,)
        Latitude, longitude and altitude; metres of a radian of latitude and of longitude; velocity in n.
    axes : ndarray, shape (3, 3)
        From n to inertial axes.
    """

    constants: Array
    here: Array
    radii: Array
    velocity: Array
    axes: Array


def starting_point(truth: Truth, time: float) -> StartingPoint:
    """Compute the truth at a start of navigation."""
    earth, states = truth.earth, truth.states(np.array([time]), "level", time)
    point = true_states(earth, np.hstack([states.position, states.velocity]))
    sf, cf, sl, cl, altitude = point.local[0, :5]
    latitude, longitude = np.arctan2(sf, cf), np.arctan2(sl, cl)
    return StartingPoint(
        earth.constants, np.array([latitude, longitude, altitude]), point.radii[0], point.local[0, 5:],
        local_axes(latitude, longitude),
    )  # fmt: skip


def deviate(start: StartingPoint, errors: Array) -> Array:
    """Compute the states of samples from their initial errors.

    Parameters
    ----------
    errors : ndarray, shape (n, 9)
        In the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`, of which they are the exact inverse.

    Returns
    -------
    ndarray, shape (n, 10)
        Quaternions, deviations of velocity and deviations of position.
    """
    check_shape("errors", errors, (None, 9))
    result = np.empty((len(errors), 10))
    _deviate(start.constants, start.here, start.radii, start.velocity, start.axes, np.ascontiguousarray(errors), result)
    return result
