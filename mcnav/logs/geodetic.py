"""The ellipsoid WGS 84 as receivers use it, whatever earth a campaign has."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array

RADIUS: Final = 6_378_137.0
"""Radius of the equator, m."""

FLATTENING: Final = 1.0 / 298.257223563


def from_earth_fixed(position: Array) -> tuple[Array, Array, Array]:
    """Return latitude, longitude (rad) and height (m) of earth-fixed positions, shape (n, 3).

    The latitude is iterated: ``tan(latitude) = (z + e² N sin(latitude)) / p`` contracts by e² = 0.0067 near the earth.

    >>> latitude, longitude, height = from_earth_fixed(np.array([[6378137.0, 0.0, 0.0]]))
    >>> float(latitude[0]), float(longitude[0]), float(height[0])
    (0.0, 0.0, 0.0)
    """
    squared = FLATTENING * (2.0 - FLATTENING)
    x, y, z = position.T
    from_axis = np.hypot(x, y)
    latitude = np.arctan2(z, from_axis * (1.0 - squared))
    for _ in range(8):
        sine = np.sin(latitude)
        prime = RADIUS / np.sqrt(1.0 - squared * sine**2)
        latitude = np.arctan2(z + squared * prime * sine, from_axis)
    sine, cosine = np.sin(latitude), np.cos(latitude)
    height = from_axis * cosine + z * sine - RADIUS * np.sqrt(1.0 - squared * sine**2)
    return np.asarray(latitude), np.asarray(np.arctan2(y, x)), np.asarray(height)


def north_east_down(latitude: Array, longitude: Array) -> Array:
    """Return the directions north, east, down in earth-fixed axes as columns, shape (n, 3, 3)."""
    north = np.stack(
        [-np.sin(latitude) * np.cos(longitude), -np.sin(latitude) * np.sin(longitude), np.cos(latitude)], axis=1
    )
    east = np.stack([-np.sin(longitude), np.cos(longitude), np.zeros_like(longitude)], axis=1)
    return np.stack([north, east, np.cross(north, east)], axis=2)
