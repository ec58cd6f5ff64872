"""Aided navigations for tests: sensors, filters, and channels whose steady states are known."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.linear import CovarianceReadings
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.filter.model import Beliefs, FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.tunings import Navigated, Tunings

EMPTY_SPACE = Earth(6.4e6, 0.0, 1.0, 0.0)
"""A sphere at rest without gravity to speak of: 2e-14 m/s^2."""


def make_sensor(
    name: str,
    times: Array,
    noise: dict[str, float],
    correlated: float = 0.0,
    correlation_time: float = 100.0,
    lever_arm: tuple[float, float, float] | None = None,
    gate: float | None = None,
) -> Sensor:
    """Make a sensor that measures all axes of some quantities with white noise."""
    components = tuple(
        Component(
            quantity, axis, sigma, correlated, correlation_time, name if len(noise) == 1 else f"{name}_{quantity}"
        )
        for quantity, sigma in noise.items()
        for axis in range(len(QUANTITIES[quantity].axes))
    )
    arm = np.zeros(3) if lever_arm is None else np.array(lever_arm)
    return Sensor(name, name, times, components, arm, lever_arm is not None, gate)


def make_filter(
    sensors: tuple[Sensor, ...],
    imu: Imu,
    sigmas: dict[str, float],
    estimates: tuple[str, ...] = (),
    considers: tuple[str, ...] = (),
) -> FilterModel:
    """Make a filter that believes in given sigmas of constant errors, by the beginnings of their names."""
    every = sized(sensors, sigmas)
    names = (*CONSTANTS, *aiding_constants(sensors))
    beliefs = Beliefs(dict(zip(names, every, strict=True)), np.diag(every[:9] ** 2), imu, sensors)
    return FilterModel(estimates, considers, beliefs)


def propagated_at_once(aided: AidedNavigation, times: Array, sizes: Array) -> CovarianceReadings:
    """Propagate the errors of all causes together to some times, as allocations and sweeps do."""
    grid = aided.grid(1, np.concatenate([[aided.start], times]))
    navigated = Navigated(
        aided.truth, aided.platform, grid, times, aided.imu, aided.sensors, aided.filter, np.zeros(len(sizes)),
        np.diag(sizes**2),
    )  # fmt: skip
    (answer,) = Tunings().answer([navigated], [navigated])
    return answer


def sized(sensors: tuple[Sensor, ...], sigmas: dict[str, float]) -> Array:
    """Return the sigmas of all constant errors, in order, from those by the beginnings of names."""
    names = (*CONSTANTS, *aiding_constants(sensors))
    return np.array([next((size for kind, size in sigmas.items() if name.startswith(kind)), 0.0) for name in names])
