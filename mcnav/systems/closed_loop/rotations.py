"""Attitudes in X: rotation vectors of at most half a turn, whose changes and differences are rotations.

A rotation vector phi stands for the matrix ``C = exp([phi x])``, which turns body axes into reference axes. A deviation
d of it turns it in reference axes, ``exp([d x]) C``, or in body axes, ``C exp([d x])``. All functions take and return
vectors of shape (3, n), by unit quaternions (scalar first), so that nothing is singular at half a turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from mcnav.arrays.types import Array

Side = Literal["reference", "body"]
"""Axes in which an attitude's errors are rotation vectors."""

SMALL_ANGLE: Final = 1e-3
"""Angle, rad, below which series of two terms are exact to rounding."""


def to_quaternion(vector: Array) -> Array:
    """Return unit quaternions, shape (4, n)."""
    angle = np.sqrt(np.sum(vector**2, axis=0))
    half = 0.5 * angle
    share = np.where(angle > SMALL_ANGLE, np.sin(half) / np.where(angle > 0.0, angle, 1.0), 0.5 - angle**2 / 48.0)
    return np.concatenate([np.cos(half)[None], share * vector])


def to_vector(quaternion: Array) -> Array:
    """Return rotation vectors of at most half a turn, shape (3, n), of quaternions, shape (4, n)."""
    upright = np.where(quaternion[0] < 0.0, -quaternion, quaternion)
    size = np.sqrt(np.sum(upright[1:] ** 2, axis=0))
    regular = size > 1e-9  # of a unit quaternion; below it the vector is twice the quaternion's
    share = np.where(regular, 2.0 * np.arctan2(size, upright[0]) / np.where(regular, size, 1.0), 2.0)
    return np.asarray(share * upright[1:])


def cross(left: Array, right: Array) -> Array:
    """Return the cross product along the first axis."""
    (a, b, c), (x, y, z) = left, right
    first = b * z - c * y
    result = np.empty((3, *first.shape))
    result[0], result[1], result[2] = first, c * x - a * z, a * y - b * x
    return result


def product(left: Array, right: Array) -> Array:
    """Multiply quaternions, shape (4, n): the rotation on the right comes first."""
    scalar = left[0] * right[0] - np.sum(left[1:] * right[1:], axis=0)
    vector = left[0] * right[1:] + right[0] * left[1:] + cross(left[1:], right[1:])
    return np.concatenate([scalar[None], vector])


def turned(vector: Array, change: Array, side: Side) -> Array:
    """Turn attitudes by rotation vectors in reference or in body axes."""
    first, second = to_quaternion(vector), to_quaternion(change)
    return to_vector(product(second, first) if side == "reference" else product(first, second))


def turn_between(vector: Array, origin: Array, side: Side) -> Array:
    """Return the rotation vectors that turn ``origin`` into ``vector``; `turned` with them is the inverse."""
    back = to_quaternion(-origin)
    there = to_quaternion(vector)
    return to_vector(product(there, back) if side == "reference" else product(back, there))


def to_matrix(vector: Array) -> Array:
    """Return rotation matrices from body to reference axes, shape (n, 3, 3)."""
    w, x, y, z = to_quaternion(vector)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def from_matrix(matrix: Array) -> Array:
    """Return rotation vectors of matrices, shape (n, 3, 3), by the largest part of the quaternion (Shepperd)."""
    m = np.moveaxis(matrix, 0, -1)
    # 4 q q^T, of which the row of the largest part is taken
    squares = np.array([
        [1.0 + m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], 1.0 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
        [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 1.0 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1]],
        [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1.0 - m[0, 0] - m[1, 1] + m[2, 2]],
    ])  # fmt: skip
    largest = np.argmax(np.einsum("iin->in", squares), axis=0)
    quaternion = squares[largest, :, np.arange(squares.shape[2])].T
    return to_vector(quaternion / np.sqrt(np.sum(quaternion**2, axis=0)))


def vector_rate(change: Array, rate: Array) -> Array:
    """Return the derivative of a rotation vector from its angular rate in body axes (Bortz's equation).

    With phi and its angle a: ``phi_dot = w + phi x w / 2 + (1 - (a / 2) cot(a / 2)) / a^2 phi x (phi x w)``.
    """
    angle = np.sqrt(np.sum(change**2, axis=0))
    half = 0.5 * np.where(angle > SMALL_ANGLE, angle, 1.0)
    share = np.where(angle > SMALL_ANGLE, (1.0 - half / np.tan(half)) / (4.0 * half**2), 1.0 / 12.0 + angle**2 / 720.0)
    across = cross(change, rate)
    return np.asarray(rate + 0.5 * across + share * cross(change, across))


@dataclass(frozen=True)
class Space:
    """Arithmetic of X: sums and differences, of attitudes by rotations.

    Attributes
    ----------
    attitudes : tuple of (slice, Side)
        Places of attitudes in X, and the axes of their deviations.
    """

    attitudes: tuple[tuple[slice, Side], ...] = ()

    def within(self, rows: slice) -> Space:
        """Return the arithmetic of some rows of X."""
        kept = ((place, side) for place, side in self.attitudes if rows.start <= place.start < rows.stop)
        return Space(tuple((slice(at.start - rows.start, at.stop - rows.start), side) for at, side in kept))

    def plus(self, x: Array, change: Array) -> Array:
        """Add deviations; shapes (size, n) that broadcast, as all below."""
        result = x + change
        for place, side in self.attitudes:
            result[place] = turned(x[place], change[place], side)
        return np.asarray(result)

    def minus(self, x: Array, origin: Array) -> Array:
        """Return the deviations of X from an origin."""
        result = x - origin
        for place, side in self.attitudes:
            result[place] = turn_between(x[place], origin[place], side)
        return np.asarray(result)

    def advanced(self, x: Array, change: Array) -> Array:
        """Add what rates have changed: attitudes turn in body axes."""
        result = x + change
        for place, _ in self.attitudes:
            result[place] = turned(x[place], change[place], "body")
        return np.asarray(result)

    def rates_at(self, change: Array, rates: Array) -> Array:
        """Return the derivative of a change from rates, of which an attitude's is its angular rate in body axes."""
        if not self.attitudes:
            return rates
        result = rates.copy()
        for place, _ in self.attitudes:
            result[place] = vector_rate(change[place], rates[place])
        return result

    def deviation_rates(self, x: Array, rates: Array) -> Array:
        """Return the rates of deviations from X itself: angular rates in the axes of the deviations."""
        result = rates.copy()
        for place, side in self.attitudes:
            if side == "reference":
                result[place] = np.einsum("nij,jn->in", to_matrix(x[place]), rates[place])
        return result
