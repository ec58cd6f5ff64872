"""What recorded files are not: units, held rows, clocks, exchanged or negated columns, found without a filter.

Each check compares two records of the same motion, and speaks only where the motion tells them apart. A specific force
has the size of gravity in the median. Velocities integrate to positions. Gyros turn as the track does. The readings,
turned by their own gyros, are the track's acceleration less gravity in axes that stand still (`force_match`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedMeasurements, Recording
from mcnav.judgement.axes_match import UPRIGHT, apart_fault, scale_fault, upward_share
from mcnav.judgement.column_match import velocity_fault
from mcnav.judgement.force_match import ForceMatch, clock_fault, heading_fault, mirror_fault
from mcnav.judgement.local_track import local_metres, speeds
from mcnav.judgement.turn_match import turn_clock_fault, turn_fault
from mcnav.physics.constants import STANDARD_GRAVITY

IMU: Final = "imu"
START: Final = "start"

GRAVITIES: Final = {"g": 1.0, "mg": 1e3, "ug": 1e6, "cm/s^2": 1e2 * STANDARD_GRAVITY}
"""Size of gravity in units other than m/s^2."""

NEAR: Final = 0.2
"""Share by which the median specific force of a vehicle may differ from gravity."""

MOVING: Final = 1.0
"""Speed from which a track has a course, m/s."""

HELD: Final = 0.02
"""Share of repeated rows of a moving receiver from which its fixes are held."""

HELD_READINGS: Final = 0.2
"""Share of repeated rows from which readings are held."""

FAR: Final = 1000.0
"""Distance between the start and the first fix that no campaign means, m, beside ten of its sigmas."""


@dataclass(frozen=True)
class Fault:
    """What a file is not.

    Attributes
    ----------
    subject : str
        `IMU`, `START`, or the name of a sensor.
    message : str
        Without the file's name and a full stop.
    """

    subject: str
    message: str


def find_fault(
    recording: Recording, position_sigma: float = 0.0, heading_sigma: float = 0.0, scale_sigma: float = 0.0
) -> Fault | None:
    """Return the first fault of a recorded flight, the most basic first; none where there is none to be seen.

    Parameters
    ----------
    position_sigma, heading_sigma : float
        Of the campaign's initial errors, m and rad: a start within them is no fault.
    scale_sigma : float
        Of the campaign's scale factors, the largest.
    """
    if message := _force_fault(recording.accelerometer) or _held_readings(recording):
        return Fault(IMU, message)
    for name, measured in recording.measurements.items():
        if message := _held_rows(measured) or _far_from_start(recording, measured, position_sigma):
            return Fault(name, message)
        if message := velocity_fault(measured):
            return Fault(name, message)
    for name, measured in recording.measurements.items():
        match = ForceMatch.of(recording, measured)
        if match is not None:
            if message := clock_fault(match):
                return Fault(name, message)
            if fault := _axes_fault(recording, match, name, scale_sigma):
                return fault
        if (match is None or not match.agrees) and (message := turn_clock_fault(recording, measured)):
            return Fault(name, message)
        if message := turn_fault(recording, measured):
            return Fault(IMU, message)
        if message := _heading_columns(measured):
            return Fault(name, message)
        if match is not None and recording.start is not None and recording.start.attitude is not None:
            heading = float(recording.start.attitude[0, 2])
            if message := heading_fault(match, heading, heading_sigma):
                return Fault(START, message)
    return None


def _axes_fault(recording: Recording, match: ForceMatch, name: str, scale_sigma: float) -> Fault | None:
    """Return a fault of axes: of a mirrored track, unless gravity at the start says that readings are mirrored."""
    up = upward_share(recording)
    upside_down = up is not None and up < UPRIGHT
    if not upside_down and (message := mirror_fault(match)):
        return Fault(name, message)
    if message := apart_fault(recording, match) or scale_fault(recording, match, scale_sigma):
        return Fault(IMU, message)
    return None


def _force_fault(force: Array) -> str:
    """Say in which unit specific forces are, where it is not m/s^2."""
    size = float(np.median(np.linalg.norm(force[:: max(len(force) // 100_000, 1)], axis=1)))
    for unit, gravity in GRAVITIES.items():
        if abs(size / gravity - 1.0) < NEAR:
            return (
                f"the specific force is {size:.4g} m/s^2 in the median, gravity is {STANDARD_GRAVITY:.4g}: it is in "
                f"{unit}; --unit accelerometer={unit}"
            )
    return ""


def _held_readings(recording: Recording) -> str:
    values = np.concatenate([recording.gyro, recording.accelerometer], axis=1)
    if np.ptp(values, axis=0).max() == 0.0:
        return ""
    share = float(np.mean(np.all(np.diff(values, axis=0) == 0.0, axis=1)))
    if share < HELD_READINGS:
        return ""
    return (
        f"{share:.0%} of the rows repeat the readings of the row before: readings are held between samples; keep the "
        "first row of each"
    )


def _held_rows(measured: RecordedMeasurements) -> str:
    """Say that fixes are held until the next: rows that repeat the one before although the receiver moves."""
    quantities = [name for name in ("position", "velocity", "altitude", "heading", "body_velocity")
                  if name in measured.values]  # fmt: skip
    if "position" not in quantities and "velocity" not in quantities and "body_velocity" not in quantities:
        return ""
    table = np.concatenate([measured.values[name] for name in quantities], axis=1)
    same = np.all(np.diff(table, axis=0) == 0.0, axis=1)
    moving = speeds(measured)[1:] > MOVING
    if np.sum(moving) < 10 or np.mean(same[moving]) < HELD:
        return ""
    every = float(np.median(np.diff(measured.times[1:][~same]))) if np.sum(~same) > 1 else np.nan
    return (
        f"{np.sum(same & moving):,} of {len(table):,} rows repeat the row before while the vehicle moves: fixes are "
        f"held until the next, about every {every:.3g} s; keep the first row of each"
    )


def _far_from_start(recording: Recording, measured: RecordedMeasurements, sigma: float) -> str:
    """Say that the first fix is not where navigation starts: latitude and longitude exchanged, or a wrong sign."""
    start = recording.start
    if start is None or "position" not in measured.values:
        return ""
    first = measured.values["position"][0]
    allowed = max(FAR, 10.0 * sigma) + 400.0 * max(float(measured.times[0]), 0.0)

    def apart(position: Array) -> float:
        return float(np.linalg.norm(local_metres(np.stack([start.position[0], position]))[1]))

    if apart(first) <= allowed:
        return ""
    others = {
        "latitude and longitude are exchanged": first[[1, 0, 2]],
        "longitude has the wrong sign": first * (1.0, -1.0, 1.0),
        "latitude has the wrong sign": first * (-1.0, 1.0, 1.0),
        "altitude has the wrong sign": first * (1.0, 1.0, -1.0),
    }
    told = next((f": {words}" for words, position in others.items() if apart(position) <= allowed), "")
    return f"the first fix is {apart(first) / 1e3:,.4g} km from where navigation starts{told}"


def _heading_columns(measured: RecordedMeasurements) -> str:
    """Say that headings of a sensor count otherwise than clockwise from north, by the course of its own track."""
    velocity = measured.values.get("velocity")
    headings = measured.values.get("heading")
    if headings is None and "attitude" in measured.values:
        headings = measured.values["attitude"][:, 2:]
    if velocity is None or headings is None:
        return ""
    fast = np.hypot(velocity[:, 0], velocity[:, 1]) > 3.0 * MOVING
    course = np.arctan2(velocity[:, 1], velocity[:, 0])[fast]
    return heading_law(headings[fast, 0], course)


def heading_law(heading: Array, course: Array) -> str:
    """Say how headings follow courses, both shape (n,) in rad, where it is not as they should.

    >>> turn = np.linspace(0.0, 3.0, 50)
    >>> heading_law(turn + 0.1, turn), heading_law(turn + np.pi, turn)
    ('', 'the heading is opposite to the course all along: it is turned by 180 deg')
    >>> heading_law(np.pi / 2 - turn, turn)
    'the heading falls where the course rises: it is counted counter-clockwise from east'
    """
    if len(course) < 10:
        return ""
    same, mirrored = np.mean(np.exp(1j * (heading - course))), np.mean(np.exp(1j * (heading + course)))
    steady = np.abs(np.mean(np.exp(1j * course))) > 0.97
    if np.abs(mirrored) > 0.95 and np.abs(same) < 0.9 and not steady:
        offset = np.degrees(np.angle(mirrored))
        begins = {0.0: "north", 90.0: "east", 180.0: "south", -180.0: "south", -90.0: "west"}
        near = min(begins, key=lambda angle: abs(angle - offset))
        return f"the heading falls where the course rises: it is counted counter-clockwise from {begins[near]}"
    offset = np.degrees(np.angle(same))
    if np.abs(same) > 0.95 and abs(offset) > 160.0:
        return "the heading is opposite to the course all along: it is turned by 180 deg"
    if np.abs(same) > 0.95 and not steady and abs(abs(offset) - 90.0) < 15.0:
        return f"the heading is {offset:.0f} deg from the course all along: it is counted from another direction"
    return ""
