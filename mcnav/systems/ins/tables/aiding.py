"""The entries of ``[[aiding]]``: sensors, their instants, and the sizes of their errors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from mcnav.entries.context import FileContext
from mcnav.errors import suggestion
from mcnav.systems.ins.filter.model import estimated_kinds
from mcnav.systems.ins.imu.instruments import AXES, CONSTANTS, PROCESSES
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import RANDOM
from mcnav.systems.ins.tables import instants
from mcnav.systems.ins.tables.instants import check_count, read_instants
from mcnav.systems.ins.tables.sensors import SensorErrors, check_measured, keys_of_errors, read_sensor_errors

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
COMMON: Final = ("type", "name", "gate", *instants.KEYS)

MOST_SENSORS: Final = 100

NO_CORRELATION: Final = 3600.0
"""Correlation time of an error that there is not, s."""


@dataclass(frozen=True)
class Aiding:
    """Sensors, and sigmas of their constant errors by source, SI."""

    sensors: tuple[Sensor, ...]
    sigmas: Mapping[str, float]


def read_aiding(entries: object, navigation: Navigation, context: FileContext) -> Aiding | None:
    """Read all sensors of a navigation; mistakes are added to the context."""
    if not isinstance(entries, list):
        context.problem("aiding", "expected tables [[aiding]]")
        return None
    if len(entries) > MOST_SENSORS:
        context.problem("aiding", f"got {len(entries)} sensors; expected at most {MOST_SENSORS}")
        return None
    before = len(context.problems)
    sensors: list[Sensor] = []
    sigmas: dict[str, float] = {}
    for number, entry in enumerate(entries, start=1):
        key = f"aiding #{number}"
        if not isinstance(entry, dict):
            context.problem(key, "expected a table")
            continue
        kind = _read_type(entry, key, context)
        name = None if kind is None else _read_name(entry, sensors, f"{key}.name", context)
        if kind is None or name is None:
            continue
        problems = len(context.problems)
        sensor, aiding = _read_sensor(entry, kind, name, navigation, key, context)
        if len(context.problems) == problems:
            _check_names(sensor, sensors, f"{key}.name", context)
        sound = len(context.problems) == problems
        if sound and len(sensor.times) and (wrong := kind.limit(navigation.truth, sensor.times)):
            context.problem(key, wrong)
        sensors.append(sensor)
        sigmas |= aiding
    check_count(sum(len(sensor.times) for sensor in sensors), context)
    return Aiding(tuple(sensors), sigmas) if len(context.problems) == before else None


def _read_type(entry: Mapping[str, Any], key: str, context: FileContext) -> SensorType | None:
    known = list(SENSOR_TYPES)
    if "type" not in entry:
        context.problem(f"{key}.type", f"is missing; it is one of {', '.join(known)}")
        return None
    if not isinstance(entry["type"], str) or entry["type"] not in SENSOR_TYPES:
        context.problem(f"{key}.type", f"got {entry['type']!r}{suggestion(str(entry['type']), known)}")
        return None
    return SENSOR_TYPES[entry["type"]]


def _read_name(entry: Mapping[str, Any], sensors: list[Sensor], key: str, context: FileContext) -> str | None:
    name = entry.get("name", entry["type"].replace("-", "_"))
    if not isinstance(name, str) or not NAME.fullmatch(name):
        context.problem(key, f"got {name!r}; expected at most 40 letters, digits and _, a letter first")
    elif name in (sensor.name for sensor in sensors):
        context.problem(key, f"got {name!r} twice; give one of the sensors another name")
    else:
        return name
    return None


def _read_sensor(
    entry: Mapping[str, Any], kind: SensorType, name: str, navigation: Navigation, key: str, context: FileContext
) -> tuple[Sensor, dict[str, float]]:
    known = [*COMMON, *keys_of_errors(kind), *kind.further]
    for unknown in (each for each in entry if each not in known):
        context.problem(f"{key}.{unknown}", f"unknown key of type {entry['type']}{suggestion(unknown, known)}")
    times, outages = read_instants(entry, navigation, key, context)
    if kind.select is not None:
        times = kind.select(entry, times, navigation.truth, key, context)
    problems = len(context.problems)
    errors = read_sensor_errors(entry, kind, key, context)
    if len(context.problems) == problems:
        _check_measured(entry, kind, errors, key, context)
    components, sigmas = _components(kind, name, errors)
    if kind.lever_arm:
        sized = zip(AXES, errors.lever_arm_error, strict=True)
        sigmas |= {f"{name}_lever_arm_{axis}": float(size) for axis, size in sized if not np.isnan(size)}
    sensor = Sensor(
        name,
        entry["type"],
        times,
        components,
        np.nan_to_num(errors.lever_arm),
        kind.lever_arm,
        read_gate(entry, key, context),
        outages,
    )
    return sensor, sigmas


def _check_measured(
    entry: Mapping[str, Any], kind: SensorType, errors: SensorErrors, key: str, context: FileContext
) -> None:
    measured = {name: ~np.isnan(sizes.noise) for name, sizes in errors.sizes.items()}
    empty = [name for name in kind.quantities if name in entry and not measured[name].any()]
    for name in empty:
        context.problem(f"{key}.{name}", "names no axis; expected the sigma of at least one")
    if empty:
        return
    if not any(axes.any() for axes in measured.values()):
        wanted = " or ".join(kind.quantities)
        context.problem(f"{key}.{next(iter(kind.quantities))}", f"is missing; expected the sigma of {wanted}")
    check_measured(entry, kind, measured, key, context)


def _components(kind: SensorType, name: str, errors: SensorErrors) -> tuple[tuple[Component, ...], dict[str, float]]:
    """Build the measured components, and the sigmas of their constant errors that are given."""
    components: list[Component] = []
    sigmas: dict[str, float] = {}
    for measured, sizes in errors.sizes.items():
        for axis in np.flatnonzero(~np.isnan(sizes.noise)).tolist():
            correlated = float(np.nan_to_num(sizes.correlated[axis]))
            time = float(sizes.correlation_time[axis]) if correlated > 0.0 else NO_CORRELATION
            label = kind.label(name, measured)
            component = Component(kind.quantities[measured], axis, float(sizes.noise[axis]), correlated, time, label)
            components.append(component)
            sigmas |= constant_sizes(component, sizes.bias[axis], sizes.scale_factor[axis])
    return tuple(components), sigmas


def constant_sizes(component: Component, bias: float, scale_factor: float) -> dict[str, float]:
    """Return the sigmas of a component's constant errors that are given, by source."""
    sizes = {component.error_name("bias"): bias, component.error_name("scale_factor"): scale_factor}
    return {name: float(size) for name, size in sizes.items() if not np.isnan(size)}


def with_gate(sensors: tuple[Sensor, ...], gate: float | None) -> tuple[Sensor, ...]:
    """Give a gate to the sensors that have none of their own."""
    return tuple(sensor if sensor.gate is not None else replace(sensor, gate=gate) for sensor in sensors)


def read_gate(entry: Mapping[str, Any], key: str, context: FileContext) -> float | None:
    """Read the probability of a gate; none when there is none."""
    if "gate" not in entry:
        return None
    gate = context.quantity(entry["gate"], "1", f"{key}.gate")
    if gate is not None and not 0.0 < gate < 1.0:
        context.problem(f"{key}.gate", f"got {entry['gate']!r}; expected a probability between 0 and 1, such as 0.999")
    return gate


def _check_names(sensor: Sensor, earlier: list[Sensor], key: str, context: FileContext) -> None:
    """Add a mistake when errors of a sensor would have the names of others."""
    taken = {*PROCESSES, *estimated_kinds(CONSTANTS)}
    for other in earlier:
        taken |= _error_names(other)
    if clashes := sorted(_error_names(sensor) & taken):
        context.problem(key, f"got {sensor.name!r}; other errors have the name {clashes[0]} already, choose another")


def _error_names(sensor: Sensor) -> set[str]:
    processes = {each.error_name(error) for each in sensor.components for error in RANDOM}
    return processes | set(estimated_kinds(tuple(sensor.constants())))
