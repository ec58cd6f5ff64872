"""Linear answers about a loop by the linear engine: readings at instants, around updates, and at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearSystem, Update
from mcnav.contract.scenario import ScenarioError
from mcnav.contract.timeline import Instants, Start, Timeline
from mcnav.linear.engine.design import Design, design
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.smoother import smooth
from mcnav.linear.engine.transitions import TOGETHER
from mcnav.systems.closed_loop.nominal_flight import within_step
from mcnav.systems.closed_loop.timeline import LoopTimeline, LoopTransitions
from mcnav.systems.closed_loop.transitions import Moment, Transition

SAME: Final = 1e-9
"""Share of the flight within which two times are one."""


@dataclass(frozen=True)
class Reading:
    """A reading of the linear system.

    Attributes
    ----------
    time : float
    x : ndarray, shape (size,)
        Of the nominal.
    position : int
        In the timeline; that of the begin of a step for a moment within it.
    label : str, optional
        ``before`` or ``after`` an update.
    within : tuple of Transition
        From the position to the moment.
    """

    time: float
    x: Array
    position: int
    label: Update = None
    within: tuple[Transition, ...] = ()


@dataclass(frozen=True)
class LinearLoop:
    """The linear system of a loop, read out.

    Attributes
    ----------
    begin : int
        Position at which the navigator starts.
    start : Start, optional
        The start there, where it is not that of the flight.
    """

    loop: LoopTimeline
    begin: int = 0
    start: Start | None = None

    @cached_property
    def design(self) -> Design | None:
        """Gains and the filter's covariance at all positions; none without a filter."""
        loop = self.loop
        if loop.states is None:
            return None
        return design(loop.timeline, np.arange(self.begin, loop.timeline.end + 1), self.begin, self.start)

    @property
    def gains(self) -> Table | None:
        """Gains of all updates; none without a filter."""
        return None if self.design is None else self.design.gains

    def at_instants(self, numbers: Sequence[int]) -> list[Reading]:
        """Return readings after all at instants, by number."""
        return [self._after(number) for number in numbers]

    def around(self, numbers: Sequence[int], moments: bool = True) -> list[Reading]:
        """Return readings before and after updates at instants by number, and before and after all corrections.

        Parameters
        ----------
        moments : bool
            Whether to read out before and after events within steps.
        """
        readings: list[Reading] = []
        for number, planned in enumerate(self.loop.linear.instants):
            before = int(self.loop.before[number])
            if before < self.begin:
                continue
            for place, step in enumerate(planned.steps if moments else ()):
                position = before - len(planned.steps) + place
                readings += [_of_moment(moment, position) for moment in step.moments if position >= self.begin]
            corrects = any(update.kind == "correct" for update in planned.updates)
            changes = (number in numbers or corrects) and planned.changed
            after = replace(self._after(number), label="after" if changes else None)
            if changes:
                readings.append(Reading(after.time, planned.before[-1], before, "before"))
            known = bool(readings) and readings[-1].time == after.time and not changes  # after a correction then
            if (number in numbers or changes) and not known:
                readings.append(after)
        return readings

    def _after(self, number: int) -> Reading:
        planned = self.loop.linear.instants[number]
        return Reading(float(self.loop.times[number]), planned.nominal, int(self.loop.after[number]))

    def at_times(self, times: Sequence[float]) -> list[Reading]:
        """Return readings at times, before and after updates where there are some.

        Raises `ScenarioError` for a time outside of the flight.
        """
        loop, known = self.loop, self.loop.times
        first = float(known[np.searchsorted(loop.before, self.begin)])
        same, readings = SAME * float(known[-1]), list[Reading]()
        for time in times:
            if not first - same <= time <= known[-1] + same:
                raise ScenarioError("end", f"got {time:g} s; the flight is from {first:g} s to {known[-1]:g} s")
            nearest = int(np.abs(known - time).argmin())
            if abs(known[nearest] - time) > same:
                readings.append(self._within_step(time))
                continue
            planned, after = loop.linear.instants[nearest], self._after(nearest)
            if planned.changed:
                readings.append(Reading(after.time, planned.before[-1], int(loop.before[nearest]), "before"))
                after = replace(after, label="after")
            readings.append(after)
        return readings

    def _within_step(self, time: float) -> Reading:
        """Return a reading at a time within a step: by transitions of its own, beside the line."""
        loop = self.loop
        number = int(np.searchsorted(loop.times, time))
        planned = loop.linear.instants[number]
        step = int(np.searchsorted(planned.instant.step_times(), time, side="right")) - 1
        transitions, x = within_step(loop.maps, loop.linear, loop.sizes, (number, step), time)
        return Reading(time, x, int(loop.before[number]) - len(planned.steps) + step, None, transitions)

    def smooth(self, readings: Sequence[Reading], lag: float) -> tuple[LinearSystem, Array]:
        """Read the linear system out behind a smoother, with the smoother's covariance, shape (r, k, k).

        Outputs that the filter does not estimate are as they are.

        Raises `ScenarioError` for a reading within a step.
        """
        loop, designed, states = self.loop, self.design, self.loop.states
        assert designed is not None
        assert states is not None
        within = [reading.time for reading in readings if reading.within]
        if within:
            nearest = loop.times[np.abs(loop.times - within[0]).argmin()]
            told = f"got {within[0]:g} s; it is read out at instants of the loop, the nearest is {nearest:g} s"
            raise ScenarioError("filter", f"smoother: {told}")
        positions = np.array([reading.position for reading in readings])
        own = replace(designed, positions=positions, covariances=self.own(readings))
        smoothed, system = smooth(loop.timeline, own, positions, lag), self.read(readings)
        known = states.estimates - loop.maps.structure.estimate.begin
        partials = system.partials.copy()
        partials[:, known] = smoothed.partials[:, :, :-1]
        processes: dict[str, Array] = {}
        for number, name in enumerate(loop.timeline.processes):
            processes[name] = added = system.processes[name].copy()
            added[:, known] = added[:, :, known] = 0.0
            added[:, known[:, None], known] = smoothed.covariances[:, number]
        return without_rounding(replace(system, partials=partials, processes=processes), loop), smoothed.claimed

    def read(self, readings: Sequence[Reading], by_cause: bool = True) -> LinearSystem:
        """Read the linear system out, each process by itself, or all together in less time."""
        loop, names = self.loop, self.loop.timeline.processes
        if not by_cause:
            names = (TOGETHER,)[: len(names)]
        plain = [number for number, reading in enumerate(readings) if not reading.within]
        outputs = len(loop.readout.outputs)
        partials = np.zeros((len(readings), outputs, loop.timeline.sources + 1))
        covariances = np.zeros((len(readings), len(names), outputs, outputs))
        if plain:
            positions = [readings[number].position for number in plain]
            of_plain = propagate(loop.timeline, self.gains, positions, by_cause, self.begin, self.start)
            partials[plain], covariances[plain] = of_plain.partials, of_plain.covariances
        for number in sorted(set(range(len(readings))) - set(plain)):
            of_moment = self._within(readings[number])
            added = of_moment.covariances[0]
            partials[number], covariances[number] = of_moment.partials[0], added if by_cause else added.sum(axis=0)
        nominal = [loop.readout.read_nominal(reading.x, reading.time) for reading in readings]
        floor = loop.readout.floor(loop.linear)
        processes = {name: covariances[:, number] for number, name in enumerate(names)}
        system = LinearSystem(
            np.array([reading.time for reading in readings]), partials[:, :, :-1],
            np.array(nominal).reshape(len(readings), outputs) + partials[:, :, -1], processes,
            tuple(reading.label for reading in readings),
            origin=np.array([loop.readout.origin(reading.x, floor) for reading in readings]).reshape(-1, outputs),
        )  # fmt: skip
        return without_rounding(system, loop)

    def own(self, readings: Sequence[Reading]) -> Array:
        """Return the filter's covariance at readings, shape (r, k, k)."""
        designed = self.design
        assert designed is not None
        covariances = designed.covariances[[reading.position - self.begin for reading in readings]]
        for number, reading in enumerate(readings):
            if reading.within:
                covariances[number] = design(
                    self._branch(reading, covariances[number]), (len(reading.within),)
                ).covariances[0]
        return covariances

    def _within(self, reading: Reading) -> Propagated:
        """Read a moment within a step: by transitions of its own, from X at the begin of the step."""
        return propagate(self._branch(reading), None, (len(reading.within),))

    def _branch(self, reading: Reading, own: Array | None = None) -> Timeline:
        """Return the timeline from the begin of a step to a moment within it.

        Parameters
        ----------
        own : ndarray, shape (k, k), optional
            The filter's covariance at the begin, for the filter alone.
        """
        loop, timeline = self.loop, self.loop.timeline
        start, filtered = timeline.start, None
        if own is None:
            whole = np.eye(timeline.states)
            there = propagate(
                timeline, self.gains, (reading.position,), begin=self.begin, start=self.start, maps=lambda _: whole
            )
            start = Start(there.partials[0], dict(zip(timeline.processes, there.covariances[0], strict=True)))
        transitions = LoopTransitions(loop.maps, loop.states, loop.sizes, loop.pairs, reading.within)
        if own is not None and timeline.filter is not None:
            filtered = replace(
                timeline.filter, steps=transitions.filter_steps_between, covariance=own,
                responses=timeline.filter.responses[:0], variances=timeline.filter.variances[:0],
            )  # fmt: skip
        count = len(reading.within)
        ends = np.array([0, count])
        return Timeline(
            start, np.zeros(count, dtype=bool), transitions.steps_between, Instants(np.array([0.0, 1.0]), ends, ends),
            lambda position, time: loop.read_at(reading.x, reading.time), timeline.processes, timeline.biases,
            filter=filtered,
        )  # fmt: skip


def _of_moment(moment: Moment, position: int) -> Reading:
    return Reading(moment.time, moment.x, position, moment.label, (moment.transition,))


def without_rounding(system: LinearSystem, loop: LoopTimeline) -> LinearSystem:
    """Return readings in which outputs that are rounding alone are not dispersed at all.

    Partial derivatives by sources without a size are kept where the step of a difference moves the output.
    """
    start, floor = loop.sizes.true.start, loop.readout.floor(loop.linear)
    steps = np.array([loop.linear.steps[source.moves[0]] for source in loop.maps.structure.sources])
    variances = transformed_variances(system.partials, start)
    for process in system.processes.values():
        variances = variances + np.diagonal(process, axis1=1, axis2=2)
    kept = ~(variances <= floor**2)  # NaN of a loop that diverges is kept, and told
    moved = (np.diag(start) == 0.0) & (np.abs(system.partials) * steps > floor[:, None])
    return replace(
        system, partials=np.where(kept[:, :, None] | moved, system.partials, 0.0),
        processes={name: _kept(process, kept) for name, process in system.processes.items()},
    )  # fmt: skip


def _kept(covariances: Array, kept: NDArray[np.bool_]) -> Array:
    """Return a process's covariances of the outputs that are kept, without variances that rounding makes negative."""
    own = kept & ~(np.diagonal(covariances, axis1=1, axis2=2) <= 0.0)
    return np.where(own[:, :, None] & own[:, None, :], covariances, 0.0)
