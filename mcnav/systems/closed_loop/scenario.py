"""Scenario of a closed loop: implements the contract for a user's subclass of `ClosedLoop`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Final, TypeVar

import numpy as np

from mcnav._types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs, History, Panel, StartClock
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import TRUE_DISPERSION, Output, Source
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Capability, ScenarioError
from mcnav.systems.closed_loop.beliefs import believed_shares
from mcnav.systems.closed_loop.departures import (
    check_finite,
    departures_from_twins,
    growth_of,
    sigmas_of,
    singular_corrections,
)
from mcnav.systems.closed_loop.engine import ClosedLoopEngine, judged_states, maps_of, readout_of, set_up
from mcnav.systems.closed_loop.filter import read_filter
from mcnav.systems.closed_loop.linear import LinearReadings, process_names, read_plan
from mcnav.systems.closed_loop.own_update import stated_covariance
from mcnav.systems.closed_loop.plan import Plan, make_plan
from mcnav.systems.closed_loop.reading import read_start
from mcnav.systems.closed_loop.records import schema_of
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from mcnav.systems.closed_loop.soundness import check_repeatable, remarks_on
from mcnav.systems.closed_loop.start_times import Starts, check_starts, plan_starts
from mcnav.systems.closed_loop.strapdown.merged import with_navigator
from mcnav.systems.closed_loop.strapdown.shown import instrument_sources, shown_units
from mcnav.systems.closed_loop.timeline import read_timeline
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.user.code import UserScenarioSpec, ask

Read = TypeVar("Read")

REVISION: Final = 1
"""Counts the changes of the samples' last digits: before, products of a library were of all samples at once."""

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
"""Share of a quantity's size below which its nominal values are rounding, and of the flight that tells instants apart.
"""

MOST_STARTS: Final = 61
"""Start times of a study: each has a filter, and linear covariance, of its own."""

START_CLOCK: Final = StartClock(
    "min of the flight",
    meaning="Until its navigator starts the vehicle flies by what is commanded without errors, dispersed by its errors "
    "at the start of the flight and by its processes; nothing is measured. Then the navigator has its stated errors.",
    compared="Starts at instants of the loop are compared, up to the first event by trigger.",
    weighs=TRUE_DISPERSION,
    instants=True,
)


class ClosedLoopScenario:
    """A scenario made of the user's loop.

    Parameters
    ----------
    spec : UserScenarioSpec
    sizes : LoopSizes
        Of the errors, and as the filter believes them.
    begun : Plan, optional
        Of a navigator that starts within the flight.

    Raises
    ------
    ScenarioError
        When the class does not follow the protocol.
    """

    engines = ("vectorised",)
    revision = REVISION
    outages: tuple[tuple[float, float], ...] = ()

    start_clock = START_CLOCK

    def __init__(self, spec: UserScenarioSpec, sizes: LoopSizes, begun: Plan | None = None) -> None:
        self.spec = spec
        self.sizes = sizes
        self._begun = begun
        self._ends: dict[float, tuple[Array, Array]] = {}
        self._object = spec.build_current()
        _read_loop(spec, lambda: self._read(spec, sizes))

    def _read(self, spec: UserScenarioSpec, sizes: LoopSizes) -> None:
        """Read what the class declares."""
        self._instance = with_navigator(self._object.value)
        self.maps = maps_of(self._instance, spec.name, sizes)
        self._start = read_start(self._instance, spec.name, self.maps.structure)
        self.timeline = read_timeline(self._instance, spec.name, tuple(sensor.declared for sensor in self.maps.sensors))
        self.states = read_filter(self._instance.filter, spec.name, self.maps.structure)
        self._check_navigator(spec.name)
        self.judged = judged_states(self._instance, spec.name, self.maps)
        self.readout = readout_of(self.maps)
        self._shown, self._instruments = shown_units(self._instance), instrument_sources(self._instance)
        shown = self._shown
        self.outputs: tuple[Output, ...] = tuple(
            replace(output, shown_in=shown.get(output.name, output.shown_in)) for output in self.readout.outputs
        )

    def _check_navigator(self, name: str) -> None:
        """Raise `ScenarioError` when nothing uses the measurements, or two would."""
        maps, update = self.maps, self.maps.update
        if maps.sensors and self.states is None and update is None:
            raise ScenarioError("type", f"{name} has measurements and no filter that uses them")
        if self.states is not None and (update is not None or maps.covariance is not None):
            raise ScenarioError("type", f"{name} has a Filter and an update or covariance of its own; leave one out")
        if maps.covariance is not None and update is None:
            raise ScenarioError("type", f"{name} has a covariance and no update of its own; write update, too")

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Errors at the start, and parameters."""
        sigmas = np.sqrt(np.maximum(np.diag(self.sizes.true.start), 0.0))
        shown, known = self._shown, self._instruments
        sources = []
        for each, sigma in zip(self.maps.structure.sources, sigmas.tolist(), strict=True):
            usual = known[each.name].nominal if each.name in known else 1e-3 if each.unit.startswith("rad") else 1.0
            unit = shown.get(each.name, each.unit)
            sources.append(Source(each.name, each.unit, unit, sigma or usual, group=each.group, of=each.of))
        return tuple(sources)

    @property
    def can(self) -> frozenset[Capability]:
        """Capabilities of the scenario."""
        over_time = {Capability.LINEAR_OVER_TIME, Capability.EPOCHS, Capability.UPDATES, Capability.START_TIMES}
        always = {Capability.USER_CODE, Capability.REMARKS, *over_time}
        noise = {Capability.NOISE} if self.noisy else set()
        return frozenset(always | noise | ({Capability.FILTER} if self.judged is not None else set()))

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
        """True where it has noise at present."""
        return bool(self.processes)

    def with_sizes(self, sizes: LoopSizes) -> ClosedLoopScenario:
        """Return the scenario with other sizes."""
        return type(self)(self.spec, sizes)

    @cached_property
    def plan(self) -> Plan:
        """The linear system along the nominal; `ScenarioError` when the flight without errors fails."""
        if self._begun is not None:
            return self._begun

        def make() -> Plan:
            if self.maps.covariance is not None:
                stated_covariance(self.maps, np.repeat(self._start[:, None], 3, axis=1), np.zeros(3))
            return make_plan(self.maps, self._start, self.timeline, self.states, self.sizes.true, self.sizes.believed)

        return self._linearized(make)

    def _linearized(self, run: Callable[[], Read], what: str = "its flight without any error failed") -> Read:
        """Run code of the user's without errors, or with small ones; what fails is a `ScenarioError`."""
        with self._object.recording(self.spec.code.file, LINEARIZING), np.errstate(all="ignore"):
            return ask(self.spec.code.file, LINEARIZING, what, run)

    @cached_property
    def _chosen(self) -> tuple[int, ...]:
        """Instants that are epochs, by number: cycle instants, evenly thinned, and the end."""
        triggered = self.maps.ends
        end = self.plan.end if triggered else len(self.timeline) - 1
        if self._begun is not None:
            return (end,)
        latest = np.inf
        if triggered:
            end_time = self.plan.end_time
            latest = max(EARLY * end_time, end_time - SURE * self._sigmas_of_times.get("end", 0.0))
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
        with np.errstate(all="ignore"):
            readings = read_plan(self.plan, self.maps, self.sizes.true, self.readout, self._chosen)
        check_finite(readings, tuple(output.name for output in self.outputs))
        return readings

    @property
    def reading_times(self) -> Array:
        """The epochs, s."""
        end = self.plan.end_time if self.maps.ends else self.timeline[-1].time
        return np.array([*(self.timeline[number].time for number in self._chosen[:-1]), end])

    @property
    def epochs(self) -> Epochs:
        """The epochs, with corrections as events."""
        events = {
            self.maps.impulses[number].declared.name: instant.time
            for instant in self.timeline
            for number in instant.corrections
        }
        events |= {name: time for name, time in self.plan.event_times.items() if name != "end"}
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
        return LinearSystem(
            read.times[chosen], read.partials[chosen], read.nominal[chosen], processes, label=LABEL,
            origin=read.origin[chosen],
        )  # fmt: skip

    def linear_around_updates(self) -> LinearSystem:
        """Return the linear system at all epochs, before and after updates, and around all corrections."""
        with np.errstate(all="ignore"):
            read = read_plan(self.plan, self.maps, self.sizes.true, self.readout, self._chosen, around=True)
        system = LinearSystem(
            read.times, read.partials, read.nominal, read.processes, read.updates, label=LABEL, origin=read.origin
        )
        schema = self.filter_schema
        if schema is None:
            return system
        own = np.array([self._stated(time, *seen) for time, seen in zip(read.times.tolist(), read.seen, strict=True)])
        if self.maps.covariance is not None:  # what a user states holds after updates
            own[[number for number, update in enumerate(read.updates) if update == "before"]] = np.nan
        return replace(system, own=own, own_outputs=schema.known, believed=self.believed)

    def _stated(self, time: float, x: Array, covariance: Array) -> Array:
        """Return the covariance of the outputs that the navigator states, shape (outputs, outputs)."""
        states, schema = self.judged, self.filter_schema
        assert states is not None
        assert schema is not None
        known, whole = np.array(schema.known), np.full((schema.outputs, schema.outputs), np.nan)
        if self.maps.covariance is not None:
            own = stated_covariance(self.maps, x[:, None], np.array([time]))[:, :, 0]
        else:
            own = covariance[: states.estimated, : states.estimated]
        whole[known[:, None], known] = own
        return whole

    @cached_property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record of the filter; none without one."""
        return None if self.judged is None else schema_of(self.maps, self.judged, len(self.outputs))

    def filter_prediction(self) -> FilterPrediction | None:
        """Return the covariance that the filter states along the nominal; none without a filter."""
        if self.filter_schema is None:
            return None
        times, count = self.reading_times, len(self._chosen)
        planned = [self.plan.instants[number] for number in self._chosen]
        own = [
            self._stated(time, each.nominal, each.covariance)
            for time, each in zip(times.tolist(), planned, strict=True)
        ]
        return FilterPrediction(
            LABEL, times, np.array(own), np.zeros((count, 0)), np.zeros((count, 0, len(self.sources))),
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
        return (
            f"{self.spec.code.file}, class {self.spec.name}, many at once; Runge-Kutta steps of {length:.4g} s; "
            "derivatives of each map by central differences of fourth order along the nominal"
        )

    def remarks_on(self, mean: Array, covariance: Array) -> tuple[str, ...]:
        """Return `remarks`: sizes of the loop are already those of the campaign's errors."""
        return self.remarks

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the loop.

        Raises `ScenarioError` when samples depend on more than their errors and noise.
        """
        self.plan  # noqa: B018  its failure is told first
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}

        def try_out() -> tuple[str, ...]:
            setup = set_up(self._instance, self.spec.name, self.sizes, self.plan, instants, None)
            result = check_repeatable(setup)
            return (*remarks_on(setup, self._sigmas_of_times), *self._departures(setup, result))

        return self._linearized(try_out, "flights with small errors failed")

    def _departures(self, setup: Setup, result: SimulationResult) -> tuple[str, ...]:
        """Say what linear analysis says of the loop itself, and how a few samples depart from it."""
        names = tuple(output.name for output in self.outputs)
        start = self.sizes.true.start
        said = [*growth_of(self.readings, names, start), *singular_corrections(setup, self.readings, names)]
        sigma = sigmas_of(self.readings, start)[-1]
        return tuple(said or departures_from_twins(setup, result, sigma))

    @cached_property
    def _sigmas_of_times(self) -> dict[str, float]:
        """Linear sigmas of the times of events by trigger, s, by name."""
        if not self.maps.events:
            return {}
        with np.errstate(all="ignore"):
            end = read_plan(self.plan, self.maps, self.sizes.true, self.readout, (self.plan.end,))
        sigmas, names = sigmas_of(end, self.sizes.true.start)[-1], [output.name for output in self.outputs]
        places = [names.index(quantity.name) for quantity in self.maps.structure.clock.quantities]
        return {event.name: float(sigmas[place]) for event, place in zip(self.maps.events, places, strict=True)}

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine.

        Raises `ScenarioError` when the nominal flight fails, or samples depend on more than their errors and noise.
        """
        if self._begun is None:
            self.remarks  # noqa: B018  fails where samples are not repeatable
        schema, epochs = self.filter_schema if self._begun is None else None, self.epochs
        width = len(self.outputs) + (0 if schema is None else schema.width)
        chunk = int(np.clip(CHUNK_NUMBERS // (width * len(epochs.times)), 32, MOST_SAMPLES))
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}
        return ClosedLoopEngine(
            self.spec.pinned(self._object), self.sizes, self.plan, instants, len(self.outputs), chunk, self.accuracy,
            epochs, self.noisy, schema,
        )  # fmt: skip

    def check_start_axes(self, axes: str) -> None:
        """Refuse axes of another instant, and loops whose navigator has no other start."""
        if axes != "start":
            raise ScenarioError("axes", f"got {axes!r}; a closed loop has axes of its own: leave it out")
        check_starts(self.maps)

    @cached_property
    def _starts(self) -> Starts:
        return self._linearized(lambda: plan_starts(self.maps, self._start, self.timeline, self.states, self.sizes))

    def start_times(self, count: int) -> Array:
        """Choose evenly spaced instants of the loop up to the first event by trigger, and those of corrections, s."""
        times = self._starts.times
        wanted = np.linspace(times[0], times[-1], min(count, MOST_STARTS))
        corrections = [instant.time for instant in self.timeline if instant.corrections and instant.time <= times[-1]]
        return times[self._starts.nearest(np.concatenate([wanted, corrections]))]

    def started_at(self, time: float, axes: str) -> ClosedLoopScenario:
        """Start the navigator at an instant of the loop, s; see `mcnav.systems.closed_loop.start_times`."""
        self.check_start_axes(axes)
        times = self._starts.times
        (number,) = self._starts.nearest(np.array([time]))
        if abs(times[number] - time) > ROUNDING * self.plan.end_time:
            message = (
                f"got {time:g} s; the navigator starts at instants of the loop, the nearest is {times[number]:g} s"
            )
            raise ScenarioError("start", message)
        return self._linearized(
            lambda: type(self)(self.spec, self.sizes, self._starts.plan_of(self._starts.begins[number]))
        )

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives at the end for a navigator started at each time, (n, outputs, sources)."""
        return np.array([partials for partials, _ in map(self._started_end, times.tolist())])

    def noise_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the covariance by noise at the end for a navigator started at each time, (n, outputs, outputs)."""
        return np.array([noise for _, noise in map(self._started_end, times.tolist())])

    def _started_end(self, time: float) -> tuple[Array, Array]:
        """Return partial derivatives and covariance by noise at the end."""
        if time not in self._ends:
            model = self.started_at(time, "start").linear().end
            none = np.zeros((len(self.outputs),) * 2)
            self._ends[time] = model.partials, sum(model.processes.values(), none)
        return self._ends[time]

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
    loop = spec.build_current().value
    none = _read_loop(spec, lambda: Sizes.none(maps_of(with_navigator(loop), spec.name)))
    return LoopSizes(none, replace(none))


def _read_loop(spec: UserScenarioSpec, read: Callable[[], Read]) -> Read:
    """Read what a user's loop declares; `ScenarioError` when its code fails."""
    return ask(spec.code.file, f"while {spec.name} was read", spec.name, read)
