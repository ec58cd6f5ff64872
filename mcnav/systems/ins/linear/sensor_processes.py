"""Processes of aiding sensors as parts of a timeline: white noise, correlated errors, flexure of the structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.flexure import Flexure, flexure_process
from mcnav.systems.ins.sensors.measurements import Measurements, flexure_rows, white_sigmas


@dataclass(frozen=True)
class SensorProcess:
    """A process of a sensor over K steps and U updates, with b biases of its own; none, b = 0, of white noise.

    Attributes
    ----------
    decay, noise : ndarray, shapes (K, b), (K, b, b)
        What is left of the biases after a step, and the covariance that it adds.
    started : ndarray, shape (K + 1, b, b)
        Their covariance where navigation starts at a time.
    seen : ndarray, shape (U, M, b)
        Responses of the innovations to the biases.
    measured : ndarray, shape (U, M)
        Variance of white noise.
    """

    decay: Array
    noise: Array
    started: Array
    seen: Array
    measured: Array


def sensor_processes(sensors: tuple[Sensor, ...], measured: Measurements, times: Array) -> dict[str, SensorProcess]:
    """Return the processes of sensors by name, over the steps between times, shape (K + 1,)."""
    within = np.arange(measured.components.shape[1]) < measured.sizes[:, None]
    variances = np.where(within, white_sigmas(sensors, measured) ** 2, 0.0)
    processes: dict[str, SensorProcess] = {}
    number = 0
    for place, sensor in enumerate(sensors):
        of_components: dict[str, SensorProcess] = {}
        for component in sensor.components:
            at = within & (measured.components == number)
            of_components[component.error_name("noise")] = _white(variances * at, len(times) - 1)
            if component.correlated > 0.0:
                of_components[component.error_name("correlated")] = _correlated(component, at, times)
            number += 1
        if sensor.flexure is not None:
            for axis in sensor.flexure.axes:
                name = flexure_process(sensor.name, axis)
                of_components[name] = _flexing(sensor.flexure, axis, place, measured, times)
        processes |= {name: of_components[name] for name in sensor.processes()}
    return processes


def _white(variances: Array, steps: int) -> SensorProcess:
    nothing = np.zeros((*variances.shape, 0))
    return SensorProcess(np.zeros((steps, 0)), np.zeros((steps, 0, 0)), np.zeros((steps + 1, 0, 0)), nothing, variances)


def _correlated(component: Component, at: Array, times: Array) -> SensorProcess:
    """Return a component's correlated errors, a Gauss-Markov process."""
    shares, variance = np.diff(times)[:, None] / component.correlation_time, component.correlated**2
    added = -variance * np.expm1(-2.0 * shares)
    return SensorProcess(
        np.exp(-shares),
        added[:, :, None],
        np.full((len(times), 1, 1), variance),
        -1.0 * at[:, :, None],
        np.zeros(at.shape),
    )


def _flexing(flexure: Flexure, axis: int, number: int, measured: Measurements, times: Array) -> SensorProcess:
    """Return a flexure about an axis, whose two biases are its states s (`mcnav.systems.ins.sensors.flexure`)."""
    since, variance = times - times[0], flexure.sigma[axis] ** 2
    return SensorProcess(
        np.repeat(flexure.decay(np.diff(since))[:, None], 2, axis=1), variance * flexure.noise(since),
        variance * flexure.covariance(since),
        flexure_rows(measured, number, flexure, axis, float(times[0])), np.zeros(measured.components.shape),
    )  # fmt: skip
