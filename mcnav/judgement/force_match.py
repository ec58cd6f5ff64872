"""Readings against a track, without a filter: clocks, exchanged axes, and the heading at the start.

Gyros alone turn the readings into axes that stand still, those of the body at the start: C' = C [w]. There the integral
of the specific force over an interval T, and what the track gains in it, differ by one rotation alone::

    S_k = integral of C f         N_k = v(t_k + T) - v(t_k) - g T         S_k = Q N_k

Q is that of least squares (Wahba 1965; by the singular values of sum S N^T) of each window, so that drifting gyros do
not matter. What is left of squares tells at which lag of the clocks the records are those of one motion, and whether a
reflection fits where no rotation does. Earth rate and Coriolis force are below what is looked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from scipy import stats

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import RecordedMeasurements, Recording
from mcnav.judgement.chance import FALSE_ALARM, is_clear
from mcnav.judgement.clocks import EXPLAINED, TIMES_WORSE, clear_lag, describe_lag
from mcnav.judgement.local_track import local_metres
from mcnav.physics.constants import STANDARD_GRAVITY

WINDOW: Final = 30.0
"""Time for which one rotation stands, s: drifting gyros turn by little in it."""

INTERVAL: Final = 2.0
"""Shortest time over which velocities are differenced, s."""

LONG_INTERVAL: Final = 6.0
"""Half of the time over which positions are differenced twice, s."""

FEWEST: Final = 8.0
"""Differences that do not overlap below which nothing is said: the noise of so few may fit anywhere."""

DRIFT: Final = np.radians(10.0)
"""Heading error that drifting gyros and a wrong vertical may cause in a window, rad."""


@dataclass(frozen=True)
class ForceMatch:
    """Readings in axes that stand still, and what a track gains in intervals.

    Attributes
    ----------
    times : ndarray, shape (n + 1,)
        s after the start of the record.
    integrals : ndarray, shape (n + 1, 3)
        Of the specific force in the body's axes at the start: once, m/s; twice for a track without velocities, m.
    stamps : ndarray, shape (u, d)
        Instants of each difference of the track, s.
    weights : ndarray, shape (d,)
        Of the integrals at these instants in the difference.
    gained : ndarray, shape (u, 3)
        Differences of the track along north, east, down, without gravity.
    gravity : ndarray, shape (u,)
        What gravity adds to each along down.
    """

    times: Array
    integrals: Array
    stamps: Array
    weights: Array
    gained: Array
    gravity: Array

    @classmethod
    def of(cls, recording: Recording, measured: RecordedMeasurements) -> ForceMatch | None:
        """Compute both; none of a sensor without velocities and positions, or of too few."""
        if "velocity" in measured.values:
            values, order = measured.values["velocity"], 1
        elif "position" in measured.values:
            values, order = local_metres(measured.values["position"]), 2
        else:
            return None
        interval = float(np.median(np.diff(measured.times)))
        apart = max(1, round((INTERVAL if order == 1 else LONG_INTERVAL) / interval))
        count = len(values) - order * apart
        if count < 10:
            return None
        rows = np.arange(count)[:, None] + apart * np.arange(order + 1)
        stamps = measured.times[rows]
        even = np.ptp(np.diff(stamps, axis=1), axis=1) < 0.01 * interval if order == 2 else np.ones(count, dtype=bool)
        even &= stamps[:, -1] - stamps[:, 0] < 1.5 * order * apart * interval
        weights = np.array([-1.0, 1.0] if order == 1 else [1.0, -2.0, 1.0])
        gained = np.einsum("d,udi->ui", weights, values[rows])
        gravity = STANDARD_GRAVITY * (stamps[:, 1] - stamps[:, 0]) ** order
        if np.sum(even) < 10:
            return None
        return cls(*_integrals(recording, order), stamps[even], weights, gained[even], gravity[even])

    def with_readings(self, recording: Recording) -> ForceMatch:
        """Return the track with other readings."""
        times, integrals = _integrals(recording, len(self.weights) - 1)
        return replace(self, times=times, integrals=integrals)

    def gains(self, lag: float) -> tuple[Array, Array]:
        """Return S where the track is late by a lag, shape (u, 3), and which instants are within the readings."""
        at = self.stamps - lag
        within = (at[:, 0] >= self.times[0]) & (at[:, -1] <= self.times[-1])
        values = np.stack([np.interp(at, self.times, column) for column in self.integrals.T], axis=-1)
        return np.asarray(np.einsum("d,udi->ui", self.weights, values)), within

    def left(self, lag: float, signs: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> tuple[float, int]:
        """Return what the best rotations leave of squares, a mean, and of how many vectors.

        Parameters
        ----------
        signs : tuple of float
            Of what the track gains along north, east, down.
        """
        by_readings, within = self.gains(lag)
        by_track = self.gained * signs - np.stack([0.0 * self.gravity, 0.0 * self.gravity, self.gravity], axis=1)
        total, count = 0.0, 0
        for rows in self._windows:
            some = rows[within[rows]]
            if len(some) >= 5:
                total += float(np.sum(by_readings[some] ** 2) + np.sum(by_track[some] ** 2))
                total -= 2.0 * _rotation(by_readings[some], by_track[some])[1]
                count += len(some)
        return total / max(count, 1), count

    @cached_property
    def _windows(self) -> list[IndexArray]:
        number = np.floor((self.stamps[:, 0] - self.stamps[0, 0]) / WINDOW)
        return [np.flatnonzero(number == window) for window in np.unique(number)]

    @cached_property
    def moved(self) -> float:
        """Mean square of what the track gains, about its mean in each window."""
        squares = [np.sum((self.gained[rows] - self.gained[rows].mean(axis=0)) ** 2) for rows in self._windows]
        return float(np.sum(squares)) / len(self.gained)

    @cached_property
    def agrees(self) -> bool:
        """Return whether the accelerations of both agree by the clocks as they are."""
        return self.left(0.0)[0] <= EXPLAINED * self.moved

    @property
    def freedom(self) -> float:
        """Degrees of freedom of what is left: three of each difference that does not overlap, less three a window."""
        return 3.0 * (self.independent - len(self._windows))

    @property
    def independent(self) -> float:
        """Number of differences that do not overlap."""
        return float((self.stamps[-1, 0] - self.stamps[0, 0]) / np.median(self.stamps[:, -1] - self.stamps[:, 0]))

    def heading(self) -> tuple[float, float] | None:
        """Return the heading at the start by the first window whose track tells it, and its sigma, rad."""
        by_readings, within = self.gains(0.0)
        by_track = self.gained - np.stack([0.0 * self.gravity, 0.0 * self.gravity, self.gravity], axis=1)
        for rows in self._windows[:4]:
            some = rows[within[rows]]
            if len(some) < 5:
                continue
            rotation, _ = _rotation(by_readings[some], by_track[some])
            left = float(np.sum((by_readings[some] - by_track[some] @ rotation.T) ** 2)) / len(some)
            level = float(np.sum(self.gained[some, :2] ** 2)) / len(some)
            if level > 0.0 and left < EXPLAINED * level:
                sigma = float(np.sqrt(left / level / max(len(some) / 4.0, 1.0)))
                forward = rotation[0]
                return float(np.arctan2(forward[1], forward[0])), sigma
        return None


def _integrals(recording: Recording, order: int) -> tuple[Array, Array]:
    """Return times, and the specific force in axes that stand still, integrated once or twice."""
    times = np.concatenate([[0.0], recording.ends])
    integral = _still_integral(recording, times)
    if order == 2:
        steps = np.diff(times)[:, None]
        integral = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * steps * (integral[1:] + integral[:-1]), 0)])
    return times, integral


def _still_integral(recording: Recording, times: Array) -> Array:
    """Integrate the specific force in axes that stand still, those of the body at the start, shape (n + 1, 3)."""
    steps = np.diff(times)[:, None]
    turns = _accumulated(recording.gyro * steps)
    middle = np.concatenate([turns[:1] * 0.0 + (1.0, 0.0, 0.0, 0.0), turns[:-1]])
    middle = middle + turns
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(_turned(middle, recording.accelerometer * steps), axis=0)])


def _accumulated(vectors: Array) -> Array:
    """Return the products of all rotations up to each, as quaternions, scalar first, shape (n, 4)."""
    size = np.linalg.norm(vectors, axis=1)[:, None]
    result = np.concatenate([np.cos(0.5 * size), 0.5 * np.sinc(size / (2.0 * np.pi)) * vectors], axis=1)
    apart = 1
    while apart < len(result):  # products of twice as many with each pass
        result[apart:] = _times(result[:-apart].copy(), result[apart:])
        apart *= 2
    return np.asarray(result / np.linalg.norm(result, axis=1)[:, None])


def _times(first: Array, second: Array) -> Array:
    scalar = first[:, :1] * second[:, :1] - np.sum(first[:, 1:] * second[:, 1:], axis=1, keepdims=True)
    vector = first[:, :1] * second[:, 1:] + second[:, :1] * first[:, 1:] + np.cross(first[:, 1:], second[:, 1:])
    return np.concatenate([scalar, vector], axis=1)


def _turned(quaternions: Array, vectors: Array) -> Array:
    twice = 2.0 * np.cross(quaternions[:, 1:], vectors)
    return np.asarray(vectors + quaternions[:, :1] * twice + np.cross(quaternions[:, 1:], twice))


def _rotation(by_readings: Array, by_track: Array) -> tuple[Array, float]:
    """Return the rotation Q with S = Q N of least squares, and the sum of S . Q N."""
    left, singular, right = np.linalg.svd(by_readings.T @ by_track)
    sign = float(np.sign(np.linalg.det(left @ right)))
    return (left * (1.0, 1.0, sign)) @ right, float(singular @ (1.0, 1.0, sign))


def clock_fault(match: ForceMatch) -> str:
    """Say that the track has another clock than the readings, where their motion tells by more than a delay."""
    if match.independent < FEWEST:
        return ""
    lag = clear_lag(match.left, len(match.gained), match.freedom, match.moved)
    return "" if lag is None else describe_lag(lag, "the readings", "the accelerations")


def mirror_fault(match: ForceMatch) -> str:
    """Say that north and east are exchanged, or up is taken for down, where no rotation fits the readings."""
    if match.independent < FEWEST:
        return ""
    as_named = match.left(0.0)[0]
    reflections = {
        "north and east are exchanged, or one of them has the wrong sign": (-1.0, 1.0, 1.0),
        "up is taken for down": (1.0, 1.0, -1.0),
    }
    for words, signs in reflections.items():
        least = match.left(0.0, signs)[0]
        clear = is_clear(as_named, least, match.freedom, len(reflections))
        if as_named > TIMES_WORSE * least and clear and least < EXPLAINED * match.moved:
            return f"{words}: the readings are those of the mirrored track"
    return ""


def heading_fault(match: ForceMatch, heading: float, sigma: float) -> str:
    """Say that the heading at the start is not that by which readings and track are one motion."""
    by_motion = match.heading()
    if by_motion is None:
        return ""
    by_both, error = by_motion
    apart = _wrapped(heading - by_both)
    allowed = DRIFT + float(stats.norm.isf(0.5 * FALSE_ALARM) * np.hypot(error, sigma))
    if abs(apart) < allowed:
        return ""
    others = {
        "it is turned by 180 deg": by_both + np.pi,
        "it is counted counter-clockwise from east": 0.5 * np.pi - by_both,
        "it is counted counter-clockwise from north": -by_both,
        "it is counted from east": by_both - 0.5 * np.pi,
    }
    near = [words for words, other in others.items() if abs(_wrapped(heading - other)) < allowed]
    return (
        f"the heading at the start is {np.degrees(heading) % 360.0:.4g} deg, readings and track together give "
        f"{np.degrees(by_both) % 360.0:.4g}: {' or '.join(near) or 'it is another one'}, or the readings' axes are "
        "turned about down"
    )


def _wrapped(angle: float) -> float:
    return float(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)
