"""The entries of ``[[aiding]]``: sensors, their instants, and the sizes of their errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from mcnav.arrays.types import Array
from mcnav.entries.context import FileContext
from mcnav.entries.inputs import InputFile
from mcnav.entries.validation import validate, validate_entry
from mcnav.systems.ins.filter.model import estimated_kinds
from mcnav.systems.ins.imu.instruments import CONSTANTS, PROCESSES
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.quantity import SensorType
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import RANDOM
from mcnav.systems.ins.tables.instants import InstantRule, InstantsTable, check_count, instants_of
from mcnav.systems.ins.tables.recorded import Recorded, read_recorded
from mcnav.systems.ins.tables.sensor_tables import MOST_SENSORS, AnySensor, SensorTable
from mcnav.systems.ins.tables.sensors import SensorErrors, check_measured, errors_of

FORM: Final = TypeAdapter[SensorTable](AnySensor)

NO_CORRELATION: Final = 3600.0
"""Correlation time of an error that there is not, s."""


@dataclass(frozen=True)
class Aiding:
    """Sensors, sigmas of their constant errors by source, SI, and the logs that they read.

    Attributes
    ----------
    sensors : tuple of Sensor
    sigmas : mapping of str to float
    files : mapping of int to InputFile
        Logs by the number of the entry, from 0.
    remarks : tuple of str
        What was noticed of the logs.
    """

    sensors: tuple[Sensor, ...]
    sigmas: Mapping[str, float]
    files: Mapping[int, InputFile] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def read_aiding(entries: object, navigation: Navigation, context: FileContext, origin: float = 0.0) -> Aiding | None:
    """Read all sensors of a navigation; mistakes are added to the context.

    Parameters
    ----------
    origin : float
        Time stamp at time zero of the trajectory, s.
    """
    if not isinstance(entries, list):
        context.problem("aiding", "expected tables [[aiding]]")
        return None
    if len(entries) > MOST_SENSORS:
        context.problem("aiding", f"got {len(entries)} sensors; expected at most {MOST_SENSORS}")
        return None
    before = len(context.problems)
    sensors: list[Sensor] = []
    sigmas: dict[str, float] = {}
    files: dict[int, InputFile] = {}
    remarks: list[str] = []
    for number, entry in enumerate(entries, start=1):
        key = f"aiding #{number}"
        table = validate_entry(FORM, entry, context, key)
        if table is None:
            _check_motion(entry, navigation, key, context)
            continue
        name = _own_name(table, sensors, f"{key}.name", context)
        if name is None:
            continue
        problems = len(context.problems)
        recorded = None
        if table.log is not None:
            recorded = read_recorded(table, SENSOR_TYPES[table.type], navigation, origin, key, context)
            if recorded is None:
                continue
            files[number - 1] = recorded.file
            remarks += recorded.remarks
        sensor, of_sensor = _read_sensor(table, entry, name, navigation, key, context, recorded)
        if len(context.problems) == problems:
            _check_names(sensor, sensors, f"{key}.name", context)
        sensors.append(sensor)
        sigmas |= of_sensor
    check_count(sum(len(sensor.times) for sensor in sensors), context)
    return Aiding(tuple(sensors), sigmas, files, tuple(remarks)) if len(context.problems) == before else None


def _own_name(table: SensorTable, sensors: list[Sensor], key: str, context: FileContext) -> str | None:
    """Return the name of a sensor, which no other has."""
    name = table.name or table.type.replace("-", "_")
    if name not in (sensor.name for sensor in sensors):
        return name
    context.problem(key, f"got {name!r} twice; give one of the sensors another name")
    return None


def _read_sensor(
    table: SensorTable, entry: Mapping[str, Any], name: str, navigation: Navigation, key: str, context: FileContext,
    recorded: Recorded | None,
) -> tuple[Sensor, dict[str, float]]:  # fmt: skip
    """Build a sensor from its table, and from its log; mistakes show the entry as it is written."""
    kind = SENSOR_TYPES[table.type]
    times = _read_times(table, kind, entry, navigation, key, context, recorded)
    arrangement = None if kind.arrange is None else kind.arrange(entry, navigation.truth, key, context)
    errors = _of_beams(errors_of(table, kind), kind, arrangement)
    of_each: Mapping[str, Array] = {}
    if recorded is not None:
        errors, of_each = _with_recorded(errors, kind, recorded, times)
        if all(np.isnan(sizes.noise).all() for sizes in errors.sizes.values()):
            missing = f"has no sigmas; expected the sigma of {' or '.join(kind.quantities)}"
            context.problem(f"{key}.log", f"{table.log} {missing}")
    _check_measured(entry, kind, errors, key, context)
    components, sigmas = _components(kind, name, errors, of_each)
    sigmas |= errors.sigmas_of_sensor(name)
    sensor = Sensor(
        name,
        kind.name,
        times,
        components,
        np.nan_to_num(errors.lever_arm),
        kind.lever_arm,
        table.gate,
        table.outages if recorded is None else recorded.outages,
        None if recorded is None else recorded.log_of(table),
        flexure=errors.flexed(None, navigation.end - navigation.start, key, context),
        offsets=kind.offsets,
        arrangement=np.zeros((0, 3)) if arrangement is None else arrangement,
        has_delay=kind.delays,
        jitter=errors.jitter or 0.0,
    )
    return sensor, sigmas


def _of_beams(errors: SensorErrors, kind: SensorType, arrangement: Array | None) -> SensorErrors:
    """Return the errors without the noise of beams that a sensor has not."""
    if arrangement is None:
        return errors
    sizes = dict(errors.sizes)
    for measured, quantity in kind.quantities.items():
        if QUANTITIES[quantity].by_beam:
            noise = np.where(np.arange(len(sizes[measured].noise)) < len(arrangement), sizes[measured].noise, np.nan)
            sizes[measured] = replace(sizes[measured], noise=noise)
    return replace(errors, sizes=sizes)


def _read_times(
    table: InstantsTable, kind: SensorType, entry: Mapping[str, Any], navigation: Navigation, key: str,
    context: FileContext, recorded: Recorded | None = None,
) -> Array:  # fmt: skip
    """Return the instants at which a sensor measures; mistakes, also of the motion then, go to the context."""
    before = len(context.problems)
    times = instants_of(table, entry, navigation, key, context) if recorded is None else recorded.times
    if kind.select is not None:
        times = kind.select(entry, times, navigation.truth, key, context)
    if len(context.problems) == before and len(times) and (wrong := kind.limit(navigation.truth, times)):
        context.problem(key, wrong)
    return times


def _check_motion(entry: object, navigation: Navigation, key: str, context: FileContext) -> None:
    """Add a mistake in the vehicle's motion at the instants of a sensor whose table has others, if they can be read."""
    kind = SENSOR_TYPES.get(str(entry.get("type"))) if isinstance(entry, dict) else None
    if kind is None or not isinstance(entry, dict):
        return
    given = {name: entry[name] for name in InstantsTable.model_fields if name in entry}
    silent = FileContext(context.file, context.folder)
    table = validate(InstantsTable, given, silent)
    if table is not None and table.log is None and InstantRule().broken(given.keys(), "") is None:
        times = _read_times(table, kind, entry, navigation, key, silent)
        context.problems.extend(problem for problem in silent.problems if len(times) and problem.key == key)


def _check_measured(
    entry: Mapping[str, Any], kind: SensorType, errors: SensorErrors, key: str, context: FileContext
) -> None:
    measured = {name: ~np.isnan(sizes.noise) for name, sizes in errors.sizes.items()}
    empty = [name for name in kind.quantities if name in entry and not measured[name].any()]
    for name in empty:
        context.problem(f"{key}.{name}", "names no axis; expected the sigma of at least one")
    if not empty:
        check_measured(entry, kind, measured, key, context)


def _with_recorded(
    errors: SensorErrors, kind: SensorType, recorded: Recorded, times: Array
) -> tuple[SensorErrors, dict[str, Array]]:
    """Return the errors with the root mean squares of recorded sigmas where none is stated, and these sigmas."""
    sizes, of_each = dict(errors.sizes), dict[str, Array]()
    for measured, quantity in kind.quantities.items():
        if np.isnan(sizes[measured].noise).all() and quantity in recorded.sigmas and len(times):
            of_each[measured] = recorded.sigmas[quantity][recorded.at(times)]
            root_mean_square = np.sqrt(np.mean(of_each[measured] ** 2, axis=0))
            sizes[measured] = replace(sizes[measured], noise=root_mean_square)
    return replace(errors, sizes=sizes), of_each


def _components(
    kind: SensorType, name: str, errors: SensorErrors, of_each: Mapping[str, Array]
) -> tuple[tuple[Component, ...], dict[str, float]]:
    """Build the measured components, and the sigmas of their constant errors that are given.

    Parameters
    ----------
    of_each : mapping of str to ndarray, shape (u, axes)
        Sigmas of each measurement by quantity, of those that a log gives.
    """
    components: list[Component] = []
    sigmas: dict[str, float] = {}
    for measured, sizes in errors.sizes.items():
        for axis in np.flatnonzero(~np.isnan(sizes.noise)).tolist():
            correlated = float(np.nan_to_num(sizes.correlated[axis]))
            time = float(sizes.correlation_time[axis]) if correlated > 0.0 else NO_CORRELATION
            label = kind.label(name, measured)
            each = tuple(of_each[measured][:, axis].tolist()) if measured in of_each else None
            size = float(sizes.noise[axis])
            component = Component(kind.quantities[measured], axis, size, correlated, time, label, each)
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


def _check_names(sensor: Sensor, earlier: list[Sensor], key: str, context: FileContext) -> None:
    """Add a mistake when errors of a sensor would have the names of others."""
    taken = {*PROCESSES, *estimated_kinds(CONSTANTS)}
    for other in earlier:
        taken |= _error_names(other)
    if clashes := sorted(_error_names(sensor) & taken):
        context.problem(key, f"got {sensor.name!r}; other errors have the name {clashes[0]} already, choose another")


def _error_names(sensor: Sensor) -> set[str]:
    processes = {component.error_name(error) for component in sensor.components for error in RANDOM}
    if sensor.flexure is not None:
        processes |= {*sensor.processes(), f"{sensor.name}_flexure"}
    if sensor.has_delay:
        processes |= {sensor.jitter_name}
    return processes | set(estimated_kinds(tuple(sensor.constants())))
