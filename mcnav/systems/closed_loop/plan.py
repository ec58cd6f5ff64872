"""The linear system of a loop along its nominal: the derivative of each map, planned gains, the filter's covariance."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.contract.linear import Update
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.algebra import propagate, update
from mcnav.systems.closed_loop.differences import Derivatives, Map, Straight, differentiate_map
from mcnav.systems.closed_loop.event import Saltation, event_map, find_crossings
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.own_update import updated
from mcnav.systems.closed_loop.passage import meet, set_signs
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
        ``step``, ``measure``, ``correct``, ``guide`` or ``event``, the end.
    number : int
        Of the measurement or correction.
    gain : ndarray, shape (estimated states, k), optional
    factor : ndarray, shape (k, k, 1), optional
        Cholesky's factor of the covariance that the filter expects of the innovation.
    straight : Straight, optional
        The map of X, or of the innovation, where it is linear.
    corrections : mapping of int to ndarray, shape (size, axes)
        For the execution errors of corrections by trigger within a step, by number.
    moments : tuple of Moment
        Before and after these.
    """

    state: Array
    inputs: Array
    kind: str
    number: int = 0
    gain: Array | None = None
    factor: Array | None = None
    straight: Straight | None = None
    corrections: Mapping[int, Array] = field(default_factory=dict)
    moments: tuple[Moment, ...] = ()


@dataclass(frozen=True)
class Moment:
    """The linear system before or after a correction by trigger within a step.

    Attributes
    ----------
    x : ndarray, shape (size,)
        Of the nominal.
    transition : Transition
        From the begin of the step.
    covariance : ndarray, shape (k, k)
        The filter's.
    """

    time: float
    label: Update
    x: Array
    transition: Transition
    covariance: Array


@dataclass
class Composed:
    """Maps one after the other, all with the same noise.

    Attributes
    ----------
    state, inputs : ndarray, shapes (size, size) and (size, k)
        With events at every sample's own instant.
    fixed, inputs_fixed : ndarray, the same shapes
        With events at the nominal instants, as a filter sees them.
    corrections : dict of int to ndarray
        As those of a `Transition`.
    """

    state: Array
    inputs: Array
    fixed: Array
    inputs_fixed: Array
    corrections: dict[int, Array]

    @classmethod
    def of(cls, state: Array, inputs: Array) -> Composed:
        """Return a map alone."""
        return cls(state, inputs, state, inputs, {})

    def add(self, state: Array, inputs: Array) -> None:
        """Add a map."""
        self._change(state, state)
        self.inputs, self.inputs_fixed = self.inputs + inputs, self.inputs_fixed + inputs

    def jump(self, saltation: Saltation, correction: int | None) -> None:
        """Add an event, with the number of the correction that it is."""
        self._change(saltation.state, saltation.fixed)
        if correction is not None:
            self.corrections[correction] = saltation.inputs

    @property
    def transition(self) -> Transition:
        """The transition of all of them."""
        return Transition(self.state, self.inputs, "step", corrections=dict(self.corrections))

    def _change(self, state: Array, fixed: Array) -> None:
        self.state, self.inputs = state @ self.state, state @ self.inputs
        self.fixed, self.inputs_fixed = fixed @ self.fixed, fixed @ self.inputs_fixed
        self.corrections = {number: state @ each for number, each in self.corrections.items()}


@dataclass(frozen=True)
class PlannedInstant:
    """Linear maps from one instant to the next, about the nominal.

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
    covariance_before : ndarray, shape (k, k)
        The filter's, before the updates.
    """

    instant: Instant
    steps: tuple[Transition, ...]
    updates: tuple[Transition, ...]
    nominal: Array
    before: Array
    covariance: Array
    covariance_before: Array

    def scaled(self, multiple: float) -> PlannedInstant:
        """Return what a filter that believes a multiple of all errors does: with the same gains."""
        square = multiple**2

        def scaled(each: Transition) -> Transition:
            factor = None if each.factor is None else multiple * each.factor
            moments = tuple(replace(moment, covariance=square * moment.covariance) for moment in each.moments)
            return replace(each, factor=factor, moments=moments)

        return replace(
            self, steps=tuple(map(scaled, self.steps)), updates=tuple(map(scaled, self.updates)),
            covariance=square * self.covariance, covariance_before=square * self.covariance_before,
        )  # fmt: skip

    @property
    def changed(self) -> bool:
        """True where a measurement or a correction changes X at it."""
        return any(each.kind in ("measure", "correct") for each in self.updates)


@dataclass(frozen=True)
class Begin:
    """Start of a navigator that has waited: ``X+ = A X + U e`` before the updates of an instant.

    Attributes
    ----------
    number : int
        Of the instant.
    state : ndarray, shape (size, size)
    errors : ndarray, shape (size, sources)
        U, how the sources move X there.
    covariance : ndarray, shape (k, k)
        What the filter begins with.
    """

    number: int
    state: Array
    errors: Array
    covariance: Array


@dataclass
class Plan:
    """The linear system at all instants.

    Attributes
    ----------
    instants : list of PlannedInstant
    end : int
        Number of the instant of the nominal end.
    end_time : float
    event_times : dict of str to float
        Of corrections, phases and ends by trigger, by name.
    signs : ndarray, shape (events,)
        Of the triggers' functions before they are met.
    steps : ndarray, shape (size,)
        Sizes of X, from which steps of differences follow.
    innovations : mapping of str to float
        Largest nominal innovation of each sensor as a share of its believed sigma.
    kinks : set of str
        Maps that have a kink at the nominal.
    begin : Begin, optional
        Where the navigator starts, if not with the flight.
    """

    instants: list[PlannedInstant] = field(default_factory=list)
    end: int = -1
    end_time: float = 0.0
    event_times: dict[str, float] = field(default_factory=dict)
    signs: Array = field(default_factory=lambda: np.zeros(0))
    steps: Array = field(default_factory=lambda: np.zeros(0))
    innovations: dict[str, float] = field(default_factory=dict)
    kinks: set[str] = field(default_factory=set)
    begin: Begin | None = None
    _written: bytes | None = field(default=None, init=False, repr=False, compare=False)

    def scaled(self, multiple: float) -> Plan:
        """Return the plan of a filter that believes a multiple of all errors."""
        begin = self.begin
        begun = None if begin is None else replace(begin, covariance=multiple**2 * begin.covariance)
        return replace(self, instants=[each.scaled(multiple) for each in self.instants], begin=begun)

    def __reduce__(self) -> tuple[Callable[[bytes], Plan], tuple[bytes]]:
        """Return the plan as a text of bytes, which is written once, and read once in a worker: chunks share it."""
        if self._written is None:
            content = {name: value for name, value in vars(self).items() if name != "_written"}
            self._written = pickle.dumps(content, protocol=5)
        return _read_plan, (self._written,)


@lru_cache(maxsize=1)
def _read_plan(written: bytes) -> Plan:
    return Plan(**pickle.loads(written))


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
    """Linearization along the nominal, map by map.

    Attributes
    ----------
    known : dict, optional
        Derivatives by map and time, which are looked up before they are computed: those of one nominal.
    """

    maps: Maps
    states: FilterStates | None
    true: Sizes
    believed: Sizes
    x: Array
    steps: Array
    covariance: Array
    plan: Plan
    signs: Array
    pending: NDArray[np.bool_]
    known: dict[Hashable, Derivatives] | None = None

    def check_pending(self, time: float, over: bool = False) -> None:
        """Raise `ScenarioError` when an event should have happened by a time, or by the end of the flight."""
        for event in (each for each, waits in zip(self.maps.events, self.pending, strict=True) if waits):
            if over or event.latest <= time:
                told = f"its flight without any error meets no trigger by {min(event.latest, time):g} s"
                raise ScenarioError("type", f"{event.name}: {told}")

    def derivatives(
        self, function: Map, inputs: Array, where: str, at: tuple[float, ...], to_x: bool = True
    ) -> Derivatives:
        """Differentiate a map about the nominal, to X or to innovations; its kinks are noted.

        Parameters
        ----------
        where : str
            Its name, for people.
        at : tuple of float
            Time, s, and the like: what tells it from others of its name.
        """
        key = (where, at)
        if self.known is not None and key in self.known:
            return self.known[key]
        space = self.maps.structure.space
        result = differentiate_map(function, self.x, self.steps, inputs, space, space if to_x else None)
        if not (np.isfinite(result.value).all() and np.isfinite(result.state).all()):
            raise ScenarioError("type", f"its flight without any error is not finite: {where}")
        if result.kinked.any():
            self.plan.kinks.add(where.split(" at ")[0])
        if self.known is not None:
            self.known[key] = result
        return result

    def step(self, time: float, length: float) -> tuple[Transition, tuple[float, Transition] | None]:
        """Propagate by a step and the events within it; of an end return the time, and what it does."""
        composed, since, end, moments = None, 0.0, None, list[Moment]()
        while True:
            meeting = self._meet(time, length, since)
            fraction = 1.0 if meeting is None else meeting[1]
            part = self._part(time, length, since, fraction)
            self.x = part.value
            if composed is None:
                composed = Composed.of(part.state, part.inputs)
            else:
                composed.add(part.state, part.inputs)
            if meeting is None:
                break
            event, moment = self.maps.events[meeting[0]], time + fraction * length
            if event.kind != "end":
                moments.append(self._moment(moment, "before", composed))
            saltation = self._happen(meeting[0], moment)
            if event.kind == "end":
                end = moment, Transition(saltation.state, saltation.inputs, "event")
                break
            composed.jump(saltation, event.number if event.kind == "correction" else None)
            moments.append(self._moment(moment, "after", composed))
            since = fraction
        self._propagate_composed(composed)
        straight = part.straight if since == 0.0 and meeting is None else None
        transition = replace(composed.transition, straight=straight, moments=tuple(moments))
        return transition, end

    def _propagate_composed(self, composed: Composed) -> None:
        """Propagate the filter's covariance by a step with events."""
        self.propagate(composed.fixed, composed.inputs_fixed, self.believed.modes)
        for number, inputs in composed.corrections.items():
            self.propagate(np.eye(len(self.x)), inputs, self.believed.corrections[number])

    def _moment(self, time: float, label: Update, composed: Composed) -> Moment:
        """Return the linear system before or after an event within a step."""
        covariance = self.covariance
        self._propagate_composed(composed)
        there, self.covariance = self.covariance, covariance
        return Moment(time, label, self.x, composed.transition, there)

    def _part(self, time: float, length: float, since: float, fraction: float) -> Derivatives:
        """Differentiate the part of a step from one fraction of it to another."""
        inputs = self.maps.structure.white.size + self.maps.structure.markov.size

        def function(x: Array, entering: Array) -> Array:
            white = entering.reshape(2, inputs, x.shape[1])
            return self.maps.step(x, np.full(x.shape[1], time), length, white, fraction, since)

        sizes = np.tile(filled(np.maximum(self.true.inputs, self.believed.inputs)), 2)
        return self.derivatives(function, sizes, f"rates at {time:g} s", (time, since, fraction))

    def _meet(self, time: float, length: float, since: float) -> tuple[int, float] | None:
        """Find the next event of a step: its number, and the fraction of the step at which it happens."""
        maps, signs = self.maps, self.signs
        if not self.pending.any():
            return None
        inputs = maps.structure.white.size + maps.structure.markov.size
        white, begin, low = np.zeros((2, inputs, 1)), np.array([time]), np.array([since])
        after = maps.step(self.x[:, None], begin, length, white, 1.0, since)
        met = meet(maps, after, begin + length, signs, self.pending[:, None])[:, 0]
        crossings = []
        for number in np.flatnonzero(met).tolist():
            event = maps.events[number]
            before = maps.triggered(event.trigger, self.x[:, None], begin + low * length)
            if np.sign(before[0]) != signs[number]:
                told = f"an update at {time:g} s jumps over the trigger in the flight without errors"
                raise ScenarioError("type", f"{event.name}: {told}")
            value = maps.triggered(event.trigger, after, begin + length)
            at_begin, bracket = (self.x[:, None], begin), (low, before, value)
            crossings.append((float(find_crossings(maps, event.trigger, at_begin, length, white, bracket)[0]), number))
        fraction, number = min(crossings, default=(1.0, -1))
        return None if number < 0 else (number, fraction)

    def _happen(self, number: int, time: float) -> Saltation:
        """Linearize an event at a time, and go on after it."""
        event = self.maps.events[number]
        sizes = np.zeros(0)
        if event.kind == "correction":
            sizes = filled(np.maximum(self.true.corrections[event.number], self.believed.corrections[event.number]))
        saltation = event_map(self.maps, number, self.x, time, self.steps, sizes)
        self.x = saltation.value
        self.pending[number] = False
        if event.kind == "phase":
            set_signs(self.maps, self.signs, self.x, time, event.number)
        self.plan.event_times[event.name] = time
        return saltation

    def propagate(self, state: Array, inputs: Array, believed: Array) -> None:
        """Propagate the filter's covariance by ``F = T A S`` and ``G = T G``."""
        if self.states is not None:
            f, entering = self.states.of_errors(state, inputs * believed)
            self.covariance = propagate(self.covariance[:, :, None], f, entering)[:, :, 0]

    def measure(self, number: int, time: float) -> Transition:
        """Update by a sensor."""
        states, sensor = self.states, self.maps.sensors[number]
        if states is None:
            return self.update_own(number, time)

        def function(x: Array, entering: Array) -> Array:
            return self.maps.innovation(number, x, np.full(x.shape[1], time)) + entering

        sigma = self.believed.measurements[number]
        where = f"measurement {sensor.declared.name} at {time:g} s"
        result = self.derivatives(function, filled(sigma), where, (time,), to_x=False)
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

    def update_own(self, number: int, time: float) -> Transition:
        """Update by a sensor as the user does."""

        def function(x: Array, entering: Array) -> Array:
            return updated(self.maps, number, x, np.full(x.shape[1], time), entering)

        sizes, name = filled(self.true.measurements[number]), self.maps.sensors[number].declared.name
        expected = self.maps.innovation(number, self.x[:, None], np.array([time]))[:, 0]
        self.plan.innovations[name] = max(float(np.abs(expected / sizes).max()), self.plan.innovations.get(name, 0.0))
        result = self.derivatives(function, sizes, f"update at {time:g} s", (time, number))
        self.x = result.value
        return Transition(result.state, result.inputs, "measure", number)

    def correct(self, number: int, time: float) -> Transition:
        """Apply a correction."""
        believed = self.believed.corrections[number]

        def function(x: Array, entering: Array) -> Array:
            return self.maps.corrected(number, x, np.full(x.shape[1], time), entering)

        sizes = filled(np.maximum(self.true.corrections[number], believed))
        name = self.maps.impulses[number].declared.name
        result = self.derivatives(function, sizes, f"correction {name} at {time:g} s", (time,))
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

        result = self.derivatives(function, np.zeros(0), f"guide at {time:g} s", (time,))
        self.x = result.value
        return Transition(result.state, result.inputs, "guide")

    def updates(self, instant: Instant) -> list[Transition]:
        """Measure, correct and guide at an instant."""
        done = []
        if instant.phase is not None:
            self.x = self.maps.begin_phase(instant.phase, self.x)
            set_signs(self.maps, self.signs, self.x, instant.time, instant.phase)
        if self.states is not None or self.maps.update is not None:
            done += [self.measure(number, instant.time) for number in instant.measurements]
        done += [self.correct(number, instant.time) for number in instant.corrections]
        if instant.guide and self.maps.guide is not None:
            done.append(self.guide(instant.time))
        return done


def make_plan(
    maps: Maps, start: Array, timeline: tuple[Instant, ...], states: FilterStates | None, true: Sizes, believed: Sizes,
    known: dict[Hashable, Derivatives] | None = None,
) -> Plan:  # fmt: skip
    """Linearize along the nominal, to the latest time where that is possible.

    Parameters
    ----------
    known : dict, optional
        As that of `Planner`.

    Raises `ScenarioError` when the nominal flight is not finite, or its trigger never happens.
    """
    covariance = np.zeros((0, 0)) if states is None else states.start_covariance(maps.structure, believed)
    planner = planner_at(maps, start, states, true, believed, covariance)
    planner.known = known
    return fly(planner, timeline)


def planner_at(
    maps: Maps, start: Array, states: FilterStates | None, true: Sizes, believed: Sizes, covariance: Array
) -> Planner:
    """Return a planner at the start of the flight, with the filter's covariance there."""
    steps = difference_steps(maps, start, true)
    signs = np.zeros(len(maps.events))
    set_signs(maps, signs, start, 0.0, None)
    pending, plan = np.ones(len(signs), dtype=bool), Plan(steps=steps, signs=signs)
    return Planner(maps, states, true, believed, start, steps, covariance, plan, signs, pending)


def fly(planner: Planner, timeline: tuple[Instant, ...], first: int = 0) -> Plan:
    """Linearize from an instant, by number, to the end."""
    maps, plan, last = planner.maps, planner.plan, len(timeline) - 1
    for number, instant in enumerate(timeline[first:], start=first):
        before: list[Array] = [planner.x]
        done: list[Transition] = []
        for time in instant.step_times().tolist():
            transition, end = planner.step(time, instant.length)
            done.append(transition)
            if end is not None:
                return _ended(planner, number, instant, before, done, end)
            before.append(planner.x)
        planner.check_pending(instant.time)
        if number == last and maps.ends:
            break
        covariance = planner.covariance
        updates = tuple(planner.updates(instant))
        plan.instants.append(
            PlannedInstant(instant, tuple(done), updates, planner.x, np.array(before), planner.covariance, covariance)
        )
    planner.check_pending(timeline[-1].time, over=True)
    plan.end, plan.end_time = last, timeline[-1].time
    return plan


def _ended(
    planner: Planner,
    number: int,
    instant: Instant,
    before: list[Array],
    steps: list[Transition],
    end: tuple[float, Transition],
) -> Plan:
    """Finish a plan with an end by trigger within the last of the steps."""
    plan, (time, event) = planner.plan, end
    planner.check_pending(time, over=True)
    plan.end, plan.end_time = number, time
    covariance = planner.covariance
    plan.instants.append(
        PlannedInstant(instant, tuple(steps), (event,), planner.x, np.array(before), covariance, covariance)
    )
    return plan
