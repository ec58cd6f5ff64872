"""Segments of a trajectory's entry: ``{ hold = "60 s" }``, ``{ turn = "90 deg", bank = "25 deg" }``."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

from pydantic import BeforeValidator, Field, WithJsonSchema

from mcnav.entries.quantities import UNIT, AngularRate, Duration, Length, Table
from mcnav.entries.rules import NotBoth, Rule
from mcnav.entries.unions import ByKey
from mcnav.physics.units import UnitError, quantity
from mcnav.systems.ins.tables.motion import Angle, Forward, Latitude, Longitude, Pull
from mcnav.systems.ins.truth import segments as flown

Steepness = Annotated[Angle, Field(gt=0.0, le=1.4)]
"""Climb angle and bank: up to 80 deg."""
Elapsed = Annotated[Duration, Field(gt=0.0, le=flown.LONGEST)]
TurnRate = Annotated[AngularRate, Field(gt=0.0, le=10.0)]
Bank = Annotated[Steepness | None, Field(description="Bank angle of a turn; 20 deg unless given.")]
RateOfTurn = Annotated[TurnRate | None, Field(description="Rate of turn, in place of a bank.", examples=["3 deg/s"])]
RollRate = Annotated[TurnRate, Field(description="Largest roll rate.", examples=["5 deg/s"])]

BANK_OR_RATE: Final[tuple[Rule, ...]] = (NotBoth("bank", "rate"),)


def _length_or_time(value: object) -> tuple[str, float]:
    try:
        return "s", quantity(value, "s")
    except UnitError:
        return "m", quantity(value, "m")


class HoldTable(Table):
    """``{ hold = "60 s" }``."""

    hold: Annotated[Elapsed, Field(description="Time for which the vehicle goes on as it is: at rest, or straight.")]

    def segment(self) -> flown.Segment:
        """Return the segment."""
        return flown.Hold(self.hold)


class StraightTable(Table):
    """``{ straight = "50 km" }`` or ``{ straight = "10 min" }``."""

    straight: Annotated[
        tuple[str, Annotated[float, Field(gt=0.0, le=1e9)]],
        BeforeValidator(_length_or_time),
        WithJsonSchema({UNIT: "", "examples": ["50 km", "10 min"]}),
        Field(description="Length or duration of a flight straight on."),
    ]

    def segment(self) -> flown.Segment:
        """Return the segment."""
        unit, size = self.straight
        return flown.Hold(size) if unit == "s" else flown.Straight(size)


class SpeedTable(Table):
    """``{ speed = "80 m/s", acceleration = "2 m/s^2" }``."""

    speed: Annotated[Forward, Field(description="Speed at the end of the segment.")]
    acceleration: Annotated[Pull, Field(description="Largest acceleration.")] = flown.ACCELERATION

    def segment(self) -> flown.Segment:
        """Return the segment."""
        return flown.SpeedChange(self.speed, self.acceleration)


class ClimbTable(Table):
    """``{ climb = "3 km", angle = "5 deg", acceleration = "0.2 g" }``; a descent is a negative climb."""

    climb: Annotated[Length, Field(ge=-1e8, le=1e8, description="Altitude gained; a descent is negative.")]
    angle: Annotated[Steepness, Field(description="Climb angle.")] = flown.CLIMB_ANGLE
    acceleration: Annotated[Pull, Field(description="Largest acceleration across the path.")] = (
        flown.NORMAL_ACCELERATION
    )

    def segment(self) -> flown.Segment:
        """Return the segment."""
        return flown.Climb(self.climb, self.angle, self.acceleration)


class TurnTable(Table):
    """``{ turn = "-90 deg", bank = "25 deg", roll_rate = "5 deg/s" }``; in place of a bank, a ``rate`` of turn.

    To the right is positive.
    """

    rules: ClassVar[tuple[Rule, ...]] = BANK_OR_RATE
    turn: Annotated[Angle, Field(ge=-1e3, le=1e3, description="Change of course; to the right is positive.")]
    bank: Bank = None
    rate: RateOfTurn = None
    roll_rate: RollRate = flown.ROLL_RATE

    def segment(self) -> flown.Segment:
        """Return the segment."""
        return flown.Turn(self.turn, self.bank, self.rate, self.roll_rate)


class PlaceTable(Table):
    """A way point."""

    latitude: Annotated[Latitude, Field(description="Geodetic latitude.")]
    longitude: Annotated[Longitude, Field(description="Longitude.")]


class WayPointTable(Table):
    """``{ to = { latitude = "48 deg", longitude = "11 deg" }, bank = "25 deg" }``."""

    rules: ClassVar[tuple[Rule, ...]] = BANK_OR_RATE
    to: Annotated[PlaceTable, Field(description="Way point, reached by a turn and a geodesic.")]
    bank: Bank = None
    rate: RateOfTurn = None
    roll_rate: RollRate = flown.ROLL_RATE

    def segment(self) -> flown.Segment:
        """Return the segment."""
        return flown.WayPoint(self.to.latitude, self.to.longitude, self.bank, self.rate, self.roll_rate)


Segment = Annotated[
    HoldTable | StraightTable | SpeedTable | ClimbTable | TurnTable | WayPointTable,
    ByKey("it is one of"),
    Field(description="A segment of the flight."),
]
"""A segment by the key that names its kind."""
