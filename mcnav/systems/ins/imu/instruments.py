"""Errors of an inertial measurement unit: their names in order, and the processes of its noise.

An instrument measures ``true + bias + M true`` with ``M = [[s_x, m_xy, m_xz], [m_yx, s_y, m_yz], [m_zx, m_zy, s_z]]``
of scale factors and misalignments, plus what its own error law and its processes add.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.gravity import DISTURBANCES, GravityDisturbance

AXES: Final = ("x", "y", "z")
CROSS_AXES: Final = ("xy", "xz", "yx", "yz", "zx", "zy")
"""Pairs of axes: the first reads part of an input along the second."""

NEGLECTED: Final = {"quantization": "filters neglect quantization; leave it out"}
"""Errors of instruments that no filter knows, and what is said where one is given to it."""

OUTPUTS: Final = (
    "position_north",
    "position_east",
    "position_down",
    "velocity_north",
    "velocity_east",
    "velocity_down",
    "tilt_north",
    "tilt_east",
    "heading",
)
"""Navigation errors, indicated less true; initial errors have the same names, order and definitions."""


def _constants(instrument: str, law: str) -> Iterator[str]:
    for kind, axes in (("bias", AXES), ("scale_factor", AXES), ("misalignment", CROSS_AXES), (law, AXES)):
        yield from (f"{instrument}_{kind}_{axis}" for axis in axes)


GYRO: Final = tuple(_constants("gyro", "g_sensitivity"))
"""Constant errors of the gyros: rad/s, 1, 1, (rad/s) / (m/s^2)."""

ACCELEROMETER: Final = tuple(_constants("accelerometer", "nonlinearity"))
"""Constant errors of the accelerometers: m/s^2, 1, 1, (m/s^2) / (m/s^2)^2."""

CONSTANTS: Final = (*OUTPUTS, *GYRO, *ACCELEROMETER)
"""Constant error sources in order."""

IMU_STREAM: Final = 1
"""Stream of the variates of the instruments' processes (`mcnav.sampler.normals`)."""

READING_INTERVAL: Final = 0.01
"""Usual interval between readings of an instrument, s."""


def _nothing() -> Array:
    return np.zeros(3)


@dataclass(frozen=True)
class Noise:
    """Processes of three instruments, by axis; zero where there is none. Each array has shape (3,).

    Attributes
    ----------
    random_walk : ndarray
        N of white noise: the sigma of its integral over a time t is N sqrt(t). rad/sqrt(s), or m/s/sqrt(s).
    instability : ndarray
        Sigma of a first-order Gauss-Markov process that is stationary from the first instant. rad/s, or m/s^2.
    correlation_time : ndarray
        Of that process, s; positive.
    rate_random_walk : ndarray
        K of a bias whose sigma is K sqrt(t). rad/s/sqrt(s), or m/s^2/sqrt(s).
    quantization : ndarray
        Q, the sigma of a white error of the accumulated angle or velocity (IEEE Std 952: an Allan deviation of
        sqrt(3) Q / tau); 1/sqrt(12) of a step in which it is counted. rad, or m/s.
    quantization_interval : ndarray
        Interval between readings, each with a new such error, s; positive.
    """

    random_walk: Array = field(default_factory=_nothing)
    instability: Array = field(default_factory=_nothing)
    correlation_time: Array = field(default_factory=lambda: np.full(3, 3600.0))
    rate_random_walk: Array = field(default_factory=_nothing)
    quantization: Array = field(default_factory=_nothing)
    quantization_interval: Array = field(default_factory=lambda: np.full(3, READING_INTERVAL))


@dataclass(frozen=True)
class Imu:
    """The processes of gyros and accelerometers, and of the gravity that accelerometers feel and no model has."""

    gyro: Noise = field(default_factory=Noise)
    accelerometer: Noise = field(default_factory=Noise)
    gravity: GravityDisturbance = field(default_factory=GravityDisturbance)

    @property
    def quantized(self) -> bool:
        """Presence of quantization in an instrument."""
        return bool(self.gyro.quantization.any() or self.accelerometer.quantization.any())

    @property
    def shortest_reading(self) -> float:
        """Shortest interval between readings of the instruments with quantization, s; infinite without."""
        pairs = ((noise.quantization, noise.quantization_interval) for noise in (self.gyro, self.accelerometer))
        return min(float(np.where(size > 0.0, interval, np.inf).min()) for size, interval in pairs)


PROCESSES: Final = tuple(
    f"{instrument}_{kind}_{axis}"
    for instrument, walk in (("gyro", "angle_random_walk"), ("accelerometer", "velocity_random_walk"))
    for kind in (walk, "bias_instability", "rate_random_walk", "quantization")
    for axis in AXES
)
"""Names of all processes of the instruments in order."""


def process_sizes(imu: Imu) -> dict[str, float]:
    """Return the size of each process that is not zero, by name, in the unit of its attribute."""
    sizes = [
        size
        for noise in (imu.gyro, imu.accelerometer)
        for each in (noise.random_walk, noise.instability, noise.rate_random_walk, noise.quantization)
        for size in each
    ]
    present = {name: float(size) for name, size in zip(PROCESSES, sizes, strict=True) if size > 0.0}
    return present | imu.gravity.sizes


def of_unit_sizes(imu: Imu) -> Imu:
    """Return a unit with the same processes, each of size one."""
    sizes = ("random_walk", "instability", "rate_random_walk", "quantization")
    gyro, accelerometer = (
        replace(noise, **{name: (getattr(noise, name) > 0.0).astype(float) for name in sizes})
        for noise in (imu.gyro, imu.accelerometer)
    )
    gravity = imu.gravity
    disturbed = replace(gravity, deflection=float(gravity.deflection > 0.0), anomaly=float(gravity.anomaly > 0.0))
    return Imu(gyro, accelerometer, disturbed)


def process_variances(imu: Imu) -> dict[str, float]:
    """Return the squared size of each process that is not zero, those of gravity by disturbance."""
    sizes = {name: size for name, size in process_sizes(imu).items() if name in PROCESSES}
    sizes |= {name: size for name in DISTURBANCES if (size := imu.gravity.sigma(name)) > 0.0}
    return {name: size**2 for name, size in sizes.items()}
