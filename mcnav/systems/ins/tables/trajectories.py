"""``trajectory`` of a campaign: a file, a reentry of NASA TN D-1772 on a globe, segments, a boost, or a swaying base.

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

[scenario.trajectory.sway]
latitude = "47 deg"
longitude = "9 deg"
duration = "10 min"
roll = { amplitude = "5 deg", period = "9 s" }
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from mcnav.caches.recent import Recent
from mcnav.entries.context import FileContext
from mcnav.entries.files import read_file
from mcnav.entries.inputs import InputFile
from mcnav.entries.quantities import Table
from mcnav.entries.validation import validate_entry
from mcnav.entries.values import SettingError
from mcnav.files.whole import INPUTS
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.tables.tracks import FileRows, read_rows
from mcnav.systems.ins.tables.trajectory_file import LARGEST_FILE
from mcnav.systems.ins.tables.trajectory_tables import (
    BoostTable,
    FileTable,
    ReentryTable,
    SegmentsTable,
    SwayTable,
    Trajectory,
)
from mcnav.systems.ins.truth import segments as flown
from mcnav.systems.ins.truth.boost import Boost, BoostError, Stage, boost_truth
from mcnav.systems.ins.truth.reentry import Plane, reentry_truth
from mcnav.systems.ins.truth.rows import TrajectoryError, TrajectoryRows, check_rows, rows_from
from mcnav.systems.ins.truth.sway import ANGLES, SHIFTS, Oscillation, Sway, sway_rows
from mcnav.systems.ins.truth.trajectory import Truth
from mcnav.systems.reentry.table_i import TABLE_I, start_state
from mcnav.systems.reentry.truth import fly_truth
from mcnav.systems.reentry.vehicle import Vehicle

_RECENT: Final = Recent[tuple[Truth, TrajectoryRows]](most=2)
"""Trajectories of the campaigns read last, which variations of a campaign share."""

_RECENT_FILES: Final = Recent[tuple[Truth, FileRows]](most=2)
"""Those from files."""

FORM: Final[TypeAdapter[FileTable | ReentryTable | SegmentsTable | BoostTable | SwayTable]] = TypeAdapter(Trajectory)

KEY: Final = "scenario.trajectory"
"""Key of the entry; its last part is the setting that names the file."""


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
    origin : float
        Time stamp of a file at time zero, s.
    remarks : tuple of str
        What was assumed of a file, and noticed, a clause each.
    """

    label: str
    truth: Truth
    rows: TrajectoryRows
    resolved: str | Mapping[str, Any]
    file: InputFile | None = None
    origin: float = 0.0
    remarks: tuple[str, ...] = ()


def read_trajectory(
    entry: object, earth: Earth, context: FileContext, columns: Mapping[str, str] | None = None
) -> TrajectorySpec | None:
    """Build the trajectory of an entry; mistakes are added to the context.

    Parameters
    ----------
    entry : object
        A path, or a table with ``file``, ``reentry``, ``segments``, ``boost`` or ``sway``.
    columns : mapping, optional
        Names and units of the columns of a path: ``columns`` beside ``trajectory``.
    """
    before = len(context.problems)
    content = _read(entry, earth, context, columns, KEY)
    return content if len(context.problems) == before else None


def _read(
    entry: object, earth: Earth, context: FileContext, columns: Mapping[str, str] | None, key: str
) -> TrajectorySpec | None:
    if isinstance(entry, str):
        return _from_file(FileTable(file=entry, columns=dict(columns or {})), entry, earth, context, key)
    if columns:
        context.problem("scenario.columns", "belongs to a trajectory that is a path; leave it out")
    table = validate_entry(FORM, entry, context, key)
    if table is None or not isinstance(entry, Mapping):
        return None
    build = BUILDERS[type(table)]
    return build(table, entry, earth, context, key)


def _from_file(
    table: FileTable, entry: str | Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    path = context.folder / table.file
    try:
        if _size(path) > LARGEST_FILE:  # before its content is digested
            raise SettingError(f"{path} is longer than {LARGEST_FILE:,} bytes")
        file = read_file(table.file, key.rpartition(".")[2], context)

        def read() -> tuple[Truth, FileRows]:
            result = read_rows(Path(file.path), table, earth, file.digest)
            return result.rows.truth(earth), result

        named = tuple(sorted(table.columns.items())), table.attitude, table.topic
        truth, result = _RECENT_FILES.get((file.digest, file.name, named, earth), read)
    except SettingError as wrong:
        context.problem(key, str(wrong))
        return None
    except TrajectoryError as wrong:
        context.problem(key, f"{path}: {wrong}")
        return None
    place = f"{INPUTS}/{file.name}"
    resolved = place if isinstance(entry, str) else {**entry, "file": place}
    return TrajectorySpec(Path(table.file).name, truth, result.rows, resolved, file, result.origin, result.remarks)


def _size(path: Path) -> int:
    """Return the length of a file; zero where there is none, or its name is none."""
    try:
        return path.stat().st_size if path.is_file() else 0
    except OSError:
        return 0


def _from_reentry(
    table: ReentryTable, entry: Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    if earth.body != "earth":
        context.problem(f"{key}.reentry", f"is one on the earth, and the scenario's is {earth.body}; give another one")
        return None

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
    segments = [segment.segment() for segment in table.segments]
    at = table.start
    start = flown.Start(at.latitude, at.longitude, at.altitude, at.course, at.speed)

    def fly() -> tuple[Truth, TrajectoryRows]:
        rows = flown.fly_segments(start, segments, table.rate, earth)
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
        Stage(stage.acceleration, stage.last or stage.acceleration, stage.burn, stage.pause) for stage in at.stages
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


def _from_sway(
    table: SwayTable, entry: Mapping[str, Any], earth: Earth, context: FileContext, key: str
) -> TrajectorySpec | None:
    at = table.sway
    moving = [(name, getattr(at, name)) for name in (*ANGLES, *SHIFTS)]
    oscillations = tuple(
        (name, Oscillation(motion.amplitude, motion.period)) for name, motion in moving if motion is not None
    )
    sway = Sway(at.latitude, at.longitude, at.altitude, at.heading, at.duration, oscillations)

    def fly() -> tuple[Truth, TrajectoryRows]:
        rows = sway_rows(sway, earth)
        check_rows(rows, earth)
        return rows.truth(earth), rows

    try:
        truth, rows = _RECENT.get((repr(sway), earth), fly)
    except TrajectoryError as wrong:
        context.problem(f"{key}.sway", str(wrong))
        return None
    defaults = {"altitude": f"{at.altitude!r} m", "heading": f"{at.heading!r} rad"}
    return TrajectorySpec("swaying base", truth, rows, {"sway": {**defaults, **entry["sway"]}})


BUILDERS: Final[Mapping[type[Table], Callable[..., TrajectorySpec | None]]] = {
    FileTable: _from_file,
    ReentryTable: _from_reentry,
    SegmentsTable: _from_segments,
    BoostTable: _from_boost,
    SwayTable: _from_sway,
}
"""Functions that build a trajectory from its table."""
