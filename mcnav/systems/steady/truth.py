"""Steady flight over a spherical earth that does not turn: the truth of "The Story of 84 Minutes".

The vehicle keeps its radius r and its angular rate along a great circle, so that the truth needs no integration:

    range angle = rate t,   specific force = g_eff upwards,   g_eff = mu / r^2 - r rate^2 = g - V^2 / r.

At rest (rate zero) it hovers or stands, and the accelerometers feel g. What varies besides is how the navigator finds
its altitude (from an outside altimeter, or from its own vertical accelerometer), and whether its platform keeps
inertial directions or is levelled.

Axes: X along the track, Y to its right, U up, all at the start. Instruments have x along X, y along Y and z **down**.
Position angles: theta along the great circle, ``cross`` to its right. Errors come in the order of `Error`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER


class Error(IntEnum):
    """Position of each initial-condition and equipment error in an array of errors.

    Misalignments and drifts are rotations of the platform; positive ones tilt the accelerometers so that
    ``m_x = f_x + misalignment f_z``, ``m_y = f_y + roll_misalignment f_z + azimuth_misalignment f_x``. A misalignment
    keeps its direction in inertial axes, whichever way the platform is driven: what begins as a tilt in roll is one in
    azimuth a quarter round the earth. Initial range and range-rate errors are arc lengths at the start's radius.
    """

    ALTITUDE = 0
    RANGE = 1
    CROSS_RANGE = 2
    ALTITUDE_RATE = 3
    RANGE_RATE = 4
    CROSS_RANGE_RATE = 5
    MISALIGNMENT = 6
    ROLL_MISALIGNMENT = 7
    AZIMUTH_MISALIGNMENT = 8
    GYRO_DRIFT = 9
    ROLL_DRIFT = 10
    AZIMUTH_DRIFT = 11
    BIAS_X = 12
    BIAS_Y = 13
    BIAS_Z = 14
    SCALE_FACTOR_X = 15
    SCALE_FACTOR_Y = 16
    SCALE_FACTOR_Z = 17


@dataclass(frozen=True)
class Earth:
    """A spherical earth that does not turn.

    Attributes
    ----------
    radius : float
        m.
    gravitational_parameter : float
        m^3/s^2.
    """

    radius: float = EARTH_RADIUS
    gravitational_parameter: float = GRAVITATIONAL_PARAMETER

    @classmethod
    def with_gravity(cls, radius: float, gravity: float) -> Earth:
        """Make an earth from its radius (m) and the gravity at its surface (m/s^2)."""
        return cls(radius, gravity * radius**2)


@dataclass(frozen=True)
class SteadyFlight:
    """A truth at constant height and speed, and how the navigator goes with it.

    Attributes
    ----------
    altitude : float
        m.
    speed : float
        Along the great circle, m/s, at the flight's radius; zero stands still.
    duration : float
        s.
    slaved : bool
        Whether indicated radius and radius rate are the actual ones, from an outside altimeter. Else the navigator
        integrates its vertical accelerometer.
    level : bool
        Whether the platform is kept level at the indicated position, as the seed has it, so that accelerometers and
        gyros stay along the local axes. Else it keeps the directions it had at the start, as NASA TN D-1772 has it.
    """

    altitude: float
    speed: float
    duration: float
    slaved: bool = True
    level: bool = False
    earth: Earth = Earth()

    @property
    def radius(self) -> float:
        """Radius of the flight, m."""
        return self.earth.radius + self.altitude

    @property
    def rate(self) -> float:
        """Angular rate along the great circle, rad/s."""
        return self.speed / self.radius

    def drifted(self, times: Array) -> tuple[Array, Array]:
        """Compute how long gyros along local axes drift about the first ones and about those a quarter turn on, s.

        A level platform's gyros turn with the vertical: the integrals of the cosine and the sine of the range angle.
        Those of an inertial platform do not: the time, and nothing.
        """
        times = np.asarray(times, dtype=float)
        if not self.level or self.rate == 0.0:
            return times, np.zeros_like(times)
        return np.sin(self.rate * times) / self.rate, 2.0 * np.sin(0.5 * self.rate * times) ** 2 / self.rate

    @property
    def gravity(self) -> float:
        """Gravity at the flight's radius, m/s^2."""
        return self.earth.gravitational_parameter / self.radius**2

    @property
    def effective_gravity(self) -> float:
        """The specific force on the vehicle, upwards: g_eff = g - V^2 / r, m/s^2 (the seed's footnote b)."""
        return self.gravity - self.speed * self.rate


def navigation_error(flight: SteadyFlight, indicated: Array) -> Array:
    """Subtract actual from indicated at the end of a flight, shape (6,).

    Altitude, range, cross range and their rates, m and m/s; ranges are arc lengths at the earth's radius.

    Parameters
    ----------
    indicated : ndarray, shape (6,)
        r, theta, cross and their rates: m, rad, m/s, rad/s.
    """
    arc = flight.earth.radius
    actual = np.array([flight.radius, flight.rate * flight.duration, 0.0, 0.0, flight.rate, 0.0])
    return np.asarray((indicated - actual) * [1.0, arc, arc, 1.0, arc, arc])
