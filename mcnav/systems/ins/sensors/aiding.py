"""Aiding sensors: what they measure, when, and the errors of their measurements.

A sensor measures one or more components of the state at its instants. A measured component is ::

    (1 + scale factor) true + bias + correlated + noise

with a constant bias and scale factor, a stationary first-order Gauss-Markov error, and white noise. What the navigator
predicts for it less what is measured is the innovation. `mcnav.systems.ins.sensors.registry` has the quantities.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import MeasurementFile
from mcnav.systems.faults import Fault, gate_limit
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.flexure import Flexure, flexure_process
from mcnav.systems.ins.sensors.quantity import OFFSETS
from mcnav.systems.ins.sensors.registry import QUANTITIES

MeasurementError = Literal["bias", "scale_factor", "correlated", "noise"]


@dataclass(frozen=True)
class Component:
    """One measured component.

    Attributes
    ----------
    quantity : str
        Of `QUANTITIES`.
    axis : int
        Number among the axes of the quantity.
    noise : float
        Sigma of the white noise of one measurement: m, m/s or rad; positive.
    correlated : float
        Sigma of the Gauss-Markov error, zero for none.
    correlation_time : float
        Of that error, s; positive.
    label : str
        Beginning of its errors' names: the sensor's name, and the quantity where the sensor measures several.
    noise_at : tuple of float, optional
        Sigma of the white noise of each measurement of a recorded sensor, whose root mean square is `noise`; all have
        that one unless given.

    Raises
    ------
    ValueError
        When no file defines the quantity, or it has no such axis.
    """

    quantity: str
    axis: int
    noise: float
    correlated: float
    correlation_time: float
    label: str
    noise_at: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            known = ", ".join(QUANTITIES)
            raise ValueError(f"{self.label} measures {self.quantity}, which no file of sensors/ defines; of {known}")
        if not 0 <= self.axis < len(QUANTITIES[self.quantity].axes):
            raise ValueError(f"{self.label}: {self.quantity} has no axis number {self.axis}")

    @property
    def name(self) -> str:
        """Name of what is measured: the quantity and the axis.

        >>> Component("position", 0, 3.0, 0.0, 100.0, "gnss_position").name
        'position_north'
        """
        axis = QUANTITIES[self.quantity].axes[self.axis]
        return f"{self.quantity}_{axis}" if axis else self.quantity

    def white_sigmas(self, count: int) -> Array:
        """Return the sigma of the white noise of each of so many measurements, shape (count,)."""
        return np.full(count, self.noise) if self.noise_at is None else np.array(self.noise_at)

    def white_variances(self, count: int) -> Array:
        """Return the variance of the white noise of each of so many measurements, shape (count,)."""
        return np.full(count, self.noise**2) if self.noise_at is None else np.array(self.noise_at) ** 2

    def error_name(self, error: MeasurementError) -> str:
        """Return the name of one of its errors.

        >>> Component("position", 0, 3.0, 0.0, 100.0, "gnss_position").error_name("bias")
        'gnss_position_bias_north'
        >>> Component("altitude", 0, 3.0, 0.0, 100.0, "altimeter").error_name("noise")
        'altimeter_noise'
        """
        axis = QUANTITIES[self.quantity].axes[self.axis]
        return f"{self.label}_{error}" + (f"_{axis}" if axis else "")


@dataclass(frozen=True)
class Sensor:
    """An aiding sensor.

    Attributes
    ----------
    name : str
        Of its own in a campaign; by default its type with underscores.
    kind : str
        Type, as campaign files have it: of `SENSOR_TYPES`.
    times : ndarray, shape (u,)
        Instants of its measurements in the trajectory's time, s: rising, after the start of navigation; those in
        outages are left out.
    components : tuple of Component
    lever_arm : ndarray, shape (3,)
        From the unit to the antenna in the body's axes, m.
    has_lever_arm : bool
        Whether it may have errors of the lever arm.
    gate : float or None
        Probability with which a measurement without blunders is accepted; none for no gate.
    outages : tuple of (float, float)
        Begin, included, and end, excluded, s.
    log : MeasurementFile, optional
        Of a recorded sensor.
    faults : tuple of Fault
        What its measurements have that no filter believes in.
    flexure : Flexure, optional
        Of the structure between the unit and the sensor.
    offsets : tuple of str
        Errors of `mcnav.systems.ins.sensors.quantity.OFFSETS` that it may have.
    arrangement : ndarray
        As `mcnav.systems.ins.sensors.quantity.SensorType.arrange` has it.
    has_delay : bool
        Whether its measurements may be late.
    jitter : float
        Sigma of a delay of its own at each time, s.
    """

    name: str
    kind: str
    times: Array
    components: tuple[Component, ...]
    lever_arm: Array = field(default_factory=lambda: np.zeros(3))
    has_lever_arm: bool = False
    gate: float | None = None
    outages: tuple[tuple[float, float], ...] = ()
    log: MeasurementFile | None = None
    faults: tuple[Fault, ...] = ()
    flexure: Flexure | None = None
    offsets: tuple[str, ...] = ()
    arrangement: Array = field(default_factory=lambda: np.zeros((0, 3)))
    has_delay: bool = True
    jitter: float = 0.0

    @property
    def delay_name(self) -> str:
        """Name of its constant delay, which all that it measures has."""
        return f"{self.name}_delay"

    @property
    def jitter_name(self) -> str:
        """Name of its jitter, a process."""
        return f"{self.name}_jitter"

    def constants(self) -> Iterator[str]:
        """Yield the names of its constant errors in order, whatever their sizes."""
        for component in self.components:
            yield component.error_name("bias")
        for component in self.components:
            if QUANTITIES[component.quantity].scaled:
                yield component.error_name("scale_factor")
        if self.has_lever_arm:
            yield from (f"{self.name}_lever_arm_{axis}" for axis in AXES)
        for offset in self.offsets:
            yield from (f"{self.name}_{offset}_{axis}" for axis in OFFSETS[offset][0])
        if self.has_delay:
            yield self.delay_name

    def since(self, start: float) -> Sensor:
        """Return the same with its measurements after a time alone, s."""
        kept = self.times > start
        if kept.all():
            return self
        components = tuple(
            component
            if component.noise_at is None
            else replace(component, noise_at=tuple(np.array(component.noise_at)[kept].tolist()))
            for component in self.components
        )
        return replace(self, times=self.times[kept], components=components)

    def processes(self) -> dict[str, float]:
        """Return the sizes of its processes that are not zero, by name."""
        sizes = {each.error_name("noise"): each.noise for each in self.components}
        sizes |= {each.error_name("correlated"): each.correlated for each in self.components}
        if self.flexure is not None:
            sizes |= {flexure_process(self.name, axis): self.flexure.sigma[axis] for axis in self.flexure.axes}
        sizes |= {self.jitter_name: self.jitter}
        return {name: size for name, size in sizes.items() if size > 0.0}


def gate_limits(sensors: tuple[Sensor, ...]) -> Array:
    """Return the largest normalized innovations squared that are accepted, shape (sensors,); else infinite."""
    return np.array([
        np.inf if sensor.gate is None else gate_limit(sensor.gate, len(sensor.components)) for sensor in sensors
    ])  # fmt: skip


def aiding_constants(sensors: tuple[Sensor, ...]) -> tuple[str, ...]:
    """Return the names of all constant errors that aiding brings, in order."""
    return tuple(name for sensor in sensors for name in sensor.constants())


def aiding_processes(sensors: tuple[Sensor, ...]) -> dict[str, float]:
    """Return the sizes of all processes that aiding brings and that are not zero, by name, in order."""
    return {name: size for sensor in sensors for name, size in sensor.processes().items()}
