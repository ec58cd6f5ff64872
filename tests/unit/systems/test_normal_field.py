"""Gravitation of the reference ellipsoid in closed form: a harmonic field whose level surface is the ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import MARS, MOON, WGS84, ZONALS, Earth, local_axes
from mcnav.systems.ins.reference.normal_field import DEEPEST, HEADER, field_constants, normal_gravitation_at

LATITUDES = np.radians([0.0, 1e-9, 15.0, 45.0, 51.0, 60.0, 89.9, 90.0, -30.0, -90.0])
LONGITUDES = np.linspace(-3.0, 3.0, len(LATITUDES))
ROUNDING = 20 * np.finfo(float).eps * 9.83
"""Of a gravitation computed in some twenty operations, m/s^2."""


def gravitation(position: Array, earth: Earth = WGS84) -> Array:
    return normal_gravitation_at(field_constants(earth), position)


def gravity(latitude: Array, longitude: Array) -> Array:
    """Compute gravity on the ellipsoid along north, east, down."""
    position = WGS84.from_geodetic(latitude, longitude, np.zeros_like(latitude))
    pull = gravitation(position) + WGS84.rotation_rate**2 * position * [1.0, 1.0, 0.0]
    return np.einsum("nji,nj->ni", local_axes(latitude, longitude), pull)


def test_gravity_is_normal_to_the_ellipsoid() -> None:
    """The ellipsoid is a level surface of gravity; a position's last digit turns the vertical by 1e-16 rad."""
    level = gravity(LATITUDES, LONGITUDES)[:, :2]
    assert np.max(np.abs(level)) <= ROUNDING


@pytest.mark.parametrize(("latitude", "value"), [(45.0, 9.80619776934378), (51.0, 9.81159132687041)])
def test_somigliana(latitude: float, value: float) -> None:
    """Its gravity at the equator is printed with ten decimals, 9.7803253359 m/s^2: 5e-11, and a hundredth at 51 deg."""
    assert gravity(np.radians([latitude]), np.zeros(1))[0, 2] == pytest.approx(value, abs=5.1e-11)


def test_agrees_with_the_zonal_harmonics() -> None:
    """The series leaves out J10 and what follows: 66 times J10 of gravitation at a pole, less elsewhere."""
    squared = WGS84.eccentricity_squared
    k = ZONALS + 1
    share = 1.0 - k + 5.0 * k * WGS84.zonals[0] / squared
    left_out = 3.0 * squared**k / ((2 * k + 1) * (2 * k + 3)) * abs(share) * (2 * k + 1) * (2 * k + 2) / 2
    for altitude in (0.0, 1e4, 1e6):
        position = WGS84.from_geodetic(LATITUDES, LONGITUDES, np.full(len(LATITUDES), altitude))
        difference = gravitation(position) - WGS84.gravitation(position)
        assert np.max(np.abs(difference)) <= 9.87 * left_out + ROUNDING


def test_field_is_harmonic() -> None:
    """Its gradient is symmetric and free of trace; differences over 2 km err by 1e-8 of it, and rounding by 1e-12."""
    position = WGS84.from_geodetic(LATITUDES, LONGITUDES, np.full(len(LATITUDES), 3e4))
    step = 1e3
    columns = [(gravitation(position + step * e) - gravitation(position - step * e)) / (2.0 * step) for e in np.eye(3)]
    gradient = np.stack(columns, axis=-1)
    size = np.max(np.abs(gradient))
    assert np.max(np.abs(np.trace(gradient, axis1=-2, axis2=-1))) <= 1e-7 * size
    assert np.max(np.abs(gradient - np.swapaxes(gradient, -1, -2))) <= 1e-7 * size


def test_series_have_all_digits_as_far_down_as_is_said() -> None:
    """The first term that is left out is below the last digit of the first one, where E / u is largest."""
    terms = (len(field_constants(WGS84)) - HEADER) // 2
    square = WGS84.eccentricity_squared / (DEEPEST * (1.0 - WGS84.flattening)) ** 2

    def term(n: int) -> float:
        return 2.0 * n / ((2 * n + 1) * (2 * n + 3)) * square ** (n - 1)

    assert term(terms + 1) < np.finfo(float).eps * term(1)


def test_sphere_is_central() -> None:
    earth = Earth(6_371_000.0, 0.0, 3.986e14, 7.292115e-5)
    position = WGS84.from_geodetic(LATITUDES, LONGITUDES, np.full(len(LATITUDES), 2e3))
    radius = np.linalg.norm(position, axis=-1, keepdims=True)
    expected = -earth.gravitational_parameter * position / radius**3
    assert np.max(np.abs(gravitation(position, earth) - expected)) <= ROUNDING


@pytest.mark.parametrize(
    ("body", "equator", "tolerance"), [(MOON, 1.62, 0.005), (MARS, 3.69, 0.025)], ids=["moon", "mars"]
)
def test_moon_and_mars_have_the_field_of_their_j2(body: Earth, equator: float, tolerance: float) -> None:
    """The gradient of ``mu / r [1 - J2 (a / r)^2 P2]``; gravity at the surface is NASA's, with two decimals.

    Differences over 200 m err by 1e-9 of gravitation, and the rounding of a potential of 3e6 to 1e7 m^2/s^2 by 4e-11.
    """
    latitude, longitude = LATITUDES, LONGITUDES
    position = body.from_geodetic(latitude, longitude, np.full(len(latitude), 2e3))
    np.testing.assert_allclose(gravitation(position, body), body.gravitation(position), rtol=0.0, atol=ROUNDING)
    assert body.j2 is not None

    def potential(at: Array) -> Array:
        r, z = np.linalg.norm(at, axis=-1), at[:, 2]
        second = 0.5 * (3.0 * (z / r) ** 2 - 1.0)
        return np.asarray(body.gravitational_parameter / r * (1.0 - (body.j2 or 0.0) * (body.radius / r) ** 2 * second))

    columns = [(potential(position + 100.0 * e) - potential(position - 100.0 * e)) / 200.0 for e in np.eye(3)]
    found = body.gravitation(position)
    np.testing.assert_allclose(found, np.stack(columns, axis=-1), rtol=0.0, atol=1e-8 * np.abs(found).max())
    surface = body.from_geodetic(*np.zeros((3, 1)))
    spun = np.linalg.norm(gravitation(surface, body) + body.rotation_rate**2 * surface)
    assert spun == pytest.approx(equator, abs=tolerance)


def test_curvature_of_the_zonal_harmonics() -> None:
    """Second differences over 10 km leave out what is of fourth order, ten times (10 / 6400)^2 of it, twice aslant.

    Along axes and diagonals, so that each of the six products has its coefficient; rounding is 1e-8 of it.
    """
    position = WGS84.from_geodetic(LATITUDES, LONGITUDES, np.full(len(LATITUDES), 1e4))

    def zonal(at: Array) -> Array:
        radius = np.linalg.norm(at, axis=1, keepdims=True)
        return np.asarray(WGS84.gravitation(at) + WGS84.gravitational_parameter * at / radius**3)

    found, size = WGS84.zonal_curvature(position), 1e4
    for x, y, z in size * np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 1)]):
        step = np.array([x, y, z])
        expected = 0.5 * (zonal(position + step) + zonal(position - step)) - zonal(position)
        change = found @ np.array([x * x, y * y, z * z, x * y, x * z, y * z])
        np.testing.assert_allclose(change, expected, rtol=0.0, atol=1e-4 * np.abs(found).max() * size**2)
