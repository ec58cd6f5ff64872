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
from typing import Any, Literal, TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes

Rows: TypeAlias = Any
"""Matrices by row and column: numbers, or arrays of shape (n,)."""


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
    def _spin(self) -> list[Any]:
        return list(self.spin)

    @cached_property
    def _turns(self) -> tuple[Rows, Rows]:
        """Rows of the matrices to the planet's axes, and back."""
        return self.to_planet.tolist(), self.to_planet.T.tolist()

    def gravitation(self, position: Array) -> Array:
        """Compute the gravitation g at positions, both of shape (n, 3)."""
        return np.stack(self._pulled(list(position.T)), axis=-1)

    def fall(self, position: Array, velocity: Array) -> Array:
        """Compute the acceleration over the axes without a specific force, shape (n, 3)."""
        return np.stack(self._falling(position, velocity), axis=-1)

    def move(self, position: Array, velocity: Array, attitude: Array, force: Array, rate: Array) -> dict[str, Array]:
        """Compute the rates of position, velocity and attitude by their names.

        Parameters
        ----------
        position, velocity, force, rate : ndarray, shape (n, 3)
        attitude : ndarray, shape (n, 3, 3)
        """
        result = np.empty((2, 3, len(force)))
        axes = _turned(attitude.transpose(2, 1, 0), self._spin)
        felt, falling = _turned(attitude.transpose(1, 2, 0), list(force.T)), self._falling(position, velocity)
        for axis in range(3):
            np.add(felt[axis], falling[axis], out=result[0, axis])
            np.subtract(rate[:, axis], axes[axis], out=result[1, axis])
        return {"position": velocity, "velocity": result[0].T, "attitude": result[1].T}

    def _falling(self, position: Array, velocity: Array) -> list[Array]:
        """Compute `fall`, axis by axis."""
        place = list(position.T)
        falling = self._pulled(place)
        if any(self._spin):
            coriolis = _across(self._spin, list(velocity.T))
            outwards = _across(self._spin, _across(self._spin, self._from_centre(place)))
            for axis in range(3):
                falling[axis] -= 2.0 * coriolis[axis]
                falling[axis] -= outwards[axis]
        return falling

    def _pulled(self, place: list[Array]) -> list[Array]:
        """Compute the gravitation, axis by axis, at a position given so."""
        if self.site is None:
            return list(self.planet.gravitation_along(*place))
        there, back = self._turns
        along = self.planet.gravitation_along(*_turned(there, self._from_centre(place)))
        return _turned(back, list(along))

    def _from_centre(self, place: list[Array]) -> list[Array]:
        return [origin + along for origin, along in zip(self.origin, place, strict=True)]

    def altitude(self, position: Array) -> Array:
        """Compute the altitude above the planet's figure at positions, shape (n, 3): shape (n,)."""
        return self.planet.to_geodetic(turned(self.to_planet, self.origin + position))[:, 2]


def turned(matrix: Array, vectors: Array) -> Array:
    """Turn vectors, shape (n, 3), by matrices, shape (n, 3, 3) or (3, 3): with the same bits for any n."""
    return np.stack(_turned(np.moveaxis(matrix, (-2, -1), (0, 1)), list(vectors.T)), axis=-1)


def _turned(rows: Rows, vector: list[Array]) -> list[Array]:
    """Turn vectors by the rows of matrices, axis by axis."""
    x, y, z = vector
    turned = []
    for first, second, third in rows:
        along = first * x
        along += second * y
        along += third * z
        turned.append(along)
    return turned


def _across(one: list[Array], vector: list[Array]) -> list[Array]:
    """Return the cross products of one vector with others, axis by axis."""
    (a, b, c), (x, y, z) = one, vector
    return [b * z - c * y, c * x - a * z, a * y - b * x]
