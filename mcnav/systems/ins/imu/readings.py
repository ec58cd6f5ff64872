"""Readings of instruments: measured with errors, and compensated for what is estimated of them.

An instrument measures ``(I + M) x + b + l y`` of its input x, with its law's input y: the specific force of a gyro, its
square of an accelerometer. With estimates of M, b and l its compensated reading is ``(I + M)^-1 (measured - b - l y)``,
y being the compensated force, or the square of the force without this last term (Groves 2013, section 5.7.2).

Constants of one instrument have the order of `mcnav.systems.ins.imu.instruments.GYRO` or ``ACCELEROMETER``; those of
many samples have axes before it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES

_CROSS: Final = tuple((AXES.index(reads), AXES.index(along)) for reads, along in CROSS_AXES)

CROSS_PLACES: Final = tuple(reads for reads, _ in _CROSS), tuple(along for _, along in _CROSS)
"""Rows and columns of misalignments in an instrument's matrix."""


def _places() -> list[int]:
    """Return the constant that stands at each place of an instrument's matrix, row by row."""
    places = [[0] * 5 for _ in AXES]
    for axis in range(3):
        places[axis][3], places[axis][axis], places[axis][4] = axis, 3 + axis, 12 + axis
    for number, (reads, along) in enumerate(_CROSS):
        places[reads][along] = 6 + number
    return [constant for row in places for constant in row]


_PLACES: Final = _places()


def response_matrix(constants: Array) -> Array:
    """Arrange an instrument's constants, shape (..., 15): M, bias and the law's coefficients, shape (..., 3, 5)."""
    return np.take(constants, _PLACES, axis=-1).reshape(*constants.shape[:-1], 3, 5)


def reading_errors(inputs: Array, law: Array, response: Array) -> Array:
    """Compute ``M x + b + l y``, shape (..., k, 3).

    Parameters
    ----------
    inputs, law : ndarray, shape (..., k, 3)
        x and y.
    response : ndarray, shape (..., 3, 5)
    """
    turned = inputs @ np.swapaxes(response[..., :3], -1, -2)
    return np.asarray(turned + response[..., None, :, 3] + response[..., None, :, 4] * law)


def compensate(
    rate: Array, force: Array, gyro: Array, accelerometer: Array, drift: Array | float = 0.0, push: Array | float = 0.0
) -> tuple[Array, Array]:
    """Compensate measured rates and specific forces, shape (..., k, 3), for estimated errors.

    Parameters
    ----------
    gyro, accelerometer : ndarray, shape (..., 3, 5)
    drift, push : ndarray or float
        Estimates of gyros' and accelerometers' biases besides the constant ones.
    """
    unbiased = force - accelerometer[..., None, :, 3] - push
    felt = _undone(unbiased, accelerometer)
    if np.any(accelerometer[..., 4]):
        felt = _undone(unbiased - accelerometer[..., None, :, 4] * felt**2, accelerometer)
    turning = rate - gyro[..., None, :, 3] - drift - gyro[..., None, :, 4] * felt
    return _undone(turning, gyro), felt


def _undone(values: Array, response: Array) -> Array:
    """Compute ``(I + M)^-1`` times values."""
    if not np.any(response[..., :3]):
        return values
    return np.asarray(values @ np.swapaxes(np.linalg.inv(np.eye(3) + response[..., :3]), -1, -2))
