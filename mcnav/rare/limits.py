"""Events whose probability is asked for: outputs beyond their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array

DIRECTIONS: Final = 16
"""Directions in which the outside of a circle is divided; twice as many for a sphere."""


def strict_margin(margin: Array) -> Array:
    """Count outputs exactly at a limit, such as saturated commands, as beyond it: "below" is strict.

    Their margin is the smallest positive number instead of zero, so that a positive margin is all that fails.

    >>> strict_margin(np.array([-1.0, 0.0, 2.0])) > 0.0
    array([False,  True,  True])
    """
    return np.asarray(np.where(margin == 0.0, np.nextafter(0.0, 1.0), margin))


@dataclass(frozen=True)
class Sides:
    """At least one output at a side or beyond: ``y_i >= upper_i`` or ``y_i <= lower_i``.

    ``lower`` and ``upper`` have shape (outputs,), SI; infinite where an output has no such side.
    """

    lower: Array
    upper: Array

    def margin(self, outputs: Array) -> Array:
        """Return how far outputs, shape (n, outputs), lie beyond, shape (n,); negative within; NaN of a failed flight.

        See `strict_margin` for outputs exactly at a side.

        With several outputs it is the largest of the distances, each over half the width between its sides.
        """
        return strict_margin(np.max((outputs @ self.normals.T - self.offsets) / self._scales, axis=1))

    def reached(self, outputs: Array) -> Array:
        """Return the largest multiple of two equal limits that outputs, shape (n, outputs), reach, shape (n,)."""
        return np.asarray(np.max(np.abs(outputs) / self.upper, axis=1))

    @property
    def normals(self) -> Array:
        """Directions n of the sides ``n . y > c``, shape (sides, outputs)."""
        signs = np.vstack([np.eye(len(self.upper)), -np.eye(len(self.lower))])
        return np.asarray(signs[self._stated])

    @property
    def offsets(self) -> Array:
        """Their distances c, shape (sides,)."""
        return np.asarray(np.concatenate([self.upper, -self.lower])[self._stated])

    @property
    def _stated(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(np.concatenate([self.upper, -self.lower])))

    @property
    def _scales(self) -> Array:
        if len(self.upper) == 1:
            return np.ones(len(self.offsets))
        width = np.where(np.isfinite(self.upper - self.lower), 0.5 * (self.upper - self.lower), 1.0)
        return np.asarray(np.concatenate([width, width])[self._stated])


@dataclass(frozen=True)
class Distance:
    """Distance from zero in two or three outputs beyond a radius, SI."""

    radius: float
    dimensions: int

    def margin(self, outputs: Array) -> Array:
        """Return how far outputs, shape (n, dimensions), lie beyond; see `Sides.margin`."""
        return strict_margin(np.sqrt(np.sum(outputs**2, axis=1)) - self.radius)

    def reached(self, outputs: Array) -> Array:
        """Return the multiple of the radius that outputs, shape (n, dimensions), reach, shape (n,)."""
        return np.asarray(np.sqrt(np.sum(outputs**2, axis=1)) / self.radius)

    @property
    def normals(self) -> Array:
        """Directions that cover the circle or the sphere evenly (golden spiral), shape (directions, dimensions)."""
        if self.dimensions == 2:
            angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
            return np.stack([np.cos(angle), np.sin(angle)], axis=1)
        count = 2 * DIRECTIONS
        height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
        angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
        flat = np.sqrt(1.0 - height**2)
        return np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)

    @property
    def offsets(self) -> Array:
        """The radius in each of the directions, shape (directions,)."""
        return np.full(len(self.normals), self.radius)


@dataclass(frozen=True)
class AnyEpoch:
    """Beyond a limit at one of several epochs at least: the first passage lies within them.

    Outputs are those of the first epoch, then those of the second, and so on.
    """

    limit: Sides | Distance
    epochs: int

    def margin(self, outputs: Array) -> Array:
        """Return how far outputs, shape (n, epochs times outputs), lie beyond, shape (n,); see `Sides.margin`."""
        return np.asarray(np.max(self.margins(outputs), axis=1))

    def margins(self, outputs: Array) -> Array:
        """Return the same at each epoch, shape (n, epochs)."""
        return self.limit.margin(self._apart(outputs)).reshape(len(outputs), self.epochs)

    def reached(self, outputs: Array) -> Array:
        """Return the largest multiple of the limit that outputs reach, shape (n,)."""
        return np.asarray(np.max(self.limit.reached(self._apart(outputs)).reshape(len(outputs), self.epochs), axis=1))

    @property
    def normals(self) -> Array:
        """Directions of the sides at each epoch, shape (epochs times sides, epochs times outputs)."""
        return np.asarray(np.kron(np.eye(self.epochs), self.limit.normals))

    @property
    def offsets(self) -> Array:
        """Their distances."""
        return np.tile(self.limit.offsets, self.epochs)

    def _apart(self, outputs: Array) -> Array:
        return outputs.reshape(len(outputs) * self.epochs, outputs.shape[1] // self.epochs)


def side_towards(limit: Limit, change: Array) -> Array:
    """Return the normal of the side that a change of the outputs, shape (outputs,), reaches first."""
    scales = np.where(limit.offsets > 0.0, limit.offsets, 1.0)
    return np.asarray(limit.normals[int(np.argmax(limit.normals @ change / scales))])


Limit = Sides | Distance | AnyEpoch
