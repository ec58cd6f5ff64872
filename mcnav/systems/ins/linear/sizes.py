"""Whether two navigators differ in sizes of errors alone, so that they are tunings of one timeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mcnav.systems.ins.filter.model import FilterState
from mcnav.systems.ins.imu.instruments import Imu, process_sizes
from mcnav.systems.ins.linear.same_content import same_content
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_processes


def same_kind(one: Imu, other: Imu) -> bool:
    """Return whether another unit has no process that one has not, and the same correlation and intervals."""
    return process_sizes(other).keys() <= process_sizes(one).keys() and same_content(_memory(one), _memory(other))


def _memory(imu: Imu) -> tuple[object, ...]:
    noises = tuple((noise.correlation_time, noise.quantization_interval) for noise in (imu.gyro, imu.accelerometer))
    return (noises, imu.gravity.deflection_length, imu.gravity.anomaly_length)


def same_sensors(one: tuple[Sensor, ...], other: tuple[Sensor, ...]) -> bool:
    """Return whether other sensors have no process that these have not, and measure the same at the same times."""
    present = aiding_processes(other).keys() <= aiding_processes(one).keys()
    return present and same_content(_geometry(one), _geometry(other))


def _geometry(sensors: tuple[Sensor, ...]) -> tuple[object, ...]:
    """Return what innovations and processes depend on besides sizes."""
    return tuple(
        (
            sensor.name, sensor.times, sensor.lever_arm, sensor.has_lever_arm,
            tuple(
                (component.quantity, component.axis, component.label, component.correlation_time)
                for component in sensor.components
            ),
            sensor.faults, sensor.offsets, sensor.arrangement,
            None if sensor.flexure is None else replace(sensor.flexure, sigma=(0.0, 0.0, 0.0)),
        )
        for sensor in sensors
    )  # fmt: skip


def states_of_sizes(states: Sequence[FilterState], other: Sequence[FilterState]) -> list[FilterState] | None:
    """Return states of a filter with the sizes that another one has, zero where it lacks them.

    There are none where the filters differ in more than sizes.
    """
    others, sized = {state.name: state for state in other}, list[FilterState]()
    for state in states:
        absent = _without_size(state)
        sized.append(others.pop(state.name, absent))
        if not same_content(_without_size(sized[-1]), absent):
            return None
    return None if others else sized


def _without_size(state: FilterState) -> FilterState:
    flexing = state.flexure
    if flexing is not None:
        flexing = replace(flexing, flexure=replace(flexing.flexure, sigma=(0.0, 0.0, 0.0)))
    return replace(state, sigma=0.0, walk=0.0, flexure=flexing)
