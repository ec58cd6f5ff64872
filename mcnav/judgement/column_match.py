"""Columns of velocity against differences of position: exchanged, negated, or in another unit."""

from __future__ import annotations

from itertools import permutations, product
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedMeasurements
from mcnav.judgement.chance import is_clear, slope_through_zero
from mcnav.judgement.local_track import local_metres

BASELINE: Final = 5.0
"""Time over which positions are differenced, s."""

FEWEST: Final = 8
"""Differences below which nothing is said."""

TIMES_WORSE: Final = 4.0
"""Ratio of sums of squares from which columns as they are named are worse than others."""

UNITS: Final = {"km/h": 3.6, "kn": 1.943844, "ft/s": 3.28084, "cm/s": 100.0, "mm/s": 1000.0, "mph": 2.236936}
"""Size of 1 m/s in other units."""

OTHER_UNIT: Final = 0.04
"""Share by which a ratio may differ from that of two units to be taken for it."""

FEET: Final = 3.28084
"""Feet of a metre."""

LEVEL: Final = ("north", "east")


def velocity_fault(measured: RecordedMeasurements) -> str:
    """Say how velocities are not what positions change by; nothing where they are, or the motion does not tell."""
    if "velocity" not in measured.values or "position" not in measured.values:
        return ""
    velocity = measured.values["velocity"]
    if np.any(velocity[:, :2]) and not np.any(velocity[:, 2]) and len(velocity) > FEWEST:
        return "velocity_down is exactly zero in all rows: it was not measured"
    moved, passed = _differences(measured)
    if len(moved) < FEWEST:
        return ""
    return _level_fault(moved[:, :2], passed[:, :2]) or _vertical_fault(moved[:, 2], passed[:, 2])


def _differences(measured: RecordedMeasurements) -> tuple[Array, Array]:
    """Return changes of position, and what velocities integrate to, over baselines that follow each other, m."""
    times, velocity = measured.times, measured.values["velocity"]
    steps = np.diff(times)
    places = np.searchsorted(times, np.arange(times[0], times[-1] + 0.5 * BASELINE, BASELINE) - 1e-6)
    places = np.unique(np.minimum(places, len(times) - 1))
    travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * steps[:, None] * (velocity[1:] + velocity[:-1]), 0)])
    longest = np.maximum.reduceat(np.append(steps, 0.0), places[:-1])
    kept = longest <= max(2.0 * float(np.median(steps)), 1e-9)
    metres = local_metres(measured.values["position"])
    return np.diff(metres[places], axis=0)[kept], np.diff(travelled[places], axis=0)[kept]


def _level_fault(moved: Array, passed: Array) -> str:
    """Compare both level components with all of their exchanges and signs."""
    power = float(np.sum(passed**2))
    if power == 0.0:
        return ""
    squares = {}
    for order, signs in product(permutations(range(2)), product((1.0, -1.0), repeat=2)):
        other = passed[:, order] * signs
        scale = float(np.sum(moved * other)) / power
        squares[order, signs] = (float(np.sum((moved - scale * other) ** 2)), scale)
    best = min(squares, key=lambda key: squares[key][0] if squares[key][1] > 0.0 else np.inf)
    least, scale = squares[best]
    as_named = float(np.sum((moved - passed) ** 2))
    if as_named < TIMES_WORSE * least or not is_clear(as_named, least, moved.size - 1.0, len(squares)):
        return ""
    order, signs = best
    if order == (1, 0):
        return "velocity_north and velocity_east are exchanged, or latitude and longitude: velocities against positions"
    if signs != (1.0, 1.0):
        wrong = " and ".join(f"velocity_{axis}" for axis, sign in zip(LEVEL, signs, strict=True) if sign < 0.0)
        return f"{wrong} {'has' if signs.count(-1.0) == 1 else 'have'} the wrong sign against differences of position"
    for unit, size in UNITS.items():
        if abs(scale * size - 1.0) < OTHER_UNIT:
            return f"velocities are {1.0 / scale:.3g} times as large as differences of position: they are in {unit}"
    return ""


def _vertical_fault(moved: Array, passed: Array) -> str:
    """Say that downward velocities are upward ones, or in another unit: where the altitude changes enough to tell."""
    if not np.any(passed):
        return ""
    slope, noise = slope_through_zero(passed, moved)
    if slope < -0.5 and slope < -noise:
        return "velocity_down has the wrong sign against differences of altitude: it is counted upward"
    if abs(slope / FEET - 1.0) < 0.2 and slope - noise > 2.0:
        return f"the altitude changes {slope:.3g} times as much as velocity_down says: it is in ft"
    return ""
