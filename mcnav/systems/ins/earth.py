"""The rotating earth, moon and Mars: figure, gravitation, and the local directions at a place.

The gravitation is that of the reference ellipsoid itself, as a series of even zonal harmonics in earth-centred axes.
On the ellipsoid it reproduces Somigliana's formula, and above it both the vertical gradient and the small north
component, which formulas that continue gravity straight upwards lack. Of a body whose figure is not that of its field,
such as the moon and Mars, the field has a J2 of its own.

Frames: i, earth-centred inertial, which coincides with e at the first instant of a trajectory; e, earth-fixed; n,
north, east, down at the geodetic position.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, cast

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, inlined
from mcnav.numerics.elements import stack_elements

ZONALS: Final = 4
"""Harmonics J2, J4, J6, J8; the next would change gravity by 1e-13 of it."""

GEODETIC_ITERATIONS: Final = 3
"""Steps of Bowring's iteration: 1e-15 rad up to ten thousand kilometres of altitude."""

GRADIENT_STEP: Final = 64.0
"""Step of the central differences of gravitation, m: its gradient is right to 1e-10 of it."""

CURVATURE_STEP: Final = 1e4
"""Step of the gradient's differences, m: of the earth's radius squared, 2e-6."""


@dataclass(frozen=True)
class Earth:
    """An earth that is an ellipsoid of revolution, or a sphere.

    Attributes
    ----------
    radius : float
        Equatorial radius, m.
    flattening : float
        Zero for a sphere, whose gravitation is central.
    gravitational_parameter : float
        m^3/s^2.
    rotation_rate : float
        rad/s.
    j2 : float, optional
        The field's only zonal harmonic, at the equatorial radius; unless given the field is the figure's own.
    body : str
        What it is: `earth`, `moon` or `mars`.
    """

    radius: float
    flattening: float
    gravitational_parameter: float
    rotation_rate: float
    j2: float | None = None
    body: str = "earth"

    @property
    def eccentricity_squared(self) -> float:
        """First eccentricity, squared."""
        return self.flattening * (2.0 - self.flattening)

    @cached_property
    def zonals(self) -> Array:
        """Even zonal harmonics of the ellipsoid's own field (Heiskanen and Moritz 1967, eqs. 2-90 and 2-92)."""
        squared = self.eccentricity_squared
        if self.j2 is not None:
            return np.array([self.j2, *np.zeros(ZONALS - 1)])
        if squared == 0.0:
            return np.zeros(ZONALS)
        second = np.sqrt(squared / (1.0 - squared))
        if second < 0.01:
            raise ValueError("a flattening of less than 5e-5 loses the digits of J2; give a sphere")
        polar = self.radius * (1.0 - self.flattening)
        m = self.rotation_rate**2 * self.radius**2 * polar / self.gravitational_parameter
        # q0 = ((1 + 3 / e'^2) arctan e' - 3 / e') / 2 as a series, free of its cancellation
        n = np.arange(1, 40)
        q0 = float(np.sum(2.0 * (-1.0) ** (n + 1) * n / ((2 * n + 1) * (2 * n + 3)) * second ** (2 * n + 1)))
        j2 = squared / 3.0 * (1.0 - 2.0 / 15.0 * m * second / q0)
        k = np.arange(1, ZONALS + 1)
        share = 1.0 - k + 5.0 * k * j2 / squared
        return np.asarray((-1.0) ** (k + 1) * 3.0 * squared**k / ((2 * k + 1) * (2 * k + 3)) * share)

    @cached_property
    def constants(self) -> Array:
        """Figure, field and rotation as compiled functions take them.

        Radius, squared eccentricity, gravitational parameter, rotation rate, zonal harmonics.
        """
        first = [self.radius, self.eccentricity_squared, self.gravitational_parameter, self.rotation_rate]
        return np.array([*first, *self.zonals])

    def gravitation(self, position: Array) -> Array:
        """Compute the gravitation, m/s^2, at earth-centred positions, shape (n, 3), i or e."""
        return np.stack(self.gravitation_along(*np.asarray(position, dtype=float).T), axis=-1)

    def gravitation_along(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """Compute the gravitation, m/s^2, along each axis, shape (n,), at earth-centred positions, i or e."""
        if self.zonals.any():
            return cast(tuple[Array, Array, Array], cast(Any, gravitation).py_func(self.constants, x, y, z))
        inverse = 1.0 / np.sqrt(x * x + y * y + z * z)  # a central field: the same bits without sums of zeros
        along = -self.gravitational_parameter * inverse * inverse * inverse
        return along * x, along * y, along * z

    def gravity_gradient(self, position: Array) -> Array:
        """Compute the gradient of the gravitation, 1/s^2, at positions, shape (n, 3): shape (n, 3, 3)."""
        return _gradient_of(self.constants, np.ascontiguousarray(position, dtype=float))

    def zonal_curvature(self, position: Array) -> Array:
        """Compute half of the second derivative of the gravitation of the zonal harmonics, 1/(m s^2).

        At positions, shape (n, 3), earth-centred: of xx, yy, zz, xy, xz and yz, the last three twice, shape (n, 3, 6).
        """
        derivative = np.empty((len(position), 3, 3, 3))
        for axis in range(3):
            shift = CURVATURE_STEP * np.eye(3)[axis]
            change = self._zonal_gradient(position + shift) - self._zonal_gradient(position - shift)
            derivative[..., axis] = change / (4.0 * CURVATURE_STEP)
        mixed = derivative + derivative.swapaxes(2, 3)
        squares = np.einsum("nijj->nij", derivative)
        return np.concatenate([squares, mixed[:, :, [0, 0, 1], [1, 2, 2]]], axis=2)

    def _zonal_gradient(self, position: Array) -> Array:
        radius = np.linalg.norm(position, axis=1)[:, None, None]
        vertical = position / radius[:, 0]
        central = (3.0 * vertical[:, :, None] * vertical[:, None, :] - np.eye(3)) / radius**3
        return np.asarray(self.gravity_gradient(position) - self.gravitational_parameter * central)

    def curvature_radii(self, latitude: Array) -> tuple[Array, Array]:
        """Compute the radii of curvature in the meridian, R_N, and in the prime vertical, R_E, m."""
        w = 1.0 - self.eccentricity_squared * np.sin(latitude) ** 2
        prime = self.radius / np.sqrt(w)
        return np.asarray(prime * (1.0 - self.eccentricity_squared) / w), np.asarray(prime)

    def from_geodetic(self, latitude: Array, longitude: Array, altitude: Array) -> Array:
        """Compute earth-fixed positions, shape (..., 3), m, from angles in rad and altitudes in m."""
        _, prime = self.curvature_radii(latitude)
        level = (prime + altitude) * np.cos(latitude)
        up = (prime * (1.0 - self.eccentricity_squared) + altitude) * np.sin(latitude)
        return np.stack([level * np.cos(longitude), level * np.sin(longitude), up], axis=-1)

    def to_geodetic(self, position: Array) -> Array:
        """Compute latitude, longitude (rad) and altitude (m) of earth-fixed positions, shape (n, 3)."""
        return _geodetic_of(self.constants, np.ascontiguousarray(position, dtype=float))

    def turned(self, duration: Array) -> Array:
        """Compute the matrices that take earth-fixed to inertial axes after durations, s: shape (..., 3, 3)."""
        angle = self.rotation_rate * np.asarray(duration)
        sine, cosine = np.sin(angle), np.cos(angle)
        return stack_elements([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


WGS84: Final = Earth(6_378_137.0, 1.0 / 298.257223563, 3.986004418e14, 7.292115e-5)
"""World Geodetic System 1984 (NIMA TR8350.2), with the rotation rate of its definition."""


MOON: Final = Earth(1_737_400.0, 0.0, 4.902_800_118e12, 2.661_699_5e-6, 2.027e-4, "moon")
"""The moon: the sphere and the rotation of the IAU (Archinal and others 2018, *Celestial Mechanics* 130:22), the
gravitational parameter of GRAIL (DE440), and J2 of NASA's Moon Fact Sheet."""

MARS: Final = Earth(3_396_190.0, 1.0 / 169.894_447, 4.282_837_5e13, 7.088_218e-5, 1.960_45e-3, "mars")
"""Mars: the ellipsoid (3396.19 and 3376.20 km) and the rotation (350.892 deg/day) of the IAU (as for `MOON`), the
gravitational parameter and J2 of NASA's Mars Fact Sheet."""

BODIES: Final = {"wgs84": WGS84, "moon": MOON, "mars": MARS}
"""Bodies by the entry ``earth`` of a scenario."""


def local_axes(latitude: Array, longitude: Array) -> Array:
    """Compute the matrices from north, east, down to earth-fixed axes, shape (..., 3, 3)."""
    sf, cf, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return stack_elements([[-sf * cl, -sl, -cf * cl], [-sf * sl, cl, -cf * sl], [cf, 0.0, -sf]])


@inlined
def gravitation(constants: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Compute the gravitation at one place, m/s^2: the gradient of the potential of zonal harmonics.

    ``g = -(mu / r^2) {r^ [1 - sum J_n (a/r)^n P'_{n+1}(s)] + z^ sum J_n (a/r)^n P'_n(s)}`` with ``s = z / r``.
    """
    square = x * x + y * y + z * z
    inverse = 1.0 / np.sqrt(square)
    s = z * inverse
    q = constants[0] * constants[0] * inverse * inverse
    power, radial, polar = 1.0, 1.0, 0.0
    # derivatives of the Legendre polynomials: P'_{n+1} = ((2 n + 1) s P'_n - (n + 1) P'_{n-1}) / n
    before, now = 1.0, 3.0 * s  # P'_1, P'_2
    for k in range(ZONALS):
        n = 2.0 * k + 2.0
        power = power * q
        following = ((2.0 * n + 1.0) * s * now - (n + 1.0) * before) * (1.0 / n)  # P'_{n+1}
        weight = constants[4 + k] * power
        radial -= weight * following
        polar += weight * now
        before, now = following, ((2.0 * n + 3.0) * s * following - (n + 2.0) * now) * (1.0 / (n + 1.0))
    pull = -constants[2] * inverse * inverse
    along = pull * radial * inverse
    return along * x, along * y, along * z + pull * polar


@inlined
def meridian_sides(constants: Array, level: float, z: float) -> tuple[float, float]:
    """Compute the sides of a triangle with the geodetic latitude, up and out, by Bowring's iteration.

    Parameters
    ----------
    level : float
        Distance from the axis.
    """
    radius, squared = constants[0], constants[1]
    ratio = np.sqrt(1.0 - squared)
    up, out = z, ratio * level  # of the parametric latitude, up to a factor
    for _ in range(GEODETIC_ITERATIONS):
        # (z + e^2 a / sqrt(1 - e^2) sin^3 beta) / (level - e^2 a cos^3 beta), of the parametric latitude beta
        scale = 1.0 / np.sqrt(up * up + out * out)
        sine, cosine = up * scale, out * scale
        rise = z + squared * radius / ratio * sine * sine * sine
        out = level - squared * radius * cosine * cosine * cosine
        up = ratio * rise
    return rise, out


@inlined
def geodetic_altitude(constants: Array, x: float, y: float, z: float) -> float:
    """Compute the altitude of an earth-fixed position."""
    level = np.sqrt(x * x + y * y)
    up, out = meridian_sides(constants, level, z)
    scale = 1.0 / np.sqrt(up * up + out * out)
    sine, cosine = up * scale, out * scale
    altitude: float = level * cosine + z * sine - constants[0] * np.sqrt(1.0 - constants[1] * sine * sine)
    return altitude


@inlined
def geodetic(constants: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Compute geodetic latitude, longitude and altitude of an earth-fixed position."""
    up, out = meridian_sides(constants, np.sqrt(x * x + y * y), z)
    return np.arctan2(up, out), np.arctan2(y, x), geodetic_altitude(constants, x, y, z)


@compiled
def _gradient_of(constants: Array, position: Array) -> Array:
    gradient = np.empty((len(position), 3, 3))
    there = np.empty(3)
    for row in range(len(position)):
        for axis in range(3):
            for i in range(3):
                there[i] = position[row, i]
            # central differences along each axis
            there[axis] += GRADIENT_STEP
            ax, ay, az = gravitation(constants, there[0], there[1], there[2])
            there[axis] -= 2.0 * GRADIENT_STEP
            bx, by, bz = gravitation(constants, there[0], there[1], there[2])
            gradient[row, 0, axis] = (ax - bx) / (2.0 * GRADIENT_STEP)
            gradient[row, 1, axis] = (ay - by) / (2.0 * GRADIENT_STEP)
            gradient[row, 2, axis] = (az - bz) / (2.0 * GRADIENT_STEP)
    return gradient


@compiled
def _geodetic_of(constants: Array, position: Array) -> Array:
    result = np.empty_like(position)
    for row in range(len(position)):
        x, y, z = geodetic(constants, position[row, 0], position[row, 1], position[row, 2])
        result[row, 0], result[row, 1], result[row, 2] = x, y, z
    return result
