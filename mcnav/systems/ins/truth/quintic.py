"""Quintic splines through position, velocity and acceleration at rows that are as dense as the force needs."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Motion = Callable[[float], NDArray[Any]]
"""Position, velocity and acceleration at a time, shape (3, ...): vectors, or complex numbers of a plane."""

LONGEST_STEP: Final = 16.0
"""Longest step between rows, s."""

FORCE_ERROR: Final = 8e-6
"""Error of the specific force between rows, m/s^2, above which a step is halved: 0.8 millionths of gravity.

Steps of one to two seconds reach it on all seven trajectories of NASA TN D-1772. In shorter ones the interpolation
error of the integrated velocity, 1e-7 m/s, becomes an error of the force that grows as they shrink.
"""

SHORTEST_STEP: Final = 0.05
"""Shortest step, s: in shorter ones the rounding of positions, 1e-9 m, would show in the force."""


def row_times(motion: Motion, begin: float, end: float, longest: float = LONGEST_STEP) -> list[float]:
    """Choose the ends of the steps in a phase: equal ones, halved where the quintic misses the acceleration."""
    ends = np.linspace(begin, end, int(np.ceil((end - begin) / longest)) + 1)
    return [time for step in pairwise(ends.tolist()) for time in _refined(motion, *step)]


def _refined(motion: Motion, begin: float, end: float) -> list[float]:
    if end - begin < 2.0 * SHORTEST_STEP or _error(motion, begin, end) < FORCE_ERROR:
        return [end]
    middle = 0.5 * (begin + end)
    return [*_refined(motion, begin, middle), *_refined(motion, middle, end)]


def _error(motion: Motion, begin: float, end: float) -> float:
    """Compare the acceleration of the quintic between two rows with the motion at three instants."""
    between = np.linspace(begin, end, 5)[1:-1]
    quintic = quintic_spline(np.array([begin, end]), np.array([motion(begin), motion(end)]))
    actual = np.array([motion(float(time))[2] for time in between])
    return float(np.max(np.abs(quintic(between, 2) - actual)))


def quintic_spline(times: Array, motions: NDArray[Any]) -> PPoly:
    """Interpolate positions, velocities and accelerations, shape (n, 3, ...), between n times.

    A piece is its first row's motion at constant acceleration, and three powers for what the next row has beyond it.
    The velocities of two pieces therefore meet to the rounding of velocities, in rows however dense; the coefficients
    of Bernstein's basis are positions, whose rounding, 1e-9 m on the earth, is a velocity in short steps.
    """
    from scipy.interpolate import PPoly

    position, velocity, acceleration = motions.swapaxes(0, 1)
    h = np.diff(times).reshape(-1, *(1 for _ in position.shape[1:]))
    moved = np.diff(position, axis=0) - (velocity[:-1] + 0.5 * acceleration[:-1] * h) * h
    gained = np.diff(velocity, axis=0) - acceleration[:-1] * h
    risen = np.diff(acceleration, axis=0)
    powers = (
        (6.0 * moved - 3.0 * gained * h + 0.5 * risen * h**2) / h**5,
        (-15.0 * moved + 7.0 * gained * h - risen * h**2) / h**4,
        (10.0 * moved - 4.0 * gained * h + 0.5 * risen * h**2) / h**3,
    )
    return PPoly(np.stack([*powers, 0.5 * acceleration[:-1], velocity[:-1], position[:-1]]), times)


def earth_fixed_quintic(earth: Earth, times: Array, motions: Array) -> PPoly:
    """Interpolate inertial motions, shape (n, 3, 3), as earth-fixed positions.

    Inertial and earth-fixed axes coincide at the first of the times.
    """
    position, velocity, acceleration = motions.transpose(1, 0, 2)
    spin = np.array([0.0, 0.0, earth.rotation_rate])
    relative = velocity - np.cross(spin, position)
    fixed = np.stack([position, relative, acceleration - np.cross(spin, velocity + relative)], axis=1)
    rotated = np.einsum("nji,nkj->nki", earth.turned(times - times[0]), fixed)
    return quintic_spline(times, rotated)
