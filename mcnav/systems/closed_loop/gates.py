"""Gates and faults of a loop's sensors: of its samples, and as linear analysis sees them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.gates import USUAL, GateQuestion
from mcnav.linear.engine.design import Design
from mcnav.systems.closed_loop.linear import LinearLoop
from mcnav.systems.closed_loop.maps import Sensor
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.transitions import Innovation
from mcnav.systems.faults import Fault, fault_errors, gate_limit
from mcnav.systems.gates import GatedFilter, GatedSensor


@dataclass(frozen=True)
class LoopGates:
    """What a campaign says of the gates and the faults of a loop's sensors.

    Attributes
    ----------
    gate : float, optional
        Probability with which each sensor's good measurement is accepted; none without gates.
    question : GateQuestion
    faults : mapping of str to tuple of Fault
        By sensor.
    """

    gate: float | None = None
    question: GateQuestion = USUAL
    faults: Mapping[str, tuple[Fault, ...]] = field(default_factory=dict)

    @property
    def any(self) -> bool:
        """True where there are gates or faults."""
        return self.gate is not None or bool(self.faults)

    def sensor(self, sensor: Sensor) -> GatedSensor:
        """Return a sensor as its gate sees it."""
        declared = sensor.declared
        components = tuple((name, declared.unit, declared.unit) for name in component_names(sensor))
        return GatedSensor(declared.name, components, self.gate, self.faults.get(declared.name, ()))


NO_GATES: Final = LoopGates()
"""Neither gates nor faults."""


def component_names(sensor: Sensor) -> tuple[str, ...]:
    """Return the names of what a sensor measures: numbers follow the sensor's name where there are several."""
    name = sensor.declared.name
    return (name,) if sensor.size == 1 else tuple(f"{name}_{number}" for number in range(1, sensor.size + 1))


def times_of(schedule: Sequence[Instant], number: int) -> Array:
    """Return the times of a sensor's measurements, by its number, s."""
    return np.array([instant.time for instant in schedule if number in instant.measurements])


@dataclass(frozen=True)
class SampleGates:
    """Gates and faults as samples meet them.

    Attributes
    ----------
    limits : tuple of float
        Largest normalized innovation squared that each sensor's gate accepts; infinite without gates.
    errors : mapping of (int, float) to ndarray
        What faults add to the measurements of a sensor, by number, at a time, s.
    """

    limits: tuple[float, ...]
    errors: Mapping[tuple[int, float], Array]

    @classmethod
    def of(cls, gates: LoopGates, sensors: Sequence[Sensor], schedule: Sequence[Instant]) -> SampleGates:
        """Prepare those of a schedule."""
        limits = tuple(np.inf if gates.gate is None else gate_limit(gates.gate, sensor.size) for sensor in sensors)
        errors: dict[tuple[int, float], Array] = {}
        for number, sensor in enumerate(sensors):
            if faults := gates.faults.get(sensor.declared.name):
                times = times_of(schedule, number)
                table = fault_errors(faults, times, sensor.size)
                errors |= {(number, time): row for time, row in zip(times.tolist(), table, strict=True) if row.any()}
        return cls(limits, errors)


def around_faults(gates: LoopGates, sensors: Sequence[Sensor], schedule: Sequence[Instant]) -> set[float]:
    """Return the times of the last measurement before each fault, and of the last one during it."""
    around: set[float] = set()
    for number, sensor in enumerate(sensors):
        times = times_of(schedule, number)
        for fault in gates.faults.get(sensor.declared.name, ()):
            during = np.flatnonzero(fault.errors(times) != 0.0)
            if len(during):
                around |= {float(times[max(int(during[0]) - 1, 0)]), float(times[during[-1]])}
    return around


def gated_filter(linear: LinearLoop, gates: LoopGates, mean: Array, covariance: Array) -> GatedFilter:
    """Return a loop's filter with its gates, for errors of a mean and a covariance."""
    loop, designed = linear.loop, linear.design
    assert designed is not None
    assert loop.states is not None

    def design(positions: IndexArray) -> Design:
        return replace(designed, positions=positions, covariances=designed.covariances[positions])

    measured = [
        (update.number, planned.instant.time)
        for planned in loop.linear.instants for update in planned.updates if isinstance(update, Innovation)
    ]  # fmt: skip
    numbers, times = np.array(measured).reshape(-1, 2).T
    return GatedFilter(
        loop.timeline, design, tuple(map(gates.sensor, loop.maps.sensors)), numbers.astype(np.int64), times, mean,
        covariance, planned=not loop.states.own_gains,
    )  # fmt: skip
