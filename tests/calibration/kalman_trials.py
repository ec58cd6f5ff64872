"""Synthetic campaigns with a Kalman filter in closed loop, and whether each statement about it is right.

`Kalman filter, matched`
    It estimates the bias, and believes its true size.
`Kalman filter, considering`
    It considers the bias without estimating it (Schmidt), and believes its true size: its covariance is right, and its
    innovations are not white.
`Kalman filter, biases neglected`
    It neglects biases along all axes; that along x is larger than the others by 3 %.
`Kalman filter, fixed bias`
    It neglects a bias along y that is the same in every sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_consistency import MEAN, FilterConsistency, Honesty
from mcnav.arrays.types import Array
from tests.calibration.cells import LEVEL, Cell, Tally, tally
from tests.calibration.kalman import KalmanFilter

SIZES: Final = (100, 200, 500)
CRITERION: Final = Criterion(tolerance=0.05, confidence=LEVEL)
BIAS: Final = 0.02
"""Sigma of the bias, m/s^2."""

KALMAN: Final = "Kalman filter"
"""Beginning of the names of the systems."""

MATCHED, CONSIDERING = f"{KALMAN}, matched", f"{KALMAN}, considering"
NEGLECTING, FIXED = f"{KALMAN}, biases neglected", f"{KALMAN}, fixed bias"

SYSTEMS: Final = {
    MATCHED: KalmanFilter(np.full(3, BIAS), believed=np.full(3, BIAS)),
    CONSIDERING: KalmanFilter(np.full(3, BIAS), believed=np.full(3, BIAS), estimates=False),
    NEGLECTING: KalmanFilter(BIAS * np.array([1.03, 1.0, 1.0]), estimates=False),
    FIXED: KalmanFilter(np.zeros(3), mean=BIAS * np.array([0.0, 2.0, 0.0]), estimates=False),
}
CAUSES: Final = {NEGLECTING: "bias_x", FIXED: f"{MEAN}bias_y"}
"""The cause to be named."""

Statement = tuple[str, str, bool]


def run_kalman_trials(trials: int, jobs: int, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each filter and size, with seeds 0, 1, ..."""
    return tally(trials, jobs, [(name, size) for name in SYSTEMS for size in sizes], _count)


def _count(kind: tuple[str, int], seeds: Sequence[int], result: Tally) -> None:
    name, count = kind
    number = list(SYSTEMS).index(name)
    for seed in seeds:
        generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(count, 7, number))))
        judged = assess_filter(SYSTEMS[name].simulate(generator, count), CRITERION)
        for statement, sort, hit in _statements(name, judged):
            result.add(Cell(sort, name, statement, "normal", "random", count), hit)


def _statements(name: str, consistency: FilterConsistency) -> Iterator[Statement]:
    yield from covered(consistency, "position")
    if name in CAUSES:
        yield from detected(consistency, CAUSES[name])
        return
    yield from alarms(consistency)
    if name == MATCHED:
        yield from out_of_bounds(consistency)


def covered(consistency: FilterConsistency, name: str) -> Iterator[Statement]:
    """Yield whether the intervals of a group's ratio, and of all outputs', cover those of linear analysis."""
    group = next(group for group in consistency.groups if group.name == name)
    assert group.linear is not None
    yield "sigma ratio by NEES, at all epochs", "coverage", _holds(group.ratio.together, group.linear)
    yield "sigma ratio by NEES, at one epoch", "coverage", _holds(group.ratio.each[-1:], group.linear[-1:])
    every = [each.linear is not None and _holds(each.ratio.together, each.linear) for each in consistency.outputs]
    yield "sigmas of outputs over the filter's, all at all epochs", "coverage", all(every)


def _holds(intervals: Array, true: Array) -> bool:
    """Return whether the intervals hold wherever there is a true value."""
    known = np.isfinite(true)
    return bool(np.all((intervals[known, 0] <= true[known]) & (true[known] <= intervals[known, 1])))


def detected(consistency: FilterConsistency, cause: str) -> Iterator[Statement]:
    """Yield whether a filter is found to be optimistic and, if so, whether a cause is named first."""
    yield "filter optimistic", "power", consistency.verdict == Honesty.OPTIMISTIC
    if consistency.verdict == Honesty.OPTIMISTIC:
        named = bool(consistency.neglected) and consistency.neglected[0].name == cause
        yield "largest neglected error named, where optimistic", "power", named


def alarms(consistency: FilterConsistency) -> Iterator[Statement]:
    """Yield what a filter whose covariance is right is blamed for."""
    yield (
        "filter optimistic or pessimistic",
        "false alarm",
        consistency.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC),
    )
    blamed = [
        sensor.beyond or (sensor.whiteness.beyond and not sensor.whiteness.expected) for sensor in consistency.sensors
    ]
    yield "NIS or whiteness beyond bounds", "false alarm", any(blamed)
    shares = [
        (band, bounds)
        for each in consistency.outputs
        for band, bounds in ((each.within_1, each.bounds_1), (each.within_3, each.bounds_3))
        if band is not None
    ]
    beyond = [bool(np.any((band.value < low) | (band.value > high))) for band, (low, high) in shares]
    yield "samples within one and three sigmas beyond bounds, at any epoch", "false alarm", any(beyond)


def out_of_bounds(consistency: FilterConsistency) -> Iterator[Statement]:
    """Yield whether a matched filter leaves the bounds that are drawn over time."""
    nees = [(group.nees.value, *group.bounds_together) for group in consistency.groups]
    beyond = [bool(np.any((value < low) | (value > high))) for value, low, high in nees]
    yield "mean NEES beyond bounds, at any epoch", "false alarm", any(beyond)
    nis = [(sensor.nis.value, *sensor.bounds.T) for sensor in consistency.sensors]
    beyond = [bool(np.any((value < low) | (value > high))) for value, low, high in nis]
    yield "mean NIS beyond bounds, between any epochs", "false alarm", any(beyond)
