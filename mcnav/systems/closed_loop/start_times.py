"""Start of the navigator at an instant of the flight, by the linear system.

Until it starts the truth flies by what is commanded without errors, `WaitingMaps`, dispersed by its errors at the start
of the flight and by its processes; nothing is measured, and the navigator's errors are those of `Begin`. What comes
after the start is that of any start: of each start the filter's covariance and gains are computed again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearSystem
from mcnav.contract.scenario import ScenarioError
from mcnav.contract.timeline import Start
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.starts import start_times
from mcnav.systems.closed_loop.linear import LinearLoop, without_rounding
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.nominal_flight import innovation_shares, linearize
from mcnav.systems.closed_loop.plan import Begin, Plan, make_plan
from mcnav.systems.closed_loop.schedule import Instant
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.timeline import LoopTimeline, rows_of_errors
from mcnav.systems.closed_loop.transitions import Linearization
from mcnav.systems.closed_loop.waiting import WaitingMaps, follow_truth

LARGEST_INNOVATION: Final = 1e-3
"""Nominal innovation, as a share of its believed sigma, up to which gains do not move the flight without errors."""


@dataclass(frozen=True)
class Begun:
    """A navigator that starts within the flight: the plan of its samples, and its linear system."""

    plan: Plan
    linear: LinearLoop


@dataclass(frozen=True)
class Starts:
    """Starts of a navigator within the flight.

    Attributes
    ----------
    loop : LoopTimeline
        Of a navigator that starts with the flight.
    waiting : Linearization
        Of one that never starts.
    numbers : tuple of int
        Instants at which it may start, in the order of time.
    """

    loop: LoopTimeline
    waiting: Linearization
    numbers: tuple[int, ...]

    @property
    def times(self) -> Array:
        """Times of the starts, s."""
        return self.loop.times[list(self.numbers)]

    def nearest(self, times: Array) -> list[int]:
        """Return the starts, by their place in ``numbers``, that are nearest to some times, each once."""
        return [int(place) for place in np.unique(np.abs(self.times[:, None] - times).argmin(axis=0))]

    def begins(self, numbers: Sequence[int]) -> dict[int, tuple[Begin, Start]]:
        """Return starts at instants by number, those of samples and of the linear engine, by their position."""
        loop, structure, states = self.loop, self.loop.maps.structure, self.loop.states
        places, counterparts = follow_truth(structure)
        state = np.eye(structure.size)
        state[structure.navigator] = 0.0
        state[places, counterparts] = 1.0
        errors = structure.start_partials * np.array([source.of == "navigation" for source in structure.sources])
        added = np.pad(rows_of_errors(loop.pairs, errors), ((0, 0), (0, 1)))
        turned, names = rows_of_errors(loop.pairs, state), loop.timeline.processes
        true, believed = (self._waited(sizes, numbers) for sizes in (loop.sizes.true, loop.sizes.believed))
        begins = {}
        for row, number in enumerate(numbers):
            covariance = np.zeros((0, 0))
            if states is not None:
                seen = states.reading @ state
                moved = seen @ believed.partials[row, :, :-1] + states.reading @ errors
                covariance = transform(moved, loop.sizes.believed.start)
                covariance += transform(seen, believed.covariances[row].sum(axis=0))
            noise = dict(zip(names, transform(turned, true.covariances[row]), strict=True))
            own = None if states is None else covariance
            start = Start(turned @ true.partials[row] + added, noise, filter_covariance=own)
            begins[int(loop.before[number])] = Begin(number, state, errors, covariance), start
        return begins

    def _waited(self, sizes: Sizes, numbers: Sequence[int]) -> Propagated:
        """Return X at instants by number, of a navigator that waits: without errors."""
        structure = self.loop.maps.structure
        waits = LoopTimeline(self.waiting, self.loop.maps, None, LoopSizes(sizes, sizes), self.loop.readout, waits=True)
        partials, whole = np.pad(structure.start_partials, ((0, 0), (0, 1))), np.eye(structure.size)
        partials[structure.navigator] = 0.0
        start = replace(waits.timeline.start, partials=partials)
        return propagate(waits.timeline, None, waits.before[list(numbers)], start=start, maps=lambda _: whole)

    def read_ends(self, numbers: Sequence[int]) -> LinearSystem:
        """Read the linear system out at the end for a navigator started at each of some instants, by number."""
        loop = self.loop
        (end,) = LinearLoop(loop).at_instants((loop.linear.end,))
        begins = self.begins(numbers)
        matrix = loop.read_at(end.x, end.time)
        read = start_times(
            loop.timeline, end.position, matrix, np.array(list(begins)), lambda position: begins[position][1]
        )
        processes = {name: read.covariances[:, row] for row, name in enumerate(loop.timeline.processes)}
        system = LinearSystem(self.loop.times[list(numbers)], read.partials[:, :, :-1], processes=processes)
        return without_rounding(system, loop)

    def begun(self, number: int) -> Begun:
        """Start the navigator at an instant."""
        loop = self.loop
        ((position, (begin, start)),) = self.begins((number,)).items()
        reached = loop.linear.instants[number]
        waited = replace(self.waiting.instants[number], updates=reached.updates, nominal=reached.nominal)
        instants = [*self.waiting.instants[:number], waited, *loop.linear.instants[number + 1 :]]
        plan = make_plan(replace(loop.linear, instants=instants), loop.maps, loop.states, loop.sizes.believed, begin)
        return Begun(plan, LinearLoop(loop, position, start))


def check_starts(maps: Maps) -> None:
    """Raise `ScenarioError` where a later start has no meaning."""
    if maps.update is not None:
        raise ScenarioError(
            "type", "start times: an update of its own has memory whose values at a later start are not known. Make "
            "the start a setting of the class, which mcnav sweep varies",
        )  # fmt: skip


def plan_starts(loop: LoopTimeline, start: Array, schedule: tuple[Instant, ...]) -> Starts:
    """Linearize what the flights of all starts share.

    Raises `ScenarioError` where the flight without errors depends on the start.
    """
    linear, maps = loop.linear, loop.maps
    check_starts(maps)
    shares = innovation_shares(linear, maps, loop.states is not None, loop.sizes)
    moved = [name for name, share in shares.items() if share > LARGEST_INNOVATION]
    if moved:
        raise ScenarioError(
            "type", f"start times: the innovation of {moved[0]} is not zero without errors, so that the nominal flight "
            "depends on when the navigator starts. Make the start a setting of the class, which mcnav sweep varies",
        )  # fmt: skip
    waiting = linearize(WaitingMaps.along(maps, linear), start, schedule, loop.sizes, None)
    latest = min(linear.event_times.values(), default=np.inf)
    possible = tuple(
        number
        for number, instant in enumerate(schedule[: linear.end])
        if (instant.epoch or instant.corrections) and instant.time <= latest
    )
    return Starts(loop, waiting, possible)
