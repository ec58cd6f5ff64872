"""Samples in flight: each has its own truth, navigator, filter and guidance.

The linear outcome of a sample is the plan's linear system with the same draws.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.systems.closed_loop.differences import Map, differentiate_own
from mcnav.systems.closed_loop.event import find_crossings
from mcnav.systems.closed_loop.filter import FilterStates, propagated, updated
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, SENSORS, Noise, NoNoise
from mcnav.systems.closed_loop.plan import Transition
from mcnav.systems.closed_loop.records import Recorder
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.timeline import Instant


@dataclass
class Flight:
    """Samples in flight: those that have not ended, by their rows, and what was read out of all.

    Attributes
    ----------
    x : ndarray, shape (size, k)
        Of the samples in flight.
    covariance : ndarray, shape (k, states, states) or (states, states)
        Each filter's own, or the planned one.
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
    number: int = 0
    failures: dict[int, Failure] = field(default_factory=dict)
    gains: dict[int, Transition] = field(default_factory=dict)

    @property
    def own(self) -> bool:
        """Whether each sample has its own covariance."""
        return self.covariance.ndim == 3

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Drop samples that have ended."""
        self.rows, self.x, self.sign = self.rows[kept], self.x[:, kept], self.sign[kept]
        if self.own:
            self.covariance = self.covariance[kept]

    def end(self, ended: NDArray[np.bool_], x: Array) -> None:
        """Keep the final X, shape (size, k), of samples that have ended."""
        self.final[:, self.rows[ended]] = x[:, ended]
        if self.own:
            self.final_covariance[self.rows[ended]] = self.covariance[ended]
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
            self.covariance = planned_covariance

    def propagated_own(self, function: Map, believed: Array, x: Array, covariance: Array) -> Array:
        """Propagate samples' own covariances by a map's derivatives about their own estimates."""
        states = self.setup.states
        if states is None or not self.own or not x.shape[1]:
            return covariance
        space = self.setup.maps.structure.space
        changes = differentiate_own(function, self.seen(x, states), self.directions(states), believed, space, space)
        moved = states.reading @ changes
        return propagated(covariance, moved[:, :, : states.count] / self.scale(states), moved[:, :, states.count :])

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
        if self.number <= plan.end and number < len(plan.instants[self.number].steps):
            self.follow(plan.instants[self.number].steps[number], drawn)
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
        believed = np.tile(setup.believed.inputs, 2)
        self.covariance = self.propagated_own(function, believed, self.x, self.covariance)
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

            def part(states: Array, entering: Array) -> Array:
                repeated = np.tile(fraction, states.shape[1] // len(fraction))
                drawn = entering.reshape(2, inputs, states.shape[1])
                return maps.step(states, np.full(states.shape[1], time), length, drawn, repeated)

            believed = np.tile(self.setup.believed.inputs, 2)
            self.covariance[met] = self.propagated_own(part, believed, x, self.covariance[met])
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
        self.deviation = transition.state @ self.deviation
        if drawn is not None and len(drawn):
            self.deviation += transition.inputs @ drawn

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

        innovation = function(self.x, drawn) + drawn[:, self.rows]
        if self.own:
            seen, directions = self.seen(self.x, states), self.directions(states)
            changes = differentiate_own(function, seen, directions, np.zeros(0), maps.structure.space)
            h = -changes / self.scale(states)
            update = updated(self.covariance, h, sigma, states.estimated)
            gain, expected, self.covariance = update.gain, update.innovation, update.covariance
            added = np.einsum("nkm,mn->kn", gain[:, : states.estimated], innovation)
        else:
            last = self.gains[number]
            assert last.gain is not None
            assert last.innovation is not None
            expected, added = last.innovation, last.gain[: states.estimated] @ innovation
        change = np.zeros_like(self.x)
        change[states.estimates] = added
        self.x = maps.structure.space.plus(self.x, change)
        if self.recorder is not None:
            self.recorder.sensors[number].add(self.rows, innovation, expected)

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
        believed = setup.believed.corrections[number]
        self.covariance = self.propagated_own(function, believed, self.x, self.covariance)
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
            covariance[self.rows] = self.covariance
        values = setup.readout.read(x, self.nominal).T
        nominal = setup.readout.read(self.nominal[:, None], self.nominal)[:, 0]
        self.history[:, epoch] = np.where(np.abs(values - nominal) <= setup.floor, nominal, values)
        if self.recorder is not None:
            self.recorder.record(epoch, x, covariance)
