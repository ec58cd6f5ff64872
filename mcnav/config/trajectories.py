"""``trajectory`` of a campaign: a file, a reentry of NASA TN D-1772 on a globe, segments, or a boost.

trajectory = "flight.csv"
trajectory = { file = "flight.csv", columns = { lat = "latitude [rad]" } }
trajectory = { reentry = 4, latitude = "28 deg", longitude = "-80 deg", azimuth = "60 deg" }

[scenario.trajectory]
start = { latitude = "47 deg", longitude = "9 deg", altitude = "500 m", course = "80 deg" }
segments = [{ hold = "60 s" }, { speed = "80 m/s" }, { climb = "3 km" }, { turn = "90 deg" }, { straight = "50 km" }]

[scenario.trajectory.boost]
latitude = "28.5 deg"
longitude = "-80.5 deg"
azimuth = "90 deg"
stages = [{ acceleration = "1.3 g", last = "3.5 g", burn = "120 s" }]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from mcnav._recent import Recent
from mcnav.config.context import FileContext
from mcnav.config.files import read_file
from mcnav.config.schema import UNIT, Acceleration, AngularRate, Duration, Length, QuantityIn, Speed, Table
from mcnav.config.trajectory_file import LARGEST_FILE, read_trajectory_file
from mcnav.config.validation import validate
from mcnav.errors import suggestion
from mcnav.physics.ins import segments as flown
from mcnav.physics.ins.boost import RAMP, Boost, BoostError, Stage, boost_truth
from mcnav.physics.ins.earth import Earth
from mcnav.physics.ins.reentry import Plane, reentry_truth
from mcnav.physics.ins.rows import TrajectoryError, TrajectoryRows, check_rows, rows_from
from mcnav.physics.ins.truth import Truth
from mcnav.physics.reentry.truth import fly_truth
from mcnav.physics.reentry.vehicle import Vehicle
from mcnav.scenarios.inputs import InputFile
from mcnav.scenarios.settings import SettingError
from mcnav.scenarios.table_i import TABLE_I, start_state
from mcnav.store.inputs import INPUTS
from mcnav.units import UnitError, quantity

_RECENT: Final = Recent[tuple[Truth, TrajectoryRows]](most=2)
"""Trajectories of the campaigns read last, which variations of a campaign share."""

KEY: Final = "scenario.trajectory"
"""Key of the entry; its last part is the setting that names the file."""

Angle = Annotated[float, QuantityIn("rad")]
Latitude = Annotated[Angle, Field(gt=-np.pi / 2.0, lt=np.pi / 2.0)]
Longitude = Annotated[Angle, Field(ge=-2.0 * np.pi, le=2.0 * np.pi)]
Azimuth = Annotated[Angle, Field(ge=-2.0 * np.pi, le=2.0 * np.pi)]
Steepness = Annotated[Angle, Field(gt=0.0, le=1.4)]
"""Climb angle and bank: up to 80 deg."""
Height = Annotated[Length, Field(ge=-15e3, le=1e8)]
Elapsed = Annotated[Duration, Field(gt=0.0, le=flown.LONGEST)]
Forward = Annotated[Speed, Field(ge=0.0, le=20e3)]
Pull = Annotated[Acceleration, Field(gt=0.0, le=1e3)]
TurnRate = Annotated[AngularRate, Field(gt=0.0, le=10.0)]
Bank = Annotated[Steepness | None, Field(description="Bank angle of a turn; 20 deg unless given.")]
RateOfTurn = Annotated[TurnRate | None, Field(description="Rate of turn, in place of a bank.", examples=["3 deg/s"])]
RollRate = Annotated[TurnRate, Field(description="Largest roll rate.", examples=["5 deg/s"])]


def _length_or_time(value: object) -> tuple[str, float]:
    try:
        return "s", quantity(value, "s")
    except UnitError:
        return "m", quantity(value, "m")


class FileTable(Table):
    """``{ file = "flight.csv", columns = { lat = "latitude [rad]" } }``."""

    file: Annotated[str, Field(description="Trajectory file, CSV or parquet, beside the campaign file or below it.")]
    columns: Annotated[
        dict[str, str] | None, Field(description='Names of the file\'s columns, with units: lat = "latitude [rad]".')
    ] = None


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

    start: Annotated[StartTable, Field(description="Place and motion at the beginning.")]
    segments: Annotated[
        list[dict[str, Any]], Field(min_length=1, max_length=10_000, description="Segments, one after the other.")
    ]
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


TRAJECTORIES: Final[Mapping[str, type[Table]]] = {
    "file": FileTable,
    "reentry": ReentryTable,
    "segments": SegmentsTable,
    "boost": BoostTable,
}
"""Tables of trajectories by the key that names their kind."""


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


@dataclass(frozen=True)
class TrajectorySpec:
    """A trajectory built from its entry.

    Attributes
    ----------
    label : str
        What it is, in a few words.
    rows : TrajectoryRows
        As in the file; of other trajectories the rows of the truth.
    file : InputFile, optional
        File that the run depends on.
    resolved : str or mapping
        Entry with every default spelled out, with the path that a file has in a run folder.
    """

    label: str
    truth: Truth
    rows: TrajectoryRows
    resolved: str | Mapping[str, Any]
    file: InputFile | None = None


def read_trajectory(
    entry: object, earth: Earth, context: FileContext, columns: Mapping[str, str] | None = None
) -> TrajectorySpec | None:
    """Build the trajectory of an entry; mistakes are added to the context.

    Parameters
    ----------
    entry : object
        A path, or a table with ``file``, ``reentry``, ``segments`` or ``boost``.
    columns : mapping, optional
        Names and units of the columns of a path: ``columns`` beside ``trajectory``.
    """
    before = len(context.problems)
    found = _read(entry, earth, context, columns, KEY)
    return found if len(context.problems) == before else None


def _read(
    entry: object, earth: Earth, context: FileContext, columns: Mapping[str, str] | None, key: str
) -> TrajectorySpec | None:
    if isinstance(entry, str):
        return _from_file(FileTable(file=entry, columns=dict(columns or {})), entry, earth, context, key)
    if columns:
        context.problem("scenario.columns", "belongs to a trajectory that is a path; leave it out")
    if not isinstance(entry, Mapping):
        context.problem(key, "expected a file in quotes, or a table with file, reentry, segments or boost")
        return None
    named = [kind for kind in TRAJECTORIES if kind in entry]
    if len(named) != 1:
        came = f"got {' and '.join(named)}" if named else "has no kind"
        context.problem(key, f"{came}; expected a table with one of {', '.join(TRAJECTORIES)}")
        return None
    builders: Mapping[str, Callable[..., TrajectorySpec | None]] = {
        "file": _from_file,
        "reentry": _from_reentry,
        "segments": _from_segments,
        "boost": _from_boost,
    }
    table = validate(TRAJECTORIES[named[0]], entry, context, key)
    return None if table is None else builders[named[0]](table, entry, earth, context, key)


def _from_file(
    table: FileTable, entry: str | Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    path = context.folder / table.file
    try:
        if _size(path) > LARGEST_FILE:  # before its content is digested
            raise SettingError(f"{path} is longer than {LARGEST_FILE:,} bytes")
        file = read_file(table.file, key.rpartition(".")[2], context)

        def read() -> tuple[Truth, TrajectoryRows]:
            rows = read_trajectory_file(Path(file.path), table.columns, earth, file.digest)
            return rows.truth(earth), rows

        named = tuple(sorted((table.columns or {}).items()))
        truth, rows = _RECENT.get(("file", file.digest, file.name, named, earth), read)
    except SettingError as wrong:
        context.problem(key, str(wrong))
        return None
    except TrajectoryError as wrong:
        context.problem(key, f"{path}: {wrong}")
        return None
    place = f"{INPUTS}/{file.name}"
    resolved = place if isinstance(entry, str) else {**entry, "file": place}
    return TrajectorySpec(Path(table.file).name, truth, rows, resolved, file)


def _size(path: Path) -> int:
    """Return the length of a file; zero where there is none, or its name is none."""
    try:
        return path.stat().st_size if path.is_file() else 0
    except OSError:
        return 0


def _from_reentry(
    table: ReentryTable, entry: Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec:

    def fly() -> tuple[Truth, TrajectoryRows]:
        row = TABLE_I[table.reentry]
        planar = fly_truth(np.array(start_state(table.reentry)), Vehicle(row.lift_law), row.final_altitude)
        truth = reentry_truth(planar, earth, Plane.at(table.latitude, table.longitude, table.azimuth))
        return truth, rows_from(truth, truth.times)

    truth, rows = _RECENT.get((repr(table), earth), fly)
    defaults = {name: f"{getattr(table, name)!r} rad" for name in ("latitude", "longitude", "azimuth")}
    label = f"trajectory {table.reentry} of NASA TN D-1772"
    return TrajectorySpec(label, truth, rows, {**defaults, **entry})


def _from_segments(
    table: SegmentsTable, entry: Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    segments = [_read_segment(each, context, f"{key}.segments #{n}") for n, each in enumerate(table.segments, start=1)]
    at = table.start
    start = flown.Start(at.latitude, at.longitude, at.altitude, at.course, at.speed)
    if any(segment is None for segment in segments):
        return None

    def fly() -> tuple[Truth, TrajectoryRows]:
        rows = flown.fly_segments(start, [each for each in segments if each is not None], table.rate, earth)
        check_rows(rows, earth)
        return rows.truth(earth), rows

    try:
        truth, rows = _RECENT.get((repr((start, segments, table.rate)), earth), fly)
    except flown.SegmentError as wrong:
        context.problem(f"{key}.segments #{wrong.number}", str(wrong))
        return None
    except TrajectoryError as wrong:
        context.problem(f"{key}.segments", str(wrong))
        return None
    label = f"flight of {len(segments)} segments"
    return TrajectorySpec(label, truth, rows, {"rate": f"{table.rate!r} Hz", **entry})


def _from_boost(
    table: BoostTable, entry: Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    at = table.boost
    stages = tuple(
        Stage(each.acceleration, each.last or each.acceleration, each.burn, each.pause) for each in at.stages
    )
    boost = Boost(at.latitude, at.longitude, at.azimuth, stages, at.altitude, at.rise, at.kick, at.kick_time, at.coast)

    def fly() -> tuple[Truth, TrajectoryRows]:
        truth = boost_truth(boost, earth)
        return truth, rows_from(truth, truth.times)

    try:
        truth, rows = _RECENT.get((repr(boost), earth), fly)
    except BoostError as wrong:
        context.problem(f"{key}.boost.{wrong.key}", str(wrong))
        return None
    defaults = {name: f"{getattr(at, name)!r} s" for name in ("rise", "kick_time", "coast")}
    defaults |= {"altitude": f"{at.altitude!r} m", "kick": f"{at.kick!r} rad"}
    resolved = {"boost": {**defaults, **entry["boost"]}}
    return TrajectorySpec(f"boost of {len(stages)} stages", truth, rows, resolved)


def _read_segment(entry: Mapping[str, Any], context: FileContext, key: str) -> flown.Segment | None:
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
