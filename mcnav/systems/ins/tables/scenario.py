"""``type = "ins"``: inertial navigation in three dimensions along a trajectory of the user's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field, TypeAdapter

from mcnav.contract.questions import UNMEASURED
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.entries.context import FileContext
from mcnav.entries.inputs import InputFile
from mcnav.entries.quantities import AngularRate, Duration, GravitationalParameter, Later, Length, Table
from mcnav.entries.unions import ByForm
from mcnav.entries.validation import validate, validate_entry
from mcnav.files.whole import INPUTS
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.description import FurtherTable, ScenarioSpec, ScenarioType
from mcnav.systems.ins.earth import BODIES, WGS84, Earth
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.scenario import NAVIGATION_ERRORS, SOURCES, Ins, Navigation
from mcnav.systems.ins.tables.aiding import Aiding, read_aiding, with_gate
from mcnav.systems.ins.tables.error_names import error_patterns
from mcnav.systems.ins.tables.faults import FAULTS, NO_AIDING, read_faults
from mcnav.systems.ins.tables.filter import (
    FilterPlan,
    FilterTable,
    check_filter_alone,
    check_states_as_written,
    plan_filter,
)
from mcnav.systems.ins.tables.gravity import GRAVITY, read_gravity
from mcnav.systems.ins.tables.imu import IMU, read_imu
from mcnav.systems.ins.tables.sensor_tables import Sensors
from mcnav.systems.ins.tables.trajectories import read_trajectory
from mcnav.systems.ins.tables.trajectory_tables import Columns, Trajectory

TRAJECTORY: Final = "trajectory"


class SphereTable(Table):
    """``earth = { radius = …, gravitational_parameter = …, rotation_rate = … }``."""

    expected: ClassVar[str] = 'expected "wgs84", "moon", "mars", or a sphere: { radius = …, … }'
    called: ClassVar[str] = "a sphere"
    radius: Annotated[Length, Field(ge=1e3, le=1e12, description="Radius of the sphere.")]
    gravitational_parameter: Annotated[
        GravitationalParameter,
        Field(gt=0.0, le=1e24, description="Gravitational parameter.", examples=["3.986004418e14 m^3/s^2"]),
    ]
    rotation_rate: Annotated[
        AngularRate, Field(ge=-1e-2, le=1e-2, description="Rotation rate.", examples=["15.041067 deg/h"])
    ]


class InsTable(Table):
    """``[scenario]`` of type ins."""

    type: Annotated[Literal["ins"], Field(description="Inertial navigation in three dimensions.")]
    trajectory: Annotated[
        Any,
        Later(Trajectory),
        Field(description="Trajectory file (CSV or parquet), or a table with file, reentry, segments, boost or sway."),
    ]
    columns: Columns = Field(default_factory=dict)
    platform: Annotated[
        Literal["strapdown", "inertial", "level"],
        Field(description="Carrier of the instruments: the body, a platform with inertial directions, or a level one."),
    ] = "strapdown"
    earth: Annotated[
        Annotated[Literal["wgs84", "moon", "mars"] | SphereTable, ByForm()],
        Field(description="Figure and gravitation of the earth, the moon or Mars, or a sphere."),
    ] = "wgs84"
    start: Annotated[
        Duration | None, Field(description="Start of navigation, in the trajectory's time; its first unless given.")
    ] = None
    end: Annotated[
        Duration | None, Field(description="End of navigation, in the trajectory's time; its last unless given.")
    ] = None


def _read_earth(table: Literal["wgs84", "moon", "mars"] | SphereTable) -> Earth:
    if isinstance(table, SphereTable):
        return Earth(table.radius, 0.0, table.gravitational_parameter, table.rotation_rate)
    return BODIES[table]


def read_scenario(table: InsTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec | None:
    """Build the scenario; mistakes are added to the context.

    Raises
    ------
    ScenarioError
        When navigation does not lie within the trajectory.
    """
    sizes = read_imu(context.content.get("imu", {}), context)
    gravity = read_gravity(context.content.get("gravity"), context)
    trajectory = read_trajectory(table.trajectory, _read_earth(table.earth), context, table.columns)
    if trajectory is None:
        return None
    truth = trajectory.truth
    first, last = (float(time) for time in truth.times[[0, -1]])
    start = first if table.start is None else table.start
    end = last if table.end is None else table.end
    imu = replace(Imu() if sizes is None else sizes.processes, gravity=gravity)
    navigation = Ins(Navigation(truth, table.platform, start, end, imu)).navigation
    aiding, plan = _read_aiding(navigation, trajectory.origin, context)
    scenario = Ins(
        replace(navigation, sensors=aiding.sensors), tuple(dict.fromkeys((*trajectory.remarks, *aiding.remarks)))
    )
    defaults = {"platform": table.platform, "earth": "wgs84", "start": f"{start!r} s", "end": f"{end!r} s"}
    resolved = {**defaults, **entries, TRAJECTORY: trajectory.resolved}
    files, logs = with_logs(trajectory.file, aiding.files)
    of_imu = {} if sizes is None else sizes.sigmas
    tables = {**dict.fromkeys(of_imu, "[imu]"), **dict.fromkeys(aiding.sigmas, "[[aiding]]")}
    complete = None if plan is None else partial(_with_filter, plan)
    return ScenarioSpec(
        scenario, resolved, inputs=files, sigmas={**of_imu, **aiding.sigmas}, tables=tables, complete=complete,
        further=_with_places(context.content, logs),
    )  # fmt: skip


def with_logs(
    trajectory: InputFile | None, logs: Mapping[int, InputFile]
) -> tuple[tuple[InputFile, ...], dict[int, str]]:
    """Return the files of a run, each once and under a name of its own, and the names of the logs by sensor."""
    files = [] if trajectory is None else [trajectory]
    names: dict[int, str] = {}
    for number, log in logs.items():
        same = next((file for file in files if file.path == log.path), None)
        if same is None:
            taken = {file.name.casefold() for file in files}
            same = log if log.name.casefold() not in taken else replace(log, name=f"{number + 1}_{log.name}")
            files.append(same)
        names[number] = same.name
    return tuple(files), names


def _with_places(content: Mapping[str, Any], logs: Mapping[int, str]) -> dict[str, Any]:
    """Return ``[[aiding]]`` with the paths that logs have in a run folder; nothing without logs."""
    if not logs:
        return {}
    entries = [
        {**entry, "log": f"{INPUTS}/{logs[number]}"} if number in logs else entry
        for number, entry in enumerate(content["aiding"])
    ]
    return {"aiding": entries}


def _with_filter(plan: FilterPlan, scenario: Scenario, errors: ErrorModel) -> Scenario:
    """Return the scenario with its filter, which may believe the statistics of all errors.

    Raises
    ------
    ScenarioError
        When a sensor is late at the end of a structure that bends: samples would bend at the time stamp.
    """
    true = {
        name: math.hypot(sigma, mean)
        for name, sigma, mean in zip(errors.names, errors.standard_deviations, errors.mean, strict=True)
    }
    if not is_ins(scenario):
        return scenario
    for number, sensor in enumerate(scenario.navigation.sensors):
        if sensor.flexure is not None and (sensor.jitter > 0.0 or true.get(sensor.delay_name, 0.0) > 0.0):
            late = f"delay, jitter and {sensor.delay_name} in [errors]"
            raise ScenarioError(
                f"aiding #{number + 1}.flexure",
                f"{sensor.name} is late as well, and how the structure bent before a time stamp is not modelled; "
                f"leave out flexure, or {late}",
            )
    return scenario.with_filter(plan.completed(errors), true)


def _read_aiding(navigation: Navigation, origin: float, context: FileContext) -> tuple[Aiding, FilterPlan | None]:
    """Read ``[[aiding]]`` and ``[filter]``; mistakes are added to the context."""
    none = Aiding((), {})
    sensors, entries = context.content.get("aiding", []), context.content.get("filter")
    aiding = read_aiding(sensors, navigation, context, origin)
    if aiding is None:
        _check_filter_and_faults(context)
    if entries is None or aiding is None or not aiding.sensors:
        return aiding or none, None
    table = validate(FilterTable, entries, context, "filter")
    if table is not None:
        aiding = replace(aiding, sensors=with_gate(aiding.sensors, table.gate))
    if (faults := context.content.get("faults")) is not None:
        aiding = replace(aiding, sensors=read_faults(faults, aiding.sensors, navigation, context))
    if table is None:
        check_states_as_written(entries, aiding.sensors, context)
        return aiding, None
    return aiding, plan_filter(table, aiding.sensors, navigation.imu, navigation.end - navigation.start, context)


def _check_filter_and_faults(context: FileContext) -> None:
    """Add the mistakes of ``[filter]`` and ``[[faults]]`` that do not depend on the sensors."""
    if (entries := context.content.get("filter")) is not None:
        check_filter_alone(entries, context)
    if (faults := context.content.get("faults")) is not None:
        validate_entry(TypeAdapter(FAULTS.form), faults, context, "faults")


def check_alone(context: FileContext) -> None:
    """Add the mistakes of the trajectory and of further tables that do not depend on each other; see `ScenarioType`."""
    entries = context.content["scenario"]
    if TRAJECTORY in entries and entries.get("earth", "wgs84") == "wgs84":  # over another figure others may be wrong
        columns = entries.get("columns")
        read_trajectory(entries[TRAJECTORY], WGS84, context, columns if isinstance(columns, dict) else {})
    read_imu(context.content.get("imu", {}), context)
    read_gravity(context.content.get("gravity"), context)
    if (sensors := context.content.get("aiding")) is not None:
        validate_entry(TypeAdapter(Sensors), sensors, context, "aiding")
    _check_filter_and_faults(context)


INS: Final = ScenarioType(
    InsTable,
    read_scenario,
    SOURCES,
    NAVIGATION_ERRORS,
    check_alone=check_alone,
    tables={
        "imu": IMU,
        "gravity": GRAVITY,
        "aiding": FurtherTable(
            Sensors,
            "Sensors that aid the navigation; needs [filter].",
            NO_AIDING,
            "filter",
            "needs a [filter], which says what is estimated from its measurements",
            error_patterns(),
        ),
        "faults": FAULTS,
        "filter": FurtherTable(
            FilterTable,
            "Error-state Kalman filter of an aided navigation; needs [[aiding]].",
            NO_AIDING,
            "aiding",
            f"{UNMEASURED}; needs [[aiding]], the sensors whose measurements it uses",
        ),
    },
)
