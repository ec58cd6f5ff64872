"""Scenario of a closed loop: implements the contract for a user's subclass of `ClosedLoop`."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs, History, Panel
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import Capability, ScenarioError
from mcnav.systems.closed_loop.beliefs import believed_shares
from mcnav.systems.closed_loop.engine import ClosedLoopEngine, maps_of, readout_of, set_up
from mcnav.systems.closed_loop.filter import read_filter
from mcnav.systems.closed_loop.linear import LinearReadings, process_names, read_plan
from mcnav.systems.closed_loop.plan import Plan, make_plan
from mcnav.systems.closed_loop.reading import read_start
from mcnav.systems.closed_loop.records import schema_of
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.soundness import check_repeatable, remarks_on
from mcnav.systems.closed_loop.timeline import read_timeline
from mcnav.systems.sample_loop import format_exception
from mcnav.systems.user.code import UserScenarioSpec

LABEL: Final = "time [s]"

MOST_NUMBERS: Final = 20_000
"""Numbers of a sample's records over time, which bound the epochs."""

FEWEST_EPOCHS: Final = 20

CHUNK_NUMBERS: Final = 16_000_000
MOST_SAMPLES: Final = 1_024
"""Numbers over time, and samples, of a chunk."""

SURE: Final = 6.0
"""Sigmas of the final time before the nominal end by trigger up to which epochs lie: samples that have ended before an
epoch are read out as they were at their end."""

EARLY: Final = 0.8
"""Share of the nominal flight up to which epochs lie in any case."""

ROUNDING: Final = 1e-9
"""Share of a quantity's size below which its nominal values are rounding."""


class ClosedLoopScenario:
    """A scenario made of the user's loop.

    Parameters
    ----------
    spec : UserScenarioSpec
    sizes : LoopSizes
        Of the errors, and as the filter believes them.

    Raises
    ------
    ScenarioError
        When the class does not follow the protocol.
    """

    engines = ("vectorised",)
    outages: tuple[tuple[float, float], ...] = ()

    def __init__(self, spec: UserScenarioSpec, sizes: LoopSizes) -> None:
        self.spec = spec
        self.sizes = sizes
        self._object = spec.build_current()
        self._instance = self._object.value
        self.maps = maps_of(self._instance, spec.name, sizes)
        self._start = read_start(self._instance, spec.name, self.maps.structure)
        self.timeline = read_timeline(self._instance, spec.name, tuple(sensor.declared for sensor in self.maps.sensors))
        self.states = read_filter(self._instance.filter, spec.name, self.maps.structure)
        if self.maps.sensors and self.states is None:
            raise ScenarioError("type", f"{spec.name} has measurements and no filter that uses them")
        self.readout = readout_of(self.maps)
        self.outputs: tuple[Output, ...] = self.readout.outputs

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Errors at the start, and parameters."""
        sigmas = np.sqrt(np.maximum(np.diag(self.sizes.true.start), 0.0))
        return tuple(
            Source(
                each.name, each.unit, each.unit, float(sigma) or (1e-3 if each.unit.startswith("rad") else 1.0),
                group=each.group, of=each.of,
            )
            for each, sigma in zip(self.maps.structure.sources, sigmas, strict=True)
        )  # fmt: skip

    @property
    def can(self) -> frozenset[Capability]:
        """What the scenario can do."""
        always = {Capability.USER_CODE, Capability.LINEAR_OVER_TIME, Capability.EPOCHS}
        noise = {Capability.NOISE} if self.noisy else set()
        return frozenset(always | noise | ({Capability.FILTER} if self.states is not None else set()))

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of noise that have a size."""
        true, structure = self.sizes.true, self.maps.structure
        blocks = (structure.white, structure.markov)
        sized = [
            array[place.start - block.begin : place.stop - block.begin]
            for block, array in zip(blocks, (true.white, true.markov), strict=True)
            for _, place in block.places()
        ]
        sized += [*true.measurements, *true.corrections]
        names = process_names(self.maps)
        return tuple(Output(name, "1", "1") for name, size in zip(names, sized, strict=True) if size.any())

    @property
    def noisy(self) -> bool:
        """Whether it has noise at present."""
        return bool(self.processes)

    def with_sizes(self, sizes: LoopSizes) -> ClosedLoopScenario:
        """Return the scenario with other sizes."""
        return type(self)(self.spec, sizes)

    @cached_property
    def plan(self) -> Plan:
        """The linear system along the nominal; `ScenarioError` when the flight without errors fails."""
        with self._object.recording(self.spec.code.file), np.errstate(all="ignore"):
            try:
                return make_plan(
                    self.maps, self._start, self.timeline, self.states, self.sizes.true, self.sizes.believed
                )
            except ScenarioError:
                raise
            except (Exception, SystemExit) as failure:
                message = f"its flight without any error failed: {format_exception(failure, self.spec.code.file)}"
                raise ScenarioError("type", message) from failure

    @cached_property
    def _chosen(self) -> tuple[int, ...]:
        """Instants that are epochs, by number: cycle instants, evenly thinned, and the end."""
        triggered = self.maps.end is not None
        end = self.plan.end if triggered else len(self.timeline) - 1
        end_time = self.plan.end_time
        latest = max(EARLY * end_time, end_time - SURE * self._sigma_of_time) if triggered else np.inf
        possible = [
            number
            for number, instant in enumerate(self.timeline[:end])
            if instant.epoch and 0.0 < instant.time <= latest
        ]
        schema = self.filter_schema
        width = len(self.outputs) + (0 if schema is None else schema.width)
        most = max(FEWEST_EPOCHS, MOST_NUMBERS // width) - 1
        places = np.unique(np.linspace(len(possible) - 1, 0, min(most, len(possible))).round().astype(int))
        return (*(possible[place] for place in places.tolist()), end)

    @cached_property
    def readings(self) -> LinearReadings:
        """The linear system at the epochs."""
        return read_plan(self.plan, self.maps, self.sizes.true, self.readout, self._chosen)

    @property
    def reading_times(self) -> Array:
        """The epochs, s."""
        end = self.plan.end_time if self.maps.end is not None else self.timeline[-1].time
        return np.array([*(self.timeline[number].time for number in self._chosen[:-1]), end])

    @property
    def epochs(self) -> Epochs:
        """The epochs, with corrections as events."""
        events = {
            self.maps.impulses[number].declared.name: instant.time
            for instant in self.timeline
            for number in instant.corrections
        }
        return Epochs(LABEL, self.reading_times, events)

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Return the linear system at the end."""
        system = self.linear_over_time(len(self._chosen))
        return system.at(np.arange(len(system.times)) == len(system.times) - 1)

    def linear_over_time(self, count: int) -> LinearSystem:
        """Return the linear system at so many epochs, evenly chosen, or at all when there are fewer."""
        read, last = self.readings, len(self._chosen) - 1
        chosen = np.unique(np.linspace(0, last, min(count, last + 1)).round().astype(int))
        processes = {name: each[chosen] for name, each in read.processes.items()}
        return LinearSystem(read.times[chosen], read.partials[chosen], read.nominal[chosen], processes, label=LABEL)

    @cached_property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record of the filter; none without one."""
        return None if self.states is None else schema_of(self.maps, self.states, len(self.outputs))

    def filter_prediction(self) -> FilterPrediction | None:
        """Return the covariance that the filter states along the nominal; none without a filter."""
        states, schema = self.states, self.filter_schema
        if states is None or schema is None:
            return None
        known = np.array(schema.known)
        covariance = np.full((len(self._chosen), schema.outputs, schema.outputs), np.nan)
        for epoch, number in enumerate(self._chosen):
            own = self.plan.instants[number].covariance[: states.estimated, : states.estimated]
            covariance[epoch][known[:, None], known] = own
        count = len(self._chosen)
        return FilterPrediction(
            LABEL, self.reading_times, covariance, np.zeros((count, 0)), np.zeros((count, 0, len(self.sources))),
            {process.name: np.zeros((count, 0)) for process in self.processes}, self.believed,
        )  # fmt: skip

    @property
    def believed(self) -> dict[str, float]:
        """Shares of variance that the filter believes in; zero of what it neglects."""
        return {} if self.states is None else believed_shares(self.maps, self.states, self.sizes)

    @property
    def accuracy(self) -> str:
        """Describe how samples are simulated and linearized."""
        length = max(instant.length for instant in self.timeline)
        told = (
            f"{self.spec.code.file}, class {self.spec.name}, many at once; Runge-Kutta steps of {length:.4g} s; "
            "derivatives of each map by central differences of fourth order along the nominal"
        )
        return "; ".join([told, *self.remarks])

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What is to be noticed of the loop.

        Raises `ScenarioError` when samples depend on more than their errors and noise.
        """
        self.plan  # noqa: B018  its failure is told first
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}
        setup = set_up(self._instance, self.spec.name, self.sizes, self.plan, instants, None)
        with self._object.recording(self.spec.code.file), np.errstate(all="ignore"):
            try:
                check_repeatable(setup)
                return tuple(remarks_on(setup, self._sigma_of_time))
            except ScenarioError:
                raise
            except (Exception, SystemExit) as failure:
                message = f"flights with small errors failed: {format_exception(failure, self.spec.code.file)}"
                raise ScenarioError("type", message) from failure

    @cached_property
    def _sigma_of_time(self) -> float:
        if not self.maps.structure.clock.size:
            return 0.0
        end = read_plan(self.plan, self.maps, self.sizes.true, self.readout, (self.plan.end,))
        row = end.partials[0, -1]
        variance = row @ self.sizes.true.start @ row + sum(each[0, -1, -1] for each in end.processes.values())
        return float(np.sqrt(max(variance, 0.0)))

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine; `ScenarioError` when the nominal flight fails."""
        schema, epochs = self.filter_schema, self.epochs
        width = len(self.outputs) + (0 if schema is None else schema.width)
        chunk = int(np.clip(CHUNK_NUMBERS // (width * len(epochs.times)), 32, MOST_SAMPLES))
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}
        return ClosedLoopEngine(
            self.spec.pinned(self._object), self.sizes, self.plan, instants, len(self.outputs), chunk, self.accuracy,
            epochs, self.noisy, schema,
        )  # fmt: skip

    def nominal(self) -> History:
        """Return the nominal truth and commands at all instants."""
        planned = self.plan.instants
        x = np.array([self._start, *(each.nominal for each in planned)])
        x = np.where(np.abs(x).max(axis=0) > ROUNDING * self.plan.steps, x, 0.0)
        times = np.array([0.0, *(each.instant.time for each in planned[:-1]), self.plan.end_time])
        fresh = np.append(True, np.diff(times) > 0.0)
        columns, panels = {LABEL: times[fresh]}, []
        structure = self.maps.structure
        blocks = (structure.truth, *((structure.command,) if self.maps.guide is not None else ()))
        for block in blocks:
            for quantity, place in block.places():
                spoken = quantity.name.replace("_", " ")
                names = [f"{name.replace('_', ' ')} [{quantity.unit}]" for name in quantity.names]
                columns |= dict(zip(names, x[fresh][:, place].T, strict=True))
                panels.append(Panel(spoken.capitalize(), LABEL, tuple(names), quantity.axes,
                                    f"{spoken} [{quantity.unit}]" if quantity.axes else "",
                                    marks=tuple(self.epochs.events)))  # fmt: skip
        return History(columns, self.epochs.events, tuple(panels))


def without_errors(spec: UserScenarioSpec) -> LoopSizes:
    """Return the sizes of a loop without errors."""
    none = Sizes.none(maps_of(spec.build_current().value, spec.name))
    return LoopSizes(none, replace(none))
