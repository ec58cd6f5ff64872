"""Tables of a trajectory's entry, one for each kind."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, WithJsonSchema

from mcnav.entries.files import FILE
from mcnav.entries.quantities import Duration, Length, QuantityIn, Table
from mcnav.entries.unions import ByKey
from mcnav.systems.ins.tables.motion import Angle, Azimuth, Forward, Height, Latitude, Longitude, Pull
from mcnav.systems.ins.tables.segments import Segment
from mcnav.systems.ins.truth.boost import RAMP
from mcnav.systems.ins.truth.rows import COLUMNS

Columns = Annotated[
    dict[str, str],
    WithJsonSchema(
        {
            "type": "object",
            "properties": {
                name: {
                    "type": "string",
                    "description": f"Name of the column {name} in the file, with a unit in brackets.",
                }
                for name in COLUMNS
            },
            "additionalProperties": False,
        }
    ),
    Field(description='Names of the file\'s columns, with units: lat = "latitude [rad]".'),
]
"""Names of columns by those of `COLUMNS`; the reader of the file checks them."""


class FileTable(Table):
    """``{ file = "flight.csv", columns = { lat = "latitude [rad]" } }``."""

    file: Annotated[
        str,
        Field(
            description="Trajectory file (CSV, parquet), or a track (.pos, .nmea, .gpx, .ulg, .bag, …), beside the "
            "campaign file or below it."
        ),
    ]
    columns: Columns = Field(default_factory=dict)
    attitude: Annotated[
        Literal["from-velocity", "coordinated-turn"] | None,
        Field(description="Attitude of a track that has none: along the velocity, or banked in turns as well."),
    ] = None
    topic: Annotated[str | None, Field(description="Topic of a log that holds several tracks.", examples=["/fix"])] = (
        None
    )


class ReentryTable(Table):
    """``{ reentry = 4, latitude = ..., longitude = ..., azimuth = ... }``: by default along the equator, eastwards."""

    reentry: Annotated[int, Field(ge=1, le=7, description="Row of Table I of NASA TN D-1772.")]
    latitude: Annotated[Latitude, Field(description="Latitude of the place where the range angle is zero.")] = 0.0
    longitude: Annotated[Longitude, Field(description="Longitude of that place.")] = 0.0
    azimuth: Annotated[Azimuth, Field(description="Azimuth of the plane there.")] = np.pi / 2.0


class StartTable(Table):
    """Place and motion at the beginning of the first segment."""

    latitude: Annotated[Latitude, Field(description="Geodetic latitude.")]
    longitude: Annotated[Longitude, Field(description="Longitude.")]
    altitude: Annotated[Height, Field(description="Altitude above the ellipsoid.")] = 0.0
    course: Annotated[Azimuth, Field(description="Course over ground, from north to east.")] = 0.0
    speed: Annotated[Forward, Field(description="Speed over the earth.")] = 0.0


class SegmentsTable(Table):
    """``{ start = { ... }, segments = [ ... ], rate = "10 Hz" }``."""

    segments: Annotated[
        list[Segment], Field(min_length=1, max_length=10_000, description="Segments, one after the other.")
    ]
    start: Annotated[StartTable, Field(description="Place and motion at the beginning.")]
    rate: Annotated[
        float, QuantityIn("1/s"), Field(ge=0.01, le=10_000.0, description="Rate of the trajectory's rows.")
    ] = 10.0


class StageTable(Table):
    """``{ acceleration = "1.3 g", last = "3.5 g", burn = "120 s", pause = "2 s" }``.

    By default the last acceleration is the first.
    """

    acceleration: Annotated[Pull, Field(description="Acceleration by the thrust, at first.")]
    last: Annotated[Pull | None, Field(description="Acceleration by the thrust, at last.")] = None
    burn: Annotated[Duration, Field(ge=2.0 * RAMP, le=1e4, description="Duration of the thrust.")]
    pause: Annotated[Duration, Field(ge=0.0, le=1e5, description="Time without thrust before the stage.")] = 0.0


class LaunchTable(Table):
    """``boost``: site, azimuth, stages, and the pitch program up to the gravity turn."""

    latitude: Annotated[Latitude, Field(description="Geodetic latitude of the launch site.")]
    longitude: Annotated[Longitude, Field(description="Longitude of the launch site.")]
    azimuth: Annotated[Azimuth, Field(description="Launch azimuth.")]
    altitude: Annotated[Height, Field(description="Altitude of the launch site.")] = 0.0
    stages: Annotated[list[StageTable], Field(min_length=1, max_length=10, description="Stages in order.")]
    rise: Annotated[Duration, Field(ge=RAMP, le=1e3, description="Time of vertical flight.")] = 10.0
    kick: Annotated[Angle, Field(gt=0.0, le=1.0, description="Angle of the pitch-over.")] = math.radians(3.0)
    kick_time: Annotated[Duration, Field(gt=0.0, le=1e3, description="Duration of the pitch-over.")] = 10.0
    coast: Annotated[Duration, Field(ge=0.0, le=1e5, description="Free flight after the last stage.")] = 0.0


class BoostTable(Table):
    """``{ boost = { ... } }``."""

    boost: Annotated[LaunchTable, Field(description="Ballistic boost with a gravity turn.")]


class SwingTable(Table):
    """``{ amplitude = "5 deg", period = "9 s" }``."""

    amplitude: Annotated[Angle, Field(ge=0.0, le=1.0, description="Amplitude of the sine.", examples=["5 deg"])]
    period: Annotated[Duration, Field(ge=0.1, le=1e4, description="Period of the sine.", examples=["9 s"])]


class ShiftTable(Table):
    """``{ amplitude = "0.5 m", period = "9 s" }``."""

    amplitude: Annotated[Length, Field(ge=0.0, le=100.0, description="Amplitude of the sine.", examples=["0.5 m"])]
    period: Annotated[Duration, Field(ge=0.1, le=1e4, description="Period of the sine.", examples=["9 s"])]


class MooringTable(Table):
    """``sway``: a place, a mean heading, and oscillations about them, each a sine that begins at zero."""

    latitude: Annotated[Latitude, Field(description="Geodetic latitude.")]
    longitude: Annotated[Longitude, Field(description="Longitude.")]
    altitude: Annotated[Height, Field(description="Altitude above the ellipsoid.")] = 0.0
    heading: Annotated[Azimuth, Field(description="Mean heading.")] = 0.0
    duration: Annotated[Duration, Field(ge=1.0, le=1e6, description="Duration of the trajectory.")]
    yaw: Annotated[SwingTable | None, Field(description="Oscillation of the heading.")] = None
    pitch: Annotated[SwingTable | None, Field(description="Oscillation of the pitch.")] = None
    roll: Annotated[SwingTable | None, Field(description="Oscillation of the roll.")] = None
    surge: Annotated[ShiftTable | None, Field(description="Oscillation forward.")] = None
    drift: Annotated[ShiftTable | None, Field(description="Oscillation to the right.")] = None
    heave: Annotated[ShiftTable | None, Field(description="Oscillation down.")] = None


class SwayTable(Table):
    """``{ sway = { ... } }``."""

    sway: Annotated[MooringTable, Field(description="Swaying base: at rest on the average.")]


Trajectory = Annotated[
    FileTable | ReentryTable | SegmentsTable | BoostTable | SwayTable,
    ByKey(
        "expected a table with one of",
        "expected a file in quotes, or a table with file, reentry, segments, boost or sway",
        FILE.pattern,
    ),
]
"""Entry of a trajectory: a table, or the path of a file."""
