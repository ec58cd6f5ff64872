"""Recorded flights by equations of their own, with at most one wrong thing each.

Nothing of mcnav computes them: a track of speeds, courses and climbs is integrated over the ellipsoid, its readings are
means of the specific force and the inertial rate, and a receiver measures along it. `FLOWN` has the sizes of all errors
that `CAMPAIGN` states, so that a record without a wrong thing is one of this campaign.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

CAMPAIGN: Final = """
name = "Three minutes with GNSS"
samples = 200
seed = 5

[scenario]
type = "ins"

[scenario.trajectory]
start = { latitude = "48 deg", longitude = "11 deg", altitude = "500 m", course = "30 deg", speed = "8 m/s" }
segments = [{ hold = "200 s" }]

[imu.gyro]
bias = "20 deg/h"
angle_random_walk = "0.3 deg/sqrt(h)"

[imu.accelerometer]
bias = "1 mg"
velocity_random_walk = "60 ug/sqrt(Hz)"

[errors]
position = "3 m"
velocity = "0.1 m/s"
tilt = "5 mrad"
heading = "20 mrad"

[[aiding]]
type = "gnss"
interval = "1 s"
position = "1 m"
velocity = "5 cm/s"

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]
"""

AXIS, SQUARED = 6_378_137.0, 6.69437999014e-3
RATE = 7.292115e-5
STEP: Final = 0.005
"""Step of the truth, s."""

READING: Final = 0.02
"""Interval of the readings, s."""


@dataclass(frozen=True)
class Flown:
    """Errors of a flight, SI, and what is wrong with its files.

    Attributes
    ----------
    late, jitter : float
        Of the receiver's stamps, s.
    imu_late : float
        Of the stamps of the readings, s.
    clock, imu_clock : float
        By how much the clocks of the receiver and of the readings run fast, s per s.
    arm : tuple of float
        From the unit to the antenna, m.
    correlated, correlation_time : float
        Of an error of the receiver's position, m and s.
    instability, instability_time : float
        Of the gyros, rad/s and s.
    walk : float
        Angle random walk, rad/sqrt(s).
    """

    late: float = 0.0
    jitter: float = 0.0
    imu_late: float = 0.0
    clock: float = 0.0
    imu_clock: float = 0.0
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    correlated: float = 0.0
    correlation_time: float = 30.0
    instability: float = 0.0
    instability_time: float = 20.0
    walk: float = float(np.radians(0.3) / 60.0)
    position: float = 1.0
    velocity: float = 0.05
    heading: float = 0.02


@dataclass(frozen=True)
class Files:
    """Columns of the files of a flight, SI and rad: of the readings, the fixes, and the state at the start."""

    imu: dict[str, Array]
    gnss: dict[str, Array]
    start: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Motion:
    """The truth every `STEP`: velocity north, east, down, its derivative, angles and their derivatives, position."""

    time: Array
    velocity: Array
    acceleration: Array
    angles: Array
    turning: Array
    position: Array


def _ramps(time: Array, knots: tuple[tuple[float, float], ...]) -> tuple[Array, Array]:
    """Return a function through knots with smooth ramps, and its derivative."""
    value, slope = np.full_like(time, knots[0][1]), np.zeros_like(time)
    for (begin, first), (end, last) in pairwise(knots):
        u = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        value += (last - first) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        slope += (last - first) * 30.0 * u**2 * (1.0 - u) ** 2 / (end - begin)
    return value, slope


def motion(duration: float = 170.0, steady: bool = False) -> Motion:
    """Integrate the track: speeds of 8 to 40 m/s, turns both ways, a climb and a descent; steady: level at 40 m/s."""
    time = np.arange(0.0, duration + 0.5 * STEP, STEP)
    speed, gain = _ramps(time, ((0, 8), (8, 8), (18, 40), (60, 40), (72, 12), (95, 12), (108, 38), (170, 38)))
    degrees = ((0, 30), (20, 30), (42, 160), (62, 160), (75, 160), (98, 20), (120, 20), (146, 130), (170, 130))
    course, turn = (np.radians(each) for each in _ramps(time, degrees))
    climb, rise = (np.radians(each) for each in _ramps(time, ((0, 0), (25, 0), (32, 7), (45, 7), (52, 0), (85, 0),
                                                              (92, -5), (104, -5), (112, 0), (170, 0))))  # fmt: skip
    if steady:
        speed, gain, climb, rise = np.full_like(time, 40.0), 0.0 * time, 0.0 * time, 0.0 * time
    bank = np.arctan(speed * turn / 9.81)
    level = np.stack([np.cos(climb) * np.cos(course), np.cos(climb) * np.sin(course), -np.sin(climb)], axis=1)
    along_climb = np.stack([-np.sin(climb) * np.cos(course), -np.sin(climb) * np.sin(course), -np.cos(climb)], axis=1)
    across = np.stack([-np.cos(climb) * np.sin(course), np.cos(climb) * np.cos(course), 0.0 * climb], axis=1)
    velocity = speed[:, None] * level
    acceleration = gain[:, None] * level + speed[:, None] * (rise[:, None] * along_climb + turn[:, None] * across)
    angles = np.stack([bank, climb, course], axis=1)
    turning = np.stack([np.gradient(bank, STEP), rise, turn], axis=1)
    return Motion(time, velocity, acceleration, angles, turning, _positions(velocity))


def _radii(latitude: Array) -> tuple[Array, Array]:
    normal = AXIS / np.sqrt(1.0 - SQUARED * np.sin(latitude) ** 2)
    return normal * (1.0 - SQUARED) / (1.0 - SQUARED * np.sin(latitude) ** 2), normal


def _sums(values: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * STEP * (values[1:] + values[:-1]))])


def _positions(velocity: Array) -> Array:
    """Integrate latitude, longitude and altitude; the radii are those of the pass before."""
    altitude = 500.0 - _sums(velocity[:, 2])
    latitude = np.full(len(velocity), np.radians(48.0))
    for _ in range(3):
        latitude = np.radians(48.0) + _sums(velocity[:, 0] / (_radii(latitude)[0] + altitude))
    longitude = np.radians(11.0) + _sums(velocity[:, 1] / ((_radii(latitude)[1] + altitude) * np.cos(latitude)))
    return np.stack([latitude, longitude, altitude], axis=1)


def _matrices(angles: Array) -> Array:
    """Return matrices from the body's to local axes, shape (n, 3, 3), of roll, pitch, heading."""
    (sr, sp, sh), (cr, cp, ch) = np.sin(angles).T, np.cos(angles).T
    return np.stack([
        np.stack([cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh], axis=-1),
        np.stack([cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch], axis=-1),
        np.stack([-sp, sr * cp, cr * cp], axis=-1),
    ], axis=-2)  # fmt: skip


def _gravity(latitude: Array, altitude: Array) -> Array:
    """Normal gravity of WGS 84 (Somigliana), to second order in the altitude."""
    squared = np.sin(latitude) ** 2
    ground = 9.7803253359 * (1.0 + 0.00193185265241 * squared) / np.sqrt(1.0 - SQUARED * squared)
    flat, share = 1.0 / 298.257223563, 0.00344978650684
    fall = 1.0 - 2.0 / AXIS * (1.0 + flat + share - 2.0 * flat * squared) * altitude + 3.0 * altitude**2 / AXIS**2
    return np.asarray(ground * fall)


def true_readings(track: Motion) -> tuple[Array, Array]:
    """Return rates and specific forces along the body's axes at every step."""
    latitude, _, altitude = track.position.T
    north, east, _ = track.velocity.T
    meridian, normal = _radii(latitude)
    nothing = np.zeros_like(latitude)
    earth = RATE * np.stack([np.cos(latitude), nothing, -np.sin(latitude)], axis=1)
    over = east / (normal + altitude)
    transport = np.stack([over, -north / (meridian + altitude), -over * np.tan(latitude)], axis=1)
    force = track.acceleration + np.cross(2.0 * earth + transport, track.velocity)
    force[:, 2] -= _gravity(latitude, altitude)
    to_level = _matrices(track.angles)
    (sr, sp, _), (cr, cp, _) = np.sin(track.angles).T, np.cos(track.angles).T
    bank, rise, turn = track.turning.T
    own = np.stack([bank - sp * turn, cr * rise + sr * cp * turn, -sr * rise + cr * cp * turn], axis=1)
    return own + np.einsum("nji,nj->ni", to_level, earth + transport), np.einsum("nji,nj->ni", to_level, force)


def _means(values: Array) -> Array:
    """Return means over the intervals of the readings, by Simpson's rule."""
    count = round(READING / STEP)
    weights = np.array([1.0, *([4.0, 2.0] * (count // 2))[:-1], 1.0]) / (3.0 * count)
    starts = np.arange(0, len(values) - count, count)
    return np.einsum("k,nkc->nc", weights, values[starts[:, None] + np.arange(count + 1)])


def _markov(rng: np.random.Generator, count: int, interval: float, sigma: float, time: float) -> Array:
    """Return a stationary first-order Gauss-Markov process, shape (count, 3)."""
    kept = np.exp(-interval / time)
    values = sigma * rng.standard_normal((count, 3))
    for row in range(1, count):
        values[row] = kept * values[row - 1] + np.sqrt(1.0 - kept**2) * values[row]
    return values


TRACK: Final = motion()
TRUE_RATES, TRUE_FORCES = (_means(each) for each in true_readings(TRACK))


def _antenna(flown: Flown, times: Array, track: Motion) -> tuple[Array, Array]:
    """Return position and velocity of the antenna at instants."""
    angles, turning = (
        np.stack([np.interp(times, track.time, c) for c in each.T], 1) for each in (track.angles, track.turning)
    )
    position, velocity = (
        np.stack([np.interp(times, track.time, c) for c in each.T], 1) for each in (track.position, track.velocity)
    )
    to_level = _matrices(angles)
    (sr, sp, _), (cr, cp, _) = np.sin(angles).T, np.cos(angles).T
    bank, rise, turn = turning.T
    own = np.stack([bank - sp * turn, cr * rise + sr * cp * turn, -sr * rise + cr * cp * turn], axis=1)
    offset = to_level @ np.array(flown.arm)
    velocity = velocity + np.einsum("nij,nj->ni", to_level, np.cross(own, flown.arm))
    return _moved(position, offset), velocity


def _moved(position: Array, offset: Array) -> Array:
    """Move positions by metres north, east, down."""
    meridian, normal = _radii(position[:, 0])
    return position + np.stack([
        offset[:, 0] / (meridian + position[:, 2]),
        offset[:, 1] / ((normal + position[:, 2]) * np.cos(position[:, 0])), -offset[:, 2],
    ], axis=1)  # fmt: skip


def fly(seed: int, flown: Flown | None = None, track: Motion | None = None) -> Files:
    """Return the files of one flight."""
    flown, rng = flown or Flown(), np.random.default_rng(seed)
    rates, forces = TRUE_RATES, TRUE_FORCES
    if track is not None:
        rates, forces = (_means(each) for each in true_readings(track))
    track = track or TRACK
    count = len(rates)
    gyro = rates + np.radians(20.0) / 3600.0 * rng.standard_normal(3)
    gyro = gyro + flown.walk / np.sqrt(READING) * rng.standard_normal((count, 3))
    gyro += _markov(rng, count, READING, flown.instability, flown.instability_time)
    force = forces + 9.80665e-3 * rng.standard_normal(3)
    force = force + 60e-6 * 9.80665 / np.sqrt(READING) * rng.standard_normal((count, 3))
    stamps = np.arange(1.0, track.time[-1] - 1.0)
    measured_at = np.clip(stamps - flown.late - flown.jitter * rng.standard_normal(len(stamps)), 0.0, None)
    position, velocity = _antenna(flown, measured_at, track)
    error = flown.position * rng.standard_normal((len(stamps), 3))
    error += _markov(rng, len(stamps), 1.0, flown.correlated, flown.correlation_time)
    position = _moved(position, error)
    velocity = velocity + flown.velocity * rng.standard_normal((len(stamps), 3))
    ends = READING * np.arange(1.0, count + 1.0) + flown.imu_late
    imu = {"time": ends * (1.0 + flown.imu_clock)} | {f"gyro_{axis}": gyro[:, n] for n, axis in enumerate("xyz")}
    imu |= {f"accelerometer_{axis}": force[:, n] for n, axis in enumerate("xyz")}
    gnss = {"time": stamps * (1.0 + flown.clock)}
    gnss |= dict(zip(("latitude", "longitude", "altitude"), position.T, strict=True))
    gnss |= dict(zip(("velocity_north", "velocity_east", "velocity_down"), velocity.T, strict=True))
    first = _moved(track.position[:1], 3.0 * rng.standard_normal((1, 3)))[0]
    speed = track.velocity[0] + 0.1 * rng.standard_normal(3)
    angles = track.angles[0] + np.array([0.005, 0.005, flown.heading]) * rng.standard_normal(3)
    start = {"time": np.zeros(1) + flown.imu_late}
    names = (
        "latitude",
        "longitude",
        "altitude",
        "velocity_north",
        "velocity_east",
        "velocity_down",
        "roll",
        "pitch",
        "heading",
    )
    start |= {name: np.array([value]) for name, value in zip(names, [*first, *speed, *angles], strict=True)}
    return Files(imu, gnss, start)


def _changed(table: dict[str, Array], **columns: Array) -> dict[str, Array]:
    return {**table, **columns}


def late_by(seconds: float) -> Callable[[Files], Files]:
    """Return a change of the receiver's stamps alone: its measurements are those of the right times."""
    return lambda files: replace(files, gnss=_changed(files.gnss, time=files.gnss["time"] + seconds))


def _degrees(files: Files) -> Files:
    return replace(files, imu=_changed(files.imu, **{f"gyro_{a}": np.degrees(files.imu[f"gyro_{a}"]) for a in "xyz"}))


def _in_g(files: Files) -> Files:
    return replace(
        files,
        imu=_changed(files.imu, **{f"accelerometer_{a}": files.imu[f"accelerometer_{a}"] / 9.80665 for a in "xyz"}),
    )


def _start_heading(law: Callable[[Array], Array]) -> Callable[[Files], Files]:
    return lambda files: replace(files, start=_changed(files.start, heading=law(files.start["heading"])))


def _exchanged(files: Files) -> Files:
    north, east = files.gnss["velocity_north"], files.gnss["velocity_east"]
    return replace(files, gnss=_changed(files.gnss, velocity_north=east, velocity_east=north))


def _upward(files: Files) -> Files:
    return replace(files, gnss=_changed(files.gnss, velocity_down=-files.gnss["velocity_down"]))


def _held(files: Files) -> Files:
    """Write five rows a second, each with the last fix."""
    times = np.arange(files.gnss["time"][0], files.gnss["time"][-1], 0.2)
    rows = np.searchsorted(files.gnss["time"], times + 1e-9) - 1
    return replace(files, gnss={name: values[rows] for name, values in files.gnss.items()} | {"time": times})


FILE_FAULTS: Final[Mapping[str, tuple[Callable[[Files], Files], str]]] = {
    "leap seconds": (late_by(18.0), "leap seconds"),
    "one second late": (late_by(1.0), "a whole second"),
    "two seconds early": (late_by(-2.0), "whole seconds"),
    "gyros in deg/s": (_degrees, "they are in deg/s"),
    "accelerometers in g": (_in_g, "it is in g"),
    "heading turned by 180 deg": (_start_heading(lambda h: h + np.pi), "turned by 180 deg"),
    "heading counter-clockwise from east": (_start_heading(lambda h: 0.5 * np.pi - h), "counter-clockwise from east"),
    "north and east exchanged": (_exchanged, "velocity_north and velocity_east are exchanged"),
    "up for down": (_upward, "velocity_down has the wrong sign"),
    "held fixes": (_held, "held until the next"),
}
"""Changes of the files, and words of the fault that is to be named."""

WRONG: Final[Mapping[str, tuple[Flown, str]]] = {
    "nothing": (Flown(), ""),
    "0.11 s late": (Flown(late=0.11), "gnss_delay"),
    "0.05 s late": (Flown(late=0.05), "gnss_delay"),
    "0.08 s early": (Flown(late=-0.08), "gnss_delay"),
    "readings 0.06 s late": (Flown(imu_late=0.06), "gnss_delay"),
    "receiver's clock 200 ppm fast": (Flown(clock=2e-4), "gnss_clock_rate"),
    "receiver's clock 1 % slow": (Flown(clock=-0.01), "gnss_clock_rate"),
    "readings' clock 200 ppm fast": (Flown(imu_clock=2e-4), "gnss_clock_rate"),
    "jitter of 60 ms": (Flown(jitter=0.06), "gnss_jitter"),
    "an arm of 1 m": (Flown(arm=(0.8, -0.36, -0.48)), "gnss_lever_arm"),
    "bias instability of 30 deg/h": (Flown(instability=float(np.radians(30.0) / 3600.0)), "gyro_bias_instability"),
    "a correlated error of 2 m": (Flown(correlated=2.0), "gnss_position_correlated"),
    "position 1.5 times worse": (Flown(position=1.5), "gnss_position_noise"),
    "angle random walk 3 times larger": (Flown(walk=float(np.radians(0.9) / 60.0)), "gyro_angle_random_walk"),
}
"""Errors of a flight that the campaign does not have, and the number that is to be named."""
