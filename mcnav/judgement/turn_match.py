"""Gyros against the turn of a track: in which unit, and which way, they turn as the track does.

A vehicle has its velocity v along one axis of its own, forward or backward. With the angle psi by which its gyros turn
about the vertical, v exp(-i psi) keeps to an axis that stands still, whichever that is. What is left of squares across
the axis of each window tells by which multiple of psi the track turns: noise of the velocities is in all of them alike.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedMeasurements, Recording
from mcnav.judgement.chance import is_clear
from mcnav.judgement.clocks import TIMES_WORSE, clear_lag, describe_lag

WINDOW: Final = 30.0
"""Time in which the gyros' drift turns a track by little, s."""

FEWEST: Final = 100
"""Velocities below which nothing is said of clocks: half of them may fit by chance a quarter as badly as all."""

BANKED: Final = 0.1
"""Share of the squares of a track's turns that may be left as files are named: a bank hides some of the turn."""

TURNS: Final = {"deg/s": 180.0 / np.pi, "deg/h": 3600.0 * 180.0 / np.pi, "mrad/s": 1e3, "revolutions/min": 30.0 / np.pi}
"""Rates of 1 rad/s in other units."""


def turn_fault(recording: Recording, measured: RecordedMeasurements) -> str:
    """Say that gyros turn by another factor than the track: another unit, or the other way."""
    velocity = measured.values.get("velocity")
    if velocity is None:
        return ""
    level, angles = velocity[:, 0] + 1j * velocity[:, 1], _turns(recording)(measured.times)
    windows = np.floor(measured.times / WINDOW)
    others = {1.0 / size: _message(unit, size) for unit, size in TURNS.items()}
    others |= {size: f"the track turns {size:.3g} times as much as the gyros: they are in rad/s, not {unit}"
               for unit, size in TURNS.items()}  # fmt: skip
    others[-1.0] = (
        "the gyros turn against the track: the axes are not forward, right, down, or gyros have the wrong sign"
    )
    left = {factor: _left(level * np.exp(-1j * factor * angles), windows) for factor in (0.0, 1.0, *others)}
    best = min(others, key=lambda factor: left[factor])
    freedom = float(len(level) - len(np.unique(windows)))
    clear = all(
        left[factor] > TIMES_WORSE * left[best] and is_clear(left[factor], left[best], freedom, len(left))
        for factor in (0.0, 1.0)
    )
    return others[best] if clear else ""


def turn_clock_fault(recording: Recording, measured: RecordedMeasurements) -> str:
    """Say that the track has another clock than the gyros, where its turns tell by more than a delay.

    A slow vehicle on rough ground has accelerations below their noise, and turns far above it. A bank of 45 deg leaves
    less than `BANKED` of what turns in a window: along the mean force it takes 0.7 of the turn.
    """
    velocity = measured.values.get("velocity")
    if velocity is None or len(velocity) < FEWEST:
        return ""
    level, windows = velocity[:, 0] + 1j * velocity[:, 1], np.floor(measured.times / WINDOW)
    turns = _turns(recording)

    def left(lag: float) -> tuple[float, int]:
        at = measured.times - lag
        rows = (at >= 0.0) & (at <= recording.ends[-1])
        if np.sum(rows) < 0.5 * FEWEST:
            return 0.0, 0
        turned = level[rows] * np.exp(-1j * turns(at[rows]))
        return _left(turned, windows[rows]) / int(np.sum(rows)), int(np.sum(rows))

    moved = _left(level, windows) / len(level)
    if left(0.0)[0] < BANKED * moved:
        return ""
    lag = clear_lag(left, len(level), float(len(level) - len(np.unique(windows))), moved)
    return "" if lag is None else describe_lag(lag, "the gyros", "the turns")


def _message(unit: str, size: float) -> str:
    return f"the gyros turn {size:.3g} times as much as the track: they are in {unit}, not rad/s; --unit gyro={unit}"


def _turns(recording: Recording) -> Callable[[Array], Array]:
    """Return how far the gyros have turned about the vertical at instants, rad; down is along the mean force."""
    widths = np.diff(recording.ends, prepend=0.0)
    count = max(round(1.0 / float(np.median(widths))), 1)
    smooth = np.stack([np.convolve(axis, np.ones(count) / count, "same") for axis in recording.accelerometer.T], axis=1)
    down = -smooth / np.maximum(np.linalg.norm(smooth, axis=1), 1e-9)[:, None]
    angle = np.cumsum(np.sum(recording.gyro * down, axis=1) * widths)
    ends, angles = np.append(0.0, recording.ends), np.append(0.0, angle)
    return lambda instants: np.asarray(np.interp(instants, ends, angles))


def _left(still: Array, windows: Array) -> float:
    """Return the squares of complex numbers z across the axis of each window: (sum |z|^2 - |sum z^2|) / 2."""
    _, numbers = np.unique(windows, return_inverse=True)
    squared = still**2
    sums = np.bincount(numbers, squared.real) + 1j * np.bincount(numbers, squared.imag)
    return 0.5 * float(np.sum(np.abs(squared)) - np.sum(np.abs(sums)))
