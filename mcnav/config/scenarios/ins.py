"""``type = "ins"``: inertial navigation in three dimensions along a trajectory of the user's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from mcnav.config.aiding import Aiding, read_aiding, read_gate, with_gate
from mcnav.config.context import FileContext
from mcnav.config.filter import FilterPlan, read_filter
from mcnav.config.imu import read_imu
from mcnav.config.scenarios.base import ScenarioSpec
from mcnav.config.schema import AngularRate, Duration, GravitationalParameter, Length, Table
from mcnav.config.trajectories import read_trajectory
from mcnav.physics.ins.earth import WGS84, Earth
from mcnav.physics.ins.instruments import Imu
from mcnav.scenarios.ins import Ins, Navigation

TRAJECTORY: Final = "trajectory"


class SphereTable(Table):
    """``earth = { radius = …, gravitational_parameter = …, rotation_rate = … }``."""

    radius: Annotated[Length, Field(ge=1e3, le=1e12)]
    gravitational_parameter: Annotated[GravitationalParameter, Field(gt=0.0, le=1e24)]
    rotation_rate: Annotated[AngularRate, Field(ge=-1e-2, le=1e-2)]


class InsTable(Table):
    """``[scenario]`` of type ins."""

    type: Literal["ins"]
    trajectory: str | dict[str, Any]
    columns: dict[str, str] = Field(default_factory=dict)
    platform: Literal["strapdown", "inertial", "level"] = "strapdown"
    earth: Literal["wgs84"] | SphereTable = "wgs84"
    start: Duration | None = None
    end: Duration | None = None


def _read_earth(table: Literal["wgs84"] | SphereTable) -> Earth:
    if isinstance(table, SphereTable):
        return Earth(table.radius, 0.0, table.gravitational_parameter, table.rotation_rate)
    return WGS84


def read_scenario(table: InsTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec | None:
    """Build the scenario; mistakes are added to the context.

    Raises
    ------
    ScenarioError
        When navigation does not lie within the trajectory.
    """
    instruments = context.content.get("imu", {})
    sizes = read_imu(instruments if isinstance(instruments, dict) else {}, context)  # validation has reported others
    trajectory = read_trajectory(table.trajectory, _read_earth(table.earth), context, table.columns)
    if trajectory is None:
        return None
    truth = trajectory.truth
    first, last = (float(time) for time in truth.times[[0, -1]])
    start = first if table.start is None else table.start
    end = last if table.end is None else table.end
    imu = Imu() if sizes is None else sizes.processes
    navigation = Ins(Navigation(truth, table.platform, start, end, imu)).navigation
    aiding, plan = _read_aiding(navigation, context)
    scenario = Ins(replace(navigation, sensors=aiding.sensors))
    defaults = {"platform": table.platform, "earth": "wgs84", "start": f"{start!r} s", "end": f"{end!r} s"}
    resolved = {**defaults, **entries, TRAJECTORY: trajectory.resolved}
    inputs = () if trajectory.file is None else (trajectory.file,)
    sigmas = {**({} if sizes is None else sizes.sigmas), **aiding.sigmas}
    return ScenarioSpec(scenario, resolved, inputs=inputs, sigmas=sigmas, filter=plan)


def _read_aiding(navigation: Navigation, context: FileContext) -> tuple[Aiding, FilterPlan | None]:
    """Read ``[[aiding]]`` and ``[filter]``; mistakes are added to the context."""
    none = Aiding((), {})
    sensors, entries = context.content.get("aiding", []), context.content.get("filter")
    aiding = read_aiding(sensors, navigation, context)
    if entries is None and sensors:
        context.problem("aiding", "needs a [filter], which says what is estimated from its measurements")
    if entries is None or aiding is None:
        return aiding or none, None
    if not aiding.sensors:
        context.problem("filter", "needs [[aiding]], the sensors whose measurements it uses")
        return aiding, None
    gate = read_gate(entries, "filter", context) if isinstance(entries, dict) else None
    aiding = replace(aiding, sensors=with_gate(aiding.sensors, gate))
    return aiding, read_filter(entries, aiding.sensors, navigation.imu, context)
