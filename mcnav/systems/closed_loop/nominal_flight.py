"""The nominal flight of a loop, and the derivatives of its maps along it: of many instants at once, without gains.

Where innovations are zero the flight without errors does not depend on gains: it is flown first, and then each kind of
map is differentiated about many of its instants at once. Else the filter goes along, maps are differentiated one after
the other, and each update moves the nominal by its gain times the innovation; so do maps that have other values beside
other instants, as those of a method that takes all its times for the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import (
    TimedMap,
    differentiate_map,
)
from mcnav.systems.closed_loop.event import Saltation, event_map, find_crossings
from mcnav.systems.closed_loop.flown import (
    Apart,
    FlownEvent,
    FlownInstant,
    FlownMap,
    FlownStep,
    FlownUpdate,
    check_finite,
    differentiate_flown,
    groups_of,
)
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.own_update import updated
from mcnav.systems.closed_loop.passage import meet, set_signs
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.sizes import SMALL, LoopSizes, difference_steps
from mcnav.systems.closed_loop.transitions import (
    FlownGroup,
    Group,
    Innovation,
    Linearization,
    Transition,
)

ROUNDING: Final = 1e-6
"""Share of the sizes of the truth below which what a correction changes in the nominal is rounding."""

BESIDE: Final = 8
"""States of X that are flown beside each other: a library's functions may have other last digits of one alone."""


class Follower(Protocol):
    """A filter that goes along with the nominal flight."""

    def propagate(self, transition: Transition) -> None:
        """Propagate its covariance by a step or a correction."""

    def correction(self, innovation: Innovation) -> Array:
        """Update its covariance, and return what the update adds to X, shape (size,)."""


def filled(sizes: Array) -> Array:
    """Replace sizes of zero, for which differences need some step."""
    return np.where(sizes > 0.0, sizes, SMALL)


def linearize(
    maps: Maps, start: Array, schedule: tuple[Instant, ...], sizes: LoopSizes, follow: Callable[[], Follower] | None
) -> Linearization:
    """Linearize along the nominal, to its end.

    Parameters
    ----------
    follow : callable, optional
        Returns the filter at the start; none for a loop without a filter.

    Raises
    ------
    ScenarioError
        When the nominal flight is not finite, or a trigger never happens in it.
    """
    try:
        return _Flight.at(maps, start, sizes, follow is not None, None).fly(schedule)
    except ScenarioError:
        raise
    except Exception:  # of a method that takes all its times for the same, too: alone it may do
        follower = None if follow is None else follow()
        return _Flight.at(maps, start, sizes, follow is not None, follower, apart=True).fly(schedule)


def map_of(maps: Maps, group: Group) -> TimedMap:
    """Return the map of X, of what enters, and of times and the like, of a group: one that the flight has flown.

    The group ``trigger`` is the function of an event's trigger.
    """
    kind, *which = group
    if kind == "trigger":
        trigger = maps.events[which[0]].trigger
        return lambda x, entering, at: maps.triggered(trigger, x, at[0])[None]
    if kind == "measure":
        return lambda x, entering, at: maps.innovation(which[0], x, at[0]) + entering
    if kind == "update":
        return lambda x, entering, at: updated(maps, which[0], x, at[0], entering)
    if kind == "correct":
        return lambda x, entering, at: maps.corrected(which[0], x, at[0], entering)
    if kind == "guide":
        return lambda x, entering, at: maps.after_guidance(x, at[0])
    loop = maps if kind == "step" else maps.as_believed
    inputs = maps.structure.white.size + maps.structure.markov.size
    return lambda x, entering, at: loop.step(x, at[0], at[1], entering.reshape(2, inputs, x.shape[1]), *which)


def innovation_shares(linear: Linearization, maps: Maps, filtered: bool, sizes: LoopSizes) -> dict[str, float]:
    """Return the largest nominal innovation of each sensor as a share of its sigma, with a filter its believed one."""
    sigmas = sizes.believed.measurements if filtered else tuple(map(filled, sizes.true.measurements))
    return {
        maps.sensors[number].declared.name: float((largest / sigmas[number]).max())
        for number, largest in linear.innovations.items()
    }


def within_step(
    maps: Maps, linear: Linearization, sizes: LoopSizes, place: tuple[int, int], time: float
) -> tuple[tuple[Transition, ...], Array]:
    """Linearize from the begin of a step to a time within it: as a step of its own, after an event if there is one.

    Parameters
    ----------
    place : tuple of int
        Number of the instant that the step leads to, and of the step.

    Returns
    -------
    tuple of Transition
    ndarray, shape (size,)
        X of the nominal there.
    """
    planned = linear.instants[place[0]]
    begin, x = float(planned.instant.step_times()[place[1]]), planned.before[place[1]]
    earlier: tuple[Transition, ...] = ()
    for moment in planned.steps[place[1]].moments:
        if moment.label == "after" and moment.time <= time:
            begin, x, earlier = moment.time, moment.x, (moment.transition,)
    inputs, space = maps.structure.white.size + maps.structure.markov.size, maps.structure.space

    def function(x: Array, entering: Array, loop: Maps = maps) -> Array:
        white = entering.reshape(2, inputs, x.shape[1])
        return loop.step(x, np.full(x.shape[1], begin), time - begin, white)

    known = differentiate_map(function, x, linear.steps, _step_inputs(sizes), space, space)
    fixed = None
    if maps.as_believed is not maps:
        as_believed = partial(function, loop=maps.as_believed)
        believed = differentiate_map(as_believed, x, linear.steps, _step_inputs(sizes), space, space)
        fixed = believed.state, believed.inputs
    return (*earlier, Transition(known.state, known.inputs, "step", fixed=fixed)), known.value


def _step_inputs(sizes: LoopSizes) -> Array:
    """Return the sizes of what enters a step, for differences."""
    return np.tile(filled(np.maximum(sizes.true.inputs, sizes.believed.inputs)), 2)


@dataclass
class _Flight:
    """The nominal flight.

    Attributes
    ----------
    filtered : bool
        Whether a filter uses the innovations.
    follower : Follower, optional
        The filter, where it goes along.
    apart : bool
        Whether maps are differentiated one after the other.
    x, steps : ndarray, shape (size,)
        The nominal, and its sizes, from which steps of differences follow.
    beside : hash
        Of the maps' values beside the nominal.
    """

    maps: Maps
    sizes: LoopSizes
    filtered: bool
    follower: Follower | None
    apart: bool
    x: Array
    steps: Array
    signs: Array
    pending: NDArray[np.bool_]
    flown: list[FlownMap] = field(default_factory=list)
    kinks: set[str] = field(default_factory=set)
    event_times: dict[str, float] = field(default_factory=dict)
    innovations: dict[int, Array] = field(default_factory=dict)
    beside: Any = field(default_factory=hashlib.sha256)

    @classmethod
    def at(
        cls, maps: Maps, start: Array, sizes: LoopSizes, filtered: bool, follower: Follower | None, apart: bool = False
    ) -> _Flight:
        """Return it at the start."""
        signs = np.zeros(len(maps.events))
        set_signs(maps, signs, start, 0.0, None)
        steps = difference_steps(maps, start, sizes.true)
        return cls(maps, sizes, filtered, follower, apart, start, steps, signs, np.ones(len(signs), dtype=bool))

    def fly(self, schedule: tuple[Instant, ...]) -> Linearization:
        """Fly to the end, and linearize."""
        flown, end_time = list[FlownInstant](), schedule[-1].time
        for number, instant in enumerate(schedule):
            ended = self._approach(instant, flown)
            if ended is not None:
                end_time = ended
                break
            self._check_pending(instant.time)
            if number == len(schedule) - 1 and self.maps.ends:
                self._check_pending(instant.time, over=True)
            self._update(flown[-1])
        self._check_pending(end_time, over=True)
        self._differentiate(self.flown)
        return Linearization(
            [flight.linear() for flight in flown], len(flown) - 1, end_time, self.event_times, self.signs, self.steps,
            frozenset(self.kinks), self.innovations, self.beside.hexdigest(), self._groups(),
        )  # fmt: skip

    def _groups(self) -> tuple[FlownGroup, ...]:
        """Return the groups of the maps that were flown, and the triggers at the begins of all steps."""
        groups = groups_of(self.flown)
        steps = [group for group in groups if group.group[0] == "step"]
        triggers = (("trigger", number) for number in range(len(self.maps.events)))
        return (*groups, *(replace(step, group=trigger) for trigger in triggers for step in steps))

    def _differentiate(self, maps: Sequence[FlownMap]) -> None:
        """Differentiate maps, and note their kinks and their values beside the nominal."""
        self.kinks |= differentiate_flown(maps, self.steps, self.maps.structure.space, self.apart)
        for map_ in maps:
            self.beside.update(map_.known.mixed.tobytes())

    def _approach(self, instant: Instant, flown: list[FlownInstant]) -> float | None:
        """Fly the steps that lead to an instant; return the time of an end within them."""
        approached = FlownInstant(instant, [self.x])
        flown.append(approached)
        for time in instant.step_times().tolist():
            step = FlownStep()
            approached.steps.append(step)
            end = self._step(step, time, instant.length)
            if self.follower is not None:
                self.follower.propagate(step.linear())
            if end is not None:
                approached.nominal, approached.ended = self.x, end[1]
                return end[0]
            approached.before.append(self.x)
        return None

    def _step(self, step: FlownStep, time: float, length: float) -> tuple[float, Transition] | None:
        """Fly a step and the events within it; of an end return the time, and what it does."""
        since = 0.0
        while True:
            part = self._part(time, length, since, 1.0)
            meeting = self._meet(time, length, since, part.value)
            if meeting is None:
                self.x = self._take(part)
                step.parts.append(part)
                return None
            number, fraction = meeting
            part = self._part(time, length, since, fraction)
            self.x = self._take(part)
            event, moment, before = self.maps.events[number], time + fraction * length, self.x
            saltation = self._happen(number, moment)
            step.parts.append(part)
            if event.kind == "end":
                return moment, Transition(saltation.state, saltation.inputs, "event")
            step.parts.append(FlownEvent(event, moment, fraction, saltation, before))
            since = fraction

    def _part(self, time: float, length: float, since: float, fraction: float) -> FlownMap:
        """Fly the part of a step from one fraction of it to another."""
        at, entering, where = (time, length), _step_inputs(self.sizes), f"rates at {time:g} s"
        part = self._flown(("step", fraction, since), at, entering, where)
        if self.maps.as_believed is not self.maps:
            part.believed = self._flown(("believed step", fraction, since), at, entering, where)
        return part

    def _flown(self, group: Group, at: tuple[float, ...], inputs: Array, where: str, to_x: bool = True) -> FlownMap:
        """Return a map about the nominal with its value."""
        function = map_of(self.maps, group)
        space, none = self.maps.structure.space, np.zeros((len(self.x), 1))
        x, entering, ats = space.plus(self.x[:, None], none), np.zeros((len(inputs), 1)), np.array(at)[:, None]
        value = function(*(np.repeat(argument, BESIDE, axis=1) for argument in (x, entering, ats)))[:, 0]
        return FlownMap(group, function, self.x, at, inputs, where, to_x, value)

    def _take(self, map_: FlownMap) -> Array:
        """Note a map, which is to be differentiated, and return its value."""
        both = [map_] if map_.believed is None else [map_, map_.believed]
        if self.apart:
            self._differentiate(both)
            return map_.known.value
        check_finite(map_.where, map_.value)
        self.flown += both
        return map_.value

    def _meet(self, time: float, length: float, since: float, after: Array) -> tuple[int, float] | None:
        """Find the next event of a step: its number, and the fraction of the step at which it happens."""
        maps, signs = self.maps, self.signs
        if not self.pending.any():
            return None
        inputs = maps.structure.white.size + maps.structure.markov.size
        white, begin, low = np.zeros((2, inputs, 1)), np.array([time]), np.array([since])
        met = meet(maps, after[:, None], begin + length, signs, self.pending[:, None])[:, 0]
        crossings = []
        for number in np.flatnonzero(met).tolist():
            event = maps.events[number]
            before = maps.triggered(event.trigger, self.x[:, None], begin + low * length)
            if np.sign(before[0]) != signs[number]:
                told = f"an update at {time:g} s jumps over the trigger in the flight without errors"
                raise ScenarioError("type", f"{event.name}: {told}")
            value = maps.triggered(event.trigger, after[:, None], begin + length)
            at_begin, bracket = (self.x[:, None], begin), (low, before, value)
            crossings.append((float(find_crossings(maps, event.trigger, at_begin, length, white, bracket)[0]), number))
        fraction, number = min(crossings, default=(1.0, -1))
        return None if number < 0 else (number, fraction)

    def _happen(self, number: int, time: float) -> Saltation:
        """Linearize an event at a time, and go on after it."""
        event, sizes = self.maps.events[number], np.zeros(0)
        if event.kind == "correction":
            sizes = self._correction_sizes(event.number)
        saltation = event_map(self.maps, number, self.x, time, self.steps, sizes)
        self.x = saltation.value
        self.pending[number] = False
        if event.kind == "phase":
            set_signs(self.maps, self.signs, self.x, time, event.number)
        self.event_times[event.name] = time
        return saltation

    def _correction_sizes(self, number: int) -> Array:
        return filled(np.maximum(self.sizes.true.corrections[number], self.sizes.believed.corrections[number]))

    def _check_pending(self, time: float, over: bool = False) -> None:
        """Raise `ScenarioError` when an event should have happened by a time, or by the end of the flight."""
        for event in (event for event, waits in zip(self.maps.events, self.pending, strict=True) if waits):
            if over or event.latest <= time:
                told = f"its flight without any error meets no trigger by {min(event.latest, time):g} s"
                raise ScenarioError("type", f"{event.name}: {told}")

    def _update(self, reached: FlownInstant) -> None:
        """Measure, correct and guide at an instant."""
        instant = reached.instant
        if instant.phase is not None:
            self.x = self.maps.begin_phase(instant.phase, self.x)
            set_signs(self.maps, self.signs, self.x, instant.time, instant.phase)
        if self.filtered:
            reached.updates += [self._measure(number, instant.time) for number in instant.measurements]
        elif self.maps.update is not None:
            reached.updates += [self._update_own(number, instant.time) for number in instant.measurements]
        reached.updates += [self._correct(number, instant.time) for number in instant.corrections]
        if instant.guide and self.maps.guide is not None:
            reached.updates.append(self._guide(instant.time))
        reached.nominal = self.x

    def _measure(self, number: int, time: float) -> FlownUpdate:
        """Update by a sensor: without an innovation X is what it was."""
        maps, name = self.maps, self.maps.sensors[number].declared.name
        inputs = filled(self.sizes.believed.measurements[number])
        map_ = self._flown(("measure", number), (time,), inputs, f"measurement {name} at {time:g} s", False)
        value, update = self._take(map_), FlownUpdate(map_, "measure", number)
        self._note_innovation(number, value)
        change = np.zeros_like(self.x)
        if self.follower is not None:
            innovation = update.linear()
            assert isinstance(innovation, Innovation)
            change = self.follower.correction(innovation)
        elif value.any():
            raise Apart
        self.x = maps.structure.space.plus(self.x[:, None], change[:, None])[:, 0]
        return update

    def _note_innovation(self, number: int, value: Array) -> None:
        known = self.innovations.get(number, np.zeros(len(value)))
        self.innovations[number] = np.maximum(known, np.abs(value))

    def _update_own(self, number: int, time: float) -> FlownUpdate:
        """Update by a sensor as the user does."""
        maps = self.maps
        self._note_innovation(number, maps.innovation(number, self.x[:, None], np.array([time]))[:, 0])
        inputs = filled(self.sizes.true.measurements[number])
        map_ = self._flown(("update", number), (time,), inputs, f"update at {time:g} s")
        self.x = self._take(map_)
        return FlownUpdate(map_, "measure", number)

    def _correct(self, number: int, time: float) -> FlownUpdate:
        """Apply a correction."""
        where = f"correction {self.maps.impulses[number].declared.name} at {time:g} s"
        map_ = self._flown(("correct", number), (time,), self._correction_sizes(number), where)
        update = FlownUpdate(map_, "correct", number)
        self.x = self._without_rounding(number, self._take(map_))
        if self.follower is not None:
            transition = update.linear()
            assert isinstance(transition, Transition)
            self.follower.propagate(transition)
        return update

    def _without_rounding(self, number: int, x: Array) -> Array:
        """Return X after a correction, whose commanded impulse is zero where it is rounding: it has no direction."""
        structure = self.maps.structure
        _, place = list(structure.corrections.places())[number]
        changed = structure.truth.whole
        if np.all(np.abs(x - self.x)[changed] < ROUNDING * self.steps[changed]):
            x = x.copy()
            x[place] = 0.0
        return x

    def _guide(self, time: float) -> FlownUpdate:
        """Command."""
        map_ = self._flown(("guide",), (time,), np.zeros(0), f"guide at {time:g} s")
        self.x = self._take(map_)
        return FlownUpdate(map_, "guide")
