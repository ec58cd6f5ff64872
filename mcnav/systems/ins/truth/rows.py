"""The rows of a trajectory, and the checks that they describe a flight which can be interpolated.

Rows are counted from one, without the header; `TrajectoryError.of_file` names the line of a text file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.files.lines import place_of_row
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.physics.units import printable
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.truth.smoothing import is_rough, spline_within
from mcnav.systems.ins.truth.trajectory import Truth

LONGEST_MESSAGE: Final = 600
"""Characters."""

LARGEST: Final = 1e12
"""Largest number of any column."""

FEWEST_ROWS: Final = 4
"""Rows that a cubic spline needs."""

POSITION: Final = ("lat", "lon", "alt")
VELOCITY: Final = ("VN", "VE", "VD")
ANGLES: Final = ("heading", "pitch", "roll")
COLUMNS: Final = ("time", *POSITION, *VELOCITY, *reversed(ANGLES))
"""Columns of a trajectory file in order: time, position, velocity, and roll, pitch, heading."""

LARGEST_GAP: Final = 10.0
"""Largest step of time over the median step."""

POLE_DISTANCE: Final = 10e3
"""Distance from the earth's axis, m, within which north and east are refused as directions."""

ALTITUDES: Final = (-15e3, 1e8)
"""Lowest and highest altitude, m: below the deepest sea, and a quarter of the way to the moon."""

LARGEST_FORCE: Final = 100.0
"""Largest specific force that positions may imply, standard gravities."""

LARGEST_TURN: Final = np.pi / 2.0
"""Largest rotation between neighbouring rows, rad: beyond it the direction of the turn is a guess."""

GROSS: Final = 0.5
"""Velocities whose disagreement with the positions has this share of the speed (rms) are another vehicle's."""

JUMP_SHARE: Final = 0.2
JUMP_MEDIANS: Final = 50.0
JUMP_SPEED: Final = 1.0
"""A step of position is a jump where its rate departs from the velocity by 1 m/s plus a fifth of the rms speed, or plus
fifty times the median departure if that is more."""

MOVING: Final = 1.0
"""Speed, m/s, above which the direction and size of a velocity say something about units."""

SMALLEST_TOLERANCE: Final = 1e-6
"""Distance, m, within which a spline that does not interpolate keeps in any case."""

PER_RADIAN: Final = float(np.degrees(1.0))

EXCHANGED: Final = (
    (PER_RADIAN, "radians that are read as degrees"),
    (1.0 / PER_RADIAN, "degrees that are read as radians"),
)
"""Factors that undo an exchange of degrees and radians."""

MISTAKEN_TOGETHER: Final = (("lat", "lon"), ("lat",), ("lon",))
"""Columns whose unit may be mistaken together."""

EXCHANGE_SHARE: Final = 0.1
"""Degrees and radians are exchanged where that brings positions and velocities to agree to this share of the speed."""


class TrajectoryError(ValueError):
    """Rows that describe no flight.

    Attributes
    ----------
    place : str
        Row and column, such as ``row 12, column lat``; empty for the whole.
    row : int or None
    column : str
    message : str
        What is wrong, without the place.
    """

    def __init__(self, message: str, row: int | None = None, column: str = "", path: Path | None = None) -> None:
        self.message, self.row, self.column = message, row, column
        where = "" if row is None else f"row {row:,}" if path is None else place_of_row(path, row - 1)
        parts = (where, column and f"column {column}")
        self.place = ", ".join(filter(None, parts))
        super().__init__(printable(": ".join(filter(None, (self.place, message))), LONGEST_MESSAGE))

    def of_file(self, path: Path) -> TrajectoryError:
        """Return the same error with the row as a line of a file, if the file is a text."""
        return TrajectoryError(self.message, self.row, self.column, path)


@dataclass(frozen=True)
class Disagreement:
    """The difference of given velocities from the derivative of the positions, m/s.

    Attributes
    ----------
    rms, largest : float
        Of the length of the difference.
    row : int
        Of the largest, counted from one.
    time : float
        Of the largest, s.
    """

    rms: float
    largest: float
    row: int
    time: float


@dataclass(frozen=True)
class TrajectoryRows:
    """Rows of a trajectory, n of them, in SI units and rad.

    Attributes
    ----------
    time, latitude, longitude, altitude : ndarray, shape (n,)
    angles : ndarray, shape (n, 3)
        Heading, pitch, roll: successive rotations about down, right, forward.
    velocity : ndarray, shape (n, 3), optional
        North, east, down, over the earth. The truth is the derivative of the positions; these are only compared.
    resolution : (float, float, float)
        Unit of the last decimal of latitude and longitude (rad) and altitude (m); zero where positions are exact.
    """

    time: Array
    latitude: Array
    longitude: Array
    altitude: Array
    angles: Array
    velocity: Array | None = None
    resolution: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __len__(self) -> int:
        return len(self.time)

    def truth(self, earth: Earth) -> Truth:
        """Interpolate the rows; where the decimals of their positions are too few, within their last decimal."""
        truth = Truth.through(earth, self.time, self.latitude, self.longitude, self.altitude, self.angles)
        meridian, prime = earth.curvature_radii(self.latitude[:1])
        north, east, down = self.resolution
        level = float(prime[0] * np.cos(self.latitude[0]))
        tolerance = np.maximum([north * float(meridian[0]), east * level, down], SMALLEST_TOLERANCE)
        if not is_rough(self.time, tolerance):
            return truth
        position = earth.from_geodetic(self.latitude, self.longitude, self.altitude)
        spline = spline_within(self.time, position, local_axes(self.latitude, self.longitude), tolerance)
        return truth if spline is None else replace(truth, position=spline)

    def departure(self, truth: Truth) -> float:
        """Return the largest distance of the positions from a truth, m."""
        position = truth.earth.from_geodetic(self.latitude, self.longitude, self.altitude)
        return float(np.max(np.linalg.norm(position - truth.earth_fixed(self.time)[0], axis=1)))

    def disagreement(self, truth: Truth) -> Disagreement | None:
        """Compare the given velocities with the derivative of the positions; None without velocities."""
        if self.velocity is None:
            return None
        axes = local_axes(self.latitude, self.longitude)
        derived = np.einsum("nji,nj->ni", axes, truth.earth_fixed(self.time)[1])
        difference = np.linalg.norm(self.velocity - derived, axis=1)
        row = int(np.argmax(difference))
        rms = float(np.sqrt(np.mean(difference**2)))
        return Disagreement(rms, float(difference[row]), row + 1, float(self.time[row]))


def check_rows(rows: TrajectoryRows, earth: Earth) -> None:
    """Check that rows describe a flight.

    Raises
    ------
    TrajectoryError
        With row and column: what came, and what would do.
    """
    _check_number(rows)
    _check_times(rows.time)
    _check_ranges(rows)
    position = earth.from_geodetic(rows.latitude, rows.longitude, rows.altitude)
    _check_poles(rows, position)
    if rows.velocity is not None:
        _check_units_of_position(rows, rows.velocity, earth)
        _check_units_of_heading(rows, rows.velocity)
        _check_velocities(rows, rows.velocity, position)
    _check_force(rows, position, earth)
    _check_turns(rows)


def _first(wrong: NDArray[np.bool_]) -> int | None:
    """Return the index of the first entry that is true; None when there is none."""
    place = int(np.argmax(wrong))
    return place if wrong[place] else None


def _check_number(rows: TrajectoryRows) -> None:
    if len(rows) < FEWEST_ROWS:
        raise TrajectoryError(f"has {len(rows)} rows; an interpolation needs {FEWEST_ROWS} or more")
    columns = dict(zip(COLUMNS, (rows.time, rows.latitude, rows.longitude, rows.altitude), strict=False))
    columns |= {name: rows.angles[:, axis] for axis, name in enumerate(ANGLES)}
    if rows.velocity is not None:
        columns |= {name: rows.velocity[:, axis] for axis, name in enumerate(VELOCITY)}
    for name, values in columns.items():
        row = _first(~(np.abs(values) <= LARGEST))
        if row is not None:
            expected = f"expected a finite number of at most {LARGEST:g}"
            raise TrajectoryError(f"got {_written(values[row])}; {expected}", row + 1, name)


def _written(value: float) -> str:
    return "no number" if np.isnan(value) else f"{value:.12g}"


def _check_times(time: Array) -> None:
    steps = np.diff(time)
    row = _first(steps <= 0.0)
    if row is not None:
        now, before = time[row + 1], time[row]
        word = "the same time as in the row before" if now == before else f"which falls from {before:.12g} s"
        raise TrajectoryError(f"got {now:.12g} s, {word}; times must rise from row to row", row + 2, "time")
    median = float(np.median(steps))
    row = _first(steps > LARGEST_GAP * median)
    if row is not None:
        raise TrajectoryError(
            f"follows a gap of {steps[row]:.6g} s, where the median step is {median:.6g} s (at most {LARGEST_GAP:g} "
            "times that is allowed). Fill in the missing rows, or keep one side of the gap",
            row + 2, "time",
        )  # fmt: skip


def _check_ranges(rows: TrajectoryRows) -> None:
    latitude, longitude, pitch = np.degrees([rows.latitude, rows.longitude, rows.angles[:, 1]])
    for name, values, most in (("lat", latitude, 90.0), ("lon", longitude, 360.0), ("pitch", pitch, 90.0)):
        # headings of 450 deg and rolls of -200 deg are directions; these are not
        row = _first(np.abs(values) > most * (1.0 + 1e-12))
        if row is None:
            continue
        farthest = np.max(np.abs(values))
        remedy = f"it lies between -{most:g} and {most:g} deg"
        if farthest > 4.0 * most and farthest / PER_RADIAN <= most:
            remedy += "; these may be degrees that are read as radians"
        elif name == "lat" and np.max(np.abs(longitude)) <= 90.0:
            remedy += "; lat and lon may be swapped"
        raise TrajectoryError(f"got {values[row]:.9g} deg; {remedy}", row + 1, name)
    low, high = ALTITUDES
    row = _first((rows.altitude < low) | (rows.altitude > high))
    if row is not None:
        message = f"got {rows.altitude[row]:.9g} m; altitudes are positive upwards, from {low:g} to {high:g} m"
        raise TrajectoryError(message, row + 1, "alt")


def _check_poles(rows: TrajectoryRows, position: Array) -> None:
    """Find the step that passes nearest to the earth's axis."""
    begin, step = position[:-1, :2], np.diff(position[:, :2], axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    share = np.clip(-(begin * step).sum(axis=1) / length, 0.0, 1.0)
    distance = np.linalg.norm(begin + share[:, None] * step, axis=1)
    row = _first(distance < POLE_DISTANCE)
    if row is not None:
        place = row + (share[row] > 0.5)
        raise TrajectoryError(
            f"comes within {POLE_DISTANCE / 1e3:g} km of a pole (at {np.degrees(rows.latitude[place]):.6g} deg), where "
            "north and east turn with every step; keep the part before or after",
            int(place) + 1, "lat",
        )  # fmt: skip


def _step_rates(position: Array, time: Array) -> Array:
    return np.asarray(np.diff(position, axis=0) / np.diff(time)[:, None])


def _check_units_of_position(rows: TrajectoryRows, velocity: Array, earth: Earth) -> None:
    """Refuse angles whose derivative agrees with the velocities when degrees and radians are exchanged."""
    given = (velocity[:-1, :2] + velocity[1:, :2]) / 2.0
    speed = np.hypot(*given.T)
    moving = speed > MOVING
    if moving.sum() < FEWEST_ROWS:
        return

    def departure(latitude: Array, longitude: Array) -> float:
        """Return the median difference from the velocities as a share of the speed."""
        meridian, prime = earth.curvature_radii(latitude)
        north = np.diff(latitude) * (meridian + rows.altitude)[1:]
        east = _wrapped(np.diff(longitude)) * ((prime + rows.altitude) * np.cos(latitude))[1:]
        derived = np.stack([north, east], axis=1) / np.diff(rows.time)[:, None]
        return float(np.median(np.hypot(*(derived - given)[moving].T) / speed[moving]))

    units = departure(rows.latitude, rows.longitude)
    if units < GROSS:
        return
    for factor, mistaken in EXCHANGED:
        for names in MISTAKEN_TOGETHER:
            latitude = rows.latitude * (factor if "lat" in names else 1.0)
            longitude = rows.longitude * (factor if "lon" in names else 1.0)
            if np.max(np.abs(latitude)) <= np.pi / 2.0 and departure(latitude, longitude) < EXCHANGE_SHARE:
                written = "columns " + " and ".join(names) if len(names) > 1 else f"column {names[0]}"
                raise TrajectoryError(
                    f"{written}: the positions' derivative differs from VN and VE by {100.0 * units:.0f} % of the "
                    f"speed; these may be {mistaken}"
                )


def _check_units_of_heading(rows: TrajectoryRows, velocity: Array) -> None:
    """Refuse headings that follow the course when degrees and radians are exchanged, and else do not."""
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING
    if moving.sum() < FEWEST_ROWS:
        return
    course, heading = np.arctan2(velocity[moving, 1], velocity[moving, 0]), rows.angles[moving, 0]

    def departure(factor: float) -> float:
        return float(np.sqrt(np.mean(_wrapped(course - factor * heading) ** 2)))

    if departure(1.0) < GROSS:
        return
    for factor, mistaken in EXCHANGED:
        if departure(factor) < EXCHANGE_SHARE:
            raise TrajectoryError(
                f"column heading: departs from the course of VN and VE by {np.degrees(departure(1.0)):.0f} deg (rms); "
                f"these may be {mistaken}"
            )


def _check_velocities(rows: TrajectoryRows, velocity: Array, position: Array) -> None:
    """Refuse velocities that belong to another flight, and steps of position that jump."""
    fixed = np.einsum("nij,nj->ni", local_axes(rows.latitude, rows.longitude), velocity)
    derived = _step_rates(position, rows.time)
    difference = np.linalg.norm(derived - (fixed[:-1] + fixed[1:]) / 2.0, axis=1)
    speed = float(np.sqrt(np.mean((derived**2).sum(axis=1))))
    given = float(np.sqrt(np.mean((velocity**2).sum(axis=1))))
    typical = float(np.median(difference))
    limit = JUMP_SPEED + max(JUMP_SHARE * given, JUMP_MEDIANS * typical)
    row = _first(difference > limit)
    if row is not None and typical < GROSS * given:
        column = _largest(rows, row, derived[row] - (fixed[row] + fixed[row + 1]) / 2.0)
        raise TrajectoryError(
            f"the position jumps: from the row before it moves at {np.linalg.norm(derived[row]):.6g} m/s, while "
            f"VN, VE, VD give {np.linalg.norm(fixed[row]):.6g} m/s; remove or correct the row",
            row + 2, column,
        )  # fmt: skip
    if typical > JUMP_SPEED + GROSS * max(speed, given):
        raise TrajectoryError(
            f"columns VN, VE, VD: the velocities ({given:.6g} m/s rms) are not the derivative of the positions "
            f"({speed:.6g} m/s rms). Check units, signs (VD is positive downwards) and order, or leave them out"
        )


def _largest(rows: TrajectoryRows, row: int, vector: Array) -> str:
    """Name the coordinate of position along which an earth-fixed vector is largest."""
    local = local_axes(rows.latitude[row], rows.longitude[row]).T @ vector
    return POSITION[int(np.argmax(np.abs(local)))]


def _check_force(rows: TrajectoryRows, position: Array, earth: Earth) -> None:
    """Find the first row where divided differences of the positions imply too large a specific force."""
    rates = _step_rates(position, rows.time)
    span = (rows.time[2:] - rows.time[:-2]) / 2.0
    spin = np.array([0.0, 0.0, earth.rotation_rate])
    middle = (rates[1:] + rates[:-1]) / 2.0
    carried = np.cross(spin, 2.0 * middle + np.cross(spin, position[1:-1]))
    felt = np.diff(rates, axis=0) / span[:, None] + carried - earth.gravitation(position[1:-1])
    size = np.linalg.norm(felt, axis=1) / STANDARD_GRAVITY
    row = _first(size > LARGEST_FORCE)
    if row is not None:
        raise TrajectoryError(
            f"the positions around it imply a specific force of {size[row]:.4g} g, above the limit of "
            f"{LARGEST_FORCE:g} g. Look for a jump, too few digits, or a wrong unit",
            row + 2, _largest(rows, row + 1, felt[row]),
        )  # fmt: skip


def _check_turns(rows: TrajectoryRows) -> None:
    """Find the first row to which the body turns too far for its direction of turn to be known."""
    from scipy.spatial.transform import Rotation

    steps = np.abs(_wrapped(np.diff(rows.angles, axis=0)))
    # successive rotations turn by no more than their sum, which is cheap
    for row in np.flatnonzero(steps.sum(axis=1) > LARGEST_TURN):
        before, after = Rotation.from_euler("ZYX", rows.angles[row : row + 2])
        turned = float((before.inv() * after).magnitude())
        if turned > LARGEST_TURN:
            raise TrajectoryError(
                f"the attitude turns by {np.degrees(turned):.4g} deg from the row before, more than "
                f"{np.degrees(LARGEST_TURN):g} deg; give more rows, or correct it",
                int(row) + 2, ANGLES[int(np.argmax(steps[row]))],
            )  # fmt: skip


def _wrapped(angles: Array) -> Array:
    """Return angles between -pi and pi."""
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


def rows_from(truth: Truth, times: Array) -> TrajectoryRows:
    """Tabulate a truth at some instants, shape (n,), s."""
    position, velocity = truth.earth_fixed(times)
    latitude, longitude, altitude = truth.earth.to_geodetic(position).T
    local = np.einsum("nji,nj->ni", local_axes(latitude, longitude), velocity)
    return TrajectoryRows(times, latitude, longitude, altitude, truth.angles(times), local)
