"""Samples in flight: each has its own truth, navigator, filter and guidance.

The linear outcome of a sample is the plan's linear system with the same draws.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.systems.closed_loop.algebra import combine, propagate, update
from mcnav.systems.closed_loop.differences import differentiate_own
from mcnav.systems.closed_loop.event import find_crossings
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, SENSORS, Noise, NoNoise
from mcnav.systems.closed_loop.plan import Transition
from mcnav.systems.closed_loop.records import Recorder
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.timeline import Instant


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
    share : ndarray, shape (n,), optional
        Fraction of a step for each sample.
    """

    function: Callable[..., Array]
    x: Array
    entering: Array
    believed: Array
    share: Array | None = None

    def some(self, chosen: NDArray[np.bool_]) -> OwnMap:
        """Return the map of some samples."""
        share = None if self.share is None else self.share[chosen]
        return OwnMap(self.function, self.x[:, chosen], self.entering[:, chosen], self.believed, share)


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
    sign: Array
    recorder: Recorder | None
    history: Array
    own: bool = False
    number: int = 0
    failures: dict[int, Failure] = field(default_factory=dict)
    gains: dict[int, Transition] = field(default_factory=dict)

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Drop samples that have ended."""
        self.rows, self.x, self.sign = self.rows[kept], self.x[:, kept], self.sign[kept]
        if self.own:
            self.covariance = self.covariance[:, :, kept]

    def end(self, ended: NDArray[np.bool_], x: Array) -> None:
        """Keep the final X, shape (size, k), of samples that have ended."""
        self.final[:, self.rows[ended]] = x[:, ended]
        if self.own:
            self.final_covariance[:, :, self.rows[ended]] = self.covariance[:, :, ended]
        self.keep(~ended)

    def drop_failed(self, time: float) -> None:
        """Drop samples that are not finite."""
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
        f, entering = states.of_errors(straight.state, straight.inputs * map_.believed)
        bent = straight.departures(map_.x, map_.entering, outcome)
        if not bent.any():
            return propagate(covariance, f, entering)
        result = np.empty_like(covariance)
        result[:, :, ~bent] = propagate(covariance[:, :, ~bent], f, entering)
        result[:, :, bent] = propagate(covariance[:, :, bent], *self.own_derivatives(map_.some(bent), states))
        return result

    def own_derivatives(self, map_: OwnMap, states: FilterStates) -> tuple[Array, Array]:
        """Compute F, shape (states, states, n), and what enters in believed sizes, shape (states, inputs, n)."""
        seen, space = self.seen(map_.x, states), self.setup.maps.structure.space
        directions = self.directions(states)
        changes = differentiate_own(map_.function, seen, directions, map_.believed, space, space, map_.share)
        moved = changes[states.estimates] - changes[states.counterparts]
        moved = np.concatenate([moved, -changes[states.considered]])
        return moved[:, : states.count] / self.scale(states)[:, None], moved[:, states.count :]

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
        drawn = self.noise.draw(PROCESSES, 2 * inputs) * np.tile(setup.true.inputs, 2)[:, None]
        plan, length = setup.plan, instant.length
        planned = None
        if self.number <= plan.end and number < len(plan.instants[self.number].steps):
            planned = plan.instants[self.number].steps[number]
            self.follow(planned, drawn)
        if not len(self.rows):
            return

        def function(x: Array, entering: Array) -> Array:
            white = entering.reshape(2, inputs, x.shape[1])
            return maps.step(x, np.full(x.shape[1], time), length, white)

        white = drawn[:, self.rows]
        after = function(self.x, white)
        if maps.end is not None:
            value = maps.triggered(maps.end, after, np.full(len(self.rows), time + length))
            met = np.sign(value) != self.sign
            if met.any():
                met &= np.isfinite(value)
                after, white = self._end_within(instant, time, white, after, value, met)
        if self.own:
            own = OwnMap(function, self.x, white, np.tile(setup.believed.inputs, 2))
            self.covariance = self.propagated_own(own, self.covariance, planned, after)
        self.x = after
        self.drop_failed(time + length)

    def _end_within(
        self, instant: Instant, time: float, white: Array, after: Array, value: Array, met: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """End the samples that have met the trigger within a step; return X after it and the noise of the others."""
        maps, length = self.setup.maps, instant.length
        assert maps.end is not None
        inputs = maps.structure.white.size + maps.structure.markov.size
        x, begin = self.x[:, met], np.full(int(met.sum()), time)
        of_step = white[:, met].reshape(2, inputs, len(begin))
        before = maps.triggered(maps.end, x, begin)
        fraction = find_crossings(maps, x, begin, length, of_step, before, value[met])
        moment = begin + fraction * length
        there = maps.step(x, begin, length, of_step, fraction)
        there[maps.structure.clock.whole] = moment
        if maps.continuous:
            there = maps.after_guidance(there, moment)
        ended = after.copy()
        ended[:, met] = there
        if self.own:

            def part(states: Array, entering: Array, share: Array) -> Array:
                drawn = entering.reshape(2, inputs, states.shape[1])
                return maps.step(states, np.full(states.shape[1], time), length, drawn, share)

            own = OwnMap(part, x, white[:, met], np.tile(self.setup.believed.inputs, 2), fraction)
            self.covariance[:, :, met] = self.propagated_own(own, self.covariance[:, :, met])
        self.end(met, ended)
        return after[:, ~met], white[:, ~met]

    def end_jumped(self, time: float) -> None:
        """End the samples that an update has carried over the trigger."""
        maps = self.setup.maps
        if maps.end is not None and len(self.rows):
            met = np.sign(maps.triggered(maps.end, self.x, np.full(len(self.rows), time))) != self.sign
            if met.any():
                self.x[self.setup.maps.structure.clock.whole] = np.where(met, time, 0.0)
                self.end(met, self.x)

    def follow(self, transition: Transition, drawn: Array | None = None) -> None:
        """Apply a transition of the linear system to all samples' deviations."""
        self.deviation = combine(transition.state, self.deviation)
        if drawn is not None and len(drawn):
            self.deviation += combine(transition.inputs, drawn)

    def measure(self, number: int, time: float, planned: Transition | None) -> None:
        """Update every sample's navigator by a sensor."""
        setup, maps, states = self.setup, self.setup.maps, self.setup.states
        if states is None:
            return
        sigma = setup.believed.measurements[number]
        drawn = self.noise.draw(SENSORS + number, len(sigma)) * setup.true.measurements[number][:, None]
        if planned is not None:
            self.follow(planned, drawn)
            self.gains[number] = planned
        if not len(self.rows):
            return

        def function(x: Array, entering: Array) -> Array:
            return maps.innovation(number, x, np.full(x.shape[1], time))

        exact = function(self.x, drawn)
        innovation = exact + drawn[:, self.rows]
        if self.own:
            gain, factor, self.covariance = self.own_update(
                OwnMap(function, self.x, drawn[:, self.rows], sigma), exact, planned
            )
            added = combine(gain, innovation)
        else:
            last = self.gains[number]
            assert last.gain is not None
            assert last.factor is not None
            factor, added = last.factor, combine(last.gain, innovation)
        change = np.zeros_like(self.x)
        change[states.estimates] = added
        self.x = maps.structure.space.plus(self.x, change)
        if self.recorder is not None:
            self.recorder.sensors[number].add(self.rows, innovation, factor)

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

        after = function(self.x, drawn[:, self.rows])
        own = OwnMap(function, self.x, drawn[:, self.rows], setup.believed.corrections[number])
        self.covariance = self.propagated_own(own, self.covariance, planned, after)
        self.x = after

    def update(self, instant: Instant) -> None:
        """Measure, correct, guide and read out at an instant."""
        setup, plan = self.setup, self.setup.plan
        known = list(plan.instants[self.number].updates) if self.number <= plan.end else []
        event = bool(known) and known[0].kind == "event"
        if event:  # the nominal has ended within the steps before
            for transition in known:
                self.follow(transition)
            known = []

        def planned() -> Transition | None:
            return known.pop(0) if known else None

        if setup.states is not None:
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

    def read(self, epoch: int) -> None:
        """Read all samples out at an epoch, those that have ended as they were at their end."""
        setup = self.setup
        x, covariance = self.final.copy(), self.final_covariance.copy() if self.own else self.covariance
        x[:, self.rows] = self.x
        if self.own:
            covariance[:, :, self.rows] = self.covariance
        values = setup.readout.read(x, self.nominal).T
        nominal = setup.readout.read(self.nominal[:, None], self.nominal)[:, 0]
        self.history[:, epoch] = np.where(np.abs(values - nominal) <= setup.floor, nominal, values)
        if self.recorder is not None:
            self.recorder.record(epoch, x, covariance)
