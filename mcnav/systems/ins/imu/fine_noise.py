"""Noise of an inertial measurement unit at the steps of the reference engine: one sample by generators of its own.

Each process has the counter-based generator keyed by seed and sample, at a place of its own on the counter. A sample
therefore has the same noise in any worker, and a process that is left out changes no other.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.imu.gravity import DISTURBANCES, GravityDisturbance
from mcnav.systems.ins.imu.instruments import AXES, Imu, Noise
from mcnav.systems.ins.truth.gravity import GravityPath

SERIES_BELOW: Final = 0.1
"""Duration, in correlation times, below which the variance of a mean is a series: 1e-12 of it is lost at most."""

SAME_READING: Final = 1e-6
"""Instants that are no further apart are one, in intervals between readings."""

_ORDERS: Final = np.arange(3, 13)
_FACTORIALS: Final = np.cumprod(np.arange(1.0, _ORDERS[-1] + 1.0))[_ORDERS - 1]
_SERIES: Final = (-1.0) ** _ORDERS * (4.0 - 2.0**_ORDERS) / _FACTORIALS
"""Coefficients of 2 x - 3 + 4 exp(-x) - exp(-2 x) from x^3 on."""


def draw_noise(
    imu: Imu, step_times: Array, seed: int, index: int, path: GravityPath | None = None
) -> tuple[Array, Array]:
    """Draw what the processes of one sample add to the readings, as means over steps.

    Parameters
    ----------
    step_times : ndarray, shape (S + 1,)
        Boundaries of the steps, s.
    path : GravityPath, optional
        How gravity disturbances act in the steps; without it there are none.
    seed, index : int
        Of the campaign and of the sample, below 2^64.

    Returns
    -------
    tuple of ndarray, shape (S, 3)
        Of the gyros, rad/s, and of the accelerometers, m/s^2.
    """
    key = (seed, index)
    gyro, accelerometer = _drawn(imu.gyro, step_times, key, 0), _drawn(imu.accelerometer, step_times, key, 1)
    if path is not None:
        accelerometer += draw_gravity(path, imu.gravity, seed, index)
    return gyro, accelerometer


def process_values(imu: Imu, step_times: Array, at: IndexArray, seed: int, index: int) -> dict[str, Array]:
    """Draw the values of the biases that processes drive, in the sample that `draw_noise` draws.

    Parameters
    ----------
    at : ndarray of int, shape (m,)
        Boundaries of steps.

    Returns
    -------
    dict of str to ndarray, shape (m,)
        By the name of the process; those that are zero are missing.
    """
    durations, key, result = np.diff(step_times), (seed, index), {}
    for instrument, (name, noise) in enumerate((("gyro", imu.gyro), ("accelerometer", imu.accelerometer))):
        for axis, letter in enumerate(AXES):
            if noise.instability[axis] > 0.0:
                first, variates = _instability_variates(key, instrument, axis, len(durations))
                decay, _, factor = _gauss_markov(durations / noise.correlation_time[axis])
                values = boundary_values(decay, factor[:, 0].copy(), first, variates[:, 0].copy())[at]
                result[f"{name}_bias_instability_{letter}"] = noise.instability[axis] * values
            if noise.rate_random_walk[axis] > 0.0:
                decay, _, factor = _random_walk(durations)
                variates = _walk_variates(key, instrument, axis, len(durations))
                values = boundary_values(decay, factor[:, 0].copy(), 0.0, variates[:, 0].copy())[at]
                result[f"{name}_rate_random_walk_{letter}"] = noise.rate_random_walk[axis] * values
    return result


def gyro_drifts(imu: Imu, step_times: Array, seed: int, index: int) -> Array:
    """Add up the biases of the gyros that processes drive, at the ends of the steps, shape (S, 3)."""
    drifts, ends = np.zeros((len(step_times) - 1, 3)), np.arange(1, len(step_times))
    for name, values in process_values(Imu(gyro=imu.gyro), step_times, ends, seed, index).items():
        drifts[:, AXES.index(name[-1])] += values
    return drifts


def draw_gravity(path: GravityPath, gravity: GravityDisturbance, seed: int, index: int) -> Array:
    """Draw what the gravity disturbances of one sample take from the specific force, as means over steps.

    Returns
    -------
    ndarray, shape (S, 3)
        What the accelerometers read besides the specific force of the model, m/s^2.
    """
    total = np.zeros((len(path.pulls), 3))
    for place, name in enumerate(DISTURBANCES):
        if (sigma := gravity.sigma(name)) > 0.0:
            first, variates = _gravity_variates((seed, index), place, len(total))
            unit = _means(*_gauss_markov(path.distances / gravity.length(name)), first, variates)
            total += sigma * unit[:, None] * path.pulls[:, :, place]
    return total


def gravity_values(
    path: GravityPath, gravity: GravityDisturbance, at: IndexArray, seed: int, index: int
) -> dict[str, Array]:
    """Draw the values of the gravity disturbances in the sample that `draw_gravity` draws; see `process_values`."""
    result = {}
    for place, name in enumerate(DISTURBANCES):
        if (sigma := gravity.sigma(name)) > 0.0:
            first, variates = _gravity_variates((seed, index), place, len(path.pulls))
            decay, _, factor = _gauss_markov(path.distances / gravity.length(name))
            values = boundary_values(decay, factor[:, 0].copy(), first, variates[:, 0].copy())[at]
            result[name] = sigma * values
    return result


def _drawn(noise: Noise, step_times: Array, key: tuple[int, int], instrument: int) -> Array:
    """Add up the processes of three instruments, shape (S, 3)."""
    durations = np.diff(step_times)
    total = np.zeros((len(durations), 3))
    for axis in range(3):
        if noise.random_walk[axis] > 0.0:
            white = _generator(key, instrument, 0, axis).standard_normal(len(durations))
            total[:, axis] += noise.random_walk[axis] * white / np.sqrt(durations)
        if noise.instability[axis] > 0.0:
            first, variates = _instability_variates(key, instrument, axis, len(durations))
            unit = _means(*_gauss_markov(durations / noise.correlation_time[axis]), first, variates)
            total[:, axis] += noise.instability[axis] * unit
        if noise.rate_random_walk[axis] > 0.0:
            variates = _walk_variates(key, instrument, axis, len(durations))
            unit = _means(*_random_walk(durations), 0.0, variates)
            total[:, axis] += noise.rate_random_walk[axis] * unit
        if noise.quantization[axis] > 0.0:
            generator = _generator(key, instrument, 0, axis, part=1)
            errors = _accumulated_errors(step_times, noise.quantization_interval[axis], generator)
            total[:, axis] += noise.quantization[axis] * np.diff(errors) / durations
    return total


def _accumulated_errors(step_times: Array, interval: float, generator: np.random.Generator) -> Array:
    """Draw errors of unit sigma of what readings add up to, at the boundaries of steps, shape (S + 1,).

    Readings are taken at each interval from the first boundary on; the navigator has what they add up to grow evenly
    from one to the next.
    """
    elapsed = (step_times - step_times[0]) / interval
    errors = generator.standard_normal(int(np.ceil(elapsed[-1] + SAME_READING)) + 1)
    return np.asarray(np.interp(elapsed, np.arange(len(errors)), errors))


def _instability_variates(key: tuple[int, int], instrument: int, axis: int, steps: int) -> tuple[float, Array]:
    """Draw the variates of the first value of a bias instability and of its steps."""
    generator = _generator(key, instrument, 1, axis)
    return generator.standard_normal(), generator.standard_normal((steps, 2))


def _gravity_variates(key: tuple[int, int], place: int, steps: int) -> tuple[float, Array]:
    """Draw the variates of the first value of a gravity disturbance and of its steps."""
    generator = _generator(key, 0, 0, place, part=2)
    return generator.standard_normal(), generator.standard_normal((steps, 2))


def _walk_variates(key: tuple[int, int], instrument: int, axis: int, steps: int) -> Array:
    """Draw the variates of the steps of a rate random walk."""
    return _generator(key, instrument, 2, axis).standard_normal((steps, 2))


def _generator(key: tuple[int, int], instrument: int, process: int, axis: int, part: int = 0) -> np.random.Generator:
    """Make the generator of one process, whose number is the counter's two highest words."""
    stream = 9 * instrument + 3 * process + axis
    words = np.array([0, 0, part, stream], dtype=np.uint64)
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


@compiled
def boundary_values(decay: Array, driven: Array, first: float, variates: Array) -> Array:
    """Compute the values at the boundaries of S steps, shape (S + 1,), of a process that starts at a value."""
    values = np.empty(len(decay) + 1)
    values[0] = first
    for step in range(len(decay)):
        values[step + 1] = decay[step] * values[step] + driven[step] * variates[step]
    return values
