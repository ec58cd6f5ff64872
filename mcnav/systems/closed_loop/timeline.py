"""The timeline of a loop, from which the linear engine answers: `mcnav.contract.timeline`.

X is truth, parameters, Gauss-Markov processes, navigation errors (estimate less counterpart, in place of the estimate),
command, memory, corrections and the clock; the maps of the loop are of the estimate itself. The innovation of the
timeline is what the navigator expects less what is measured, so that ``n = H_f z + v`` with z the navigation errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import (
    FilterSteps,
    Instants,
    Start,
    StepNoise,
    Steps,
    Timeline,
    TimelineFilter,
    Updates,
)
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import sized
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.transitions import Innovation, Linearization, Transition


def sized_processes(maps: Maps, sizes: Sizes) -> tuple[str, ...]:
    """Return the names of the processes of noise that have a size: white, Gauss-Markov, of sensors, of corrections."""
    structure = maps.structure
    sized_by_name: dict[str, Array] = {}
    for block, array in ((structure.white, sizes.white), (structure.markov, sizes.markov)):
        for quantity, place in block.places():
            sized_by_name[quantity.name] = array[place.start - block.begin : place.stop - block.begin]
    sensors = [sensor.declared.name for sensor in maps.sensors]
    sized_by_name |= dict(zip(sensors, sizes.measurements, strict=True))
    sized_by_name |= dict(zip(structure.corrections.names, sizes.corrections, strict=True))
    return tuple(name for name, size in sized_by_name.items() if size.any())


def entering_steps(maps: Maps, sizes: Sizes, inputs: Sequence[Array]) -> Iterator[tuple[str, Array]]:
    """Return what enters p steps by process: name, and ``G`` in sizes of the process, shape (p, size, k).

    ``inputs``: of each step, the derivatives by what enters it, shape (size, 2 inputs).
    """
    if not inputs:
        return
    structure, sized_inputs = maps.structure, np.stack(inputs) * sizes.modes
    count, begin = structure.white.size + structure.markov.size, 0
    for quantity in (*structure.white.quantities, *structure.markov.quantities):
        columns = np.arange(begin, begin + quantity.size)
        yield quantity.name, sized_inputs[:, :, np.concatenate([columns, count + columns])]
        begin += quantity.size


def entering(maps: Maps, sizes: Sizes, transition: Transition) -> Iterator[tuple[str, Array]]:
    """Return what else enters a map by process, that of sensors and corrections: name, and ``G``, shape (size, k)."""
    structure = maps.structure
    if transition.kind == "step":
        for number, of_errors in transition.corrections.items():
            yield structure.corrections.quantities[number].name, of_errors * sizes.corrections[number]
    elif transition.kind == "measure":
        yield maps.sensors[transition.number].declared.name, transition.inputs * sizes.measurements[transition.number]
    elif transition.kind == "correct":
        name = structure.corrections.quantities[transition.number].name
        yield name, transition.inputs * sizes.corrections[transition.number]


Pairs = tuple[IndexArray, IndexArray]
"""Places in X of estimates, and of their counterparts; none for a navigator that waits, whose estimates stay."""


def rows_of_errors(pairs: Pairs, rows: Array) -> Array:
    """Return rows of X with errors, shape (..., size, k), from those with the estimate."""
    places, counterparts = pairs
    result = rows.copy()
    result[..., places, :] -= rows[..., counterparts, :]
    return result


def columns_of_errors(pairs: Pairs, columns: Array) -> Array:
    """Return derivatives by X with errors, shape (..., k, size), from those by X with the estimate."""
    places, counterparts = pairs
    result = columns.copy()
    result[..., counterparts] += columns[..., places]
    return result


@dataclass(frozen=True)
class LoopTransitions:
    """Transitions of a loop's timeline, of some sizes of its errors.

    Attributes
    ----------
    steps : sequence of Transition
        All but innovations.
    """

    maps: Maps
    states: FilterStates | None
    sizes: LoopSizes
    pairs: Pairs
    steps: Sequence[Transition]

    def steps_between(self, first: int, last: int) -> Steps:
        """Return the steps from the first to before the last."""
        structure, chosen = self.maps.structure, self.steps[first:last]
        size = structure.size
        states = np.array([step.state for step in chosen]).reshape(-1, size, size)
        transitions = columns_of_errors(self.pairs, rows_of_errors(self.pairs, states))
        inputs = np.zeros((len(chosen), size, len(structure.sources) + 1))
        by_process: dict[str, list[tuple[IndexArray, Array]]] = {}
        places = np.flatnonzero([step.kind == "step" for step in chosen])
        driven = entering_steps(self.maps, self.sizes.true, [chosen[place].inputs for place in places.tolist()])
        for name, factors in driven:
            if factors.any():
                by_process.setdefault(name, []).append((places, rows_of_errors(self.pairs, factors)))
        for place, step in enumerate(chosen):
            for name, factor in entering(self.maps, self.sizes.true, step):
                if factor.any():
                    moved = rows_of_errors(self.pairs, factor)[None]
                    by_process.setdefault(name, []).append((np.array([place]), moved))
        return Steps(
            transitions, inputs, {name: _noise(covariances, len(chosen)) for name, covariances in by_process.items()}
        )

    def filter_steps_between(self, first: int, last: int) -> FilterSteps:
        """Return the filter's own steps: ``F = T A S``, ``Q = T G (T G)'`` in believed sizes."""
        states, believed, chosen = self.states, self.sizes.believed, self.steps[first:last]
        assert states is not None
        transitions = np.repeat(np.eye(states.count)[None], len(chosen), axis=0)
        noise = np.zeros_like(transitions)
        for place, step in enumerate(chosen):
            if step.kind in ("step", "correct"):
                state, inputs = step.of_filter
                transitions[place] = states.of_errors(state, inputs)[0][:, :, 0]
                sizes = believed.modes if step.kind == "step" else believed.corrections[step.number]
                terms = [inputs * sizes]
                terms += [added * believed.corrections[number] for number, added in step.corrections.items()]
                factor = states.reading @ np.concatenate(terms, axis=1)
                noise[place] = factor @ factor.T
        return FilterSteps.of(transitions, noise)


def _noise(factors: Sequence[tuple[IndexArray, Array]], count: int) -> StepNoise:
    """Return the noise of a process from its factors, shape (p, size, k), at places among so many steps."""
    moved = np.flatnonzero(np.any([factor.any(axis=(0, 2)) for _, factor in factors], axis=0))
    padded = np.zeros((count, len(moved), max(factor.shape[2] for _, factor in factors)))
    for places, factor in factors:
        padded[places, :, : factor.shape[2]] = factor[:, moved]
    return StepNoise(moved, factor=padded)


@dataclass(frozen=True)
class LoopTimeline:
    """A loop's linear system in the form of the linear engine.

    Attributes
    ----------
    states : FilterStates, optional
    waits : bool
        Whether the navigator waits; its estimates stay, and X is with them.
    faults : mapping of (int, float) to ndarray
        What faults add to the measurements of a sensor, by number, at a time, s.
    """

    linear: Linearization
    maps: Maps
    states: FilterStates | None
    sizes: LoopSizes
    readout: Readout
    waits: bool = False
    faults: Mapping[tuple[int, float], Array] = field(default_factory=dict)

    @cached_property
    def pairs(self) -> Pairs:
        """Estimates that are errors in X, and their counterparts."""
        none = np.zeros(0, dtype=np.intp)
        return (none, none) if self.waits else self.maps.structure.pairs

    @cached_property
    def _order(self) -> list[Transition | Innovation]:
        return [event for planned in self.linear.instants for event in (*planned.steps, *planned.updates)]

    @cached_property
    def transitions(self) -> LoopTransitions:
        """All steps."""
        steps = [event for event in self._order if isinstance(event, Transition)]
        return LoopTransitions(self.maps, self.states, self.sizes, self.pairs, steps)

    @cached_property
    def before(self) -> IndexArray:
        """Position before the updates at each instant."""
        sizes = [(len(planned.steps), len(planned.updates)) for planned in self.linear.instants]
        steps, updates = np.array(sizes, dtype=np.int64).reshape(-1, 2).T
        return np.asarray(np.cumsum(steps + updates) - updates, dtype=np.int64)

    @cached_property
    def after(self) -> IndexArray:
        """Position after the updates at each instant."""
        return self.before + np.array([len(planned.updates) for planned in self.linear.instants], dtype=np.int64)

    @cached_property
    def times(self) -> Array:
        """Times of the instants, s."""
        times = np.array([planned.instant.time for planned in self.linear.instants])
        times[self.linear.end] = self.linear.end_time
        return times

    @cached_property
    def processes(self) -> tuple[str, ...]:
        """Processes of noise that have a size."""
        return sized_processes(self.maps, self.sizes.true)

    @cached_property
    def timeline(self) -> Timeline:
        """The timeline."""
        structure, true = self.maps.structure, self.sizes.true
        started = rows_of_errors(self.pairs, structure.start_partials)
        noise, begin = {}, structure.markov.begin
        for quantity, place in structure.markov.places():
            if quantity.name not in self.processes:
                continue
            sigmas = np.zeros((structure.size, quantity.size))
            sigmas[place] = np.diag(true.markov[place.start - begin : place.stop - begin])
            factor = rows_of_errors(self.pairs, sigmas)
            noise[quantity.name] = factor @ factor.T
        biases = {name: np.flatnonzero(np.diag(covariance)) for name, covariance in noise.items()}
        return Timeline(
            Start(np.pad(started, ((0, 0), (0, 1))), noise),
            np.array([isinstance(event, Innovation) for event in self._order], dtype=bool),
            self.transitions.steps_between,
            Instants(self.times, self.before, self.after),
            self.read,
            self.processes,
            {name: np.setdiff1d(bias, self.pairs[0]) for name, bias in biases.items()},
            self._updates,
            self._filter,
        )

    def read(self, position: int, time: float) -> Array:
        """Return C at a position before or after an instant's updates."""
        number = int(np.searchsorted(self.after, position))
        planned = self.linear.instants[number]
        x = planned.nominal if position == self.after[number] else planned.before[-1]
        return self.read_at(x, time)

    def read_at(self, x: Array, time: float) -> Array:
        """Return C about a nominal X."""
        return columns_of_errors(self.pairs, self.readout.partials(x, self.linear.steps, time))

    @cached_property
    def _innovations(self) -> list[tuple[float, Innovation]]:
        return [
            (planned.instant.time, update)
            for planned in self.linear.instants for update in planned.updates if isinstance(update, Innovation)
        ]  # fmt: skip

    @cached_property
    def _updates(self) -> Updates:
        structure, innovations = self.maps.structure, self._innovations
        sizes = np.array([len(innovation.response) for _, innovation in innovations], dtype=np.int64)
        most = int(sizes.max(initial=0))
        responses = np.zeros((len(sizes), most, structure.size))
        names = [sensor.declared.name for sensor in self.maps.sensors]
        variances = {name: np.zeros((len(sizes), most)) for name in names if name in self.processes}
        disturbances = np.zeros((len(sizes), most, len(structure.sources) + 1))
        for row, (size, (time, innovation)) in enumerate(zip(sizes.tolist(), innovations, strict=True)):
            disturbances[row, :size, -1] = -self.faults.get((innovation.number, time), 0.0)
            responses[row, :size] = -columns_of_errors(self.pairs, innovation.response)
            sigmas = self.sizes.true.measurements[innovation.number]
            if names[innovation.number] in variances:
                variances[names[innovation.number]][row, :size] = sigmas**2
        return Updates(sizes, responses, disturbances, variances)

    @cached_property
    def _filter(self) -> TimelineFilter | None:
        states = self.states
        if states is None:
            return None
        most = self._updates.responses.shape[1]
        responses = np.zeros((len(self._innovations), most, states.count))
        variances = np.zeros((len(self._innovations), most))
        for row, (_, innovation) in enumerate(self._innovations):
            sigmas = sized(self.maps, self.sizes.believed, innovation.number)
            responses[row, : len(sigmas)] = -innovation.response @ states.moving
            variances[row, : len(sigmas)] = sigmas**2
        place, true_errors = np.zeros((states.size, states.count)), np.zeros((states.count, states.size))
        estimated = np.arange(states.estimated)
        place[states.estimates, estimated] = 1.0
        true_errors[estimated, states.estimates] = 1.0
        true_errors[states.estimated + np.arange(len(states.considered)), states.considered] = -1.0
        constants = np.zeros((states.count, len(self.maps.structure.sources) + 1))
        covariance = states.start_covariance(self.maps.structure, self.sizes.believed)
        return TimelineFilter(
            self.transitions.filter_steps_between, responses, variances, covariance,
            (np.arange(states.count) < states.estimated).astype(float), place, lambda _: (true_errors, constants),
        )  # fmt: skip
