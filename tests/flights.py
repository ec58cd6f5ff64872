"""Truths of the three-dimensional navigator: a flight with climbs and turns, and vehicles at rest."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.truth.trajectory import Truth


def _step(time: Array, begin: float, duration: float) -> Array:
    """Rise from 0 to 1 with three continuous derivatives."""
    x = np.clip((time - begin) / duration, 0.0, 1.0)
    return np.asarray(x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3))


@lru_cache
def flight(interval: float = 0.1, earth: Earth = WGS84) -> Truth:
    """Fly an hour from 45 degrees north: take-off, a climb of 8.5 km, three coordinated turns, a descent of 3 km."""
    time = np.linspace(0.0, 3600.0, round(3600.0 / interval) + 1)
    turns = [(90.0, 600.0, 60.0), (-150.0, 1500.0, 100.0), (60.0, 2600.0, 40.0)]
    heading = np.radians(30.0 + sum(angle * _step(time, begin, duration) for angle, begin, duration in turns))
    altitude = 500.0 + 8500.0 * _step(time, 60.0, 1200.0) - 3000.0 * _step(time, 2900.0, 500.0)
    speed = 120.0 + 100.0 * _step(time, 30.0, 300.0)
    radius = earth.radius + altitude
    latitude = np.radians(45.0) + CubicSpline(time, speed * np.cos(heading) / radius).antiderivative()(time)
    eastward = speed * np.sin(heading) / (radius * np.cos(latitude))
    longitude = np.radians(10.0) + CubicSpline(time, eastward).antiderivative()(time)
    roll = np.arctan(speed * CubicSpline(time, heading)(time, 1) / 9.8)
    pitch = 0.05 + np.arctan2(CubicSpline(time, altitude)(time, 1), speed)
    return Truth.through(earth, time, latitude, longitude, altitude, np.stack([heading, pitch, roll], axis=-1))


@lru_cache
def rest(
    latitude: float = 45.0,
    duration: float = 3600.0,
    angles: tuple[float, float, float] = (0.0, 0.0, 0.0),
    earth: Earth = WGS84,
) -> Truth:
    """Stay on the ground at a latitude, deg, with heading, pitch and roll, rad."""
    time = np.linspace(0.0, duration, 5)
    same = np.ones(5)
    return Truth.through(earth, time, np.radians(latitude) * same, 0.0 * same, 0.0 * same, np.tile(angles, (5, 1)))
