"""Closed forms of "The Story of 84 Minutes": position error due to each source over a flat and a spherical earth.

Stanford Engineering Case Library, W. Bollay, 1966: Problems 1 (flat), 2 (spherical) and 4 (hovering). SI units and
radians; times may be arrays. Errors are magnitudes without sign. They hold for a navigator at rest; for one that moves
at V replace g by g_eff = g - V^2 / r.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Time = TypeVar("Time", float, NDArray[np.float64])


def schuler_rate(radius: float, gravity: float) -> float:
    """Return the angular rate of the pendulum, w = sqrt(g / R), rad/s; use g_eff for a moving vehicle."""
    return float(np.sqrt(gravity / radius))


def schuler_period(radius: float, gravity: float) -> float:
    """Return the period of the pendulum, T = 2 pi sqrt(R / g), s.

    >>> round(schuler_period(6.378e6, 9.8) / 60.0, 1)
    84.5
    """
    return 2.0 * np.pi / schuler_rate(radius, gravity)


def effective_gravity(gravity: float, speed: float, radius: float) -> float:
    """Return g_eff = g - V^2 / r of a vehicle in level flight, m/s^2 (footnote b)."""
    return gravity - speed * speed / radius


def tilt_flat(tilt: float, gravity: float, time: Time) -> Time:
    """Return the position error due to a tilted platform over a flat earth, g tilt t^2 / 2, m."""
    return 0.5 * gravity * tilt * time * time


def tilt_spherical(tilt: float, radius: float, rate: float, time: Time) -> Time:
    """Return the same over a spherical earth, R tilt (1 - cos w t), m."""
    error: Time = 2.0 * radius * tilt * np.sin(0.5 * rate * time) ** 2
    return error


def velocity_flat(velocity: float, time: Time) -> Time:
    """Return the position error due to a launch velocity error over a flat earth, dV t, m."""
    return velocity * time


def velocity_spherical(velocity: float, rate: float, time: Time) -> Time:
    """Return the same over a spherical earth, (dV / w) sin w t, m."""
    error: Time = (velocity / rate) * np.sin(rate * time)
    return error


def bias_flat(bias: float, time: Time) -> Time:
    """Return the position error due to an accelerometer bias over a flat earth, a t^2 / 2, m."""
    return 0.5 * bias * time * time


def bias_spherical(bias: float, rate: float, time: Time) -> Time:
    """Return the same over a spherical earth, (a / w^2) (1 - cos w t), m: k R (1 - cos w t) for a = k g."""
    error: Time = 2.0 * (bias / (rate * rate)) * np.sin(0.5 * rate * time) ** 2
    return error


def drift_flat(drift: float, gravity: float, time: Time) -> Time:
    """Return the position error due to gyro drift over a flat earth, drift g t^3 / 6, m."""
    return drift * gravity * time * time * time / 6.0


def drift_spherical(drift: float, radius: float, rate: float, time: Time) -> Time:
    """Return the same over a spherical earth, (R drift / w) (w t - sin w t), m."""
    error: Time = (radius * drift / rate) * (rate * time - np.sin(rate * time))
    return error


def azimuth_flat(azimuth: float, distance: float) -> float:
    """Return the cross-range error due to a wrong launch direction over a flat earth, distance azimuth, m."""
    return distance * azimuth


def azimuth_spherical(azimuth: float, radius: float, distance: float) -> float:
    """Return the same over a spherical earth, R sin(distance / R) azimuth, m."""
    return float(radius * np.sin(distance / radius) * azimuth)


def hover(bias: float, rate: float, time: Time) -> Time:
    """Return the height error of a hovering vehicle due to the bias of its vertical accelerometer, m.

    The vertical channel diverges: z'' - 2 w^2 z = a from rest gives (a / 2 w^2) (cosh(sqrt(2) w t) - 1).
    """
    error: Time = (bias / (rate * rate)) * np.sinh(np.sqrt(0.5) * rate * time) ** 2
    return error
