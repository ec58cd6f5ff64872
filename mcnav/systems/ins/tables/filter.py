"""The table ``[filter]``: what the filter of an aided navigation estimates, and what it believes.

What it believes is the truth where ``[filter.believes]`` says nothing else. The statistics of the constant errors are
known only after ``[errors]`` is read, so that a `FilterPlan` is completed then.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, WithJsonSchema

from mcnav.arrays.types import Array
from mcnav.contract.gates import USUAL, GateQuestion
from mcnav.contract.quantities import Source
from mcnav.entries.axes import within
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import UNIT, Distinct, Duration, Later, Suggested, Table
from mcnav.entries.validation import validate
from mcnav.errors import suggestion
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.ins.filter.model import EKF, NAVIGATION, Beliefs, FilterModel, estimated_kinds
from mcnav.systems.ins.imu.gravity import ANOMALY, CAUSES, DEFLECTION, GravityDisturbance
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, GYRO, Imu
from mcnav.systems.ins.scenario import SOURCES
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.registry import QUANTITIES, SENSOR_TYPES
from mcnav.systems.ins.sensors.sources import aiding_sources
from mcnav.systems.ins.tables.aiding import constant_sizes
from mcnav.systems.ins.tables.error_names import error_patterns, kinds_of_errors, name_pattern
from mcnav.systems.ins.tables.gravity import BelievedGravityTable, read_believed_gravity
from mcnav.systems.ins.tables.imu import BelievedImuTable, read_imu
from mcnav.systems.ins.tables.sensor_tables import BELIEVED, MULTIPLE, Gate, OfGate, OfName, believed_sensor
from mcnav.systems.ins.tables.sensors import SensorErrors, check_measured, errors_of
from mcnav.systems.smoother_table import SmootherEntry, lag_of

ALWAYS: Final = ("position", "velocity", "attitude")
"""States that every filter estimates."""

KINDS: Final = (*estimated_kinds((*GYRO, *ACCELEROMETER)), *CAUSES)
"""Kinds of the instruments' errors, and of gravity disturbances."""

OF_ANY_SENSOR: Final = name_pattern(kinds_of_errors())
"""Pattern of the kinds of any sensor's errors."""

OfEstimates: Final = Field(description="position, velocity, attitude, and kinds of errors that are estimated.")
OfConsiders: Final = Field(description="Kinds of errors that are in the covariance but not estimated (Schmidt).")

OF_SENSORS: Final = re.compile(rf"(\w+?)_({'|'.join(kinds_of_errors())})")
"""Kinds of a sensor's errors, after its name."""


def _schema_of_believed_errors() -> dict[str, object]:
    """Return the JSON schema of sigmas by source, or kind of sources, of a navigation with any sensors."""
    units = {source.group: source.unit for source in SOURCES} | {source.name: source.unit for source in SOURCES}
    told = "Believed sigma of {}."
    known = {name: {UNIT: unit, "description": told.format(name)} for name, unit in units.items()}
    of_sensor = told.format("a constant error of a sensor")
    others = {pattern: {UNIT: unit, "description": of_sensor} for unit, pattern in error_patterns().items()}
    return {"type": "object", "properties": known, "patternProperties": others, "additionalProperties": False}


class BelievesTable(Table):
    """``[filter.believes]``."""

    imu: Annotated[Any, Later(BelievedImuTable)] = Field(
        default_factory=dict, description="Believed errors of the instruments."
    )
    gravity: Annotated[Any, Later(BelievedGravityTable)] = Field(
        default_factory=dict, description="Believed gravity disturbance."
    )
    errors: Annotated[dict[str, object], WithJsonSchema(_schema_of_believed_errors())] = Field(
        default_factory=dict, description="Believed sigmas by source, or kind of sources."
    )
    aiding: dict[
        Annotated[str, OfName],
        Annotated[object, Later(believed_sensor)],
    ] = Field(
        default_factory=dict,
        description="Believed errors of the sensors, by their names.",
        json_schema_extra={"additionalProperties": False},
    )


class StopsTable(Table):
    """``stops = { probability = 0.99, ramp = "60 s" }``."""

    expected: ClassVar[str] = 'expected probability, ramp or both, such as { probability = 0.99, ramp = "60 s" }'
    called: ClassVar[str] = "what gates stop"
    probability: Annotated[
        float,
        Field(gt=0.0, lt=1.0, description="Probability with which a spike or a ramp is rejected.", examples=[0.99]),
    ] = USUAL.probability
    ramp: Annotated[Duration, Field(gt=0.0, le=1e7, description="How long a ramp grows.", examples=["60 s"])] = (
        USUAL.ramp
    )


class FilterTable(Table):
    """``[filter]``; the gate is one of the sensors."""

    estimates: Annotated[
        list[Annotated[str, Suggested((*ALWAYS, *KINDS), OF_ANY_SENSOR), OfEstimates]],
        Distinct(ALWAYS),
        Field(max_length=1_000),
        OfEstimates,
    ]
    considers: Annotated[
        list[Annotated[str, Suggested(KINDS, OF_ANY_SENSOR), OfConsiders]],
        Distinct(),
        Field(max_length=1_000),
        OfConsiders,
    ] = Field(default_factory=list)
    gate: Annotated[Gate | None, OfGate] = None
    kind: Annotated[
        Literal["ekf", "iterated", "left-invariant", "right-invariant", "ukf"],
        Field(
            description="Kind of the filter: ekf, the error-state filter; iterated, re-linearized at the updated "
            "state; left-invariant and right-invariant, with errors of the group SE2(3); ukf, of sigma points."
        ),
    ] = "ekf"
    smoother: Annotated[
        SmootherEntry | None,
        Field(description='"fixed-interval" uses all measurements, { lag = "60 s" } those up to a minute later.'),
    ] = None
    stops: Annotated[
        StopsTable,
        Field(
            description="Probability of detection and duration of a ramp for which the sizes of detectable faults "
            'are reported: { probability = 0.95, ramp = "60 s" } unless given.'
        ),
    ] = StopsTable()
    believes: BelievesTable = Field(
        default_factory=BelievesTable,
        description="Errors as the filter models them; the true values where nothing is given.",
    )


@dataclass(frozen=True)
class FilterPlan:
    """A filter as its table describes it.

    Attributes
    ----------
    estimates, considers : tuple of str
        Kinds of errors; see `FilterModel`.
    sigmas : mapping of str to float
        Believed ones that differ from the truth, by source, SI.
    imu : Imu
        Believed processes.
    sensors : tuple of Sensor
        Believed ones.
    lag : float or None
    question : GateQuestion
    kind : str
        As `FilterModel` has them.
    """

    estimates: tuple[str, ...]
    considers: tuple[str, ...]
    sigmas: Mapping[str, float]
    imu: Imu
    sensors: tuple[Sensor, ...]
    lag: float | None = None
    question: GateQuestion = USUAL
    kind: str = EKF

    def completed(self, errors: ErrorModel) -> FilterModel:
        """Return the filter, which believes the statistics of all errors where it does not believe others."""
        true = errors.standard_deviations
        believed = np.array(
            [self.sigmas.get(name, sigma) for name, sigma in zip(errors.names, true.tolist(), strict=True)]
        )
        covariance = _scaled(errors.covariance[:NAVIGATION, :NAVIGATION], believed[:NAVIGATION])
        sigmas = dict(zip(errors.names, believed.tolist(), strict=True))
        beliefs = Beliefs(sigmas, covariance, self.imu, self.sensors)
        return FilterModel(self.estimates, self.considers, beliefs, self.lag, self.question, self.kind)


def _scaled(covariance: Array, sigmas: Array) -> Array:
    """Scale a covariance to other standard deviations; an error without one is independent of the others."""
    true = np.sqrt(np.diag(covariance))
    correlation = np.divide(covariance, np.outer(true, true), out=np.eye(len(true)), where=np.outer(true, true) > 0.0)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation * np.outer(sigmas, sigmas))


def plan_filter(
    table: FilterTable, sensors: tuple[Sensor, ...], imu: Imu, duration: float, context: FileContext
) -> FilterPlan | None:
    """Plan the filter of a navigation of a duration, s, with these sensors; mistakes are added to the context."""
    before = len(context.problems)
    _check_states(table, sensors, context)
    _check_smoother(table, context)
    _check_kind(table, context)
    believed = read_imu(table.believes.imu, context, "filter.believes.imu", imu)
    gravity = read_believed_gravity(table.believes.gravity, imu.gravity, context)
    _check_gravity(table, gravity, context)
    sigmas = {} if believed is None else dict(believed.sigmas)
    seen = []
    by_name = {sensor.name: sensor for sensor in sensors}
    for name in table.believes.aiding.keys() - by_name.keys():
        context.problem(f"filter.believes.aiding.{name}", f"no sensor has this name{suggestion(name, list(by_name))}")
    for name, sensor in by_name.items():
        plan, of_sensor = _believed_sensor(table.believes.aiding.get(name, {}), sensor, duration, context)
        seen.append(plan)
        sigmas |= of_sensor
    stated = _believed_errors(table.believes.errors, (*SOURCES, *aiding_sources(sensors)), context)
    for name in stated.keys() & sigmas.keys():
        context.problem(f"filter.believes.errors.{name}", "is given by another table of [filter.believes]; keep one")
    if len(context.problems) > before or believed is None:
        return None
    estimates = tuple(name for name in table.estimates if name not in ALWAYS)
    processes = replace(believed.processes, gravity=gravity)
    lag = lag_of(table.smoother)
    question = GateQuestion(table.stops.probability, table.stops.ramp)
    believes = ({**sigmas, **stated}, processes, tuple(seen))
    return FilterPlan(estimates, tuple(table.considers), *believes, lag, question, table.kind)


def check_filter_alone(entries: object, context: FileContext) -> None:
    """Add the mistakes of ``[filter]`` that do not depend on the sensors, which cannot be read."""
    table = validate(FilterTable, entries, context, "filter")
    if table is None:
        check_states_as_written(entries, None, context)
    else:
        _check_states(table, None, context)
        _check_smoother(table, context)
        _check_kind(table, context)
        validate(BelievedImuTable, table.believes.imu, context, "filter.believes.imu")
        validate(BelievedGravityTable, table.believes.gravity, context, "filter.believes.gravity")


def check_states_as_written(entries: object, sensors: tuple[Sensor, ...] | None, context: FileContext) -> None:
    """Add the mistakes in the states of a filter whose table has others, if they can be read."""
    given = (
        {key: entries[key] for key in ("estimates", "considers") if key in entries} if isinstance(entries, dict) else {}
    )
    table = validate(FilterTable, given, FileContext(context.file, context.folder))
    if table is not None:
        _check_states(table, sensors, context)


def _check_smoother(table: FilterTable, context: FileContext) -> None:
    """Add a mistake where a smoother is not defined."""
    if table.smoother is not None and table.considers:
        message = (
            "is not defined with considers, whose errors the filter's gains leave out; estimate them, or leave it out"
        )
        context.problem("filter.smoother", message)


def _check_kind(table: FilterTable, context: FileContext) -> None:
    """Add a mistake for each thing that other kinds than the EKF have not."""
    if table.kind == EKF:
        return
    without = f"is not there with kind = {table.kind!r}; leave it out, or take kind = 'ekf'"
    if table.smoother is not None:
        context.problem("filter.smoother", without)
    if table.considers:
        context.problem("filter.considers", without)
    if gravity := [name for name in table.estimates if name in CAUSES]:
        context.problem("filter.estimates", f"got {gravity[0]!r}, which {without}")


def _check_states(table: FilterTable, sensors: tuple[Sensor, ...] | None, context: FileContext) -> None:
    """Add a mistake for each state that is missing, unknown, or named twice; without sensors theirs may be there."""
    if sensors is None:
        kinds = (*KINDS, *(name for name in (*table.estimates, *table.considers) if OF_SENSORS.fullmatch(name)))
    else:
        flexures = (f"{sensor.name}_flexure" for sensor in sensors if sensor.flexure is not None)
        kinds = (*KINDS, *estimated_kinds(aiding_constants(sensors)), *flexures)
    if absent := [name for name in ALWAYS if name not in table.estimates]:
        context.problem("filter.estimates", f"{' and '.join(absent)} must be there; expected {', '.join(ALWAYS)}, …")
    seen: set[str] = set()
    for key, names, known in (
        ("filter.estimates", table.estimates, (*ALWAYS, *kinds)),
        ("filter.considers", table.considers, kinds),
    ):
        for name in names:
            if name in seen:
                both = "in estimates and considers" if name in table.estimates and name in table.considers else "twice"
                context.problem(key, f"got {name!r} {both}; keep one")
            elif name in ALWAYS and name not in known:
                context.problem(key, f"got {name!r}; a filter always estimates it")
            elif name not in known:
                context.problem(key, _unknown_state(name, sensors or (), known))
            seen.add(name)


def _check_gravity(table: FilterTable, believed: GravityDisturbance, context: FileContext) -> None:
    """Add a mistake for each gravity disturbance that is a state without a size, unless [gravity] is wrong itself."""
    if any(problem.key.partition(".")[0] == "gravity" for problem in context.problems):
        return
    lengths = {DEFLECTION: believed.deflection_length, ANOMALY: believed.anomaly_length}
    for key, names in (("estimates", table.estimates), ("considers", table.considers)):
        for name in lengths.keys() & set(names):
            if not np.isfinite(lengths[name]):
                context.problem(f"filter.{key}", f"got {name!r}; it needs {name.partition('_')[2]} in [gravity]")


def _unknown_state(name: str, sensors: tuple[Sensor, ...], known: Sequence[str]) -> str:
    of_sensor = OF_SENSORS.fullmatch(name)
    if of_sensor and of_sensor[1] not in (*(sensor.name for sensor in sensors), "gyro", "accelerometer"):
        return f"got {name!r}; no sensor of [[aiding]] is named {of_sensor[1]!r}{suggestion(name, list(known))}"
    return f"unknown error {name!r}{suggestion(name, list(known))}"


def _believed_errors(entries: Mapping[str, Any], sources: Sequence[Source], context: FileContext) -> dict[str, float]:
    """Read believed sigmas by source or group of sources."""
    groups: dict[str, list[Source]] = {}
    for source in sources:
        groups.setdefault(source.group, []).append(source)
    known = {source.name: [source] for source in sources}
    names = [*known, *(group for group in groups if group not in known)]
    believed_errors: dict[str, float] = {}
    for name, entry in sorted(entries.items(), key=lambda entry: entry[0] in known):  # groups first
        key = f"filter.believes.errors.{name}"
        meant = known.get(name) or groups.get(name)
        if meant is None:
            context.problem(key, f"unknown error source{suggestion(name, names)}")
            continue
        size = context.quantity(entry, meant[0].unit, key, meant[0].shares)
        if size is None:
            continue
        if wrong := within(0.0, MULTIPLE * meant[0].nominal, meant[0].unit)(size):
            context.problem(key, f"got {entry!r}; {wrong}")
        believed_errors |= {source.name: size for source in meant}
    return believed_errors


def _believed_sensor(
    entry: object, sensor: Sensor, duration: float, context: FileContext
) -> tuple[Sensor, dict[str, float]]:
    """Read what the filter believes of a sensor, and of the sigmas of its constant errors."""
    key = f"filter.believes.aiding.{sensor.name}"
    kind = SENSOR_TYPES[sensor.kind]
    if kind.lever_arm and isinstance(entry, dict) and "lever_arm" in entry:
        known = f'{sensor.name}_lever_arm_x = {{ distribution = "fixed", value = "1 cm" }}'
        context.problem(
            f"{key}.lever_arm", f"is that of [[aiding]]; a wrong one is an error such as {known} in [errors]"
        )
        entry = {name: item for name, item in entry.items() if name != "lever_arm"}
    table = validate(BELIEVED[sensor.kind], entry, context, key)
    if table is None or not isinstance(entry, dict):
        return sensor, {}
    errors = errors_of(table, kind)
    measured: dict[str, NDArray[np.bool_]] = {
        name: np.isin(
            np.arange(len(QUANTITIES[quantity].axes)), [c.axis for c in sensor.components if c.quantity == quantity]
        )
        for name, quantity in kind.quantities.items()
    }
    check_measured(entry, kind, measured, key, context)
    names = {quantity: name for name, quantity in kind.quantities.items()}
    components: list[Component] = []
    sigmas: dict[str, float] = {}
    for component in sensor.components:
        sensors, of_component = _believed_component(component, names[component.quantity], errors, key, context)
        components.append(sensors)
        sigmas |= of_component
    sigmas |= errors.sigmas_of_sensor(sensor.name)
    if errors.flexure is not None and sensor.flexure is None:
        context.problem(f"{key}.flexure", "the sensor has none; give it one in [[aiding]], if only of sigma zero")
    flexure = errors.flexed(sensor.flexure, duration, key, context)
    jitter = sensor.jitter if errors.jitter is None else errors.jitter
    return replace(sensor, components=tuple(components), flexure=flexure, jitter=jitter), sigmas


def _believed_component(
    component: Component, measured: str, errors: SensorErrors, key: str, context: FileContext
) -> tuple[Component, dict[str, float]]:
    sizes, axis = errors.sizes[measured], component.axis
    noise, correlated, time = (
        float(below if np.isnan(given[axis]) else given[axis])
        for given, below in (
            (sizes.noise, component.noise),
            (sizes.correlated, component.correlated),
            (sizes.correlation_time, component.correlation_time),
        )
    )
    if correlated > 0.0 and component.correlated == 0.0 and np.isnan(sizes.correlation_time[axis]):
        name = component.error_name("correlated")
        context.problem(key, f"{name} needs a correlation_time, because the sensor itself has no such error")
    of_each = component.noise_at if np.isnan(sizes.noise[axis]) else None
    believed = replace(component, noise=noise, correlated=correlated, correlation_time=time, noise_at=of_each)
    return believed, constant_sizes(component, sizes.bias[axis], sizes.scale_factor[axis])
