"""Samples in flight: each has its own truth, navigator, filter and guidance.

The linear outcome of a sample is the plan's linear system with the same draws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.systems.closed_loop.algebra import combine, propagate, update, whiten
from mcnav.systems.closed_loop.differences import differentiate_own
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Event, Maps
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, SENSORS, Noise, NoNoise
from mcnav.systems.closed_loop.own_update import stated_covariance, updated
from mcnav.systems.closed_loop.passage import Step, find_passages, meet, pass_through
from mcnav.systems.closed_loop.records import Recorder, sum_rows
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.structure import Part
from mcnav.systems.closed_loop.transitions import Transition

NOTHING: Final = np.zeros(0, dtype=bool)
"""Flags of an event that there is not."""


def late_failure(event: Event, time: float) -> Failure:
    """Return why a sample has failed that has not met an event by a time."""
    prefix = "" if event.kind == "end" else f"{event.name}: "
    return Failure(Reason.STATED, f"{prefix}meets no trigger by {time:g} s")


@dataclass(frozen=True)
class OwnMap:
    """A map of samples in flight with what enters it.

    Attributes
    ----------
    function : callable
        Of X, shape (size, n), and what enters, shape (inputs, n); and of ``share``, where there is one.
    x, entering : ndarray, shapes (size, n) and (inputs, n)
    believed : ndarray, shape (inputs,)
        Believed sizes of what enters.
    share : ndarray, shape (..., n), optional
        Fractions of a step for each sample.
    parts : mapping of str to callable
        The same of the truth and of the navigator alone, with the rows of X that are theirs; none where these depend
        on each other.
    """

    function: Callable[..., Array]
    x: Array
    entering: Array
    believed: Array
    share: Array | None = None
    parts: Mapping[Part, Callable[..., Array]] = field(default_factory=dict)

    def some(self, chosen: NDArray[np.bool_]) -> OwnMap:
        """Return the map of some samples."""
        share = None if self.share is None else self.share[..., chosen]
        x, entering = self.x[:, chosen], self.entering[:, chosen]
        return replace(self, x=x, entering=entering, share=share)


@dataclass
class Flight:
    """Samples in flight: those that have not ended, by their rows, and what was read out of all.

    Attributes
    ----------
    x : ndarray, shape (size, k)
        Of the samples in flight.
    covariance : ndarray, shape (states, states, k) or (states, states, 1)
        Each filter's own, or the planned one.
    own : bool
        Whether each sample has its own covariance.
    deviation : ndarray, shape (size, n)
        Of all samples by the linear system.
    signs : ndarray, shape (events,)
        Of the triggers' functions before they are met.
    pending : ndarray of bool, shape (events, k)
        Which events have not happened.
    impulses : mapping of int to ndarray, shape (axes, n)
        Execution errors of corrections by trigger, by number.
    final : ndarray, shape (size, n)
        X at the end of those that have ended; NaN for those that failed.
    """

    setup: Setup
    noise: Noise | NoNoise
    rows: NDArray[np.intp]
    x: Array
    covariance: Array
    deviation: Array
    final: Array
    final_covariance: Array
    signs: Array
    pending: NDArray[np.bool_]
    impulses: Mapping[int, Array]
    recorder: Recorder | None
    history: Array
    own: bool = False
    number: int = 0
    failures: dict[int, Failure] = field(default_factory=dict)
    gains: dict[int, Transition] = field(default_factory=dict)

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Drop samples that have ended."""
        self.rows, self.x, self.pending = self.rows[kept], self.x[:, kept], self.pending[:, kept]
        if self.own:
            self.covariance = self.covariance[:, :, kept]

    def end(self, ended: NDArray[np.bool_], x: Array) -> None:
        """Keep the final X, shape (size, k), of samples that have ended; if they have missed an event they failed."""
        for number, event in enumerate(self.setup.maps.events):
            for column in np.flatnonzero(ended & self.pending[number]).tolist():
                time = float(x[self.setup.maps.structure.clock.whole, column][-1])
                self.failures.setdefault(int(self.rows[column]), late_failure(event, min(event.latest, time)))
        missed = np.any(self.pending[:, ended], axis=0)
        self.final[:, self.rows[ended]] = np.where(missed, np.nan, x[:, ended])
        if self.own:
            self.final_covariance[:, :, self.rows[ended]] = self.covariance[:, :, ended]
        self.keep(~ended)

    def of_flight(self, drawn: Array) -> Array:
        """Return what was drawn for all samples, shape (k, n), for those in flight."""
        return drawn if len(self.rows) == drawn.shape[1] else drawn[:, self.rows]

    def drop_failed(self, time: float) -> None:
        """Drop samples that are not finite."""
        if np.isfinite(self.x.sum()):
            return
        lost = ~np.isfinite(self.x.sum(axis=0))
        if lost.any():
            for row in self.rows[lost].tolist():
                self.failures[row] = Failure(Reason.DIVERGED, f"its states are not finite at {time:g} s")
            self.keep(~lost)

    def reach(self, planned_covariance: Array | None) -> None:
        """Take over the planned covariance where samples have none of their own."""
        if planned_covariance is not None and not self.own:
            self.covariance = planned_covariance[:, :, None]

    def propagated_own(
        self, map_: OwnMap, covariance: Array, planned: Transition | None = None, outcome: Array | None = None
    ) -> Array:
        """Propagate samples' own covariances by a map's derivatives about their own estimates.

        Those of a linear map are the planned ones, for every sample whose outcome, shape (m, n), is that of linearity.
        """
        states = self.setup.states
        if states is None or not self.own or not map_.x.shape[1]:
            return covariance
        straight = None if planned is None else planned.straight
        if straight is None or outcome is None:
            return propagate(covariance, *self.own_derivatives(map_, states))
        assert planned is not None
        state, inputs = (straight.state, straight.inputs) if planned.fixed is None else planned.fixed
        f, entering = states.of_errors(state, inputs * map_.believed)
        bent = straight.departures(map_.x, map_.entering, outcome)
        if not bent.any():
            return propagate(covariance, f, entering)
        if bent.all():
            return propagate(covariance, *self.own_derivatives(map_, states))
        result = np.empty_like(covariance)
        result[:, :, ~bent] = propagate(covariance[:, :, ~bent], f, entering)
        result[:, :, bent] = propagate(covariance[:, :, bent], *self.own_derivatives(map_.some(bent), states))
        return result

    def own_derivatives(self, map_: OwnMap, states: FilterStates) -> tuple[Array, Array]:
        """Compute F, shape (states, states, n), and what enters in believed sizes, shape (states, inputs, n)."""
        seen, space = self.seen(map_.x, states), self.setup.maps.structure.space
        if map_.parts:
            return self.derivatives_apart(map_, states, seen)
        directions = self.directions(states)
        changes = differentiate_own(map_.function, seen, directions, map_.believed, space, space, map_.share)
        moved = changes[states.estimates] - changes[states.counterparts]
        moved = np.concatenate([moved, -changes[states.considered]])
        return moved[:, : states.count] / self.scale(states)[:, None], moved[:, states.count :]

    def derivatives_apart(self, map_: OwnMap, states: FilterStates, seen: Array) -> tuple[Array, Array]:
        """Compute `own_derivatives` of a map whose truth and navigator ignore each other.

        Estimates move the navigator alone; what is considered, and what enters, move the truth alone.
        """
        structure, count, estimated = self.setup.maps.structure, states.count, states.estimated
        directions, scale = self.directions(states), self.scale(states)[:, None]
        of = {"navigator": (directions[:, :estimated], 0.0 * map_.believed),
              "truth": (directions[:, estimated:], map_.believed)}  # fmt: skip
        navigator, truth = (
            differentiate_own(map_.parts[part], seen, *of[part], structure.space, structure.spaces[part])
            for part in ("navigator", "truth")
        )
        considered = count - estimated
        f = np.zeros((count, count, seen.shape[1]))
        f[:estimated, :estimated] = navigator[states.estimates - structure.rows("navigator").start]
        moved = 0.0 - truth[[*states.counterparts, *states.considered]]
        f[:, estimated:] = moved[:, :considered]
        f /= scale
        return f, moved[:, considered:]

    def scale(self, states: FilterStates) -> Array:
        """Return the steps of differences of the filter's states, shape (count,)."""
        return np.asarray(np.abs(states.moving).T @ self.setup.steps)

    def directions(self, states: FilterStates) -> Array:
        """Return the changes of X by a step of each of the filter's states, shape (size, count)."""
        return states.moving * self.scale(states)

    def seen(self, x: Array, states: FilterStates) -> Array:
        """Return X as the navigators see it; see `FilterStates.seen`."""
        return states.seen(x, self.nominal, self.setup.maps.structure)

    @property
    def nominal(self) -> Array:
        """X of the nominal at the last instant, shape (size,)."""
        plan = self.setup.plan
        return plan.instants[min(self.number, plan.end)].nominal

    def step(self, instant: Instant, number: int, time: float) -> None:
        """Propagate by a step; samples whose trigger happens end within it."""
        setup, maps = self.setup, self.setup.maps
        inputs = maps.structure.white.size + maps.structure.markov.size
        drawn = self.noise.draw(PROCESSES, 2 * inputs) * setup.true.modes[:, None]
        plan, length = setup.plan, instant.length
        planned = None
        if self.number <= plan.end and number < len(plan.instants[self.number].steps):
            planned = plan.instants[self.number].steps[number]
            self.follow(planned, drawn)
        if not len(self.rows):
            return

        def function(x: Array, entering: Array, part: Part = "both", loop: Maps = maps) -> Array:
            white = entering.reshape(2, inputs, x.shape[1])
            return loop.step(x, np.full(x.shape[1], time), length, white, part=part)

        white = self.of_flight(drawn)
        after = function(self.x, white)
        met = NOTHING
        if maps.events:
            times = np.full(len(self.rows), time + length)
            met = np.any(meet(maps, after, times, self.signs, self.pending), axis=0)
        parts: dict[Part, Callable[..., Array]] = {}
        as_believed = partial(function, loop=maps.as_believed)
        if maps.apart:
            parts = {"truth": partial(as_believed, part="truth"), "navigator": partial(as_believed, part="navigator")}
        own = OwnMap(as_believed, self.x, white, setup.believed.modes, parts=parts)
        if not met.any():
            self.covariance = self.propagated_own(own, self.covariance, planned, after)
            self.x = after
        else:
            smooth = ~met
            if self.own:
                self.covariance[:, :, smooth] = self.propagated_own(
                    own.some(smooth), self.covariance[:, :, smooth], planned, after[:, smooth]
                )
            self._pass(Step(time, length), white.reshape(2, inputs, len(self.rows)), met, after)
        self.drop_failed(time + length)

    def _pass(self, step: Step, white: Array, met: NDArray[np.bool_], after: Array) -> None:
        """Let the samples that meet events pass through them; those that end leave.

        Parameters
        ----------
        after : ndarray, shape (size, k)
            X of the other samples after the step.
        """
        setup, maps, columns = self.setup, self.setup.maps, np.flatnonzero(met)
        noises = [self.execution_errors(number)[:, self.rows] for number in range(len(maps.events))]
        of_x, of_white = self.x[:, met], white[:, :, met]
        of_noise = [noise[:, met] for noise in noises]
        passages = find_passages(maps, step, of_x, of_white, self.signs, self.pending[:, met], of_noise)
        ended = np.zeros(len(self.rows), dtype=bool)
        after = after.copy()
        for events, chosen in passages.groups():
            here, fractions = columns[chosen], passages.fractions[: len(events), chosen]
            of_step = white[:, :, here].reshape(2 * white.shape[1], len(here))
            entering = np.concatenate([of_step, *(noises[event][:, here] for event in events)])
            own = [setup.believed.corrections[maps.events[e].number] for e in events if self._corrects(e)]
            after[:, here] = self._passing(maps, step, events)(self.x[:, here], entering, fractions)
            if self.own:
                believed = np.concatenate([setup.believed.modes, *own])
                function = self._passing(maps.as_believed, step, events)
                passing = OwnMap(function, self.x[:, here], entering, believed, fractions)
                self.covariance[:, :, here] = self.propagated_own(passing, self.covariance[:, :, here])
            self.pending[np.array(events, dtype=np.intp)[:, None], here] = False
            ended[here] = bool(events) and maps.events[events[-1]].kind == "end"
        self.x = after
        self.end(ended, after)

    def _corrects(self, number: int) -> bool:
        return self.setup.maps.events[number].kind == "correction"

    def _passing(self, maps: Maps, step: Step, events: tuple[int, ...]) -> Callable[..., Array]:
        """Return the map of a step with events: of X, of noise, and of the fractions at which they happen."""
        inputs = maps.structure.white.size + maps.structure.markov.size
        sizes = [len(self.execution_errors(number)) for number in events]
        splits = np.cumsum([2 * inputs, *sizes])[:-1]

        def function(x: Array, entering: Array, fractions: Array) -> Array:
            count = x.shape[1]
            white, *noises = np.split(entering, splits) if events else [entering]
            return pass_through(maps, step, x, white.reshape(2, inputs, count), events, fractions, noises)

        return function

    def execution_errors(self, number: int) -> Array:
        """Return the execution errors of an event that is a correction, shape (axes, n); of others none."""
        event = self.setup.maps.events[number]
        return self.impulses[event.number] if event.kind == "correction" else np.zeros((0, self.final.shape[1]))

    def end_jumped(self, time: float) -> None:
        """Let the events happen over whose trigger an update has carried samples."""
        maps = self.setup.maps
        for number in range(len(maps.events)):
            times = np.full(len(self.rows), time)
            met = meet(maps, self.x, times, self.signs, self.pending)[number]
            if not met.any():
                continue
            noise = self.execution_errors(number)[:, self.rows]

            def function(x: Array, entering: Array, number: int = number) -> Array:
                return maps.happen(number, x, np.full(x.shape[1], time), entering)

            if self.own and self._corrects(number):
                believed = self.setup.believed.corrections[maps.events[number].number]
                own = OwnMap(function, self.x[:, met], noise[:, met], believed)
                self.covariance[:, :, met] = self.propagated_own(own, self.covariance[:, :, met])
            self.x = self.x.copy()
            self.x[:, met] = function(self.x[:, met], noise[:, met])
            self.pending[number, met] = False
            if maps.events[number].kind == "end":
                self.end(met, self.x)

    def expire(self, time: float, over: bool = False) -> None:
        """Fail the samples that have not met an event by a time, or by the end of the flight."""
        for number, event in enumerate(self.setup.maps.events):
            late = self.pending[number] & (over or event.latest <= time)
            if late.any():
                for row in self.rows[late].tolist():
                    self.failures[row] = late_failure(event, min(event.latest, time))
                self.keep(~late)

    def follow(self, transition: Transition, drawn: Array | None = None) -> None:
        """Apply a transition of the linear system to all samples' deviations."""
        self.deviation = combine(transition.state, self.deviation)
        if drawn is not None and len(drawn):
            self.deviation += combine(transition.inputs, drawn)
        for number, inputs in transition.corrections.items():
            self.deviation += combine(inputs, self.impulses[number])

    def measure(self, number: int, time: float, planned: Transition | None) -> None:
        """Update every sample's navigator by a sensor."""
        setup, maps, states = self.setup, self.setup.maps, self.setup.states
        sigma = setup.believed.measurements[number]
        drawn = self.noise.draw(SENSORS + number, len(sigma)) * setup.true.measurements[number][:, None]
        fault = setup.gates.errors.get((number, time))
        if fault is not None:
            drawn = drawn + fault[:, None]
        if planned is not None:
            self.follow(planned, drawn)
            self.gains[number] = planned
        if not len(self.rows):
            return
        if states is None:
            self.x = updated(maps, number, self.x, np.full(len(self.rows), time), self.of_flight(drawn))
            return

        def function(x: Array, entering: Array) -> Array:
            return maps.innovation(number, x, np.full(x.shape[1], time))

        exact = function(self.x, drawn)
        noise = self.of_flight(drawn)
        innovation, before = exact + noise, self.covariance
        if self.own:
            gain, factor, self.covariance = self.own_update(OwnMap(function, self.x, noise, sigma), exact, planned)
            added = combine(gain, innovation)
        else:
            last = self.gains[number]
            assert last.gain is not None
            assert last.factor is not None
            factor, added = last.factor, combine(last.gain, innovation)
        limit = setup.gates.limits[number]
        if self.recorder is not None or np.isfinite(limit):
            white = whiten(factor, innovation)
            rejected = sum_rows(white**2) > limit
            added[:, rejected] = 0.0
            if self.own and rejected.any():
                self.covariance[:, :, rejected] = before[:, :, rejected]
            if self.recorder is not None:
                self.recorder.sensors[number].add(self.rows, white, rejected)
        change = np.zeros_like(self.x)
        change[states.estimates] = added
        self.x = maps.structure.space.plus(self.x, change)

    def own_update(self, map_: OwnMap, exact: Array, planned: Transition | None) -> tuple[Array, Array, Array]:
        """Compute samples' own gains, factors of their innovations' covariances, and covariances after an update."""
        states = self.setup.states
        assert states is not None
        straight = None if planned is None else planned.straight
        count, size = exact.shape[1], len(map_.believed)
        bent = np.ones(count, dtype=bool)
        if straight is not None:
            bent = straight.departures(map_.x, np.zeros_like(exact), exact)
        shared = np.zeros((0, 0, 1)) if straight is None else -(straight.state @ states.moving)[:, :, None]
        if not bent.any() or bent.all():
            h = self.own_sensitivities(map_, states) if bent.any() else shared
            gains, factor, after = update(self.covariance, h, map_.believed, states.estimated)
            return gains[: states.estimated], factor, after
        gain, factor = np.empty((states.estimated, size, count)), np.empty((size, size, count))
        after = np.empty_like(self.covariance)
        for chosen, own in ((~bent, False), (bent, True)):
            if chosen.any():
                h = self.own_sensitivities(map_.some(chosen), states) if own else shared
                some = update(self.covariance[:, :, chosen], h, map_.believed, states.estimated)
                gain[:, :, chosen], factor[:, :, chosen], after[:, :, chosen] = some[0][: states.estimated], *some[1:]
        return gain, factor, after

    def own_sensitivities(self, map_: OwnMap, states: FilterStates) -> Array:
        """Compute H, shape (m, states, n)."""
        seen, space = self.seen(map_.x, states), self.setup.maps.structure.space
        changes = differentiate_own(map_.function, seen, self.directions(states), np.zeros(0), space)
        return np.asarray(-changes / self.scale(states)[:, None])

    def correct(self, number: int, time: float, planned: Transition | None) -> None:
        """Apply every sample's correction."""
        setup, maps = self.setup, self.setup.maps
        sizes = setup.true.corrections[number]
        drawn = self.noise.draw(CORRECTIONS + number, len(sizes)) * sizes[:, None]
        if planned is not None:
            self.follow(planned, drawn)
        if not len(self.rows):
            return

        def function(x: Array, entering: Array) -> Array:
            return maps.corrected(number, x, np.full(x.shape[1], time), entering)

        noise = self.of_flight(drawn)
        after = function(self.x, noise)
        own = OwnMap(function, self.x, noise, setup.believed.corrections[number])
        self.covariance = self.propagated_own(own, self.covariance, planned, after)
        self.x = after

    def update(self, instant: Instant) -> None:
        """Measure, correct, guide and read out at an instant."""
        setup, plan = self.setup, self.setup.plan
        known = list(plan.instants[self.number].updates) if self.number <= plan.end else []
        if known and known[0].kind == "event":  # the nominal has ended within the steps before
            self.follow(known.pop())

        def planned() -> Transition | None:
            return known.pop(0) if known else None

        if instant.phase is not None and len(self.rows):
            self.x = setup.maps.begin_phase(instant.phase, self.x)
        if setup.states is not None or setup.maps.update is not None:
            for number in instant.measurements:
                self.measure(number, instant.time, planned())
                self.end_jumped(instant.time)
        for number in instant.corrections:
            self.correct(number, instant.time, planned())
            self.end_jumped(instant.time)
        if instant.guide and setup.maps.guide is not None:
            guided = planned()
            if guided is not None:
                self.follow(guided)
            if len(self.rows):
                self.x = setup.maps.after_guidance(self.x, np.full(len(self.rows), instant.time))
        self.drop_failed(instant.time)

    def read(self, epoch: int, time: float) -> None:
        """Read all samples out at an epoch and its time, those that have ended as they were at their end."""
        setup = self.setup
        x, covariance = self.final.copy(), self.final_covariance.copy() if self.own else self.covariance
        x[:, self.rows] = self.x
        if self.own:
            covariance[:, :, self.rows] = self.covariance
        times = np.full(x.shape[1], time)
        if setup.maps.ends:
            ended = np.ones(x.shape[1], dtype=bool)
            ended[self.rows] = False
            times[ended] = x[setup.maps.structure.clock.whole, ended][-1]
        values = setup.readout.read(x, self.nominal, times).T
        nominal = setup.readout.read_nominal(self.nominal, time)
        self.history[:, epoch] = np.where(np.abs(values - nominal) <= setup.floor, nominal, values)
        if self.recorder is not None:
            if setup.maps.covariance is not None:
                covariance = stated_covariance(setup.maps, x, times)
            self.recorder.record(epoch, x, covariance)
