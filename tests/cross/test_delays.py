"""Measurements that are late: how fast each quantity changes, anchors of linear analysis, and both engines."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.sensors.beams import beam_range, ground_scales
from mcnav.systems.ins.sensors.magnetometer import POLE, dipole_field
from mcnav.systems.ins.sensors.measurements import measure
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.truth.trajectory import Truth
from tests.cross.test_sensor_conformance import ARRANGEMENTS, sensor_of

ARM = np.array([2.0, 0.3, -1.0])


@lru_cache
def tumble() -> Truth:
    """Climb in a turn of 3 deg/s at 80 m/s, pitching and rolling by up to 30 deg, with rows ten times a second."""
    time = np.arange(0.0, 60.05, 0.1)
    heading, altitude = np.radians(3.0) * time, 500.0 + 10.0 * time + 20.0 * np.sin(0.3 * time)
    radius = 6.38e6
    latitude = np.radians(45.0) + 80.0 / np.radians(3.0) * np.sin(heading) / radius
    longitude = np.radians(10.0) + 80.0 / np.radians(3.0) * (1.0 - np.cos(heading)) / radius / np.cos(np.radians(45.0))
    angles = np.stack([heading, 0.3 * np.sin(0.7 * time), 0.5 * np.sin(0.9 * time + 1.0)], axis=-1)
    return Truth.through(WGS84, time, latitude, longitude, altitude, angles)


def measured_at(truth: Truth, quantity: str, time: float, level: Array, axes: Array) -> Array:
    """Return what a sensor measures without errors; positions along given local axes, attitudes from given axes."""
    times = np.array([time])
    (position,), (velocity,) = truth.earth_fixed(times)
    body, turning = truth.attitude(time).as_matrix(), truth.attitude(time, 1)
    latitude, longitude, altitude = truth.geodetic(times)[0]
    own_level, antenna = local_axes(latitude, longitude), body @ np.cross(turning, ARM)
    arrangement = ARRANGEMENTS.get(quantity.partition("_")[0])
    match quantity:
        case "position":
            return np.asarray(level.T @ (position + body @ ARM))
        case "velocity":
            return np.asarray(own_level.T @ (velocity + antenna))
        case "altitude":
            return np.array([altitude])
        case "attitude":
            inertial = WGS84.turned(np.array(time)) @ body
            return Rotation.from_matrix(axes.T @ inertial).as_rotvec()
        case "body_velocity":
            return np.asarray(body.T @ velocity)
        case "heading":
            forward = own_level.T @ body[:, 0]
            return np.array([np.arctan2(forward[1], forward[0])])
        case "magnetic_field":
            return np.asarray(body.T @ dipole_field(POLE, position))
        case "beam_velocity":
            assert arrangement is not None
            return np.asarray(arrangement[:, :3] @ (body.T @ velocity + np.cross(turning, ARM)))
        case "beam_range":
            assert arrangement is not None
            place = position + body @ ARM
            return np.array([beam_range(ground_scales(WGS84, b[3]), place, body @ b[:3])[0] for b in arrangement])
    assert arrangement is not None
    away = arrangement[0] - position
    return np.array([np.linalg.norm(away)]) if quantity == "landmark_range" else body.T @ away / np.linalg.norm(away)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_a_quantity_changes_by_is_its_derivative(quantity: str) -> None:
    """Central differences within an interval of the truth's splines, extrapolated: (0.04 s)^4 of the fifth order.

    Rounding of positions of 6.4e6 m adds 1e-9 m / 0.02 s.
    """
    truth, time = tumble(), 30.05
    latitude, longitude, _ = truth.geodetic(np.array([time]))[0]
    axes = WGS84.turned(np.array(time)) @ truth.attitude(time).as_matrix()
    fixed = (local_axes(latitude, longitude), axes)

    def difference(step: float) -> Array:
        ahead, behind = (measured_at(truth, quantity, time + sign * step, *fixed) for sign in (1.0, -1.0))
        return np.asarray((ahead - behind) / (2.0 * step))

    expected = (4.0 * difference(0.02) - difference(0.04)) / 3.0
    found = measure(truth, "strapdown", 0.0, (sensor_of(quantity, np.array([time])),)).changes[0]
    scale = QUANTITIES[quantity].usual
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=2e-6, atol=1e-7 * max(1.0, scale))
