"""Reentry without an atmosphere: the ellipse, its perigee, and the partial derivatives of the perigee radius.

NASA TN D-1772, appendix, eqs. (22)-(31). With only gravity acting a perfect navigator's final altitude error is that of
the perigee radius, which the report uses to explain the shape of its curves. Nothing here integrates anything.

Every function takes r (m), r' (m/s) and theta' (rad/s), or r, V (m/s) and gamma (rad), as numbers or arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.physics.constants import GRAVITATIONAL_PARAMETER


@dataclass(frozen=True)
class Ellipse:
    """An orbit by its semimajor axis (m), eccentricity and angular momentum per unit mass (m^2/s), eq. (17)."""

    semimajor_axis: float
    eccentricity: float
    angular_momentum: float

    @property
    def perigee_radius(self) -> float:
        """Perigee radius a (1 - e), m."""
        return self.semimajor_axis * (1.0 - self.eccentricity)

    def time_to_perigee(self, radius: Array) -> Array:
        """Compute the time from a radius on the way in to the perigee, s: eqs. (29) and (30).

        ``t_p sqrt(mu / a^3) = E - e sin E`` with ``cos E = (a - r) / (a e)``.
        """
        anomaly = np.arccos((self.semimajor_axis - radius) / (self.semimajor_axis * self.eccentricity))
        mean_motion = np.sqrt(GRAVITATIONAL_PARAMETER / self.semimajor_axis**3)
        return np.asarray((anomaly - self.eccentricity * np.sin(anomaly)) / mean_motion)

    def speed(self, radius: Array) -> Array:
        """Compute V at a radius, m/s: ``V^2 = mu (2 / r - 1 / a)``, eq. (31)."""
        return np.asarray(np.sqrt(GRAVITATIONAL_PARAMETER * (2.0 / radius - 1.0 / self.semimajor_axis)))

    def flight_path_angle(self, radius: Array) -> Array:
        """Compute the flight-path angle at a radius on the way in, rad, negative: ``H = r V cos gamma``, eq. (31)."""
        cosine = self.angular_momentum / (radius * self.speed(radius))
        return np.asarray(-np.arccos(np.minimum(cosine, 1.0)))


def ellipse_of(radius: float, radius_rate: float, angle_rate: float) -> Ellipse:
    """Find the ellipse on which a state lies."""
    momentum = radius * radius * angle_rate
    energy = 0.5 * (radius_rate**2 + (radius * angle_rate) ** 2) - GRAVITATIONAL_PARAMETER / radius
    axis = -0.5 * GRAVITATIONAL_PARAMETER / energy
    return Ellipse(axis, float(np.sqrt(1.0 - momentum**2 / (GRAVITATIONAL_PARAMETER * axis))), momentum)


def perigee_radius(radius: Array, radius_rate: Array, angle_rate: Array) -> Array:
    """Compute the perigee radius of the orbit through a state, m.

    The smaller root of eq. (26), ``r_p^2 (2 mu - r V^2) - 2 mu r r_p + r^5 theta'^2 = 0`` with
    ``V^2 = r'^2 + r^2 theta'^2``, in the form that does not cancel.
    """
    mu = GRAVITATIONAL_PARAMETER
    square = radius**5 * angle_rate**2
    leading = 2.0 * mu - radius * (radius_rate**2 + (radius * angle_rate) ** 2)
    return np.asarray(square / (mu * radius + np.sqrt((mu * radius) ** 2 - leading * square)))


def perigee_by_rates(radius: Array, radius_rate: Array, angle_rate: Array) -> Array:
    """Compute partial derivatives of the perigee radius with respect to r, r' and theta', shape (3, ...): eq. (27)."""
    mu, perigee = GRAVITATIONAL_PARAMETER, perigee_radius(radius, radius_rate, angle_rate)
    common = -mu * radius + perigee * (2.0 * mu - radius * (radius_rate**2 + (radius * angle_rate) ** 2))
    by_radius = (
        mu * perigee
        - 2.5 * radius**4 * angle_rate**2
        + 0.5 * perigee**2 * (radius_rate**2 + 3.0 * (radius * angle_rate) ** 2)
    )
    by_radius_rate = radius * radius_rate * perigee**2
    by_angle_rate = -(radius**5) * angle_rate + perigee**2 * radius**3 * angle_rate
    return np.asarray([by_radius, by_radius_rate, by_angle_rate]) / common


def perigee_by_speed_and_angle(radius: Array, speed: Array, angle: Array) -> Array:
    """Compute partial derivatives of the perigee radius with respect to r, V and gamma, shape (3, ...): eq. (28)."""
    mu = GRAVITATIONAL_PARAMETER
    across = speed * np.cos(angle)
    perigee = perigee_radius(radius, speed * np.sin(angle), across / radius)
    common = -mu * radius + perigee * (2.0 * mu - radius * speed**2)
    by_radius = mu * perigee - 1.5 * (radius * across) ** 2 + 0.5 * (perigee * speed) ** 2
    by_speed = radius * speed * perigee**2 - radius**3 * speed * np.cos(angle) ** 2
    by_angle = radius**3 * speed**2 * np.cos(angle) * np.sin(angle)
    return np.asarray([by_radius, by_speed, by_angle]) / common
