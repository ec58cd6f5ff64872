"""Processes of aiding sensors as parts of a timeline: white noise, correlated errors, jitter, flexure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.flexure import Flexure, flexure_process
from mcnav.systems.ins.sensors.measurements import Measurements, Schedule, flexure_rows, jitter_rows, white_sigmas


@dataclass(frozen=True)
class SensorProcess:
    """A process of a sensor with b biases of its own, of size one, whose tables are computed where they are asked for.

    Attributes
    ----------
    biases : int
    over : callable
        From the times of steps since the start, shape (k + 1,), to what is left of the biases after each and the
        covariance that it adds, shapes (k, b), (k, b, b).
    started : callable
        From a time since the start to their covariance where navigation starts then, shape (b, b).
    seen : callable
        From measurements to the responses of the innovations to the biases, shape (u, M, b).
    """

    biases: int
    over: Callable[[Array], tuple[Array, Array]]
    started: Callable[[float], Array]
    seen: Callable[[Measurements], Array]


def sensor_processes(sensors: tuple[Sensor, ...], start: float) -> dict[str, SensorProcess]:
    """Return the processes of sensors that have biases by name, of a navigation from a start, s."""
    processes: dict[str, SensorProcess] = {}
    for number, component in enumerate(component for sensor in sensors for component in sensor.components):
        if component.correlated > 0.0:
            seen = partial(_seen_correlated, number)
            over = partial(_correlated, component.correlation_time)
            processes[component.error_name("correlated")] = SensorProcess(1, over, _one, seen)
    for number, sensor in enumerate(sensors):
        if sensor.flexure is not None:
            for axis in sensor.flexure.axes:
                processes[flexure_process(sensor.name, axis)] = SensorProcess(
                    2, partial(_flexing, sensor.flexure), partial(_flexed, sensor.flexure),
                    partial(flexure_rows, number=number, flexure=sensor.flexure, axis=axis, start=start),
                )  # fmt: skip
        if sensor.jitter > 0.0:
            processes[sensor.jitter_name] = SensorProcess(1, _jittering, _one, partial(_seen_jitter, number))
    return {name: processes[name] for sensor in sensors for name in sensor.processes() if name in processes}


def white_processes(sensors: tuple[Sensor, ...], schedule: Schedule) -> dict[str, int]:
    """Return the numbers of the components of which white noise is in any update, by process."""
    measuring = {number for number, sensor in enumerate(sensors) if (schedule.order == number).any()}
    owners = [(number, component) for number, sensor in enumerate(sensors) for component in sensor.components]
    return {
        component.error_name("noise"): place
        for place, (number, component) in enumerate(owners)
        if number in measuring and np.any(component.white_sigmas(1))
    }


def white_variances(sensors: tuple[Sensor, ...], number: int, measured: Measurements) -> Array:
    """Return the variances of the white noise of a component by its number, shape (u, M)."""
    within = np.arange(measured.components.shape[1]) < measured.sizes[:, None]
    return np.asarray(white_sigmas(sensors, measured) ** 2 * (within & (measured.components == number)))


def _one(_: float) -> Array:
    return np.ones((1, 1))


def _correlated(correlation_time: float, times: Array) -> tuple[Array, Array]:
    """Return what steps do to a component's correlated errors, a Gauss-Markov process."""
    shares = np.diff(times)[:, None] / correlation_time
    return np.asarray(np.exp(-shares)), np.asarray(-np.expm1(-2.0 * shares)[:, :, None])


def _seen_correlated(number: int, measured: Measurements) -> Array:
    within = np.arange(measured.components.shape[1]) < measured.sizes[:, None]
    return np.asarray(-1.0 * (within & (measured.components == number))[:, :, None])


def _jittering(times: Array) -> tuple[Array, Array]:
    """Return what steps do to jitter, a delay of which nothing is left."""
    return np.zeros((len(times) - 1, 1)), np.ones((len(times) - 1, 1, 1))


def _seen_jitter(number: int, measured: Measurements) -> Array:
    return np.asarray(jitter_rows(measured, number)[:, :, None])


def _flexing(flexure: Flexure, times: Array) -> tuple[Array, Array]:
    """Return what steps do to the two states s of a flexure (`mcnav.systems.ins.sensors.flexure`)."""
    return np.repeat(flexure.decay(np.diff(times))[:, None], 2, axis=1), flexure.noise(times)


def _flexed(flexure: Flexure, time: float) -> Array:
    return np.asarray(flexure.covariance(np.array([time]))[0])
