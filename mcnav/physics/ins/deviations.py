"""Deviations in inertial axes that have given navigation errors: exact, not to first order.

A sample's state is the rotation from true to indicated axes, a quaternion (scalar first), and the deviations of
velocity and position, all in inertial axes. Without errors all results are exactly zero.
"""

from __future__ import annotations

import numpy as np

from mcnav._types import Array
from mcnav.physics.ins.earth import local_axes
from mcnav.physics.ins.readout_lanes import true_states
from mcnav.physics.ins.truth import Truth


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
    here = true_states(earth, np.hstack([states.position, states.velocity]))
    sf, cf, sl, cl, altitude = here.local[0, :5]
    latitude, longitude = float(np.arctan2(sf, cf)), float(np.arctan2(sl, cl))
    north, east = errors[:, 0] / here.radii[0, 0], errors[:, 1] / here.radii[0, 1]
    zero = np.zeros(len(errors))
    first = earth.from_geodetic(latitude + zero, longitude + zero, altitude + zero)
    there = earth.from_geodetic(latitude + north, longitude + east, altitude - errors[:, 2])
    position = there - first
    axes = local_axes(np.asarray(latitude), np.asarray(longitude))
    local = _multiply(_about(np.array([0.0, 0.0, 1.0]), east), _about(-axes[:, 1], north))
    velocity = np.einsum("nj,ij->ni", errors[:, 3:6], axes)
    velocity = velocity + _rotate(local, velocity + axes @ here.local[0, 5:])
    velocity[:, 0] -= earth.rotation_rate * position[:, 1]
    velocity[:, 1] += earth.rotation_rate * position[:, 0]
    vector = np.einsum("nj,ij->ni", errors[:, 6:9], axes)
    size = np.linalg.norm(vector, axis=1)
    axis = vector / np.where(size > 0.0, size, 1.0)[:, None]
    return _multiply(local, _about(axis, size)), velocity, position
