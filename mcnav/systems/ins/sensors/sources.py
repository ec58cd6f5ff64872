"""Error sources and processes that aiding sensors bring to a scenario of inertial navigation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from mcnav.contract.quantities import Output, Source
from mcnav.systems.ins.filter.model import estimated_kinds
from mcnav.systems.ins.sensors.aiding import Component, MeasurementError, Sensor
from mcnav.systems.ins.sensors.flexure import FlexureState
from mcnav.systems.ins.sensors.quantity import OFFSETS
from mcnav.systems.ins.sensors.registry import QUANTITIES

SCALE_FACTOR: Final = ("1", "ppm", 1e-3)
LEVER_ARM: Final = ("m", "cm", 0.01)
FLEXURE: Final = ("rad", "mrad", 1e-3)
DELAY: Final = ("s", "ms", 0.01)

RANDOM: Final[tuple[MeasurementError, ...]] = ("noise", "correlated")
CONSTANT: Final[tuple[Literal["bias", "scale_factor"], ...]] = ("bias", "scale_factor")


def aiding_sources(sensors: tuple[Sensor, ...]) -> tuple[Source, ...]:
    """Return a source for each constant error of the sensors, in the order of `aiding_constants`.

    Its group is its kind: its name without the axis.
    """
    return tuple(source for sensor in sensors for source in _sources(sensor))


def _sources(sensor: Sensor) -> Iterator[Source]:
    known = {each.error_name(error): _units(each, error) for each in sensor.components for error in CONSTANT}
    for offset in sensor.offsets:
        axes, unit, shown_in, usual = OFFSETS[offset]
        known |= {f"{sensor.name}_{offset}_{axis}": (unit, shown_in, usual) for axis in axes}
    known[sensor.delay_name] = DELAY
    for name in sensor.constants():
        (kind,) = estimated_kinds((name,))
        # velocimeters had no lever arm at first, and no sensor a delay
        later = name == sensor.delay_name or (name not in known and bool(sensor.offsets))
        yield Source(name, *known.get(name, LEVER_ARM), group=kind, later=later)


def _units(component: Component, error: Literal["bias", "scale_factor"]) -> tuple[str, str, float]:
    quantity = QUANTITIES[component.quantity]
    return SCALE_FACTOR if error == "scale_factor" else (quantity.unit, quantity.shown_in, quantity.usual)


def aiding_outputs(sensors: tuple[Sensor, ...]) -> tuple[Output, ...]:
    """Return the processes of the sensors that are not zero, in the order of `aiding_processes`."""
    units = {
        each.error_name(error): _units(each, "bias")
        for sensor in sensors
        for each in sensor.components
        for error in RANDOM
    } | {sensor.jitter_name: DELAY for sensor in sensors}
    return tuple(
        Output(name, *units.get(name, FLEXURE)[:2]) for sensor in sensors for name in sensor.processes()
    )  # fmt: skip


def flexure_rates(sensors: tuple[Sensor, ...]) -> tuple[Output, ...]:
    """Return the rates of the sensors' flexures, which are states of filters and no processes of their own."""
    return tuple(
        Output(FlexureState(sensor.name, sensor.flexure, axis, True).name, "rad/s", "deg/s")
        for sensor in sensors
        if sensor.flexure is not None
        for axis in sensor.flexure.axes
    )
