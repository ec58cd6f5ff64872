"""Noise of one sample of the reference engine with aiding: instruments, measurements, and the processes' own values.

Each process has the counter-based generator keyed by seed and sample, at a place of its own on the counter, apart from
those of `mcnav.systems.ins.imu.fine_noise`. A process that is left out changes no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.imu.fine_noise import boundary_values, draw_noise, gravity_values, gyro_drifts, process_values
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.flexure import FlexureState
from mcnav.systems.ins.sensors.measurements import swings
from mcnav.systems.ins.sensors.quantity import MOST_AXES
from mcnav.systems.ins.sensors.registry import KINDS
from mcnav.systems.ins.truth.gravity import GravityPath

FIRST_STREAM: Final = 18
"""Number of the counter's highest word; lower ones are those of the instruments' processes."""

FLEXURE_STREAM: Final = (1 << 21) + 1
"""Number of the counter's highest word of flexures."""

JITTER_STREAM: Final = FLEXURE_STREAM + 1
"""Number of the counter's highest word of jitter."""

DIGITS: Final = 9
"""Decimals of a second to which times are the same."""

KINDS_OF_STREAM: Final = 6
"""Quantities with one highest word: a quantity that is added changes no sample of the others."""


@dataclass(frozen=True)
class SampleNoise:
    """Noise of one sample.

    Attributes
    ----------
    gyro, accelerometer : ndarray, shape (S, 3)
        Means over the steps of what the processes add to the readings, rad/s and m/s^2.
    measurements : mapping of str to ndarray, shape (u, c)
        What processes add to the measurements of each sensor: white noise and correlated errors. Sensors that are
        missing have none.
    processes : mapping of str to ndarray, shape (m,)
        Values at the epochs of the processes that a filter may estimate: bias instability and rate random walk of the
        instruments, gravity disturbances, correlated errors of the sensors, angles and rates of their flexures. Those
        that are missing are zero.
    flexures : mapping of str to ndarray, shape (u, 6)
        Angles of the flexure of each sensor about the body's axes, and their rates, at its measurements.
    drifts : ndarray, shape (S, 3), optional
        Bias instability and rate random walk of the gyros at the ends of the steps, rad/s, for sensors that measure an
        antenna's velocity on a lever arm; none for zero.
    jitters : mapping of str to ndarray, shape (u,)
        Delays that each measurement of a sensor has of its own, s.
    """

    gyro: Array
    accelerometer: Array
    measurements: Mapping[str, Array] = field(default_factory=dict)
    processes: Mapping[str, Array] = field(default_factory=dict)
    drifts: Array | None = None
    flexures: Mapping[str, Array] = field(default_factory=dict)
    jitters: Mapping[str, Array] = field(default_factory=dict)


def draw_sample_noise(
    imu: Imu, sensors: Sequence[Sensor], step_times: Array, epochs: IndexArray, seed: int, index: int,
    path: GravityPath | None = None,
) -> SampleNoise:  # fmt: skip
    """Draw the noise of one sample.

    Parameters
    ----------
    step_times : ndarray, shape (S + 1,)
        Boundaries of the steps, s.
    epochs : ndarray of int, shape (m,)
        Boundaries that are epochs.
    seed, index : int
        Of the campaign and of the sample, below 2^64.
    path : GravityPath, optional
        How gravity disturbances act in the steps; without it there are none.
    """
    gyro, accelerometer = draw_noise(imu, step_times, seed, index, path)
    measurements, correlated = draw_measurement_errors(sensors, step_times[epochs], seed, index)
    processes = process_values(imu, step_times, epochs, seed, index)
    if path is not None:
        processes |= gravity_values(path, imu.gravity, epochs, seed, index)
    drifts = gyro_drifts(imu, step_times, seed, index) if any(swings(sensor) for sensor in sensors) else None
    flexures, bent = draw_flexures(sensors, step_times, epochs, seed, index)
    jitters, jittered = draw_jitters(sensors, step_times[epochs], seed, index)
    states = processes | correlated | bent | jittered
    return SampleNoise(gyro, accelerometer, measurements, states, drifts, flexures, jitters)


def draw_jitters(
    sensors: Sequence[Sensor], epochs: Array, seed: int, index: int
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Draw the jitter of one sample: independent delays at all times.

    Returns
    -------
    tuple of dict
        Delays of the measurements of each sensor that has jitter, shape (u,), by its name; values at the epochs, shape
        (m,), by the names of the processes.
    """
    jitters, values = {}, {}
    for number, sensor in enumerate(sensors):
        if sensor.jitter > 0.0:
            instants = np.round(np.concatenate([sensor.times, epochs]), DIGITS)  # one jitter at one time
            _, places = np.unique(instants, return_inverse=True)
            words = np.array([0, 0, number, JITTER_STREAM], dtype=np.uint64)
            philox = np.random.Philox(counter=words, key=np.array((seed, index), dtype=np.uint64))
            drawn = sensor.jitter * np.random.Generator(philox).standard_normal(int(places.max(initial=-1)) + 1)
            jitters[sensor.name], values[sensor.jitter_name] = np.split(drawn[places], [len(sensor.times)])
    return jitters, values


def draw_flexures(
    sensors: Sequence[Sensor], step_times: Array, epochs: IndexArray, seed: int, index: int
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Draw the flexures of one sample, stationary from the first boundary of steps.

    Returns
    -------
    tuple of dict
        Angles and rates at the measurements of each sensor that flexes, shape (u, 6), by its name; values at the
        epochs, shape (m,), by the names of a filter's states.
    """
    flexures, values = {}, {}
    for number, sensor in enumerate(sensors):
        if sensor.flexure is None:
            continue
        instants = np.concatenate([step_times[:1], sensor.times, step_times[epochs]])
        times, places = np.unique(instants, return_inverse=True)
        words = np.array([0, 0, number, FLEXURE_STREAM], dtype=np.uint64)
        philox = np.random.Philox(counter=words, key=np.array((seed, index), dtype=np.uint64))
        drawn = sensor.flexure.draw(times, np.random.Generator(philox).standard_normal((len(times), 3, 2)))
        measured, read = np.split(drawn[places[1:]], [len(sensor.times)])
        flexures[sensor.name] = measured.swapaxes(1, 2).reshape(len(measured), 6)
        for axis in sensor.flexure.axes:
            for rate in (False, True):
                values[FlexureState(sensor.name, sensor.flexure, axis, rate).name] = read[:, axis, int(rate)]
    return flexures, values


def draw_measurement_errors(
    sensors: Sequence[Sensor], epochs: Array, seed: int, index: int
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Draw what processes add to the measurements of one sample.

    Gauss-Markov errors are stationary from the first instant and exact between instants.

    Parameters
    ----------
    epochs : ndarray, shape (m,)
        s.

    Returns
    -------
    tuple of dict
        Errors of the measurements of each sensor, shape (u, c), by its name; values of the correlated errors at the
        epochs, shape (m,), by the names of the processes.
    """
    measurements, correlated = {}, {}
    for number, sensor in enumerate(sensors):
        errors = np.zeros((len(sensor.times), len(sensor.components)))
        for column, component in enumerate(sensor.components):
            stream, kind = divmod(KINDS[component.quantity], KINDS_OF_STREAM)
            place = (KINDS_OF_STREAM * number + kind) * MOST_AXES + component.axis
            if component.noise > 0.0:
                variates = _generator(seed, index, stream, 2 * place).standard_normal(len(errors))
                errors[:, column] += component.white_sigmas(len(errors)) * variates
            if component.correlated > 0.0:
                generator = _generator(seed, index, stream, 2 * place + 1)
                at_times, at_epochs = _gauss_markov(component, sensor.times, epochs, generator)
                errors[:, column] += at_times
                correlated[component.error_name("correlated")] = at_epochs
        measurements[sensor.name] = errors
    return measurements, correlated


def _generator(seed: int, index: int, stream: int, process: int) -> np.random.Generator:
    """Make the generator of one process."""
    words = np.array([0, 0, process, FIRST_STREAM + stream], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(counter=words, key=np.array((seed, index), dtype=np.uint64)))


def _gauss_markov(
    component: Component, times: Array, epochs: Array, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Draw a stationary Gauss-Markov error at two sets of instants."""
    instants, places = np.unique(np.concatenate([times, epochs]), return_inverse=True)
    variates = generator.standard_normal(len(instants))
    x = np.diff(instants) / component.correlation_time
    decay, driven = np.exp(-x), np.sqrt(-np.expm1(-2.0 * x))
    values = boundary_values(decay, driven, variates[0], variates[1:])
    gauss_markov = component.correlated * values[places]
    return gauss_markov[: len(times)], gauss_markov[len(times) :]
