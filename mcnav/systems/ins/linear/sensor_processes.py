"""Processes of aiding sensors as parts of a timeline: white noise, correlated errors, jitter, flexure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.flexure import Flexure, flexure_process
from mcnav.systems.ins.sensors.measurements import Measurements, flexure_rows, jitter_rows, white_sigmas


@dataclass(frozen=True)
class SensorProcess:
    """A process of a sensor over K steps and U updates, with b biases of its own, of size one.

    Attributes
    ----------
    decay, noise : ndarray, shapes (K, b), (K, b, b)
        What is left of the biases after a step, and the covariance that it adds.
    started : ndarray, shape (K + 1, b, b)
        Their covariance where navigation starts at a time.
    seen : ndarray, shape (U, M, b)
        Responses of the innovations to the biases.
    """

    decay: Array
    noise: Array
    started: Array
    seen: Array


def sensor_processes(sensors: tuple[Sensor, ...], measured: Measurements, times: Array) -> dict[str, SensorProcess]:
    """Return the processes of sensors that have biases by name, over the steps between times, shape (K + 1,)."""
    processes: dict[str, SensorProcess] = {}
    for component, at in _components(sensors, measured):
        if component.correlated > 0.0:
            processes[component.error_name("correlated")] = _correlated(component, at, times)
    for number, sensor in enumerate(sensors):
        if sensor.flexure is not None:
            for axis in sensor.flexure.axes:
                name = flexure_process(sensor.name, axis)
                processes[name] = _flexing(sensor.flexure, axis, number, measured, times)
        if sensor.jitter > 0.0:
            processes[sensor.jitter_name] = _jittering(jitter_rows(measured, number), len(times))
    return {name: processes[name] for sensor in sensors for name in sensor.processes() if name in processes}


def white_variances(sensors: tuple[Sensor, ...], measured: Measurements) -> dict[str, Array]:
    """Return the variances of the sensors' white noise by process, each of shape (U, M)."""
    variances = white_sigmas(sensors, measured) ** 2
    by_name = {component.error_name("noise"): variances * at for component, at in _components(sensors, measured)}
    return {name: table for name, table in by_name.items() if table.any()}


def _components(sensors: tuple[Sensor, ...], measured: Measurements) -> Iterator[tuple[Component, NDArray[np.bool_]]]:
    """Yield the components of all sensors, and where they are measured, shape (U, M)."""
    within = np.arange(measured.components.shape[1]) < measured.sizes[:, None]
    for number, component in enumerate(component for sensor in sensors for component in sensor.components):
        yield component, within & (measured.components == number)


def _correlated(component: Component, at: NDArray[np.bool_], times: Array) -> SensorProcess:
    """Return a component's correlated errors, a Gauss-Markov process."""
    shares = np.diff(times)[:, None] / component.correlation_time
    added = np.asarray(-np.expm1(-2.0 * shares)[:, :, None])
    seen = np.asarray(-1.0 * at[:, :, None])
    return SensorProcess(np.asarray(np.exp(-shares)), added, np.ones((len(times), 1, 1)), seen)


def _jittering(responses: Array, times: int) -> SensorProcess:
    """Return jitter, a delay of which nothing is left after a step."""
    steps = times - 1
    return SensorProcess(np.zeros((steps, 1)), np.ones((steps, 1, 1)), np.ones((times, 1, 1)), responses[:, :, None])


def _flexing(flexure: Flexure, axis: int, number: int, measured: Measurements, times: Array) -> SensorProcess:
    """Return a flexure about an axis, whose two biases are its states s (`mcnav.systems.ins.sensors.flexure`)."""
    since = times - times[0]
    return SensorProcess(
        np.repeat(flexure.decay(np.diff(since))[:, None], 2, axis=1), flexure.noise(since), flexure.covariance(since),
        flexure_rows(measured, number, flexure, axis, float(times[0])),
    )  # fmt: skip
