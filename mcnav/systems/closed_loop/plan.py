"""The linear system of a loop along its nominal: the derivative of each map, planned gains, the filter's covariance."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.algebra import propagate, update
from mcnav.systems.closed_loop.differences import Derivatives, Map, Straight, differentiate_map
from mcnav.systems.closed_loop.event import crossing_within, event_map
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.sizes import SMALL, Sizes, difference_steps
from mcnav.systems.closed_loop.structure import Structure
from mcnav.systems.closed_loop.timeline import Instant

ROUNDING: Final = 1e-6
"""Share of the sizes of the truth below which what a correction changes in the nominal is rounding."""


@dataclass(frozen=True)
class Transition:
    """``X+ = A X + G w`` about the nominal.

    Attributes
    ----------
    state : ndarray, shape (size, size)
    inputs : ndarray, shape (size, k)
        For inputs in their SI units; those of a step are its two Legendre modes, one after the other.
    kind : str
        ``step``, ``measure``, ``correct``, ``guide`` or ``event``.
    number : int
        Of the measurement or correction.
    gain : ndarray, shape (estimated states, k), optional
    factor : ndarray, shape (k, k, 1), optional
        Cholesky's factor of the covariance that the filter expects of the innovation.
    straight : Straight, optional
        The map of X, or of the innovation, where it is linear.
    """

    state: Array
    inputs: Array
    kind: str
    number: int = 0
    gain: Array | None = None
    factor: Array | None = None
    straight: Straight | None = None


@dataclass(frozen=True)
class PlannedInstant:
    """What happens from one instant to the next, about the nominal.

    Attributes
    ----------
    instant : Instant
    steps, updates : tuple of Transition
        Those that lead to it, and those at it.
    nominal : ndarray, shape (size,)
        X after them.
    before : ndarray, shape (steps + 1, size)
        X before each step, and before the updates.
    covariance : ndarray, shape (k, k)
        The filter's, after them.
    """

    instant: Instant
    steps: tuple[Transition, ...]
    updates: tuple[Transition, ...]
    nominal: Array
    before: Array
    covariance: Array
    fraction: float = 1.0


@dataclass
class Plan:
    """The linear system at all instants.

    Attributes
    ----------
    instants : list of PlannedInstant
    end : int
        Number of the instant of the nominal end.
    end_time : float
    steps : ndarray, shape (size,)
        Sizes of X, from which steps of differences follow.
    innovations : mapping of str to float
        Largest nominal innovation of each sensor as a share of its believed sigma.
    kinks : set of str
        Maps that have a kink at the nominal.
    """

    instants: list[PlannedInstant] = field(default_factory=list)
    end: int = -1
    end_time: float = 0.0
    steps: Array = field(default_factory=lambda: np.zeros(0))
    innovations: dict[str, float] = field(default_factory=dict)
    kinks: set[str] = field(default_factory=set)


def largest_values(plan: Plan, structure: Structure, steps: Array) -> Array:
    """Return the largest value of X's quantities along the nominal, or ten of their sizes, shape (size,)."""
    largest = np.max([np.abs(each.before).max(axis=0) for each in plan.instants], axis=0)
    largest = np.maximum(largest, 10.0 * steps)
    for block in structure.blocks:
        for _, place in block.places():
            largest[place] = largest[place].max()
    return np.asarray(largest)


def filled(sizes: Array) -> Array:
    """Replace sizes of zero, for which differences need some step."""
    return np.where(sizes > 0.0, sizes, SMALL)


@dataclass
class Planner:
    """Linearization along the nominal, map by map."""

    maps: Maps
    states: FilterStates | None
    true: Sizes
    believed: Sizes
    x: Array
    steps: Array
    covariance: Array
    plan: Plan

    def derivatives(self, function: Map, inputs: Array, where: str, to_x: bool = True) -> Derivatives:
        """Differentiate a map about the nominal, to X or to innovations; its kinks are noted."""
        space = self.maps.structure.space
        result = differentiate_map(function, self.x, self.steps, inputs, space, space if to_x else None)
        if not (np.isfinite(result.value).all() and np.isfinite(result.state).all()):
            raise ScenarioError("type", f"its flight without any error is not finite: {where}")
        if result.kinked.any():
            self.plan.kinks.add(where.split(" at ")[0])
        return result

    def step(self, time: float, length: float, fraction: float = 1.0) -> Transition:
        """Propagate by a step, or by a fraction of it."""
        inputs = self.maps.structure.white.size + self.maps.structure.markov.size

        def function(x: Array, entering: Array) -> Array:
            white = entering.reshape(2, inputs, x.shape[1])
            return self.maps.step(x, np.full(x.shape[1], time), length, white, fraction)

        sizes = np.tile(filled(np.maximum(self.true.inputs, self.believed.inputs)), 2)
        result = self.derivatives(function, sizes, f"rates at {time:g} s")
        self.x = result.value
        self.propagate(result.state, result.inputs, np.tile(self.believed.inputs, 2))
        return Transition(result.state, result.inputs, "step", straight=result.straight if fraction == 1.0 else None)

    def propagate(self, state: Array, inputs: Array, believed: Array) -> None:
        """Propagate the filter's covariance by ``F = T A S`` and ``G = T G``."""
        if self.states is not None:
            f, entering = self.states.of_errors(state, inputs * believed)
            self.covariance = propagate(self.covariance[:, :, None], f, entering)[:, :, 0]

    def measure(self, number: int, time: float) -> Transition:
        """Update by a sensor."""
        states, sensor = self.states, self.maps.sensors[number]
        assert states is not None

        def function(x: Array, entering: Array) -> Array:
            return self.maps.innovation(number, x, np.full(x.shape[1], time)) + entering

        sigma = self.believed.measurements[number]
        result = self.derivatives(function, filled(sigma), f"measurement {sensor.declared.name} at {time:g} s", False)
        name = sensor.declared.name
        if not sigma.all():
            raise ScenarioError("type", f"measurement {name} needs a size in [measurements], or a believed one")
        share = float(np.abs(result.value / sigma).max())
        self.plan.innovations[name] = max(share, self.plan.innovations.get(name, 0.0))
        h = -result.state @ states.moving
        gains, factor, after = update(self.covariance[:, :, None], h[:, :, None], sigma, states.estimated)
        gain = gains[: states.estimated, :, 0]
        state, inputs = np.eye(len(self.x)), np.zeros((len(self.x), sensor.size))
        state[states.estimates] += gain @ result.state
        inputs[states.estimates] = gain
        self.covariance = after[:, :, 0]
        change = np.zeros_like(self.x)
        change[states.estimates] = gain @ result.value
        self.x = self.maps.structure.space.plus(self.x[:, None], change[:, None])[:, 0]
        return Transition(state, inputs, "measure", number, gain, factor, result.straight)

    def correct(self, number: int, time: float) -> Transition:
        """Apply a correction."""
        believed = self.believed.corrections[number]

        def function(x: Array, entering: Array) -> Array:
            return self.maps.corrected(number, x, np.full(x.shape[1], time), entering)

        sizes = filled(np.maximum(self.true.corrections[number], believed))
        name = self.maps.impulses[number].declared.name
        result = self.derivatives(function, sizes, f"correction {name} at {time:g} s")
        self.x = self._without_rounding(number, result.value)
        self.propagate(result.state, result.inputs, believed)
        return Transition(result.state, result.inputs, "correct", number, straight=result.straight)

    def _without_rounding(self, number: int, x: Array) -> Array:
        """Return X after a correction, whose commanded impulse is zero where it is rounding: it has no direction."""
        structure = self.maps.structure
        _, place = list(structure.corrections.places())[number]
        changed = structure.truth.whole
        if np.all(np.abs(x - self.x)[changed] < ROUNDING * self.steps[changed]):
            x = x.copy()
            x[place] = 0.0
        return x

    def guide(self, time: float) -> Transition:
        """Command."""

        def function(x: Array, entering: Array) -> Array:
            return self.maps.after_guidance(x, np.full(x.shape[1], time))

        result = self.derivatives(function, np.zeros(0), f"guide at {time:g} s")
        self.x = result.value
        return Transition(result.state, result.inputs, "guide")

    def updates(self, instant: Instant) -> list[Transition]:
        """Measure, correct and guide at an instant."""
        done = []
        if self.states is not None:
            done += [self.measure(number, instant.time) for number in instant.measurements]
        done += [self.correct(number, instant.time) for number in instant.corrections]
        if instant.guide and self.maps.guide is not None:
            done.append(self.guide(instant.time))
        return done


def make_plan(
    maps: Maps, start: Array, timeline: tuple[Instant, ...], states: FilterStates | None, true: Sizes, believed: Sizes
) -> Plan:
    """Linearize along the nominal, to the latest time where that is possible.

    Raises `ScenarioError` when the nominal flight is not finite, or its trigger never happens.
    """
    covariance = np.zeros((0, 0)) if states is None else states.start_covariance(maps.structure, believed)
    steps = difference_steps(maps, start, true)
    planner = Planner(maps, states, true, believed, start, steps, covariance, Plan(steps=steps))
    plan, last = planner.plan, len(timeline) - 1
    sign = 0.0 if maps.end is None else np.sign(maps.triggered(maps.end, start[:, None], np.zeros(1))[0])
    if maps.end is not None and sign == 0.0:
        raise ScenarioError("type", "end: the trigger's function is zero at the start; it must be to one side of it")
    for number, instant in enumerate(timeline):
        before: list[Array] = [planner.x]
        done: list[Transition] = []
        for time in instant.step_times().tolist():
            if maps.end is not None:
                fraction = crossing_within(maps, planner.x, time, instant.length, sign)
                if fraction is not None:
                    return _ended(planner, number, instant, before, done, (time, fraction))
            done.append(planner.step(time, instant.length))
            before.append(planner.x)
        if number == last and maps.end is not None:
            break
        updates = planner.updates(instant)
        plan.instants.append(
            PlannedInstant(instant, tuple(done), tuple(updates), planner.x, np.array(before), planner.covariance)
        )
    if maps.end is not None:
        raise ScenarioError("type", f"end: its flight without any error meets no trigger by {timeline[-1].time:g} s")
    plan.end, plan.end_time = last, timeline[-1].time
    return plan


def _ended(
    planner: Planner, number: int, instant: Instant, before: list[Array], steps: list[Transition],
    within: tuple[float, float],
) -> Plan:  # fmt: skip
    """Finish a plan with the event within a step, at a fraction of it."""
    plan, (time, fraction) = planner.plan, within
    steps.append(planner.step(time, instant.length, fraction))
    plan.end, plan.end_time = number, time + fraction * instant.length
    saltation = event_map(planner.maps, planner.x, plan.end_time, planner.steps)
    planner.x = planner.x.copy()
    planner.x[planner.maps.structure.clock.whole] = plan.end_time
    updates = [Transition(saltation, np.zeros((len(saltation), 0)), "event")]
    if planner.maps.continuous and planner.maps.guide is not None:
        updates.append(planner.guide(plan.end_time))
    plan.instants.append(
        PlannedInstant(instant, tuple(steps), tuple(updates), planner.x, np.array(before), planner.covariance, fraction)
    )
    return plan
