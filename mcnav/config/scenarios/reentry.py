"""``type = "reentry"``: the system of NASA TN D-1772 in a campaign file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from mcnav.config.scenarios.base import FileContext, ScenarioSpec
from mcnav.config.schema import AreaPerMass, Duration, Length, Number, Speed, Table, TimePerLength
from mcnav.constants import BALLISTIC_COEFFICIENT, EARTH_RADIUS
from mcnav.errors import Problem
from mcnav.physics.reentry.vehicle import ConstantLift, LiftLaw, VariableLift, Vehicle
from mcnav.scenarios.protocol import ScenarioError
from mcnav.scenarios.reentry import Flight, Reentry
from mcnav.scenarios.table_i import TABLE_I, common_start, start_state


class ConstantLiftTable(Table):
    """``lift_law = { type = "constant", lift_to_drag = 0.235 }``."""

    type: Literal["constant"]
    lift_to_drag: Annotated[Number, Field(ge=-10.0, le=10.0)]


class VariableLiftTable(Table):
    """``lift_law = { type = "variable", gain = "3.281 s/km", limit = 0.5 }``."""

    type: Literal["variable"]
    gain: Annotated[TimePerLength, Field(gt=0.0)]
    limit: Annotated[Number, Field(gt=0.0, le=10.0)]


class FirstPointTable(Table):
    """Where the truth begins, as NASA TN D-1772, eq. (18): ranges are r_E theta and r_E theta_dot."""

    altitude: Annotated[Length, Field(gt=0.0)]
    range: Length
    altitude_rate: Speed
    range_rate: Speed


class ReentryTable(Table):
    """``[scenario]`` of type reentry."""

    type: Literal["reentry"]
    trajectory: Annotated[int, Field(ge=1, le=7)] | None = None
    first_point: FirstPointTable | None = None
    lift_law: Annotated[ConstantLiftTable | VariableLiftTable, Field(discriminator="type")] | None = None
    ballistic: Annotated[AreaPerMass, Field(ge=0.0, le=100.0)] | None = None
    final_altitude: Length | None = None
    start: Duration | None = None
    axes: Literal["start", "trajectory"] = "start"
    accelerometers_off_above: Annotated[Length, Field(gt=0.0)] | None = None


def _read_flight(table: ReentryTable, place: FileContext, problems: list[Problem]) -> Flight | None:
    """What to fly: a row of Table I, with whatever is spelled out in its place."""
    row = None if table.trajectory is None else TABLE_I[table.trajectory]
    law: LiftLaw | None = row.lift_law if row else None
    if table.lift_law is not None:
        spelled = table.lift_law
        law = (
            ConstantLift(spelled.lift_to_drag)
            if spelled.type == "constant"
            else VariableLift(spelled.gain, spelled.limit)
        )
    final_altitude = table.final_altitude
    if final_altitude is None and row is not None:
        final_altitude = row.final_altitude
    for key, value in (("lift_law", law), ("final_altitude", final_altitude)):
        if value is None:
            problems.append(
                Problem(place.file, f"scenario.{key}", "is missing; give it, or a trajectory of Table I by its number")
            )
    if table.first_point is not None and table.trajectory is not None:
        problems.append(
            Problem(place.file, "scenario.first_point", "got with a trajectory of Table I, which has its own; keep one")
        )
    if law is None or final_altitude is None:
        return None
    if table.first_point is not None:
        at = table.first_point
        first: tuple[float, ...] = (
            EARTH_RADIUS + at.altitude,
            at.range / EARTH_RADIUS,
            at.altitude_rate,
            at.range_rate / EARTH_RADIUS,
        )
    else:
        first = start_state(table.trajectory) if table.trajectory else tuple(common_start())
    ballistic = BALLISTIC_COEFFICIENT if table.ballistic is None else table.ballistic
    return Flight(
        first_point=first,
        vehicle=Vehicle(law, ballistic),
        final_altitude=final_altitude,
        start=table.start,
        axes=table.axes,
        accelerometers_off_above=table.accelerometers_off_above,
    )


def read_scenario(
    table: ReentryTable, entries: Mapping[str, Any], place: FileContext, problems: list[Problem]
) -> ScenarioSpec | None:
    """The scenario of a table; mistakes are added to the list."""
    flight = _read_flight(table, place, problems)
    if flight is None:
        return None
    try:
        scenario = Reentry(flight)
    except ScenarioError as wrong:
        problems.append(Problem(place.file, f"scenario.{wrong.key}", str(wrong)))
        return None
    law = flight.vehicle.lift_law
    lift: dict[str, Any] = (
        {"type": "constant", "lift_to_drag": law.lift_to_drag}
        if isinstance(law, ConstantLift)
        else {"type": "variable", "gain": f"{law.gain!r} s/m", "limit": law.limit}
    )
    defaults = {
        "lift_law": lift,
        "ballistic": f"{flight.vehicle.ballistic_coefficient!r} m^2/kg",
        "final_altitude": f"{flight.final_altitude!r} m",
        "axes": flight.axes,
    }
    return ScenarioSpec(scenario, {**defaults, **entries})
