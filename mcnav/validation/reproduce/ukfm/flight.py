"""The benchmark's flight: a circle of 5 m in 30 s among three landmarks, without rotation, and what is random in it.

Constants and equations are those of ``model/inertial_navigation.py`` and ``benchmarks/inertial_navigation.py`` of
ukfm. Its true acceleration comes from differences of the circle that begin with zeros, so that the vehicle starts at
rest and has its speed of 1 m/s after one step of 105 m/s^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

DURATION: Final = 30.0
STEP: Final = 0.01
INSTANTS: Final = 3000
RADIUS: Final = 5.0
GRAVITY: Final = np.array([0.0, 0.0, -9.82])
LANDMARKS: Final = np.array([[0.0, 2.0, 2.0], [-2.0, -2.0, -2.0], [2.0, -2.0, -2.0]])
BETWEEN_MEASUREMENTS: Final = 100
MEASUREMENTS: Final = (INSTANTS - 1) // BETWEEN_MEASUREMENTS
"""Duration and step, s; circle, m; gravity, m/s^2; landmarks, m; steps between measurements, and their number."""

GYRO: Final = 0.01
ACCELEROMETER: Final = 0.01
RANGING: Final = 0.1
START_ATTITUDE: Final = np.radians(15.0) / np.sqrt(3.0)
START_POSITION: Final = 1.0 / np.sqrt(3.0)
"""Sigmas by axis: a step's reading, rad/s and m/s^2; a landmark's coordinate, m; at the start, rad and m."""


@dataclass(frozen=True)
class Truth:
    """The true motion, whose attitude is the identity: n instants.

    Attributes
    ----------
    forces : ndarray, shape (n - 1, 3)
        Specific force in each step, m/s^2.
    velocity, position : ndarray, shape (n, 3)
        m/s, m.
    """

    forces: Array
    velocity: Array
    position: Array


@cache
def truth() -> Truth:
    """Compute the true motion from differences of the circle, by v + a T and r + v T + a T^2/2."""
    angle = 2.0 * np.pi * np.linspace(0.0, DURATION, INSTANTS) / DURATION
    circle = RADIUS * np.stack([np.sin(angle), np.cos(angle), np.zeros(INSTANTS)], axis=1)
    nothing = np.zeros((1, 3))
    velocity = np.concatenate([nothing, np.diff(circle, axis=0)]) / STEP
    acceleration = np.concatenate([nothing, np.diff(velocity, axis=0)])[:-1] / STEP
    speeds = np.concatenate([nothing, np.cumsum(acceleration, axis=0) * STEP])
    moved = np.cumsum(speeds[:-1] * STEP + acceleration * (0.5 * STEP**2), axis=0)
    return Truth(acceleration - GRAVITY, speeds, circle[0] + np.concatenate([nothing, moved]))


@dataclass(frozen=True)
class Draws:
    """Random numbers of n runs.

    Attributes
    ----------
    start : ndarray, shape (n, 6)
        Rotation vector of the attitude error, rad, and position error, m: indicated less true.
    readings : ndarray, shape (n, 2999, 6)
        Noise of gyros, rad/s, and accelerometers, m/s^2.
    landmarks : ndarray, shape (n, 29, 9)
        Noise of the landmarks' coordinates in the vehicle's axes, m.
    """

    start: Array
    readings: Array
    landmarks: Array


def draw(seed: int, first: int, count: int) -> Draws:
    """Draw what is random in the runs from a number on; each depends on the seed and its own number alone."""
    sigmas = np.array([START_ATTITUDE] * 3 + [START_POSITION] * 3)
    start, readings = np.empty((count, 6)), np.empty((count, INSTANTS - 1, 6))
    landmarks = np.empty((count, MEASUREMENTS, LANDMARKS.size))
    for row in range(count):
        generator = np.random.Generator(np.random.Philox(key=np.array([seed, first + row], dtype=np.uint64)))
        start[row] = sigmas * generator.standard_normal(6)
        generator.standard_normal(out=readings[row])
        generator.standard_normal(out=landmarks[row])
    readings[..., :3] *= GYRO
    readings[..., 3:] *= ACCELEROMETER
    return Draws(start, readings, RANGING * landmarks)
