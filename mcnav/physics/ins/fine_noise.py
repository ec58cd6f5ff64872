"""Noise of an inertial measurement unit at the steps of the reference engine: one sample by generators of its own.

Each process has the counter-based generator keyed by seed and sample, at a place of its own on the counter. A sample
therefore has the same noise in any worker, and a process that is left out changes no other.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.physics.ins.instruments import Imu, Noise
from mcnav.physics.jit import compiled

SERIES_BELOW: Final = 0.1
"""Duration, in correlation times, below which the variance of a mean is a series: 1e-12 of it is lost at most."""

_ORDERS: Final = np.arange(3, 13)
_FACTORIALS: Final = np.cumprod(np.arange(1.0, _ORDERS[-1] + 1.0))[_ORDERS - 1]
_SERIES: Final = (-1.0) ** _ORDERS * (4.0 - 2.0**_ORDERS) / _FACTORIALS
"""Coefficients of 2 x - 3 + 4 exp(-x) - exp(-2 x) from x^3 on."""


def draw_noise(imu: Imu, step_times: Array, seed: int, index: int) -> tuple[Array, Array]:
    """Draw what the processes of one sample add to the readings, as means over steps.

    Parameters
    ----------
    step_times : ndarray, shape (S + 1,)
        Boundaries of the steps, s.
    seed, index : int
        Of the campaign and of the sample, below 2^64.

    Returns
    -------
    tuple of ndarray, shape (S, 3)
        Of the gyros, rad/s, and of the accelerometers, m/s^2.
    """
    durations = np.diff(step_times)
    return _drawn(imu.gyro, durations, (seed, index), 0), _drawn(imu.accelerometer, durations, (seed, index), 1)


def _drawn(noise: Noise, durations: Array, key: tuple[int, int], instrument: int) -> Array:
    """Add up the processes of three instruments, shape (S, 3)."""
    total = np.zeros((len(durations), 3))
    for axis in range(3):
        if noise.random_walk[axis] > 0.0:
            white = _generator(key, instrument, 0, axis).standard_normal(len(durations))
            total[:, axis] += noise.random_walk[axis] * white / np.sqrt(durations)
        if noise.instability[axis] > 0.0:
            generator = _generator(key, instrument, 1, axis)
            first, variates = generator.standard_normal(), generator.standard_normal((len(durations), 2))
            unit = _means(*_gauss_markov(durations / noise.correlation_time[axis]), first, variates)
            total[:, axis] += noise.instability[axis] * unit
        if noise.rate_random_walk[axis] > 0.0:
            variates = _generator(key, instrument, 2, axis).standard_normal((len(durations), 2))
            unit = _means(*_random_walk(durations), 0.0, variates)
            total[:, axis] += noise.rate_random_walk[axis] * unit
    return total


def _generator(key: tuple[int, int], instrument: int, process: int, axis: int) -> np.random.Generator:
    """Make the generator of one process, whose number is the counter's highest word."""
    stream = 9 * instrument + 3 * process + axis
    words = np.array([0, 0, 0, stream], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(counter=words, key=np.array(key, dtype=np.uint64)))


def _gauss_markov(x: Array) -> tuple[Array, Array, Array]:
    """Discretize a stationary Gauss-Markov process of unit sigma over steps, in correlation times.

    Returns
    -------
    decay : ndarray, shape (S,)
        What is left of a state at the end of a step.
    share : ndarray, shape (S,)
        Its mean over the step.
    factor : ndarray, shape (S, 3)
        Cholesky factor of the noise of the end and of the mean: (1, 1), (2, 1) and (2, 2).
    """
    lost = -np.expm1(-x)
    safe = np.where(x > 0.0, x, 1.0)
    small = x < SERIES_BELOW
    summed = np.polynomial.polynomial.polyval(np.where(small, x, 0.0), _SERIES) * x
    mean = np.where(small, summed, (2.0 * x - 3.0 + 4.0 * np.exp(-x) - np.exp(-2.0 * x)) / safe**2)
    share = np.where(x > 0.0, lost / safe, 1.0)
    return 1.0 - lost, share, _factor(lost * (2.0 - lost), lost * share, mean)


def _random_walk(durations: Array) -> tuple[Array, Array, Array]:
    """Discretize a random walk of unit density over steps, s; results as those of `_gauss_markov`."""
    one = np.ones_like(durations)
    return one, one, _factor(durations, durations / 2.0, durations / 3.0)


def _factor(end: Array, both: Array, mean: Array) -> Array:
    """Compute the Cholesky factors of [[end, both], [both, mean]]."""
    first = np.sqrt(end)
    second = np.where(end > 0.0, both / np.where(end > 0.0, first, 1.0), 0.0)
    return np.stack([first, second, np.sqrt(np.maximum(mean - second**2, 0.0))], axis=-1)


@compiled
def _means(decay: Array, share: Array, factor: Array, first: float, variates: Array) -> Array:
    """Compute the means over steps of a process that starts at a value."""
    means, now = np.empty(len(decay)), first
    for step in range(len(decay)):
        one, two = variates[step, 0], variates[step, 1]
        means[step] = share[step] * now + factor[step, 1] * one + factor[step, 2] * two
        now = decay[step] * now + factor[step, 0] * one
    return means
