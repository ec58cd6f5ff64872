"""A sensor of each quantity, and filters that estimate any error, for tests of the reference engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.filter.model import Beliefs, FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.registry import QUANTITIES

DEG_PER_HOUR = np.radians(1.0) / 3600.0
MICRO_G = 9.80665e-6

INITIAL = np.repeat([10.0, 0.1, 1e-4, 3e-4], [3, 3, 2, 1])
"""Sigmas of the initial errors: m, m/s, rad."""


def components(
    quantity: str,
    noise: float,
    label: str,
    correlated: float = 0.0,
    correlation_time: float = 100.0,
    axes: Sequence[int] | None = None,
) -> tuple[Component, ...]:
    """Return the components of a quantity, or some of them."""
    found = range(len(QUANTITIES[quantity].axes)) if axes is None else axes
    return tuple(Component(quantity, axis, noise, correlated, correlation_time, label) for axis in found)


def gnss(times: Array, **options: Any) -> Sensor:
    """Return a receiver of position and velocity."""
    measured = components("position", 3.0, "gnss_position") + components("velocity", 0.1, "gnss_velocity")
    return Sensor("gnss", "gnss", times, measured, **options)


def every_sensor(duration: float) -> tuple[Sensor, ...]:
    """Return a sensor of each quantity, some with correlated errors."""

    def times(interval: float) -> Array:
        return interval * np.arange(1.0, duration / interval + 1e-9)

    receiver = components("position", 3.0, "gnss_position", 2.0, 60.0) + components("velocity", 0.1, "gnss_velocity")
    odometer = components("body_velocity", 0.1, "odometer", 0.02, 30.0)
    return (
        Sensor("gnss", "gnss", times(1.0), receiver, np.array([1.0, 0.3, -0.5]), has_lever_arm=True),
        Sensor("altimeter", "altimeter", times(2.0), components("altitude", 5.0, "altimeter", 3.0, 50.0)),
        Sensor("star", "star-tracker", times(10.0), components("attitude", 1e-4, "star", 2e-5, 300.0)),
        Sensor("odometer", "velocity", times(1.0), odometer),
        Sensor("compass", "heading", times(5.0), components("heading", 1e-2, "compass", 1e-3, 200.0)),
        Sensor("fix", "position-fix", times(20.0), components("position", 10.0, "fix", axes=(0, 1))),
    )


UNIT = Imu(
    Noise(
        np.full(3, 0.002 * DEG_PER_HOUR * 60.0),
        np.full(3, 0.003 * DEG_PER_HOUR),
        np.full(3, 600.0),
        np.full(3, 0.003 * DEG_PER_HOUR / 60.0),
    ),
    Noise(np.full(3, 0.012 / 60.0), np.full(3, 20.0 * MICRO_G), np.full(3, 300.0), np.full(3, MICRO_G)),
)
"""Processes of a unit of navigation grade."""

SIZES = {
    "gyro_bias": 0.01 * DEG_PER_HOUR,
    "gyro_scale_factor": 2e-5,
    "gyro_misalignment": 2e-5,
    "gyro_g_sensitivity": 0.01 * DEG_PER_HOUR / 9.8,
    "accelerometer_bias": 50.0 * MICRO_G,
    "accelerometer_scale_factor": 1e-4,
    "accelerometer_misalignment": 1e-4,
    "accelerometer_nonlinearity": 10.0 * MICRO_G / 9.8**2,
    "gnss_position_bias": 1.0,
    "gnss_velocity_bias": 0.02,
    "gnss_lever_arm": 0.02,
    "altimeter_bias": 3.0,
    "altimeter_scale_factor": 1e-3,
    "star_bias": 2e-5,
    "odometer_bias": 0.02,
    "odometer_scale_factor": 1e-3,
    "compass_bias": 1e-3,
    "fix_bias": 1.0,
}
"""Sigmas of the kinds of constant errors besides the initial ones."""


def sigmas(sensors: tuple[Sensor, ...], kinds: Sequence[str]) -> dict[str, float]:
    """Return the sigmas of the constant errors of some kinds, by source."""
    names = (*CONSTANTS, *aiding_constants(sensors))
    return {name: SIZES[kind] for kind in kinds for name in names if name.rpartition("_")[0] == kind or name == kind}


def matched(
    sensors: tuple[Sensor, ...],
    estimates: Sequence[str] = (),
    considers: Sequence[str] = (),
    imu: Imu | None = None,
    initial: Array = INITIAL,
    others: Mapping[str, float] | None = None,
) -> FilterModel:
    """Return a filter that believes in the sigmas of what it estimates and considers."""
    believed = sigmas(sensors, (*estimates, *considers)) | dict(others or {})
    beliefs = Beliefs(believed, np.diag(initial**2), Imu() if imu is None else imu, sensors)
    return FilterModel(tuple(estimates), tuple(considers), beliefs)


def drawn(model: FilterModel, generator: np.random.Generator) -> Array:
    """Draw the constant errors of a sample as a filter believes them."""
    names = (*CONSTANTS, *aiding_constants(model.beliefs.sensors))
    found = np.array([generator.standard_normal() * model.beliefs.sigmas.get(name, 0.0) for name in names])
    found[:9] = np.sqrt(np.diag(model.beliefs.covariance)) * generator.standard_normal(9)
    return found
