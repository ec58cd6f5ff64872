"""Checks of a record's units by gravity and the rates of vehicles; nothing is converted that was not told.

A specific force is about 9.8 m/s^2 for a vehicle at rest, and in the median over a drive or a flight. Without a stated
unit, a size that belongs to another unit is refused; with one it is noted.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.logs.log_error import LogError
from mcnav.logs.times import rows
from mcnav.physics.constants import STANDARD_GRAVITY

NEAR: Final = 0.2
"""Share by which the median specific force of a vehicle may differ from gravity."""

FORCES: Final = {"g": 1.0, "mg": 1e3, "ug": 1e6, "cm/s^2": STANDARD_GRAVITY * 1e2, "ft/s^2": STANDARD_GRAVITY / 0.3048}
"""Size of gravity in units other than m/s^2."""

LARGEST_RATE: Final = 100.0
"""Rate that gyros do not measure, rad/s: their ranges end at 35 rad/s, those of few at 70."""

USUAL_RATE: Final = 1.5
"""Median rate of a vehicle that turns all the time, rad/s: without a stated unit it is asked for."""

EARTH_RATE: Final = 7.292115e-5
"""rad/s."""

SAME: Final = 0.02
"""Share by which a mean rate at rest may differ from the earth's to be taken for it in another unit."""

STEADY: Final = 0.02
"""Change of the direction of specific force over a record at rest, rad."""

TURNING: Final = 0.1
"""Mean rate across gravity that no bias of a gyro has, rad/s."""

INTERVAL_UNITS: Final = {"ms": 1e3, "us": 1e6, "ns": 1e9}

LONGEST_INTERVAL: Final = 2.0
"""Longest interval of an inertial sensor, s; a longer one is that of another unit."""

SHORTEST_INTERVAL: Final = 1e-5
"""Shortest interval of an inertial sensor, s."""

MOST: Final = 200_000
"""Rows from which sizes are taken."""


def check_interval(path: Path, interval: float, stated: bool) -> tuple[str, ...]:
    """Refuse or note an interval that no inertial sensor has.

    Raises `LogError` where the unit of time is not stated.
    """
    if SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL:
        return ()
    fitting = [unit for unit, per_second in INTERVAL_UNITS.items() if 1e-4 < interval / per_second <= 0.1]
    unit = fitting[0] if fitting else "ms"
    message = f"steps by {interval:.6g} s, which is no interval of inertial sensors"
    if stated:
        return (f"time {message}",)
    raise LogError(path, f'{message}; if it is in {unit}: units = {{ time = "{unit}" }}', "time")


def _median_size(vectors: Array) -> float:
    step = max(len(vectors) // MOST, 1)
    return float(np.median(np.linalg.norm(vectors[::step], axis=1)))


def check_force(path: Path, force: Array, interval: float, stated: bool) -> tuple[str, ...]:
    """Refuse or note specific forces whose size is that of gravity in another unit, or none of a vehicle.

    Raises `LogError` where the unit is not stated.
    """
    size = _median_size(force)
    if abs(size / STANDARD_GRAVITY - 1.0) < NEAR:
        return ()
    units = {**FORCES, "m/s": STANDARD_GRAVITY * interval}
    near = [unit for unit, gravity in units.items() if abs(size / gravity - 1.0) < NEAR]
    message = f"the specific force is {size:.4g} in the median, where gravity is {STANDARD_GRAVITY:.4g} m/s^2"
    if near and not stated:
        unit = min(near, key=lambda name: abs(np.log(size / units[name])))
        raise LogError(
            path, f'{message}; if it is in {unit}: units = {{ accelerometer = "{unit}" }}; if not, state "m/s^2"',
            "accelerometer",
        )  # fmt: skip
    return (f"{message}: it is not that of a vehicle at rest on the earth",)


def check_rates(path: Path, rates: Array, force: Array | None, time: Array, stated: bool) -> tuple[str, ...]:
    """Refuse or note angular rates that no gyro or no vehicle has in rad/s.

    Raises `LogError` where the unit is not stated.
    """
    reasons = []
    largest = float(np.max(np.abs(rates)))
    median = _median_size(rates)
    mean = rates.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if largest > LARGEST_RATE:
        reasons.append(("deg/s", f"the largest rate is {largest:.4g} rad/s, beyond any gyro"))
    elif median > USUAL_RATE:
        reasons.append(("deg/s", f"the rate is {median:.4g} rad/s in the median"))
    for unit, factor in (("deg/s", 180.0 / np.pi), ("deg/h", 3600.0 * 180.0 / np.pi)):
        if abs(size / (EARTH_RATE * factor) - 1.0) < SAME:
            reasons.append((unit, f"the mean rate is {size:.4g}, that of the earth in {unit}"))
    if force is not None and (across := _turned_across(mean, force)) > TURNING and time[-1] > 10.0:
        said = f"the mean rate of {across:.4g} rad/s across gravity would have turned it, and its direction stays"
        reasons.append(("deg/s", said))
    if not reasons:
        return ()
    unit, message = reasons[-1]
    if stated:
        return (f"{message}; see whether the unit of the gyros is right",)
    raise LogError(path, f'{message}; if it is in {unit}: units = {{ gyro = "{unit}" }}; if not, state "rad/s"', "gyro")


def _turned_across(mean: Array, force: Array) -> float:
    """Return the mean rate across the specific force, where its direction stays; zero where it turns."""
    parts = [stretch.mean(axis=0) for stretch in np.array_split(force, min(10, len(force)))]
    lengths = [float(np.linalg.norm(force_mean)) for force_mean in parts]
    if min(lengths) < STANDARD_GRAVITY / 2.0:
        return 0.0
    directions = np.array(parts) / np.array(lengths)[:, None]
    if np.max(np.linalg.norm(directions - directions[0], axis=1)) > STEADY:
        return 0.0
    return float(np.linalg.norm(np.cross(directions.mean(axis=0), mean)))


def saturations(time: Array, vectors: Mapping[str, Array]) -> tuple[str, ...]:
    """Note axes that never change, and those that stay at their largest or smallest reading.

    An instrument that saturates gives its extreme reading more often than the one next to it, and in runs.
    """
    notes: list[str] = []
    for vector, values in vectors.items():
        for axis, name in enumerate("xyz"):
            column = values[:, axis]
            low, high = float(column.min()), float(column.max())
            if low == high:
                notes.append(f"{vector}_{name} is {low:.6g} in every row")
                continue
            notes.extend(
                f"{vector}_{name} saturates at {extreme:.6g}: {rows(count)}, the longest run from {time[at]:.6g} s"
                for extreme in (low, high)
                for count, at in _runs(column, extreme)
            )
    return tuple(notes)


def _runs(column: Array, extreme: float) -> list[tuple[int, int]]:
    """Return the number of readings at an extreme that come in runs, and the first row of the longest, if it is one."""
    at = np.flatnonzero(column == extreme)
    if len(at) < 3:
        return []
    starts = np.flatnonzero(np.diff(at, prepend=at[0] - 2) > 1)
    lengths = np.diff(np.append(starts, len(at)))
    rest = column[column != extreme]
    next_to_it = rest.max() if extreme > rest.max() else rest.min()
    if lengths.max() < 3 or len(at) <= 2 * int(np.sum(rest == next_to_it)):
        return []
    return [(len(at), int(at[starts[np.argmax(lengths)]]))]
