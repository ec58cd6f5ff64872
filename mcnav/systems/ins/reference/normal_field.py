"""Gravitation of the reference ellipsoid in closed form, in ellipsoidal coordinates.

Heiskanen and Moritz (1967), *Physical Geodesy*, section 2-8: with the linear eccentricity E, a point has the semiminor
axis u of the confocal ellipsoid through it and the reduced latitude beta there, and the components of gravitation are::

    g_u    = -[mu + w^2 a^2 E (q'/q0) (sin^2 beta / 2 - 1/6)] / (W D)
    g_beta = [w^2 a^2 (q/q0) sin beta cos beta] / (W sqrt D)
    D      = u^2 + E^2        W^2 = (u^2 + E^2 sin^2 beta) / D

with the rotation rate w of the earth, and with q and q' as functions of E / u. Their closed forms in the arctangent
lose eleven digits by cancellation; the power series of the arctangent gives all of them.

A body with a J2 of its own has the field of a point mass and of J2, in cartesian axes (Vallado 2013, *Fundamentals of
Astrodynamics and Applications*, section 8.7.1)::

    (g_x, g_y) = -(mu / r^3) [1 + 3/2 J2 (a/r)^2 (1 - 5 z^2/r^2)] (x, y)
    g_z = -(mu / r^3) [1 + 3/2 J2 (a/r)^2 (3 - 5 z^2/r^2)] z
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.earth import Earth

HEADER: Final = 3
"""Constants before the coefficients: E^2, mu and w^2 a^2."""

DEEPEST: Final = 0.9
"""Share of the polar radius down to which the series have all digits of a floating-point number."""


def field_constants(earth: Earth) -> Array:
    """Compute the constants of `normal_gravitation`.

    Returns
    -------
    ndarray, shape (3 + 2 n,) or (4,)
        E^2, mu and w^2 a^2; n coefficients of q / (q0 x^3) and n of E q' / (q0 x^2), as polynomials in x^2 with
        x = E / u. A sphere has none; a body with a J2 of its own has J2 a^2 in their place, and E is zero.
    """
    if earth.j2 is not None:
        return np.array([0.0, earth.gravitational_parameter, 0.0, earth.j2 * earth.radius**2])
    eccentricity = earth.radius * np.sqrt(earth.eccentricity_squared)
    header = [eccentricity**2, earth.gravitational_parameter, (earth.rotation_rate * earth.radius) ** 2]
    if eccentricity == 0.0:
        return np.array(header)
    polar = earth.radius * (1.0 - earth.flattening)
    terms = int(np.ceil(np.log(np.finfo(float).eps) / np.log((eccentricity / (DEEPEST * polar)) ** 2))) + 1
    n = np.arange(1, terms + 1)
    odd = (-1.0) ** (n + 1) / ((2 * n + 1) * (2 * n + 3))
    surface = float(np.sum(2.0 * n * odd * (eccentricity / polar) ** (2 * n + 1)))
    return np.concatenate([header, 2.0 * n * odd / surface, 6.0 * eccentricity * odd / surface])


@compiled
def normal_gravitation(constants: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Compute the gravitation at one earth-centred place outside the focal disc, m/s^2."""
    focal = constants[0]
    square = x * x + y * y
    inside = square + z * z - focal
    u2 = 0.5 * (inside + np.sqrt(inside * inside + 4.0 * focal * z * z))
    u = np.sqrt(u2)
    d = u2 + focal
    sine = z / u
    sine2 = sine * sine
    x2 = focal / u2
    terms = (len(constants) - HEADER) // 2
    q, derivative = 0.0, 0.0
    for n in range(terms - 1, -1, -1):
        q = q * x2 + constants[HEADER + n]
        derivative = derivative * x2 + constants[HEADER + terms + n]
    q *= constants[2] * x2 * np.sqrt(x2)
    derivative *= constants[2] * x2
    pull = (constants[1] + derivative * (0.5 * sine2 - 1.0 / 6.0)) / d
    share = 1.0 / (u2 + focal * sine2)
    level = -share * (pull * u + q * sine2)
    upward = share * sine * (q * square * u / d - pull * d)
    if len(constants) == HEADER + 1:
        weight = -1.5 * constants[1] * constants[HEADER] / (u2 * u2 * u)
        level += weight * (1.0 - 5.0 * sine2)
        upward += weight * (3.0 - 5.0 * sine2) * z
    return level * x, level * y, upward


@compiled
def normal_gravitation_at(constants: Array, position: Array) -> Array:
    """Compute the gravitation, m/s^2, at earth-centred positions, shape (n, 3)."""
    gravitation = np.empty_like(position)
    for row in range(len(position)):
        x, y, z = normal_gravitation(constants, position[row, 0], position[row, 1], position[row, 2])
        gravitation[row, 0], gravitation[row, 1], gravitation[row, 2] = x, y, z
    return gravitation
