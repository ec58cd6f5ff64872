"""The truth at the instants of a sensor, in inertial axes, as the geometry of a quantity needs it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES
from mcnav.systems.ins.truth.trajectory import Platform, Truth

NO_ARRANGEMENT: Final = np.zeros((0, 3))


@dataclass(frozen=True)
class Surroundings:
    """The truth at u instants of a sensor, in inertial axes.

    Attributes
    ----------
    spin : float
        Rate of the earth about the third axis, rad/s.
    globe : Earth
    arrangement : ndarray, shape (n, …)
        As `SensorType.arrange` has it; of shape (0, 3) for a sensor without one.
    lever_arm : ndarray, shape (3,)
        From the unit to the antenna in the body's axes, m.
    position, velocity : ndarray, shape (u, 3)
        Velocity over the earth.
    altitude, latitude : ndarray, shape (u,)
        Geodetic, m and rad.
    radii : ndarray, shape (2, u)
        Of curvature at the altitude, in the meridian and in the prime vertical, m.
    earth, level, body, instruments : ndarray, shape (u, 3, 3)
        Earth-fixed axes; north, east, down; forward, right, down of the body; the instruments' axes: by columns.
    turning : ndarray, shape (u, 3)
        Rate of the body over the earth, in the body's axes, rad/s.
    rate, force : ndarray, shape (u, 3)
        Inertial rate and specific force in the instruments' axes.
    swirling : ndarray, shape (u, 3)
        How the rate of the body over the earth changes, in the body's axes, rad/s^2; zero without a lever arm, as
        nothing else depends on it.
    """

    spin: float
    globe: Earth
    arrangement: Array
    lever_arm: Array
    position: Array
    velocity: Array
    altitude: Array
    latitude: Array
    radii: Array
    earth: Array
    level: Array
    body: Array
    instruments: Array
    turning: Array
    rate: Array
    force: Array
    swirling: Array

    @classmethod
    def at(
        cls, truth: Truth, platform: Platform, start: float, times: Array, lever_arm: Array,
        arrangement: Array = NO_ARRANGEMENT,
    ) -> Surroundings:  # fmt: skip
        """Compute them at instants, s."""
        earth = truth.earth
        spin = np.array([0.0, 0.0, earth.rotation_rate])
        body = truth.states(times, "strapdown", start)
        instruments = body if platform == "strapdown" else truth.states(times, platform, start)
        latitude, longitude, altitude = truth.geodetic(times).T
        turned = earth.turned(times - truth.times[0])
        level = turned @ local_axes(latitude, longitude)
        turning = body.rate - np.einsum("nji,j->ni", body.axes, spin)
        velocity = body.velocity - np.cross(spin, body.position)
        radii = np.stack(earth.curvature_radii(latitude)) + altitude
        swirling = np.asarray(truth.attitude(times, 2)) if lever_arm.any() else np.zeros_like(turning)
        return cls(
            earth.rotation_rate, earth, arrangement, lever_arm, body.position, velocity, altitude, latitude, radii,
            turned, level, body.axes, instruments.axes, turning, instruments.rate, instruments.force, swirling,
        )  # fmt: skip

    @property
    def lever(self) -> Array:
        """The lever arm in inertial axes, shape (u, 3)."""
        return np.asarray(self.body @ self.lever_arm)

    def rate_responses(self) -> Array:
        """Return the responses of the inertial rate to the constant errors of the gyros, shape (u, 3, 15)."""
        axes, inputs = self.instruments, [np.ones_like(self.rate), self.rate]
        rate_responses = [axes * each[:, None, :] for each in inputs]
        reads = [AXES.index(pair[0]) for pair in CROSS_AXES]
        along = [AXES.index(pair[1]) for pair in CROSS_AXES]
        rate_responses += [axes[:, :, reads] * self.rate[:, None, along], axes * self.force[:, None, :]]
        return np.concatenate(rate_responses, axis=2)
