"""Mean and covariance of the errors of many navigations, in one pass over those that differ in sizes of errors alone.

Without a filter covariances are sums over processes of their squared sizes, so that one propagation answers all sizes.
With a filter each navigation has gains of its own (`mcnav.linear.engine.tunings`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import map_covariances, transform
from mcnav.arrays.types import Array
from mcnav.caches.recent import Recent
from mcnav.contract.linear import CovarianceReadings
from mcnav.contract.timeline import FilterSteps, Steps, Timeline
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.tunings import propagate_tunings
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.imu.instruments import Imu, process_variances
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, close_loop
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.linear.free_timeline import free_timeline
from mcnav.systems.ins.linear.response_blocks import recent_responses
from mcnav.systems.ins.linear.sizes import same_kind, same_sensors, states_of_sizes
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.truth.trajectory import Platform, Truth

MOST_KEPT: Final = 4_096
"""Steps up to which they are kept for all tunings: 20 kB each."""


@dataclass(frozen=True)
class Navigated:
    """A navigation on a grid, with errors to be propagated to some of its times.

    Attributes
    ----------
    grid, times : ndarray
        Rising, s; the first of the grid is the start.
    mean, covariance : ndarray, shapes (s,), (s, s)
        Of the constant sources.
    """

    truth: Truth
    platform: Platform
    grid: Array
    times: Array
    imu: Imu
    sensors: tuple[Sensor, ...]
    filter: FilterModel | None
    mean: Array
    covariance: Array

    def has(self, other: Navigated) -> bool:
        """Return whether another navigation is a tuning of this one: along the same truth, with no further errors."""
        if self.truth is not other.truth or self.platform != other.platform:
            return False
        if not (np.array_equal(self.grid, other.grid) and np.array_equal(self.times, other.times)):
            return False
        if not same_kind(self.imu, other.imu):
            return False
        one, another = self.filter, other.filter
        if one is None or another is None:
            return one is another
        return (
            same_kind(one.beliefs.imu, another.beliefs.imu)
            and same_sensors(self.sensors, other.sensors)
            and same_sensors(one.beliefs.sensors, another.beliefs.sensors)
            and states_of_sizes(one.states, another.states) is not None
        )

    @property
    def used(self) -> NDArray[np.bool_]:
        """Sources that have an error, shape (s,)."""
        return np.asarray((self.mean != 0.0) | self.covariance.any(axis=0))


@dataclass(frozen=True)
class Tables:
    """What tunings of a navigation share."""

    navigated: Navigated

    def answer(self, tunings: Sequence[Navigated]) -> list[CovarianceReadings]:
        """Propagate the errors of tunings."""
        return (
            [self._without_filter(tuning) for tuning in tunings] if self._loop is None else self._with_filter(tunings)
        )

    @cached_property
    def _loop(self) -> ClosedLoop | None:
        base = self.navigated
        if base.filter is None:
            return None
        return close_loop(base.truth, base.platform, base.grid, base.imu, base.sensors, base.filter, recent_responses)

    @cached_property
    def _maps(self) -> Array:
        """Matrices from psi, v, x to the outputs, shape (m, 9, 9)."""
        return np.stack([output_map(self.navigated.truth, float(time)) for time in self.navigated.times])

    def _with_filter(self, tunings: Sequence[Navigated]) -> list[CovarianceReadings]:
        loop, times = self._loop, self.navigated.times
        assert loop is not None
        positions = loop.positions(np.searchsorted(loop.times, times - 1e-9), np.ones(len(times)))
        answers = dict[int, CovarianceReadings]()
        by_used: dict[bytes, list[int]] = {}
        for number, tuning in enumerate(tunings):
            by_used.setdefault(tuning.used.tobytes(), []).append(number)
        for numbers in by_used.values():
            used, timelines = tunings[numbers[0]].used, [self._timeline(loop, tunings[number]) for number in numbers]
            for number, tuned in zip(numbers, propagate_tunings(timelines, positions, used), strict=True):
                tuning, partials = tunings[number], tuned.partials[:, :NAVIGATION]
                total = transform(partials[:, :, :-1], tuning.covariance[np.ix_(used, used)])
                total += tuned.covariances[:, :NAVIGATION, :NAVIGATION]
                mean = self._maps @ (partials @ np.append(tuning.mean[used], 1.0))[:, :, None]
                own = map_covariances(self._maps, tuned.own[:, :NAVIGATION, :NAVIGATION])
                answers[number] = CovarianceReadings(times, mean[:, :, 0], map_covariances(self._maps, total), own)
        return [answers[number] for number in range(len(tunings))]

    def _timeline(self, loop: ClosedLoop, tuning: Navigated) -> Timeline:
        """Return the timeline of a tuning, whose steps are those of all others: they are kept, unless they are many."""
        assert tuning.filter is not None
        timeline = loop.system.tuned(tuning.imu, tuning.sensors, tuning.filter)
        if len(loop.times) > MOST_KEPT or timeline.filter is None:
            return timeline
        steps, own = self._steps
        return replace(timeline, steps=steps, filter=replace(timeline.filter, steps=own))

    @cached_property
    def _steps(self) -> tuple[Callable[[int, int], Steps], Callable[[int, int], FilterSteps]]:
        """Steps of the timeline and of its filter, computed once."""
        assert self._loop is not None
        timeline = self._loop.timeline
        assert timeline.filter is not None
        return cache(timeline.steps), cache(timeline.filter.steps)

    @cached_property
    def _free(self) -> tuple[Timeline, Propagated]:
        """The timeline without a filter with processes of size one, and what is propagated along it."""
        base = self.navigated
        responses = recent_responses(base.truth, base.platform, base.grid, base.imu)
        timeline = replace(free_timeline(base.truth, responses, base.imu), sizes={})
        return timeline, propagate(timeline, None, timeline.positions(base.times))

    def _without_filter(self, tuning: Navigated) -> CovarianceReadings:
        timeline, read = self._free
        sizes, partials = process_variances(tuning.imu), read.partials[:, :, :-1]
        total = transform(partials, tuning.covariance)
        for number, name in enumerate(timeline.processes):
            total += sizes.get(name, 0.0) * read.covariances[:, number]
        return CovarianceReadings(tuning.times, partials @ tuning.mean, total)


class Tunings:
    """Navigations that vary one of them, whose tables are kept."""

    def __init__(self) -> None:
        self._tables = Recent[Tables](most=2)

    def answer(self, bases: Sequence[Navigated], asked: Sequence[Navigated]) -> list[CovarianceReadings]:
        """Propagate the errors of navigations; those that are tunings of their base by its tables.

        Others are tunings of one another where none has further errors: which tables answer is the same in any company.
        """
        groups: list[tuple[Tables, list[int]]] = []
        for number, (base, navigated) in enumerate(zip(bases, asked, strict=True)):
            if base.has(navigated):
                tables = self._tables.get((base.grid.tobytes(), base.times.tobytes()), partial(Tables, base))
            else:
                tables = next((known for known, _ in groups if _same(known.navigated, navigated)), Tables(navigated))
            members = next((members for known, members in groups if known is tables), None)
            if members is None:
                groups.append((tables, members := []))
            members.append(number)
        answers = dict[int, CovarianceReadings]()
        for tables, members in groups:
            answers |= zip(members, tables.answer([asked[number] for number in members]), strict=True)
        return [answers[number] for number in range(len(asked))]


def _same(one: Navigated, other: Navigated) -> bool:
    return one.has(other) and other.has(one)
