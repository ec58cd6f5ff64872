"""Engine of a closed loop: simulates the maps of the user's class; it is sent to workers as the text of the file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.closed_loop.conditional import ConditionalDraws, noise_partials, rows_of
from mcnav.systems.closed_loop.declarations import Filter
from mcnav.systems.closed_loop.filter import FilterStates, read_filter
from mcnav.systems.closed_loop.gates import NO_GATES, LoopGates, SampleGates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.plan import Plan
from mcnav.systems.closed_loop.reading import read_maps, read_start
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.schedule import read_schedule
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.simulation import simulate
from mcnav.systems.closed_loop.sizes import LoopSizes, difference_steps
from mcnav.systems.closed_loop.strapdown.merged import with_navigator
from mcnav.systems.conditions import Conditions
from mcnav.systems.guard import simulating
from mcnav.systems.sample_loop import join_results, simulate_alone
from mcnav.systems.timeouts import SampleTimeout, within_limit
from mcnav.systems.user.code import UserScenarioSpec


def maps_of(instance: Any, name: str, sizes: LoopSizes | None = None) -> Maps:
    """Read the maps of a user's object with the correlation times of its processes."""
    if sizes is None:
        return read_maps(instance, name)
    return read_maps(instance, name, sizes.true.decay[:, None], sizes.believed.decay[:, None])


def judged_states(instance: Any, name: str, maps: Maps) -> FilterStates | None:
    """Return the states of which a filter, or an update of the user's own, states a covariance; none without."""
    if maps.covariance is not None:
        return read_filter(Filter(gains="nominal"), name, maps.structure)
    return read_filter(instance.filter, name, maps.structure)


def readout_of(maps: Maps) -> Readout:
    """Return what is read out of a loop."""
    return Readout(maps)


def set_up(
    instance: Any, name: str, sizes: LoopSizes, plan: Plan, epochs: Mapping[int, int], schema: FilterSchema | None,
    gates: LoopGates = NO_GATES,
) -> Setup:  # fmt: skip
    """Put together what samples share."""
    maps = maps_of(instance, name, sizes)
    schedule = read_schedule(instance, name, tuple(sensor.declared for sensor in maps.sensors))
    start, readout = read_start(instance, name, maps.structure), readout_of(maps)
    steps = difference_steps(maps, start, sizes.true)
    return Setup(
        maps, schedule, plan, read_filter(instance.filter, name, maps.structure), judged_states(instance, name, maps),
        sizes.true, sizes.believed, start, steps, epochs, readout, schema, readout.floor(plan),
        SampleGates.of(gates, maps.sensors, schedule),
    )  # fmt: skip


@dataclass(frozen=True)
class ClosedLoopEngine:
    """Engine of the user's loop.

    Attributes
    ----------
    instants : mapping of int to int
        Epochs by the number of their instant.
    """

    spec: UserScenarioSpec
    sizes: LoopSizes
    plan: Plan
    instants: Mapping[int, int]
    outputs: int
    chunk: int
    accuracy: str
    epochs: Epochs | None
    noisy: bool
    filter: FilterSchema | None
    gates: LoopGates = NO_GATES
    parallel: str = "processes"

    def with_noise(self, multiple: float) -> ClosedLoopEngine:
        """Return that of the final outputs with so many times the noise, and as its filter believes it."""
        sizes = LoopSizes(self.sizes.true.scaled(multiple), self.sizes.believed.scaled(multiple))
        plan, last = self.plan.scaled(multiple), {self.plan.end: 0}
        return replace(self, sizes=sizes, plan=plan, instants=last, epochs=None, filter=None)

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalLoop:
        """Return the samples with conditions on what noise adds to some outputs."""
        setup, numbers = self.set_up(), {epoch: number for number, epoch in self.instants.items()}
        asked: dict[int, list[int]] = {} if outputs else {self.plan.end: []}
        for output, epoch in zip(outputs, (-1,) * len(outputs) if epochs is None else epochs, strict=True):
            asked.setdefault(numbers.get(epoch, self.plan.end), []).append(output)
        partials = [noise_partials(setup.plan, setup.maps, setup.true, setup.readout, tuple(chosen), number)
                    for number, chosen in asked.items()]  # fmt: skip
        rows, counts = rows_of(partials)
        engine = replace(self, filter=None)
        return ConditionalLoop(engine, Conditions.on(rows), counts, over_time=epochs is not None)

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples; without noise their final outputs alone."""
        with self.spec.running(simulating(batch, noise)):
            setup, noisy = self.set_up(), noise and self.noisy
            return self.each_alone(batch, lambda rows: simulate(setup, batch[rows], noisy, over_time=noise))

    def set_up(self) -> Setup:
        """Put together what samples share."""
        instance = with_navigator(self.spec.build().value)
        return set_up(instance, self.spec.name, self.sizes, self.plan, self.instants, self.filter, self.gates)

    def each_alone(self, batch: Batch, some: Callable[[slice], SimulationResult]) -> SimulationResult:
        """Simulate all samples together or, where that fails, each by itself."""
        count = len(batch.errors)
        try:
            return within_limit(lambda: some(slice(count)))
        except MemoryError:
            raise
        except (Exception, SampleTimeout):
            return simulate_alone(lambda row: some(slice(row, row + 1)), count, self.outputs, self.spec.code.file)


@dataclass(frozen=True)
class ConditionalLoop:
    """Samples of a loop with conditions on what noise adds to some outputs, at the end or at epochs.

    ``counts`` are the numbers of each stream that the conditions know, in the order of the columns.
    """

    engine: ClosedLoopEngine
    conditions: Conditions
    counts: Mapping[int, int]
    over_time: bool

    @property
    def factor(self) -> Array:
        """Additions of the normals to the outcomes; those of an epoch follow each other."""
        return self.conditions.factor

    def simulate(self, batch: Batch, normals: Array) -> SimulationResult:
        """Simulate samples with these normals of their noise, shape (n, r)."""
        setup = self.engine.set_up()
        parts = np.split(self.conditions.directions, np.cumsum(list(self.counts.values()))[:-1], axis=1)
        directions = dict(zip(self.counts, parts, strict=True))

        def some(rows: slice) -> SimulationResult:
            part = batch[rows]
            draws = ConditionalDraws(part.seed, part.index, directions, normals[rows])
            return simulate(setup, part, True, over_time=self.over_time, draws=draws)

        def together(begin: int) -> SimulationResult:
            end = min(begin + self.engine.chunk, len(normals))

            def of_piece(rows: slice) -> SimulationResult:
                return some(slice(begin + int(rows.start or 0), begin + int(rows.stop)))

            return self.engine.each_alone(batch[begin:end], of_piece)

        with self.engine.spec.running(simulating(batch, noise=True)):
            return join_results([together(begin) for begin in range(0, len(normals), self.engine.chunk)])
