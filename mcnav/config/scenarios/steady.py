"""``type = "cruise"`` and ``type = "hover"``: the systems of "The Story of 84 Minutes" in a campaign file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from mcnav.config.scenarios.base import FileContext, ScenarioSpec
from mcnav.config.schema import Acceleration, Duration, Length, Speed, Table
from mcnav.constants import EARTH_RADIUS, TN_GRAVITY
from mcnav.errors import Problem
from mcnav.physics.steady.truth import Earth, SteadyFlight
from mcnav.scenarios.protocol import ScenarioError
from mcnav.scenarios.steady import LONGEST, Cruise

SHORTEST_RADIUS: Final = 1e3


class SteadyTable(Table):
    """What cruise and hover have in common."""

    duration: Annotated[Duration, Field(gt=0.0, le=LONGEST)] | None = None
    altitude: Annotated[Length, Field(ge=0.0, le=1e8)] = 0.0
    altitude_channel: Literal["slaved", "inertial"]
    platform: Literal["inertial", "level"] = "inertial"
    earth_radius: Annotated[Length, Field(ge=SHORTEST_RADIUS, le=1e15)] = EARTH_RADIUS
    gravity: Annotated[Acceleration, Field(gt=0.0, le=1e4)] = TN_GRAVITY


class CruiseTable(SteadyTable):
    """``[scenario]`` of type cruise."""

    type: Literal["cruise"]
    speed: Annotated[Speed, Field(ge=0.0)]
    distance: Annotated[Length, Field(gt=0.0)] | None = None
    altitude_channel: Literal["slaved", "inertial"] = "slaved"


class HoverTable(SteadyTable):
    """``[scenario]`` of type hover."""

    type: Literal["hover"]
    altitude_channel: Literal["slaved", "inertial"] = "inertial"


def _duration(table: CruiseTable | HoverTable, place: FileContext, problems: list[Problem]) -> float | None:
    """Flying time, s: given, or by the distance along the earth's surface."""
    distance = table.distance if isinstance(table, CruiseTable) else None
    if table.duration is not None and distance is not None:
        problems.append(Problem(place.file, "scenario.distance", "got with a duration; keep one"))
        return None
    if table.duration is not None:
        return table.duration
    if distance is None or not isinstance(table, CruiseTable):
        wanted = "; give it, or a distance" if isinstance(table, CruiseTable) else ""
        problems.append(Problem(place.file, "scenario.duration", f"is missing{wanted}"))
        return None
    length = distance * (table.earth_radius + table.altitude) / table.earth_radius
    if table.speed * LONGEST < length:
        problems.append(Problem(place.file, "scenario.distance", "takes more than ten days at that speed"))
        return None
    return length / table.speed


def read_scenario(
    table: CruiseTable | HoverTable, entries: Mapping[str, Any], place: FileContext, problems: list[Problem]
) -> ScenarioSpec | None:
    """The scenario of a table; mistakes are added to the list."""
    duration = _duration(table, place, problems)
    if duration is None:
        return None
    flight = SteadyFlight(
        altitude=table.altitude,
        speed=table.speed if isinstance(table, CruiseTable) else 0.0,
        duration=duration,
        slaved=table.altitude_channel == "slaved",
        level=table.platform == "level",
        earth=Earth.with_gravity(table.earth_radius, table.gravity),
    )
    try:
        scenario = Cruise(flight)
    except ScenarioError as wrong:
        problems.append(Problem(place.file, f"scenario.{wrong.key}", str(wrong)))
        return None
    defaults = {
        "altitude": f"{table.altitude!r} m",
        "altitude_channel": table.altitude_channel,
        "platform": table.platform,
        "earth_radius": f"{table.earth_radius!r} m",
        "gravity": f"{table.gravity!r} m/s^2",
    }
    return ScenarioSpec(scenario, {**defaults, **entries})
