"""Motion over a planet in axes that are fixed to it, or inertial: the equations of truth and of mechanization.

With position r and velocity v over the axes, the attitude C from body to these axes, the specific force f and the
inertial angular rate w of the body in its own axes, the axes' rate W and the planet's centre c, all in the axes
(Groves 2013, section 5.3)::

    r' = v
    v' = C f + g(r) - 2 W x v - W x (W x (r - c))
    the body turns over the axes by w - C^T W, in its own axes
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes


@dataclass(frozen=True)
class PlanetAxes:
    """Axes with an origin at the planet's centre, or north, east and down at a site.

    Attributes
    ----------
    planet : Earth
    site : tuple of float, optional
        Latitude and longitude, rad, and altitude, m, of the origin; the planet's centre and its own axes without.
    kind : str
        ``fixed`` to the turning planet, or ``inertial``: those that are fixed at the time zero.
    """

    planet: Earth
    site: tuple[float, float, float] | None = None
    kind: Literal["fixed", "inertial"] = "fixed"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the axes."""
        return ("x", "y", "z") if self.site is None else ("north", "east", "down")

    @cached_property
    def to_planet(self) -> Array:
        """Matrix from these axes to the planet's, shape (3, 3)."""
        return np.eye(3) if self.site is None else local_axes(np.array(self.site[0]), np.array(self.site[1]))

    @cached_property
    def origin(self) -> Array:
        """Position of the origin from the planet's centre, in these axes: -c, m, shape (3,)."""
        if self.site is None:
            return np.zeros(3)
        return np.asarray(
            self.planet.from_geodetic(*(np.array(coordinate) for coordinate in self.site)) @ self.to_planet
        )

    @cached_property
    def spin(self) -> Array:
        """Rate of the axes, W, in them, rad/s, shape (3,)."""
        rate = self.planet.rotation_rate if self.kind == "fixed" else 0.0
        return np.asarray(rate * self.to_planet[2])

    @cached_property
    def _spins(self) -> bool:
        return bool(self.spin.any())

    def gravitation(self, position: Array) -> Array:
        """Compute the gravitation g at positions, both of shape (n, 3)."""
        if self.site is None:
            return self.planet.gravitation(position)
        return turned(self.to_planet.T, self.planet.gravitation(turned(self.to_planet, self.origin + position)))

    def fall(self, position: Array, velocity: Array) -> Array:
        """Compute the acceleration over the axes without a specific force, shape (n, 3)."""
        result = self.gravitation(position)
        if self._spins:
            centrifugal = _across(self.spin, _across(self.spin, self.origin + position))
            result = result - 2.0 * _across(self.spin, velocity) - centrifugal
        return result

    def move(self, position: Array, velocity: Array, attitude: Array, force: Array, rate: Array) -> dict[str, Array]:
        """Compute the rates of position, velocity and attitude by their names.

        Parameters
        ----------
        position, velocity, force, rate : ndarray, shape (n, 3)
        attitude : ndarray, shape (n, 3, 3)
        """
        turning = rate - turned(attitude.swapaxes(1, 2), self.spin)
        felt = turned(attitude, force)
        return {"position": velocity, "velocity": felt + self.fall(position, velocity), "attitude": turning}

    def altitude(self, position: Array) -> Array:
        """Compute the altitude above the planet's figure at positions, shape (n, 3): shape (n,)."""
        return self.planet.to_geodetic(turned(self.to_planet, self.origin + position))[:, 2]


def turned(matrix: Array, vectors: Array) -> Array:
    """Turn vectors, shape (n, 3) or (3,), by matrices, shape (n, 3, 3) or (3, 3): with the same bits for any n."""
    x, y, z = vectors.T
    first = matrix[..., 0, 0] * x
    result = np.empty((*first.shape, 3))
    for row in range(3):
        part = matrix[..., row, 0] * x if row else first
        part += matrix[..., row, 1] * y
        np.add(part, matrix[..., row, 2] * z, out=result[..., row])
    return result


def _across(one: Array, vectors: Array) -> Array:
    """Return the cross products of one vector, shape (3,), with others, shape (n, 3): `numpy.cross` is slow for few."""
    (a, b, c), (x, y, z) = one, vectors.T
    result = np.empty(vectors.shape)
    result[:, 0], result[:, 1], result[:, 2] = b * z - c * y, c * x - a * z, a * y - b * x
    return result
