"""Maps: distances and directions from their middle, the coast where it is, what lies within a box."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.report.drawing.coastline import RADIUS, Projection, coast, grid


def test_distances_and_directions_from_the_middle_are_true() -> None:
    """The distance by the dot product of unit vectors, and the azimuth by the spherical triangle."""
    middle = Projection(0.8, -2.9)
    latitude, longitude = np.random.default_rng(4).uniform([[-1.5], [-3.1]], [[1.5], [3.1]], (2, 50))
    angle = np.arccos(np.sin(0.8) * np.sin(latitude) + np.cos(0.8) * np.cos(latitude) * np.cos(longitude + 2.9))
    points = middle(latitude, longitude)
    near = angle < 2.8
    np.testing.assert_allclose(np.hypot(*points[near].T), RADIUS * angle[near], rtol=1e-9)
    azimuth = np.arctan2(
        np.sin(longitude + 2.9) * np.cos(latitude),
        np.cos(0.8) * np.sin(latitude) - np.sin(0.8) * np.cos(latitude) * np.cos(longitude + 2.9),
    )
    apart = np.arctan2(points[near, 0], points[near, 1]) - azimuth[near]
    np.testing.assert_allclose(np.cos(apart), 1.0, atol=1e-12)
    assert np.isnan(middle(np.array(-0.8), np.array(np.pi - 2.9))).all()


def test_steps_to_the_east_and_north() -> None:
    """In the middle they are themselves; a quarter of the way round, across the line of sight, π/2 as large."""
    middle = Projection(0.0, 0.0)
    here, there = middle.directions(np.array([0.0, 0.0]), np.array([0.0, 0.5 * np.pi]))
    np.testing.assert_allclose(here, np.eye(2), atol=1e-9)
    np.testing.assert_allclose(there, [[1.0, 0.0], [0.0, 0.5 * np.pi]], atol=1e-4)


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [(50.066, -5.714), (-34.357, 18.472), (36.0, -5.61), (-43.635, 146.827), (65.50, -168.09)],
)  # Land's End, Cape of Good Hope, South East Cape of Tasmania, Cape Prince of Wales
def test_the_coast_is_where_it_is(latitude: float, longitude: float) -> None:
    """Within 12 km: the outline is of 1:50,000,000."""
    middle = Projection(*np.radians([latitude, longitude]))
    lines = coast(middle, (-60.0, -60.0, 60.0, 60.0), 0.1)
    assert min(np.hypot(*line.T).min() for line in lines) < 12.0


def test_nothing_but_what_crosses_the_box() -> None:
    """Over the middle of Asia there is no coast; the frame of the map is no coast either; a grid has its degrees."""
    box = (-300.0, -300.0, 300.0, 300.0)
    assert coast(Projection(*np.radians([46.0, 90.0])), box, 1.0) == []
    assert coast(Projection(*np.radians([-89.5, 180.0])), box, 1.0) == []
    names = [name for _, name in grid(Projection(*np.radians([0.2, 179.9])), box, 1.0)]
    assert {"0°", "1° N", "1° S", "179° E", "180°", "179° W"} <= set(names)


def test_another_body_has_its_size_and_no_coast() -> None:
    """A degree of the moon is 30.3 km."""
    moon = Projection(0.0, 0.0, 1737.4, False)
    assert moon(np.radians(1.0), np.array(0.0))[1] == pytest.approx(30.32, abs=0.01)
    assert coast(moon, (-2e3, -2e3, 2e3, 2e3), 1.0) == []
