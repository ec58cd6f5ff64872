"""Attitudes in X: rotation vectors of at most half a turn, whose changes and differences are rotations.

A rotation vector phi stands for the matrix ``C = exp([phi x])``, which turns body axes into reference axes. A deviation
d of it turns it in reference axes, ``exp([d x]) C``, or in body axes, ``C exp([d x])``. All functions take and return
vectors of shape (3, n), by unit quaternions (scalar first), so that nothing is singular at half a turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal

import numpy as np

from mcnav.arrays.types import Array

Side = Literal["reference", "body"]
"""Axes in which an attitude's errors are rotation vectors."""

SMALL_ANGLE: Final = 1e-3
"""Angle, rad, below which series of two terms are exact to rounding."""


def _angles(vector: Array) -> Array:
    """Return the angles of rotation vectors, rad, shape (n,)."""
    x, y, z = vector
    square = x * x
    square += y * y
    square += z * z
    return np.asarray(np.sqrt(square))


def to_quaternion(vector: Array) -> Array:
    """Return unit quaternions, shape (4, n)."""
    angle = _angles(vector)
    half, regular = 0.5 * angle, angle > SMALL_ANGLE
    result = np.empty((4, *angle.shape))
    np.cos(half, out=result[0])
    if regular.all():
        share = np.sin(half, out=half)
        share /= angle
    elif regular.any():
        share = np.where(regular, np.sin(half) / np.where(angle > 0.0, angle, 1.0), 0.5 - angle**2 / 48.0)
    else:
        share = 0.5 - angle**2 / 48.0
    np.multiply(share, vector, out=result[1:])
    return result


def to_vector(quaternion: Array) -> Array:
    """Return rotation vectors of at most half a turn, shape (3, n), of quaternions, shape (4, n)."""
    turned_over = quaternion[0] < 0.0
    upright = np.where(turned_over, -quaternion, quaternion) if turned_over.any() else quaternion
    size = _angles(upright[1:])
    regular = size > 1e-9  # of a unit quaternion; below it the vector is twice the quaternion's
    if regular.all():
        share = np.arctan2(size, upright[0])
        share *= 2.0
        share /= size
    else:
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
    (d, a, b, c), (w, x, y, z) = left, right
    along = a * x
    along += b * y
    along += c * z
    scalar = d * w - along
    result = np.empty((4, *scalar.shape))
    result[0] = scalar
    for place, own, other, across in ((1, a, x, b * z - c * y), (2, b, y, c * x - a * z), (3, c, z, a * y - b * x)):
        part = d * other
        part += w * own
        np.add(part, across, out=result[place])
    return result


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
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    result = np.empty((3, 3, len(w)))
    for row, (first, second, third) in enumerate((
        (1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)),
        (2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)),
        (2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)),
    )):  # fmt: skip
        result[row, 0], result[row, 1], result[row, 2] = first, second, third
    return result.transpose(2, 0, 1)


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
    angle = _angles(change)
    regular = angle > SMALL_ANGLE
    if regular.any():
        half = 0.5 * np.where(regular, angle, 1.0)
        share = np.where(regular, (1.0 - half / np.tan(half)) / (4.0 * half**2), 1.0 / 12.0 + angle**2 / 720.0)
    else:
        share = 1.0 / 12.0 + angle**2 / 720.0
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

    def advancing(self, x: Array) -> Callable[[Array], Array]:
        """Return the sum of X, shape (size, n), and what rates have changed, as a function of it.

        Attitudes turn in body axes, all of them in one call.
        """
        if not self.attitudes:
            return partial(np.add, x)
        origins = to_quaternion(self._side_by_side(x))

        def advanced(change: Array) -> Array:
            result = np.asarray(x + change)
            self._spread(to_vector(product(origins, to_quaternion(self._side_by_side(change)))), result)
            return result

        return advanced

    def turn_rates(self, change: Array, rates: Array) -> Array:
        """Return rates, shape (size, n), with those of attitudes, angular ones in body axes, as those of a change.

        They are changed in place.
        """
        if self.attitudes:
            self._spread(vector_rate(self._side_by_side(change), self._side_by_side(rates)), rates)
        return rates

    def _side_by_side(self, x: Array) -> Array:
        """Return the attitudes of X, shape (3, those of all samples)."""
        return np.concatenate([x[place] for place, _ in self.attitudes], axis=1)

    def _spread(self, attitudes: Array, result: Array) -> None:
        """Put attitudes that are side by side into X."""
        count = result.shape[1]
        for number, (place, _) in enumerate(self.attitudes):
            result[place] = attitudes[:, number * count : (number + 1) * count]

    def deviation_rates(self, x: Array, rates: Array) -> Array:
        """Return the rates of deviations from X itself: angular rates in the axes of the deviations."""
        result = rates.copy()
        for place, side in self.attitudes:
            if side == "reference":
                result[place] = np.einsum("nij,jn->in", to_matrix(x[place]), rates[place])
        return result
