"""``type = "cruise"`` and ``type = "hover"``: the systems of "The Story of 84 Minutes"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from mcnav.contract.scenario import ScenarioError
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Acceleration, Duration, Length, Speed, Table
from mcnav.physics.constants import EARTH_RADIUS, TN_GRAVITY
from mcnav.systems.description import ScenarioSpec, ScenarioType
from mcnav.systems.steady.scenario import LONGEST, OUTPUTS, SOURCES, Cruise
from mcnav.systems.steady.truth import Earth, SteadyFlight

SHORTEST_RADIUS: Final = 1e3
"""Smallest earth radius accepted, m."""


AltitudeChannel = Annotated[
    Literal["slaved", "inertial"], Field(description="Altitude from an external altimeter, or from the accelerometers.")
]


class SteadyTable(Table):
    """Common keys of cruise and hover."""

    duration: Annotated[Duration, Field(gt=0.0, le=LONGEST, description="Duration of navigation.")] | None = None
    altitude: Annotated[Length, Field(ge=0.0, le=1e8, description="Altitude, which is held.")] = 0.0
    altitude_channel: AltitudeChannel
    platform: Annotated[
        Literal["inertial", "level"],
        Field(description="Platform that keeps its directions at the start, or one that follows the vertical."),
    ] = "inertial"
    earth_radius: Annotated[
        Length, Field(ge=SHORTEST_RADIUS, le=1e15, description="Radius of the earth, which does not rotate.")
    ] = EARTH_RADIUS
    gravity: Annotated[Acceleration, Field(gt=0.0, le=1e4, description="Gravity at that radius.")] = TN_GRAVITY


class CruiseTable(SteadyTable):
    """``[scenario]`` of type cruise."""

    type: Annotated[Literal["cruise"], Field(description="A flight along a great circle.")]
    speed: Annotated[Speed, Field(ge=0.0, description="Speed at altitude.")]
    distance: Annotated[
        Length, Field(gt=0.0, description="Distance along the earth's surface, in place of a duration.")
    ] | None = None  # fmt: skip
    altitude_channel: AltitudeChannel = "slaved"


class HoverTable(SteadyTable):
    """``[scenario]`` of type hover."""

    type: Annotated[Literal["hover"], Field(description="A vehicle at rest.")]
    altitude_channel: AltitudeChannel = "inertial"


def _duration(table: CruiseTable | HoverTable) -> float:
    """Return the duration, s: as given, or from the distance along the earth's surface."""
    distance = table.distance if isinstance(table, CruiseTable) else None
    if table.duration is not None:
        if distance is not None:
            raise ScenarioError("distance", "got with a duration; keep one")
        return table.duration
    if distance is None or not isinstance(table, CruiseTable):
        remedy = "; give it, or a distance" if isinstance(table, CruiseTable) else ""
        raise ScenarioError("duration", f"is missing{remedy}")
    length = distance * (table.earth_radius + table.altitude) / table.earth_radius
    if table.speed * LONGEST < length:
        raise ScenarioError("distance", "takes more than ten days at that speed")
    return length / table.speed


def read_scenario(table: CruiseTable | HoverTable, entries: Mapping[str, Any], context: FileContext) -> ScenarioSpec:
    """Build the scenario.

    Raises `ScenarioError` when its duration is missing, stated twice or too long, or the flight is impossible.
    """
    flight = SteadyFlight(
        altitude=table.altitude,
        speed=table.speed if isinstance(table, CruiseTable) else 0.0,
        duration=_duration(table),
        slaved=table.altitude_channel == "slaved",
        level=table.platform == "level",
        earth=Earth.with_gravity(table.earth_radius, table.gravity),
    )
    defaults = {
        "altitude": f"{table.altitude!r} m",
        "altitude_channel": table.altitude_channel,
        "platform": table.platform,
        "earth_radius": f"{table.earth_radius!r} m",
        "gravity": f"{table.gravity!r} m/s^2",
    }
    return ScenarioSpec(Cruise(flight), {**defaults, **entries})


CRUISE: Final = ScenarioType(CruiseTable, read_scenario, SOURCES, OUTPUTS)
HOVER: Final = ScenarioType(HoverTable, read_scenario, SOURCES, OUTPUTS)
