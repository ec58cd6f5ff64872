"""Start of the navigator at an instant of the flight, by the linear system.

Until it starts the truth flies by what is commanded without errors, `WaitingMaps`, dispersed by its errors at the start
of the flight and by its processes; nothing is measured, and the navigator's errors are those of `Begin`. The
derivatives along the nominal are those of any start: of each start the filter's covariance and gains are computed anew.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.systems.closed_loop.differences import Derivatives
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.linear import LinearState
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import Begin, Plan, PlannedInstant, fly, make_plan, planner_at
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.closed_loop.timeline import Instant
from mcnav.systems.closed_loop.waiting import WaitingMaps, follow_truth

LARGEST_INNOVATION: Final = 1e-3
"""Nominal innovation, as a share of its believed sigma, up to which gains do not move the flight without errors."""


@dataclass(frozen=True)
class Starts:
    """Parts that the plans of all starts share.

    Attributes
    ----------
    waiting : Plan
        Of a navigator that never starts.
    known : dict
        Derivatives along the nominal.
    begins : tuple of Begin
        All starts, in the order of time.
    """

    maps: Maps
    start: Array
    timeline: tuple[Instant, ...]
    states: FilterStates | None
    sizes: LoopSizes
    plan: Plan
    waiting: Plan
    known: dict[Hashable, Derivatives]
    begins: tuple[Begin, ...]

    @property
    def times(self) -> Array:
        """Times of the starts, s."""
        return np.array([self.timeline[each.number].time for each in self.begins])

    def nearest(self, times: Array) -> list[int]:
        """Return the starts, by their place in ``begins``, that are nearest to some times, each once."""
        return [int(each) for each in np.unique(np.abs(self.times[:, None] - times).argmin(axis=0))]

    def plan_of(self, begin: Begin) -> Plan:
        """Linearize the flight of a navigator that starts at an instant."""
        sizes, waited = self.sizes, self.waiting.instants[begin.number]
        planner = planner_at(self.maps, self.start, self.states, sizes.true, sizes.believed, begin.covariance)
        planner.known, planner.x = self.known, waited.before[-1]
        planner.signs[:] = self.plan.signs
        planner.plan.instants = self.waiting.instants[: begin.number]
        updates = tuple(planner.updates(waited.instant))
        there = replace(waited, updates=updates, nominal=planner.x, covariance=planner.covariance)
        planner.plan.instants.append(replace(there, covariance_before=begin.covariance))
        planner.plan.begin = begin
        return fly(planner, self.timeline, begin.number + 1)


def check_starts(maps: Maps) -> None:
    """Raise `ScenarioError` where a later start has no meaning."""
    if maps.update is not None:
        raise ScenarioError(
            "type", "start times: an update of its own has memory whose values at a later start are not known; make "
            "the start a setting of the class, which mcnav sweep varies",
        )  # fmt: skip


def plan_starts(
    maps: Maps, start: Array, timeline: tuple[Instant, ...], states: FilterStates | None, sizes: LoopSizes
) -> Starts:
    """Linearize what the flights of all starts share.

    Raises `ScenarioError` where the flight without errors depends on the start.
    """
    known: dict[Hashable, Derivatives] = {}
    plan = make_plan(maps, start, timeline, states, sizes.true, sizes.believed, known)
    moved = [name for name, share in plan.innovations.items() if share > LARGEST_INNOVATION]
    if moved:
        raise ScenarioError(
            "type", f"start times: the innovation of {moved[0]} is not zero without errors, so that the nominal flight "
            "depends on when the navigator starts; make the start a setting of the class, which mcnav sweep varies",
        )  # fmt: skip
    waits = WaitingMaps.along(maps, plan)
    waiting = make_plan(waits, start, timeline, None, sizes.true, sizes.believed)
    latest = min(plan.event_times.values(), default=np.inf)
    possible = [
        number
        for number, instant in enumerate(timeline[: plan.end])
        if (instant.epoch or instant.corrections) and instant.time <= latest
    ]
    begins = _begins(maps, waiting.instants, possible, states, sizes)
    return Starts(maps, start, timeline, states, sizes, plan, waiting, known, begins)


def _begins(
    maps: Maps, instants: Sequence[PlannedInstant], possible: Sequence[int], states: FilterStates | None,
    sizes: LoopSizes,
) -> tuple[Begin, ...]:  # fmt: skip
    """Return the starts at some instants; a filter begins with what is believed of the flight until there."""
    structure = maps.structure
    places, counterparts = follow_truth(structure)
    state = np.eye(structure.size)
    state[structure.navigator] = 0.0
    state[places, counterparts] = 1.0
    of_navigator = np.array([source.of == "navigation" for source in structure.sources])
    errors = structure.start_partials * of_navigator
    believed = LinearState.at_start(maps, sizes.believed, waits=True)
    begins = []
    for number, planned in enumerate(instants[: max(possible, default=-1) + 1]):
        for transition in planned.steps:
            believed = believed.after(maps, sizes.believed, transition)
        if number in possible:
            begin, covariance = Begin(number, state, errors, np.zeros((0, 0))), np.zeros((0, 0))
            if states is not None:
                of_x = believed.begun(begin).covariance(sizes.believed.start)
                covariance = states.reading @ of_x @ states.reading.T
            begins.append(replace(begin, covariance=covariance))
        for transition in planned.updates:
            believed = believed.after(maps, sizes.believed, transition)
    return tuple(begins)
