"""States and covariances of the case as the filters written here have them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from tests.benchmarks.inertial.case import Case
from tests.benchmarks.inertial.peers.compiled_filter import STATES


def initial_covariance(case: Case) -> Array:
    """Return the covariance at the start, shape (15, 15), in earth-fixed axes."""
    latitude, longitude, altitude = WGS84.to_geodetic(case.first[None, :3])[0]
    level = local_axes(latitude, longitude)
    # attitude errors are relative to local axes at the indicated position, which turn with it
    meridian, prime = WGS84.curvature_radii(latitude)
    turn = np.zeros((3, 3))
    turn[0, 1], turn[1, 0] = 1.0 / (prime + altitude), -1.0 / (meridian + altitude)
    turn[2, 1] = -np.tan(latitude) / (prime + altitude)
    velocity = level.T @ case.first[3:6]
    to_state = np.zeros((9, 9))
    cross = np.array([[0, -velocity[2], velocity[1]], [velocity[2], 0, -velocity[0]], [-velocity[1], velocity[0], 0]])
    to_state[:3, 6:], to_state[:3, :3] = level, level @ turn
    to_state[3:6, 3:6], to_state[3:6, :3] = level, -level @ cross @ turn
    to_state[6:, :3] = level
    found = np.zeros((STATES, STATES))
    found[:9, :9] = to_state @ np.diag(case.initial**2) @ to_state.T
    found[9:, 9:] = np.diag(case.biases**2)
    return found


def quaternions(states: Array) -> Array:
    """Return states with a quaternion, velocity and position, shape (n, 10), from those of `Case`, shape (n, 15)."""
    turns = Rotation.from_matrix(states[:, 6:].reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return np.ascontiguousarray(np.hstack([turns, states[:, 3:6], states[:, :3]]))


def returned(states: Array) -> Array:
    """Return states as those of `Case`, shape (..., 15), from those of `quaternions`."""
    flat = states.reshape(-1, 10)
    axes = Rotation.from_quat(flat[:, :4], scalar_first=True).as_matrix().reshape(-1, 9)
    return np.hstack([flat[:, 7:], flat[:, 4:7], axes]).reshape(*states.shape[:-1], 15)


def level_axes(case: Case) -> Array:
    """Return the axes from north, east, down to earth-fixed at the updates, shape (U, 3, 3)."""
    latitude, longitude, _ = WGS84.to_geodetic(np.ascontiguousarray(case.measured[:, :3])).T
    return local_axes(latitude, longitude)
