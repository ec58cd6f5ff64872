"""Order of the errors of navigation in earth-fixed axes, and matrices of cross products."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array

ATTITUDE, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
"""Places of psi, dv and dr among a filter's states."""


def cross_matrix(vector: Array) -> Array:
    """Return the matrices of the cross products with vectors, shape (..., 3): shape (..., 3, 3)."""
    matrix = np.zeros((*vector.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = vector[..., 2], -vector[..., 1], vector[..., 0]
    return matrix
