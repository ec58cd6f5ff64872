"""Segments of a trajectory's entry: ``{ hold = "60 s" }``, ``{ turn = "90 deg", bank = "25 deg" }``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field, WithJsonSchema

from mcnav.entries.context import FileContext
from mcnav.entries.quantities import UNIT, AngularRate, Duration, Length, Table
from mcnav.entries.validation import validate
from mcnav.errors import suggestion
from mcnav.systems.ins.tables.trajectory_tables import Angle, Forward, Latitude, Longitude, Pull
from mcnav.systems.ins.truth import segments as flown
from mcnav.units import UnitError, quantity

Steepness = Annotated[Angle, Field(gt=0.0, le=1.4)]
"""Climb angle and bank: up to 80 deg."""
Elapsed = Annotated[Duration, Field(gt=0.0, le=flown.LONGEST)]
TurnRate = Annotated[AngularRate, Field(gt=0.0, le=10.0)]
Bank = Annotated[Steepness | None, Field(description="Bank angle of a turn; 20 deg unless given.")]
RateOfTurn = Annotated[TurnRate | None, Field(description="Rate of turn, in place of a bank.", examples=["3 deg/s"])]
RollRate = Annotated[TurnRate, Field(description="Largest roll rate.", examples=["5 deg/s"])]


def _length_or_time(value: object) -> tuple[str, float]:
    try:
        return "s", quantity(value, "s")
    except UnitError:
        return "m", quantity(value, "m")


class HoldTable(Table):
    """``{ hold = "60 s" }``."""

    hold: Annotated[Elapsed, Field(description="Time for which the vehicle goes on as it is: at rest, or straight.")]


class StraightTable(Table):
    """``{ straight = "50 km" }`` or ``{ straight = "10 min" }``."""

    straight: Annotated[
        tuple[str, Annotated[float, Field(gt=0.0, le=1e9)]],
        BeforeValidator(_length_or_time),
        WithJsonSchema({UNIT: "", "examples": ["50 km", "10 min"]}),
        Field(description="Length or duration of a flight straight on."),
    ]


class SpeedTable(Table):
    """``{ speed = "80 m/s", acceleration = "2 m/s^2" }``."""

    speed: Annotated[Forward, Field(description="Speed at the end of the segment.")]
    acceleration: Annotated[Pull, Field(description="Largest acceleration.")] = flown.ACCELERATION


class ClimbTable(Table):
    """``{ climb = "3 km", angle = "5 deg", acceleration = "0.2 g" }``; a descent is a negative climb."""

    climb: Annotated[Length, Field(ge=-1e8, le=1e8, description="Altitude gained; a descent is negative.")]
    angle: Annotated[Steepness, Field(description="Climb angle.")] = flown.CLIMB_ANGLE
    acceleration: Annotated[Pull, Field(description="Largest acceleration across the path.")] = (
        flown.NORMAL_ACCELERATION
    )


class TurnTable(Table):
    """``{ turn = "-90 deg", bank = "25 deg", roll_rate = "5 deg/s" }``; in place of a bank, a ``rate`` of turn.

    To the right is positive.
    """

    turn: Annotated[Angle, Field(ge=-1e3, le=1e3, description="Change of course; to the right is positive.")]
    bank: Bank = None
    rate: RateOfTurn = None
    roll_rate: RollRate = flown.ROLL_RATE


class PlaceTable(Table):
    """A way point."""

    latitude: Annotated[Latitude, Field(description="Geodetic latitude.")]
    longitude: Annotated[Longitude, Field(description="Longitude.")]


class WayPointTable(Table):
    """``{ to = { latitude = "48 deg", longitude = "11 deg" }, bank = "25 deg" }``."""

    to: Annotated[PlaceTable, Field(description="Way point, reached by a turn and a geodesic.")]
    bank: Bank = None
    rate: RateOfTurn = None
    roll_rate: RollRate = flown.ROLL_RATE


def _straight(table: StraightTable) -> flown.Segment:
    unit, size = table.straight
    return flown.Hold(size) if unit == "s" else flown.Straight(size)


def _turn(table: TurnTable) -> flown.Segment:
    return flown.Turn(table.turn, table.bank, table.rate, table.roll_rate)


def _way_point(table: WayPointTable) -> flown.Segment:
    return flown.WayPoint(table.to.latitude, table.to.longitude, table.bank, table.rate, table.roll_rate)


SEGMENTS: Final[Mapping[str, tuple[type[Table], Callable[[Any], flown.Segment]]]] = {
    "hold": (HoldTable, lambda table: flown.Hold(table.hold)),
    "straight": (StraightTable, _straight),
    "speed": (SpeedTable, lambda table: flown.SpeedChange(table.speed, table.acceleration)),
    "climb": (ClimbTable, lambda table: flown.Climb(table.climb, table.angle, table.acceleration)),
    "turn": (TurnTable, _turn),
    "to": (WayPointTable, _way_point),
}
"""Segments by the key that names their kind."""


def read_segment(entry: Mapping[str, Any], context: FileContext, key: str) -> flown.Segment | None:
    """Read a segment by the key that names its kind; mistakes are added to the context."""
    named = [kind for kind in SEGMENTS if kind in entry]
    if len(named) != 1:
        unknown = next((name for name in entry if name not in SEGMENTS), "")
        hint = suggestion(unknown, list(SEGMENTS)) if unknown and not named else f"; it is one of {', '.join(SEGMENTS)}"
        context.problem(key, f"{'got ' + ' and '.join(named) if named else 'has no kind'}{hint}")
        return None
    model, build = SEGMENTS[named[0]]
    table = validate(model, entry, context, key)
    if table is None:
        return None
    if isinstance(table, (TurnTable, WayPointTable)) and table.bank is not None and table.rate is not None:
        context.problem(f"{key}.rate", "got with a bank; keep one")
        return None
    return build(table)
