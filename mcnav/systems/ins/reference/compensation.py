"""Readings at the Gauss points: measured with a sample's errors, and compensated for the filter's estimates of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, GYRO
from mcnav.systems.ins.imu.readings import compensate, reading_errors, response_matrix
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel


def measure(values: Array, gyro: Array, accelerometer: Array, gyro_noise: Array, accelerometer_noise: Array) -> Array:
    """Apply the errors of instruments to inertial rates and specific forces.

    Parameters
    ----------
    values : ndarray, shape (S, 3, 6)
        At the Gauss points of steps.
    gyro, accelerometer : ndarray, shape (15,)
        Constant errors.
    gyro_noise, accelerometer_noise : ndarray, shape (S, 3)
    """
    rate, force = values[..., :3], values[..., 3:]
    result = values.copy()
    for place, noise, own, constants, law in (
        (slice(0, 3), gyro_noise, rate, response_matrix(gyro), force),
        (slice(3, 6), accelerometer_noise, force, response_matrix(accelerometer), force * force),
    ):
        result[..., place] += reading_errors(own, law, constants) + noise[:, None]
    return result


@dataclass(frozen=True)
class Compensation:
    """Compensation of readings for what a filter estimates.

    Attributes
    ----------
    errors : ErrorModel
    """

    errors: ErrorModel

    def compensate(self, measured: Array, estimates: Array, elapsed: Array) -> Array:
        """Compensate readings, shape (S, 3, 6).

        Parameters
        ----------
        estimates : ndarray, shape (q,)
            Of the filter's states besides those of navigation.
        elapsed : ndarray, shape (S, 3)
            Time since these estimates, s, in which those of Gauss-Markov errors decay.
        """
        if not np.any(estimates):
            return measured
        constants = {True: np.zeros(len(GYRO)), False: np.zeros(len(ACCELEROMETER))}
        varying = {True: np.zeros((*elapsed.shape, 3)), False: np.zeros((*elapsed.shape, 3))}
        for instrument in self.errors.instruments:
            rate = self.errors.decay_rates[instrument.place]
            if rate > 0.0:
                varying[instrument.gyro][..., instrument.axis] += estimates[instrument.place] * np.exp(-rate * elapsed)
            else:
                constants[instrument.gyro][instrument.constant] += estimates[instrument.place]
        gyro, accelerometer = response_matrix(constants[True]), response_matrix(constants[False])
        return np.concatenate(
            compensate(measured[..., :3], measured[..., 3:], gyro, accelerometer, varying[True], varying[False]),
            axis=-1,
        )
