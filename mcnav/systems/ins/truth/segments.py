"""Trajectories flown segment by segment: hold, straight, climb, turn, change of speed, way point.

Speed, climb angle and bank follow blends with continuous second derivatives, and every segment begins and ends in
level, unbanked, steady motion, so that the specific force and its derivative are continuous. With V the speed over the
earth, chi the course, gamma the climb angle and phi the bank

    latitude' = V cos(gamma) cos(chi) / (M + h),    longitude' = V cos(gamma) sin(chi) / ((N + h) cos(latitude)),
    h' = V sin(gamma),    chi' = g tan(phi) / V + V cos(gamma) sin(chi) tan(latitude) / (N + h).

Without bank the path is a geodesic. The body heads along the course, pitches with the climb angle, and rolls with the
bank of a coordinated turn; angle of attack and Coriolis acceleration, which a wing would balance with some milliradians
more, are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Protocol

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import compiled, inlined
from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.truth.rows import POLE_DISTANCE, TrajectoryRows

ACCELERATION: Final = 1.0
"""Largest acceleration along the path, m/s^2, unless another is stated."""

NORMAL_ACCELERATION: Final = 0.2 * STANDARD_GRAVITY
"""Largest acceleration of a pull-up or push-over, m/s^2, unless another is stated."""

CLIMB_ANGLE: Final = float(np.radians(5.0))
BANK: Final = float(np.radians(20.0))
ROLL_RATE: Final = float(np.radians(5.0))
"""Climb angle, bank (rad) and largest roll rate (rad/s), unless others are stated."""

STEEPEST: Final = 15.0 / 8.0
"""Largest slope of the blend."""

INTEGRATION_STEP: Final = 0.1
"""Longest step of the integration, s: the fastest blends of aircraft take seconds."""

STEADY_STEP: Final = 5.0
"""Step along a geodesic while only its end is wanted, s."""

MISS: Final = 1e-3
"""Distance by which a way point may be missed, m."""

LONGEST: Final = 10 * 86_400.0
"""Longest flight, s."""

MOST_ROWS: Final = 5_000_000


class SegmentError(ValueError):
    """A segment that cannot be flown; ``number`` counts from one."""

    def __init__(self, number: int, message: str) -> None:
        super().__init__(message)
        self.number = number


@dataclass(frozen=True)
class Start:
    """Place and motion at the beginning: rad, m, m/s; level."""

    latitude: float
    longitude: float
    altitude: float = 0.0
    course: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True)
class Piece:
    """A stretch in which speed (m/s), climb angle and bank (rad) go from a first value to a last one.

    ``gravity`` is that of the turn, m/s^2.
    """

    duration: float
    speed: tuple[float, float]
    climb: tuple[float, float] = (0.0, 0.0)
    bank: tuple[float, float] = (0.0, 0.0)
    gravity: float = STANDARD_GRAVITY


class Segment(Protocol):
    """A part of a flight that begins and ends in level, unbanked, steady motion."""

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return its pieces from a place and motion; ValueError where it cannot be flown."""
        ...


@dataclass(frozen=True)
class Hold:
    """Motion at constant speed and course, or rest, for a time, s."""

    duration: float

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return one steady piece."""
        return [Piece(self.duration, (start.speed, start.speed))]


@dataclass(frozen=True)
class Straight:
    """A geodesic at constant altitude and speed, of a length along the path, m."""

    distance: float

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return one steady piece."""
        return [Piece(self.distance / _moving(start, "straight"), (start.speed, start.speed))]


@dataclass(frozen=True)
class SpeedChange:
    """A change to another speed, m/s, with a largest acceleration, m/s^2."""

    speed: float
    acceleration: float = ACCELERATION

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return one blend of the speed."""
        return [Piece(STEEPEST * abs(self.speed - start.speed) / self.acceleration, (start.speed, self.speed))]


@dataclass(frozen=True)
class Climb:
    """A change of altitude, m, at a climb angle, rad, with a largest normal acceleration, m/s^2.

    The angle is positive for climb and descent. Where the change is too small to reach it, a smaller one is flown.
    """

    height: float
    angle: float = CLIMB_ANGLE
    acceleration: float = NORMAL_ACCELERATION

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return pull-up, climb and push-over."""
        speed = _moving(start, "climb")

        def ramp(angle: float) -> float:
            return STEEPEST * angle * speed / self.acceleration

        def gained(angle: float) -> float:
            """Return the height of pull-up and push-over together."""
            return 2.0 * speed * ramp(angle) * _blended_mean(np.sin, angle)

        height, angle = abs(self.height), self.angle
        if gained(angle) > height:
            angle = _root(lambda each: gained(each) - height, angle)
        steady = max(height - gained(angle), 0.0) / (speed * np.sin(angle)) if angle > 0.0 else 0.0
        signed = float(np.copysign(angle, self.height))
        return _in_and_out(speed, ramp(angle), steady, climb=signed)


@dataclass(frozen=True)
class Turn:
    """A coordinated turn by an angle, rad, to the right where positive.

    The bank is given, rad, or follows from a rate of turn, rad/s. Where the turn is too small to reach it, a smaller
    bank is flown.
    """

    angle: float
    bank: float | None = None
    rate: float | None = None
    roll_rate: float = ROLL_RATE

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return roll-in, turn and roll-out."""
        speed, gravity = _moving(start, "turn"), gravity_at(start, earth)
        bank = self.bank
        if bank is None:
            bank = BANK if self.rate is None else float(np.arctan(self.rate * speed / gravity))

        def ramp(bank: float) -> float:
            return STEEPEST * bank / self.roll_rate

        def turned(bank: float) -> float:
            """Return the angle of roll-in and roll-out together."""
            return 2.0 * gravity / speed * ramp(bank) * _blended_mean(np.tan, bank)

        angle = abs(self.angle)
        if turned(bank) > angle:
            bank = _root(lambda each: turned(each) - angle, bank)
        steady = max(angle - turned(bank), 0.0) * speed / (gravity * np.tan(bank)) if bank > 0.0 else 0.0
        pieces = _in_and_out(speed, ramp(bank), steady, bank=float(np.copysign(bank, self.angle)))
        return [replace(piece, gravity=gravity) for piece in pieces]


@dataclass(frozen=True)
class WayPoint:
    """A turn towards a place, rad, and a geodesic there."""

    latitude: float
    longitude: float
    bank: float | None = None
    rate: float | None = None
    roll_rate: float = ROLL_RATE

    def pieces(self, start: Start, earth: Earth) -> Sequence[Piece]:
        """Return the pieces of turn and geodesic, solved so that the way point is met."""
        from scipy.optimize import root

        speed = _moving(start, "fly to a way point")
        bearing, distance = _great_circle(start, self.latitude, self.longitude, earth.radius + start.altitude)
        first = float((bearing - start.course + np.pi) % (2.0 * np.pi) - np.pi)

        def flown(turn: float, length: float) -> Sequence[Piece]:
            return [*self._turn(turn).pieces(start, earth), Piece(length / speed, (speed, speed))]

        def missed(unknowns: Array) -> Array:
            turn, length = float(unknowns[0]), max(float(unknowns[1]) * distance, 0.0)
            end = _flown(start, flown(turn, length), earth)
            meridian, prime = earth.curvature_radii(np.array(end.latitude))
            east = (end.longitude - self.longitude + np.pi) % (2.0 * np.pi) - np.pi
            north = (end.latitude - self.latitude) * (meridian + end.altitude)
            return np.array([north, east * (prime + end.altitude) * np.cos(end.latitude)]) / distance

        if distance > 0.0:
            pieces = root(missed, [first, 1.0], tol=1e-14)
            if np.hypot(*pieces.fun) * distance < MISS and pieces.x[1] >= 0.0:
                return flown(float(pieces.x[0]), float(pieces.x[1]) * distance)
        raise ValueError("the way point is too near to be reached in one turn; bank more, or fly straight first")

    def _turn(self, angle: float) -> Turn:
        return Turn(angle, self.bank, self.rate, self.roll_rate)


def fly_segments(start: Start, segments: Sequence[Segment], rate: float, earth: Earth) -> TrajectoryRows:
    """Fly segments one after the other.

    Parameters
    ----------
    rate : float
        Rows per second.

    Raises
    ------
    SegmentError
        When a segment cannot be flown from where the one before ends, or the flight becomes too long.
    """
    pieces: list[Piece] = []
    ends: list[float] = []
    state = start
    for number, segment in enumerate(segments, start=1):
        try:
            flown = [piece for piece in segment.pieces(state, earth) if piece.duration > 0.0]
        except ValueError as wrong:
            raise SegmentError(number, str(wrong)) from None
        pieces += flown
        ends.append(sum(piece.duration for piece in pieces))
        if ends[-1] > LONGEST:
            raise SegmentError(number, f"the flight becomes longer than {LONGEST / 86_400.0:g} days")
        state = _flown(state, flown, earth)
    duration = ends[-1] if ends else 0.0
    count = int(np.ceil(duration * rate * (1.0 - 1e-12)))
    if not 3 <= count < MOST_ROWS:
        raise SegmentError(len(segments), f"the flight has {count + 1:,} rows; expected from 4 to {MOST_ROWS:,}")
    rows = _tabulated(start, pieces, np.linspace(0.0, duration, count + 1), earth)
    polar = np.flatnonzero(np.cos(rows.latitude) * earth.radius < POLE_DISTANCE)
    if len(polar):
        number = int(np.searchsorted(ends, rows.time[polar[0]])) + 1
        raise SegmentError(number, f"comes within {POLE_DISTANCE / 1e3:g} km of a pole, where north and east turn")
    return rows


def _moving(start: Start, what: str) -> float:
    if start.speed <= 0.0:
        raise ValueError(f"the vehicle stands still and cannot {what}; change the speed first")
    return start.speed


def gravity_at(start: Start, earth: Earth) -> float:
    """Compute the size of gravity, m/s^2, centrifugal acceleration included."""
    place = (np.array(coordinate) for coordinate in (start.latitude, start.longitude, start.altitude))
    position = earth.from_geodetic(*place)
    carried = earth.rotation_rate**2 * position * [1.0, 1.0, 0.0]
    return float(np.linalg.norm(earth.gravitation(position[None])[0] + carried))


def blend(share: Array) -> Array:
    """Return the polynomial of fifth degree from zero to one whose first two derivatives vanish at both ends."""
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def _blended_mean(function: np.ufunc, last: float) -> float:
    """Return the mean of a function over a blend of its argument from zero, to rounding."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    return float(0.5 * weights @ function(last * blend(0.5 * (nodes + 1.0))))


def _root(function: Callable[[float], float], above: float) -> float:
    """Find where a rising function passes zero between zero and a value at which it is positive."""
    from scipy.optimize import brentq

    return float(brentq(function, 0.0, above, xtol=1e-15)) if function(0.0) < 0.0 else 0.0


def _in_and_out(speed: float, ramp: float, steady: float, climb: float = 0.0, bank: float = 0.0) -> list[Piece]:
    both = (speed, speed)
    return [
        Piece(ramp, both, (0.0, climb), (0.0, bank)),
        Piece(steady, both, (climb, climb), (bank, bank)),
        Piece(ramp, both, (climb, 0.0), (bank, 0.0)),
    ]


def _great_circle(start: Start, latitude: float, longitude: float, radius: float) -> tuple[float, float]:
    """Compute bearing (rad) and distance (m) of a place over a sphere."""
    east = longitude - start.longitude
    across = np.cos(latitude) * np.sin(east)
    along = np.cos(start.latitude) * np.sin(latitude) - np.sin(start.latitude) * np.cos(latitude) * np.cos(east)
    up = np.sin(start.latitude) * np.sin(latitude) + np.cos(start.latitude) * np.cos(latitude) * np.cos(east)
    return float(np.arctan2(across, along)), float(radius * np.arctan2(np.hypot(across, along), up))


def _profile(pieces: Sequence[Piece], times: Array) -> Array:
    """Evaluate speed, climb angle, bank and gravity at times from the beginning, shape (n, 4)."""
    ends = np.cumsum([piece.duration for piece in pieces])
    place = np.minimum(np.searchsorted(ends, times, side="right"), len(pieces) - 1)
    durations = np.array([piece.duration for piece in pieces])
    share = blend(np.clip(1.0 - (ends[place] - times) / durations[place], 0.0, 1.0))
    values = np.array([[piece.speed, piece.climb, piece.bank] for piece in pieces])[place]
    gravity = np.array([piece.gravity for piece in pieces])[place]
    return np.column_stack([values[..., 0] + (values[..., 1] - values[..., 0]) * share[:, None], gravity])


def _flown(start: Start, pieces: Sequence[Piece], earth: Earth) -> Start:
    """Return place and motion after some pieces."""
    pieces = [piece for piece in pieces if piece.duration > 0.0]
    if not pieces:
        return start
    ends = np.cumsum([0.0, *(piece.duration for piece in pieces)])
    times = [np.zeros(1)]
    for piece, (begin, end) in zip(pieces, pairwise(ends), strict=True):
        steady = piece.speed[0] == piece.speed[1] and piece.climb == piece.bank == (0.0, 0.0)
        steps = int(np.ceil((end - begin) / (STEADY_STEP if steady else INTEGRATION_STEP)))
        times.append(np.linspace(begin, end, steps + 1)[1:])
    latitude, longitude, altitude, course = _integrated(start, pieces, np.concatenate(times), earth)[-1]
    return Start(float(latitude), float(longitude), float(altitude), float(course), pieces[-1].speed[1])


def _tabulated(start: Start, pieces: Sequence[Piece], times: Array, earth: Earth) -> TrajectoryRows:
    between = max(int(np.ceil((times[1] - times[0]) / INTEGRATION_STEP)), 1)
    fine = np.linspace(times[0], times[-1], (len(times) - 1) * between + 1)
    latitude, longitude, altitude, course = _integrated(start, pieces, fine, earth)[::between].T
    speed, climb, bank, _ = _profile(pieces, times).T
    level = speed * np.cos(climb)
    velocity = np.stack([level * np.cos(course), level * np.sin(course), -speed * np.sin(climb)], axis=1)
    return TrajectoryRows(times, latitude, longitude, altitude, np.stack([course, climb, bank], axis=1), velocity)


def _integrated(start: Start, pieces: Sequence[Piece], times: Array, earth: Earth) -> Array:
    """Integrate latitude, longitude, altitude and course over steps between times, shape (n, 4)."""
    middles = 0.5 * (times[1:] + times[:-1])
    first = np.array([start.latitude, start.longitude, start.altitude, start.course])
    values = _profile(pieces, times), _profile(pieces, middles)
    return _runge_kutta(first, np.diff(times), *values, earth.radius, earth.eccentricity_squared)


@inlined
def _path_rates(
    latitude: float, altitude: float, course: float, values: Array, radius: float, squared: float
) -> tuple[float, float, float, float]:
    """Compute the rates of latitude, longitude, altitude and course."""
    speed, climb, bank, gravity = values[0], values[1], values[2], values[3]
    sine, cosine = np.sin(latitude), np.cos(latitude)
    w = 1.0 - squared * sine * sine
    prime = radius / np.sqrt(w)
    level = speed * np.cos(climb)
    east = level * np.sin(course) / (prime + altitude)
    turn = gravity * np.tan(bank) / speed if bank != 0.0 else 0.0
    north = level * np.cos(course) / (prime * (1.0 - squared) / w + altitude)
    return north, east / cosine, speed * np.sin(climb), turn + east * sine / cosine


@compiled
def _runge_kutta(first: Array, steps: Array, at: Array, middle: Array, radius: float, squared: float) -> Array:
    """Integrate the path by the classical method of fourth order."""
    kutta = np.empty((len(steps) + 1, 4))
    kutta[0] = first
    for row in range(len(steps)):
        a, b, c, d = kutta[row, 0], kutta[row, 1], kutta[row, 2], kutta[row, 3]
        h = steps[row]
        p1, q1, r1, s1 = _path_rates(a, c, d, at[row], radius, squared)
        k = 0.5 * h
        p2, q2, r2, s2 = _path_rates(a + k * p1, c + k * r1, d + k * s1, middle[row], radius, squared)
        p3, q3, r3, s3 = _path_rates(a + k * p2, c + k * r2, d + k * s2, middle[row], radius, squared)
        p4, q4, r4, s4 = _path_rates(a + h * p3, c + h * r3, d + h * s3, at[row + 1], radius, squared)
        kutta[row + 1, 0] = a + h / 6.0 * (p1 + 2.0 * p2 + 2.0 * p3 + p4)
        kutta[row + 1, 1] = b + h / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4)
        kutta[row + 1, 2] = c + h / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
        kutta[row + 1, 3] = d + h / 6.0 * (s1 + 2.0 * s2 + 2.0 * s3 + s4)
    return kutta
