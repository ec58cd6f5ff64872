"""The dipole field of the earth: its strength and direction, and its gradient."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.systems.ins.sensors.magnetometer import POLE, dipole_field, field_gradient

RADIUS = 6_371_200.0


def test_the_field_is_northward_at_the_geomagnetic_equator_and_twice_as_strong_and_downward_at_the_pole() -> None:
    equator = np.cross(POLE, [0.0, 0.0, 1.0])
    equator *= RADIUS / np.linalg.norm(equator)
    np.testing.assert_allclose(dipole_field(POLE, equator), 29_806e-9 * POLE, rtol=1e-12)
    np.testing.assert_allclose(dipole_field(POLE, RADIUS * POLE), -2.0 * 29_806e-9 * POLE, rtol=1e-12)


def test_the_horizontal_field_points_to_the_geomagnetic_pole() -> None:
    """Its declination in Denver is that of the great circle to the pole, 7.4 degrees east of north."""
    latitude, longitude = np.radians([39.7, -105.0])
    north = np.array([-np.sin(latitude) * np.cos(longitude), -np.sin(latitude) * np.sin(longitude), np.cos(latitude)])
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    field = dipole_field(POLE, RADIUS * np.cross(north, east) * -1.0)
    pole_latitude, apart = np.radians(80.65), np.radians(105.0 - 72.68)
    bearing = np.arctan2(
        np.sin(apart) * np.cos(pole_latitude),
        np.cos(latitude) * np.sin(pole_latitude) - np.sin(latitude) * np.cos(pole_latitude) * np.cos(apart),
    )
    assert np.arctan2(field @ east, field @ north) == pytest.approx(bearing, rel=1e-12)


def test_the_gradient_is_the_derivative_of_a_field_without_sources() -> None:
    """By central differences with a step h of 100 m, whose error is of the order of (h / r)^2."""
    position = np.array([[4.0e6, 3.0e6, 4.1e6], [-1.0e6, 2.0e6, -6.0e6]])
    gradient = field_gradient(POLE, position)
    steps = 100.0 * np.eye(3)
    numerical = np.stack(
        [(dipole_field(POLE, position + step) - dipole_field(POLE, position - step)) / 200.0 for step in steps], axis=-1
    )
    size = np.abs(gradient).max()
    np.testing.assert_allclose(gradient, numerical, atol=1e-8 * size)
    np.testing.assert_allclose(np.trace(gradient, axis1=1, axis2=2), 0.0, atol=1e-14 * size)
    np.testing.assert_allclose(gradient, gradient.swapaxes(1, 2), atol=1e-14 * size)
