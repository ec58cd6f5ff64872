"""An aided navigator along the truth: the tables of its timeline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Timeline
from mcnav.linear.engine.design import Design, design
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.filter.tables import FilterTables, tabulate_filter
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.linear.aided_timeline import AidedSystem
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.measurements import Measurements, Schedule
from mcnav.systems.ins.truth.trajectory import Platform, Truth


@dataclass
class FilterDesign:
    """Gains of a filter along the truth, and its covariance at the positions that have been asked for."""

    known: Design | None = None

    def at(self, timeline: Timeline, positions: IndexArray) -> Design:
        """Return the design with the filter's covariance at positions, in any order."""
        known = self.known
        if known is None or not np.isin(positions, known.positions).all():
            wanted = np.unique(positions if known is None else np.concatenate([known.positions, positions]))
            known = self.known = design(timeline, wanted)
        places = np.searchsorted(known.positions, positions)
        return replace(known, positions=positions, covariances=known.covariances[places])


@dataclass(frozen=True)
class ClosedLoop:
    """An aided navigator along the truth, on a grid of K steps.

    Attributes
    ----------
    first_updates : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    filter_design : FilterDesign
        Of the filter.
    """

    truth: Truth
    platform: Platform
    imu: Imu
    sensors: tuple[Sensor, ...]
    model: FilterModel
    responses: Responses
    schedule: Schedule
    filter: FilterTables
    first_updates: IndexArray
    filter_design: FilterDesign = field(default_factory=FilterDesign)

    @property
    def times(self) -> Array:
        """Times of the grid, shape (K + 1,)."""
        return self.responses.times

    @property
    def measurements(self) -> Measurements:
        """Tables of all updates, which samples take."""
        return self.schedule.whole

    @cached_property
    def system(self) -> AidedSystem:
        """What its timeline and those of its tunings consist of."""
        return AidedSystem(
            self.truth, self.imu, self.sensors, self.model, self.responses, self.schedule, self.filter,
            self.first_updates,
        )  # fmt: skip

    @property
    def timeline(self) -> Timeline:
        """The timeline of its true errors, with its filter."""
        return self.system.timeline

    def positions(self, readings: IndexArray, after: Array) -> IndexArray:
        """Return the positions of readings: numbers of times, and whether after the updates there, shapes (m,)."""
        return readings + self.first_updates[readings + np.asarray(after, dtype=np.int64)]

    def designed(self, positions: IndexArray | None = None) -> Design:
        """Return the filter's gains along the truth, and its covariance at positions."""
        return self.filter_design.at(self.timeline, np.zeros(0, np.int64) if positions is None else positions)

    def times_of(self, updates: IndexArray) -> IndexArray:
        """Return the numbers of the times of updates."""
        return np.asarray(np.searchsorted(self.first_updates, updates, side="right") - 1, dtype=np.int64)


def close_loop(
    truth: Truth, platform: Platform, times: Array, imu: Imu, sensors: tuple[Sensor, ...], model: FilterModel,
    respond: Callable[[Truth, Platform, Array, Imu], Responses] = Responses, schedule: Schedule | None = None,
) -> ClosedLoop:  # fmt: skip
    """Tabulate an aided navigator along the truth.

    Parameters
    ----------
    times : ndarray, shape (K + 1,)
        Rising, with all instants of the sensors among them; the first is the start of navigation.
    respond : callable
        Returns the responses over the steps.
    schedule : Schedule, optional
        Of the sensors' updates, where it is known.
    """
    responses = respond(truth, platform, times, imu)
    schedule = Schedule.of(truth, platform, float(times[0]), sensors) if schedule is None else schedule
    tables = tabulate_filter(truth, imu, responses, model, schedule)
    first = np.append(np.searchsorted(schedule.times, times, side="left"), len(schedule.times))
    return ClosedLoop(truth, platform, imu, sensors, model, responses, schedule, tables, first)


@dataclass(frozen=True)
class ShownPairs:
    """States as they are shown at m readings: of a flexure the angle and its rate.

    Attributes
    ----------
    natural, partners : ndarray, shapes (m, q, 2), (q,)
        As `mcnav.systems.ins.filter.tables.FilterTables` has them.
    """

    natural: Array
    partners: IndexArray

    @classmethod
    def of(cls, loop: ClosedLoop, readings: IndexArray) -> ShownPairs | None:
        """Return those of a loop; none where all states are shown as they are."""
        tables = loop.filter
        if np.array_equal(tables.partners, np.arange(len(tables.partners))):
            return None
        return cls(tables.natural(readings), tables.partners)

    def of_values(self, values: Array) -> Array:
        """Return values of the states, shape (m, q, s), as they are shown."""
        own, other = self.natural[:, :, 0, None], self.natural[:, :, 1, None]
        return np.asarray(own * values + other * values[:, self.partners])

    def of_covariances(self, covariance: Array) -> Array:
        """Return the variances of the states as shown from their covariance, shapes (m, q), (m, q, q)."""
        rows = self.of_values(covariance)
        both = self.of_values(rows.swapaxes(1, 2))
        return np.diagonal(both, axis1=1, axis2=2).copy()
