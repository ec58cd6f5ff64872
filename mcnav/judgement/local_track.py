"""Positions of a track in metres, and speeds."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedMeasurements

AXIS, SQUARED = 6_378_137.0, 6.69437999014e-3
"""Semi-major axis of WGS 84, m, and its squared eccentricity."""


def local_metres(position: Array) -> Array:
    """Return latitudes, longitudes and altitudes, shape (n, 3), as north, east, down of the first, m (WGS 84).

    >>> local_metres(np.radians([[45.0, 7.0, 0.0], [45.001, 7.0, 0.0]])).round(1)[1].tolist()
    [111.1, 0.0, -0.0]
    """
    sine, cosine = np.sin(position[0, 0]), np.cos(position[0, 0])
    normal = AXIS / np.sqrt(1.0 - SQUARED * sine**2)
    meridian = normal * (1.0 - SQUARED) / (1.0 - SQUARED * sine**2)
    moved = position - position[0]
    east = np.mod(moved[:, 1] + np.pi, 2.0 * np.pi) - np.pi
    return np.stack([moved[:, 0] * meridian, east * normal * cosine, -moved[:, 2]], axis=1)


def speeds(measured: RecordedMeasurements) -> Array:
    """Return speeds at all rows, from velocities, or from positions over five rows, m/s."""
    for name in ("velocity", "body_velocity"):
        if name in measured.values:
            return np.asarray(np.linalg.norm(measured.values[name], axis=1))
    metres = local_metres(measured.values["position"])
    apart = min(5, len(metres) - 1)
    steps = np.linalg.norm(metres[apart:, :2] - metres[:-apart, :2], axis=1)
    return np.concatenate([np.full(apart, steps[0]), steps]) / np.median(
        measured.times[apart:] - measured.times[:-apart]
    )
