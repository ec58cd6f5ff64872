"""Rotations, and attitude, velocity and position as one: the group SE_2(3) of extended poses.

An element has a rotation C and vectors v, r (Barrau and Bonnabel 2017, *The invariant extended Kalman filter as a
stable observer*, section IV); its exponential, of a rotation vector a and vectors b, c, is::

    exp(a, b, c) = (exp(a x), J(a) b, J(a) c)        J(a) = I + (1 - cos |a|)/|a|^2 a x + (|a| - sin |a|)/|a|^3 (a x)^2
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled

SMALL: Final = 1e-4
"""Square of the angle, rad^2, below which trigonometric quotients are series: 2e-16 of them is lost at most."""


@compiled
def exponential(vector: Array, rotation: Array, jacobian: Array) -> None:
    """Compute exp(a x) and the left Jacobian J(a) of a rotation vector, shape (3,) rad, into two (3, 3)."""
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    if square < SMALL:
        first = 1.0 - square / 6.0 * (1.0 - square / 20.0)
        second = 0.5 - square / 24.0 * (1.0 - square / 30.0)
        third = 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0)
    else:
        angle = np.sqrt(square)
        first = np.sin(angle) / angle
        second = (1.0 - np.cos(angle)) / square
        third = (1.0 - first) / square
    for row in range(3):
        for column in range(3):
            outer = vector[row] * vector[column]
            rotation[row, column] = second * outer
            jacobian[row, column] = third * outer
        rotation[row, row] += 1.0 - second * square
        jacobian[row, row] += 1.0 - third * square
    for row, column, value in ((2, 1, x), (0, 2, y), (1, 0, z)):
        rotation[row, column] += first * value
        rotation[column, row] -= first * value
        jacobian[row, column] += second * value
        jacobian[column, row] -= second * value


@compiled
def logarithm(rotation: Array, vector: Array) -> None:
    """Compute the rotation vector, shape (3,) rad, of a rotation by less than pi, shape (3, 3)."""
    x = 0.5 * (rotation[2, 1] - rotation[1, 2])
    y = 0.5 * (rotation[0, 2] - rotation[2, 0])
    z = 0.5 * (rotation[1, 0] - rotation[0, 1])
    sine = np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0)
    factor = np.arctan2(sine, cosine) / sine if sine > 1e-12 else 1.0
    vector[0] = factor * x
    vector[1] = factor * y
    vector[2] = factor * z
