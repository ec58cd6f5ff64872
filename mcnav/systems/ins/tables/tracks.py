"""Trajectories from tracks: positions of a receiver or of a navigation system, with their attitude or without.

trajectory = { file = "drive.pos", attitude = "from-velocity" }

Positions scatter, so that the trajectory keeps within five of their sigmas, or two metres, instead of passing through
them. Where there is no attitude, the vehicle heads along its velocity and is level across it, or banks so that the
specific force has no part across it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.errors import CampaignError
from mcnav.files.whole import read_whole
from mcnav.logs.column_names import named
from mcnav.logs.px4 import POSITIONS
from mcnav.logs.track import Track, read_track
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84, Earth, local_axes
from mcnav.systems.ins.tables.trajectory_file import LARGEST_FILE, read_trajectory_file
from mcnav.systems.ins.tables.trajectory_tables import FileTable
from mcnav.systems.ins.truth.rows import TrajectoryError, TrajectoryRows, check_rows, rows_from
from mcnav.systems.ins.truth.trajectory import Truth

ENDINGS: Final = (".pos", ".nmea", ".gpx", ".ulg", ".bag", ".db3", ".mcap", ".nav")
"""Endings of files that hold tracks, not trajectories of `mcnav.systems.ins.tables.trajectory_file`."""

Attitude = Literal["from-velocity", "coordinated-turn"]

NAMES: Final = {
    "time": "time", "lat": "latitude", "lon": "longitude", "alt": "altitude", "VN": "velocity_north",
    "VE": "velocity_east", "VD": "velocity_down", "roll": "roll", "pitch": "pitch", "heading": "heading",
}  # fmt: skip
"""Keys of `mcnav.logs.track` by those of a trajectory's columns."""

SCATTER: Final = 2.0
"""Distance from positions without sigmas within which the trajectory keeps, m."""

SIGMAS: Final = 5.0
"""Sigmas of the positions within which it keeps: of a million normal errors the largest is one of 4.9 sigma."""

MOVING: Final = 1.0
"""Horizontal speed above which the velocity has a direction, m/s."""

FOREIGN: Final = np.radians(30.0)
"""Root mean square of heading less course above which the attitude does not follow the motion, rad."""

ROWS_OF_MOTION: Final = 10
"""Rows in motion from which heading and course are compared."""


ASSUMED: Final[Mapping[str, str]] = {
    "from-velocity": "the attitude is not recorded; it is taken along the velocity, without a bank",
    "coordinated-turn": "the attitude is not recorded; it is taken along the velocity, banked as in coordinated turns",
}
"""Assumption of the attitude."""


@dataclass(frozen=True)
class FileRows:
    """Rows of a trajectory from a file.

    Attributes
    ----------
    rows : TrajectoryRows
    origin : float
        Time stamp at time zero, s.
    remarks : tuple of str
        What was assumed, and noticed, a clause each.
    """

    rows: TrajectoryRows
    origin: float = 0.0
    remarks: tuple[str, ...] = ()


def read_rows(
    path: Path,
    table: FileTable,
    earth: Earth = WGS84,
    sha256: str | None = None,
    otherwise: Attitude | None = None,
) -> FileRows:
    """Read a trajectory file, or a track.

    Parameters
    ----------
    sha256 : str, optional
        Digest by which the file was identified: another content is not read.
    otherwise : str, optional
        Attitude of a track that has none and whose table states none.

    Raises
    ------
    TrajectoryError
        When it cannot be read or describes no flight: with row and column, what came, and what would do.
    """
    if table.attitude is None and table.topic is None and Path(table.file).suffix.lower() not in ENDINGS:
        rows = read_trajectory_file(path, table.columns, earth, sha256)
        return FileRows(rows, remarks=remarks_on_heading(rows, rows.truth(earth)))
    track = _read(path, table, sha256)
    rows = _with_scatter(track, earth)
    remarks = [f"{Path(table.file).name}: {note}" for note in track.notes]
    attitude = table.attitude or (otherwise if track.attitude is None else None)
    if attitude is not None:
        rows = replace(rows, angles=angles_along(rows.truth(earth), track.time, attitude))
        remarks.append(ASSUMED[attitude])
    elif track.attitude is None:
        raise TrajectoryError(
            f'has no attitude; trajectory = {{ file = "{table.file}", attitude = "from-velocity" }} takes it from the '
            'velocity, "coordinated-turn" with a bank in turns'
        )
    truth = rows.truth(earth)
    check_rows(rows_from(truth, track.time), earth)
    if (distance := rows.departure(truth)) > 1e-6:
        remarks.append(f"the trajectory keeps within {distance:.3g} m of the recorded positions")
    return FileRows(rows, track.start, (*remarks, *remarks_on_heading(rows, truth)))


def _read(path: Path, table: FileTable, sha256: str | None) -> Track:
    """Read a track, with an attitude or without as its table says."""
    columns, units = _columns(table)
    try:
        if sha256 is not None and hashlib.sha256(read_whole(path, LARGEST_FILE)).hexdigest() != sha256:
            raise TrajectoryError("has changed while it was read; run the command again")
        track = read_track(path, columns, units)
    except OSError as failure:
        raise TrajectoryError(f"cannot be read: {failure.strerror or failure}") from None
    except CampaignError as wrong:
        problem = wrong.problems[0]
        key = "topic" if problem.key == "columns.topic" else problem.key  # a key of the trajectory's table
        raise TrajectoryError(": ".join(filter(None, (key, problem.message)))) from None
    return track


def _columns(table: FileTable) -> tuple[dict[str, str], dict[str, str]]:
    """Return the columns and units of a track from those of a trajectory, and its topic."""
    unknown = [name for name in table.columns if name not in NAMES]
    if unknown:
        raise TrajectoryError(
            f"columns.{unknown[0]}: no such column of a trajectory; expected one of {', '.join(NAMES)}"
        )
    columns = {NAMES[name]: written for name, written in table.columns.items()}
    units = {NAMES[name]: unit for name, written in table.columns.items() if (unit := named(written).unit)}
    if Path(table.file).suffix.lower() == ".ulg":
        # what the controller has estimated, to which its attitude belongs
        columns["topic"] = table.topic or POSITIONS[-1]
    elif table.topic is not None:
        columns["topic"] = table.topic
    return columns, units


def _with_scatter(track: Track, earth: Earth) -> TrajectoryRows:
    """Return the rows of a track, with the scatter of its positions as their resolution."""
    sigma = track.position_sigma
    scatter = np.full(3, SCATTER) if sigma is None else SIGMAS * np.median(sigma, axis=0)
    meridian, prime = earth.curvature_radii(track.latitude[:1])
    level = float(prime[0] * np.cos(track.latitude[0]))
    resolution = (float(scatter[0] / meridian[0]), float(scatter[1] / level), float(scatter[2]))
    angles = np.zeros((len(track.time), 3)) if track.attitude is None else track.attitude[:, ::-1]
    return TrajectoryRows(track.time, track.latitude, track.longitude, track.altitude, angles, None, resolution)


def angles_along(truth: Truth, times: Array, attitude: Attitude) -> Array:
    """Return heading, pitch and roll of a vehicle that heads along its velocity, shape (n, 3), rad.

    Where it moves by less than `MOVING` it turns evenly from one direction to the next. In a coordinated turn of the
    course χ, ``tan(roll) = v dχ/dt / g``.

    Raises `TrajectoryError` where it does not move.
    """
    velocity = rows_from(truth, times).velocity
    assert velocity is not None
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = np.flatnonzero(speed > MOVING)
    if len(moving) < ROWS_OF_MOTION:
        raise TrajectoryError(
            f"moves in {len(moving)} rows at more than {MOVING:g} m/s, which give no attitude; give one in the file"
        )
    course = np.unwrap(np.arctan2(velocity[moving, 1], velocity[moving, 0]))
    climb = np.arctan2(-velocity[moving, 2], speed[moving])
    heading, pitch = np.interp(times, times[moving], course), np.interp(times, times[moving], climb)
    roll = np.zeros(len(times))
    if attitude == "coordinated-turn":
        turning = np.interp(times, times[moving], np.gradient(course, times[moving]))
        roll = np.where(speed > MOVING, np.arctan(speed * turning / STANDARD_GRAVITY), 0.0)
    return np.stack([heading, pitch, roll], axis=1)


def remarks_on_heading(rows: TrajectoryRows, truth: Truth) -> tuple[str, ...]:
    """Notice a heading that does not follow the course over ground where the vehicle moves."""
    axes = local_axes(rows.latitude, rows.longitude)
    velocity = np.einsum("nji,nj->ni", axes, truth.earth_fixed(rows.time)[1])
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING
    if moving.sum() < ROWS_OF_MOTION:
        return ()
    course, heading = np.arctan2(velocity[moving, 1], velocity[moving, 0]), rows.angles[moving, 0]
    difference = (heading - course + np.pi) % (2.0 * np.pi) - np.pi
    departure = float(np.sqrt(np.mean(difference**2)))
    if departure <= FOREIGN:
        return ()
    still = " stays the same and" if np.ptp(np.unwrap(heading)) < 1e-6 else ""
    return (
        f"the heading{still} departs from the course over ground by {np.degrees(departure):.0f} deg (rms) in motion. "
        "The attitude may not belong to this motion",
    )
