"""Action of gravity disturbances along a truth: in which directions, and over which distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.truth.trajectory import Platform, Truth


def local_gravity(earth: Earth, position: Array) -> Array:
    """Compute the size of gravity, m/s^2, with its centrifugal part, at earth-fixed positions: shape (n,)."""
    gravity = earth.gravitation(position)
    gravity[:, :2] += earth.rotation_rate**2 * position[:, :2]
    return np.asarray(np.linalg.norm(gravity, axis=1))


def disturbed_acceleration(truth: Truth, times: Array) -> Array:
    """Compute what gravity disturbances of unit size do to the error of the velocity, in inertial axes.

    The navigator does not know d, so that the error of its velocity changes by -d: ``+g xi`` north, ``+g eta`` east,
    and minus the anomaly down.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s, in the trajectory's time.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Columns in the order of `mcnav.systems.ins.imu.gravity.DISTURBANCES`.
    """
    earth, (position, _) = truth.earth, truth.earth_fixed(times)
    latitude, longitude, _ = earth.to_geodetic(position).T
    axes = earth.turned(times - truth.times[0]) @ local_axes(latitude, longitude)
    gravity = local_gravity(earth, position)
    return np.asarray(axes * np.stack([gravity, gravity, -np.ones_like(gravity)], axis=-1)[:, None, :])


def speed(truth: Truth, times: Array) -> Array:
    """Compute the speed over the earth, m/s, shape (n,)."""
    return np.asarray(np.linalg.norm(truth.earth_fixed(times)[1], axis=1))


@dataclass(frozen=True)
class GravityPath:
    """Action of gravity disturbances in short steps along a truth, S of them.

    Attributes
    ----------
    pulls : ndarray, shape (S, 3, 3)
        What disturbances of unit size add to the readings of accelerometers, in their axes: columns in the order of
        `mcnav.systems.ins.imu.gravity.DISTURBANCES`.
    distances : ndarray, shape (S,)
        Distance travelled over the earth in each step, m.
    """

    pulls: Array
    distances: Array

    @classmethod
    def along(cls, truth: Truth, platform: Platform, step_times: Array) -> GravityPath:
        """Evaluate the truth in steps between rising times, shape (S + 1,) s; distances by Simpson's rule."""
        middles = 0.5 * (step_times[1:] + step_times[:-1])
        axes = truth.states(middles, platform, float(step_times[0])).axes
        pulls = np.swapaxes(axes, -1, -2) @ disturbed_acceleration(truth, middles)
        ends = speed(truth, step_times)
        mean = (ends[1:] + 4.0 * speed(truth, middles) + ends[:-1]) / 6.0
        return cls(pulls, mean * np.diff(step_times))
