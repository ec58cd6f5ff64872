"""Scenario of a closed loop: implements the contract for a user's subclass of `ClosedLoop`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Final, TypeVar

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.gates import FaultLaw, GateLaw, GateQuestion, RejectionLaws
from mcnav.contract.history import Epochs, History, Panel, StartClock
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import TRUE_DISPERSION, Output, Source
from mcnav.contract.questions import TimelineParts
from mcnav.contract.scenario import Capability, PlainScenario, ScenarioError
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
from mcnav.systems.closed_loop.gates import NO_GATES, LoopGates, SampleGates, around_faults, gated_filter
from mcnav.systems.closed_loop.kept import KeptLoop, KeptLoopEngine, identity_of
from mcnav.systems.closed_loop.kept_linearization import KeptLinearization
from mcnav.systems.closed_loop.linear import LinearLoop, Reading
from mcnav.systems.closed_loop.nominal_flight import linearize
from mcnav.systems.closed_loop.own_update import stated_covariance
from mcnav.systems.closed_loop.plan import GainFilter, Plan, make_plan
from mcnav.systems.closed_loop.reading import read_start
from mcnav.systems.closed_loop.records import schema_of
from mcnav.systems.closed_loop.schedule import read_schedule
from mcnav.systems.closed_loop.setup import Setup
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes, difference_steps
from mcnav.systems.closed_loop.soundness import Tried, remarks_on, try_samples
from mcnav.systems.closed_loop.start_times import Begun, Starts, check_starts, plan_starts
from mcnav.systems.closed_loop.strapdown.merged import with_navigator
from mcnav.systems.closed_loop.strapdown.shown import instrument_sources, shown_units
from mcnav.systems.closed_loop.timeline import LoopTimeline, sized_processes
from mcnav.systems.closed_loop.transitions import Linearization
from mcnav.systems.gates import GatedFilter, fault_laws, gate_laws, rejection_laws
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.kept import KeptNumbers

Read = TypeVar("Read")

REVISION: Final = 2
"""Counts the changes of the samples: 0 had products of a library of all samples at once, 1 numpy's normal variates."""

LABEL: Final = "time [s]"

MOST_NUMBERS: Final = 20_000
"""Numbers of a sample's records over time, which bound the epochs."""

FEWEST_EPOCHS: Final = 20

CHUNK_NUMBERS: Final = 32_000_000
MOST_SAMPLES: Final = 2_048
"""Numbers over time, 256 MB, and samples, of a chunk: the loop's functions are called as often for ten as for all."""

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

RETUNED: Final = 10.0
"""Factor of sizes up to which derivatives are used again: a step of differences is then at most one sigma."""

TRYING: Final = "flights with small errors failed"
"""What is said where code fails while a few samples are tried."""

START_CLOCK: Final = StartClock(
    "min of the flight",
    meaning="Until its navigator starts the vehicle flies by what is commanded without errors, dispersed by its errors "
    "at the start of the flight and by its processes; nothing is measured. Then the navigator has its stated errors.",
    compared="Starts at instants of the loop are compared, up to the first event by trigger.",
    weighs=TRUE_DISPERSION,
    instants=True,
)


class ClosedLoopScenario(PlainScenario):
    """A scenario made of the user's loop.

    Parameters
    ----------
    spec : UserScenarioSpec
    sizes : LoopSizes
        Of the errors, and as the filter believes them.
    begun : Begun, optional
        A navigator that starts within the flight.
    lag : float, optional
        Of a smoother that follows the filter, s; infinite where it uses all measurements.
    gates : LoopGates, optional
        Of the filter, with faults of its sensors.

    Raises
    ------
    ScenarioError
        When the class does not follow the protocol.
    """

    engines = ("vectorised",)
    revision = REVISION
    start_clock = START_CLOCK

    def __init__(
        self, spec: UserScenarioSpec, sizes: LoopSizes, begun: Begun | None = None, lag: float | None = None,
        gates: LoopGates = NO_GATES,
    ) -> None:  # fmt: skip
        self.spec = spec
        self.sizes = sizes
        self._begun, self._lag, self._gates = begun, lag, gates
        self._shared: Linearization | None = None
        self._together = False
        self._ends: tuple[tuple[float, ...], LinearSystem] | None = None
        self._object = spec.build_current()
        _read_loop(spec, lambda: self._read(spec, sizes))

    def _read(self, spec: UserScenarioSpec, sizes: LoopSizes) -> None:
        """Read what the class declares."""
        self._instance = with_navigator(self._object.value)
        self.maps = maps_of(self._instance, spec.name, sizes)
        self._start = read_start(self._instance, spec.name, self.maps.structure)
        self.schedule = read_schedule(self._instance, spec.name, tuple(sensor.declared for sensor in self.maps.sensors))
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
        for source, sigma in zip(self.maps.structure.sources, sigmas.tolist(), strict=True):
            usual = (
                known[source.name].nominal if source.name in known else 1e-3 if source.unit.startswith("rad") else 1.0
            )
            unit = shown.get(source.name, source.unit)
            sources.append(Source(source.name, source.unit, unit, sigma or usual, group=source.group, of=source.of))
        return tuple(sources)

    @property
    def can(self) -> frozenset[Capability]:
        """Capabilities of the scenario."""
        gated = {Capability.GATES} if self._gates.any and self._begun is None else set()
        return frozenset({Capability.USER_CODE} | gated)

    @property
    def parts(self) -> TimelineParts:
        """Parts of its timeline."""
        smoothed = self._lag is not None and self._begun is None
        measured, judged = bool(self.maps.sensors), self.judged is not None
        return TimelineParts("any time", self.noisy, updates=measured, filter=judged, smoother=smoothed)

    def with_processes_together(self) -> ClosedLoopScenario:
        """Return the same whose linear covariances have all processes together, which takes less."""
        self.linear_loop  # noqa: B018  computed once for both
        tuned = copy(self)
        tuned._together = True
        tuned.__dict__.pop("readings", None)
        return tuned

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of noise that have a size."""
        return tuple(Output(name, "1", "1") for name in sized_processes(self.maps, self.sizes.true))

    def with_sizes(self, sizes: LoopSizes) -> ClosedLoopScenario:
        """Return the scenario with other sizes."""
        return type(self)(self.spec, sizes, lag=self._lag, gates=self._gates)

    def with_filter(self, lag: float | None, gates: LoopGates) -> ClosedLoopScenario:
        """Return the scenario with a smoother of this lag, s, infinite where it uses all measurements, and gates."""
        return type(self)(self.spec, self.sizes, lag=lag, gates=gates)

    def along(self, earlier: ClosedLoopScenario, near: bool = True) -> ClosedLoopScenario:
        """Return the scenario with the derivatives of one with other sizes, for linear answers; itself if it cannot be.

        ``near``: whether their differences must have steps of the same order.

        Samples, whose bits follow from their own sizes alone, have derivatives of their own all the same.
        """
        if self._object is not earlier._object or not _same_maps(self, earlier, near):
            return self
        tuned = type(self)(self.spec, self.sizes, lag=self._lag, gates=self._gates)
        tuned._shared = earlier.linearization
        return tuned

    @cached_property
    def linearization(self) -> Linearization:
        """The derivatives along the nominal; `ScenarioError` when the flight without errors fails."""
        if self._begun is not None:
            return self._begun.linear.loop.linear
        if self._shared is not None:
            return self._shared
        states, maps, believed = self.states, self.maps, self.sizes.believed
        follow = None if states is None else lambda: GainFilter.at_start(maps, states, believed)

        def make() -> Linearization:
            if maps.covariance is not None:
                stated_covariance(maps, np.repeat(self._start[:, None], 3, axis=1), np.zeros(3))
            return linearize(maps, self._start, self.schedule, self.sizes, follow)

        kept = KeptLinearization(self._object, self.spec, maps, self.sizes, self._linearized)
        return kept.keep(self._start, self.schedule, lambda: self._linearized(make))

    @cached_property
    def linear_loop(self) -> LinearLoop:
        """The linear system along the nominal."""
        if self._begun is not None:
            return self._begun.linear
        faults = SampleGates.of(self._gates, self.maps.sensors, self.schedule).errors
        return LinearLoop(
            LoopTimeline(self.linearization, self.maps, self.states, self.sizes, self.readout, faults=faults)
        )

    @cached_property
    def plan(self) -> Plan:
        """The linear system of samples."""
        if self._begun is not None:
            return self._begun.plan
        return make_plan(self.linearization, self.maps, self.states, self.sizes.believed)

    def _linearized(self, run: Callable[[], Read], what: str = "its flight without any error failed") -> Read:
        """Run code of the user's without errors, or with small ones; what fails is a `ScenarioError`."""
        with self._object.recording(self.spec.code.file, LINEARIZING), np.errstate(all="ignore"):
            return self.spec.ask(LINEARIZING, what, run)

    @cached_property
    def _chosen(self) -> tuple[int, ...]:
        """Instants that are epochs, by number: cycle instants, evenly thinned, and the end."""
        triggered = self.maps.ends
        end = self.linearization.end if triggered else len(self.schedule) - 1
        if self._begun is not None:
            return (end,)
        latest = np.inf
        if triggered:
            end_time = self.linearization.end_time
            latest = max(EARLY * end_time, end_time - SURE * self._sigmas_of_times.get("end", 0.0))
        possible = [
            number
            for number, instant in enumerate(self.schedule[:end])
            if instant.epoch and 0.0 < instant.time <= latest
        ]
        schema = self.filter_schema
        width = len(self.outputs) + (0 if schema is None else schema.width)
        most = max(FEWEST_EPOCHS, MOST_NUMBERS // width) - 1
        places = np.unique(np.linspace(len(possible) - 1, 0, min(most, len(possible))).round().astype(int))
        chosen = {possible[place] for place in places.tolist()} | self._around_faults(possible[-1] if possible else 0)
        return (*sorted(chosen), end)

    def _around_faults(self, last: int) -> set[int]:
        """Return the instants of measurements before faults and of the last ones during them, up to the last epoch."""
        times = around_faults(self._gates, self.maps.sensors, self.schedule)
        return {
            number for number, instant in enumerate(self.schedule[: last + 1]) if instant.time in times and instant.time
        }

    @cached_property
    def readings(self) -> LinearSystem:
        """The linear system at the epochs."""
        system = self._read_out(self.linear_loop.at_instants(self._chosen))
        check_finite(system, tuple(output.name for output in self.outputs))
        return system

    def _read_out(self, readings: Sequence[Reading], own: bool = False, together: bool = False) -> LinearSystem:
        """Read the linear system out, also with what the navigator states, or with all processes together."""
        with np.errstate(all="ignore"):
            system = replace(self.linear_loop.read(readings, not (together or self._together)), label=LABEL)
        schema = self.filter_schema
        if not own or schema is None:
            return system
        return replace(system, own=self._stated(readings), own_outputs=schema.known, believed=self.believed)

    @property
    def reading_times(self) -> Array:
        """The epochs, s."""
        end = self.linearization.end_time if self.maps.ends else self.schedule[-1].time
        return np.array([*(self.schedule[number].time for number in self._chosen[:-1]), end])

    @property
    def epochs(self) -> Epochs:
        """The epochs, with corrections as events."""
        events = {
            self.maps.impulses[number].declared.name: instant.time
            for instant in self.schedule
            for number in instant.corrections
        }
        events |= {name: time for name, time in self.linearization.event_times.items() if name != "end"}
        return Epochs(LABEL, self.reading_times, events)

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Return the linear system at the end, or at rising times, s, before and after updates."""
        if times is not None:
            return self._read_out(self._readings_at(times), own=True)
        system = self.linear_over_time()
        return system.at(np.arange(len(system.times)) == len(system.times) - 1)

    def _readings_at(self, times: Array) -> list[Reading]:
        """Return the readings at times; with the epochs, those around corrections as well."""
        if np.array_equal(times, self.reading_times):
            return self.linear_loop.around(self._chosen, moments=self._lag is None)
        return self._linearized(lambda: self.linear_loop.at_times(times.tolist()))

    def smoothed(self, times: Array | None = None) -> LinearSystem:
        """Linearize the errors behind the smoother, at the readings of `linear`; `own` is what it claims."""
        schema = self.filter_schema
        assert schema is not None
        assert self._lag is not None
        readings = self.linear_loop.at_instants(self._chosen) if times is None else self._readings_at(times)
        system, claimed = self.linear_loop.smooth(readings, self._lag)
        own = self._of_outputs(claimed)
        return replace(system, label=LABEL, own=own, own_outputs=schema.known, believed=self.believed)

    @property
    def gate_question(self) -> GateQuestion:
        """Question that is asked of the sensors' gates."""
        return self._gates.question

    def gate_laws(self, mean: Array, covariance: Array) -> tuple[GateLaw, ...]:
        """Compute the laws of the sensors' gates; none without any."""
        return gate_laws(self._gated(mean, covariance), self.gate_question.ramp)

    def fault_laws(self, mean: Array, covariance: Array) -> tuple[FaultLaw, ...]:
        """Compute the laws of the sensors' faults; none without any."""
        return fault_laws(self._gated(mean, covariance))

    def rejection_laws(self, mean: Array, covariance: Array, times: Array) -> RejectionLaws | None:
        """Compute the laws of good measurements that gates reject, with errors at epochs; none without any."""
        numbers = np.array(self._chosen)[np.searchsorted(self.reading_times, times)]
        return rejection_laws(self._gated(mean, covariance), times, self.linear_loop.loop.after[numbers])

    def _gated(self, mean: Array, covariance: Array) -> GatedFilter:
        return gated_filter(self.linear_loop, self._gates, mean, covariance)

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Return the linear system at all epochs, or at so many, evenly chosen."""
        last = len(self._chosen) - 1
        chosen = np.linspace(0, last, min(count or last + 1, last + 1)).round().astype(int)
        return self.readings.at(np.isin(np.arange(last + 1), chosen))

    def _stated(self, readings: Sequence[Reading]) -> Array:
        """Return the covariance of the outputs that the navigator states, shape (r, outputs, outputs)."""
        if self.maps.covariance is None:
            return self._of_outputs(self.linear_loop.own(readings))
        return self._of_outputs(np.array([self._stated_by_user(reading) for reading in readings]))

    def _of_outputs(self, covariances: Array) -> Array:
        """Return covariances of the outputs, NaN of those that a filter does not estimate, from those of its states."""
        schema = self.filter_schema
        assert schema is not None
        known, whole = np.array(schema.known), np.full((len(covariances), schema.outputs, schema.outputs), np.nan)
        whole[:, known[:, None], known] = covariances[:, : len(known), : len(known)]
        return whole

    def _stated_by_user(self, reading: Reading) -> Array:
        """Return the covariance that the user's class states; NaN before updates, after which it holds."""
        own = stated_covariance(self.maps, reading.x[:, None], np.array([reading.time]))[:, :, 0]
        return own if reading.label != "before" else np.full_like(own, np.nan)

    @cached_property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record of the filter; none without one."""
        return None if self.judged is None else schema_of(self.maps, self.judged, len(self.outputs))

    def filter_prediction(self) -> FilterPrediction | None:
        """Return the covariance that the filter states along the nominal; none without a filter."""
        if self.filter_schema is None:
            return None
        times, count = self.reading_times, len(self._chosen)
        own = self._stated(self.linear_loop.at_instants(self._chosen))
        return FilterPrediction(
            LABEL, times, own, np.zeros((count, 0)), np.zeros((count, 0, len(self.sources))),
            {process.name: np.zeros((count, 0)) for process in self.processes}, self.believed,
        )  # fmt: skip

    @property
    def believed(self) -> dict[str, float]:
        """Shares of variance that the filter believes in; zero of what it neglects."""
        return {} if self.states is None else believed_shares(self.maps, self.states, self.sizes)

    @property
    def accuracy(self) -> str:
        """Describe how samples are simulated and linearized."""
        length = max(instant.length for instant in self.schedule)
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

        With derivatives of other sizes no samples are tried.

        Raises `ScenarioError` when samples depend on more than their errors and noise.
        """
        self.plan  # noqa: B018  its failure is told first
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}

        def begin() -> Setup:
            return set_up(self._instance, self.spec.name, self.sizes, self.plan, instants, None)

        setup = self._linearized(begin, TRYING)
        tried = None if self._shared is not None else self._tried(setup)

        def say() -> tuple[str, ...]:
            remarks = remarks_on(setup, self._sigmas_of_times)
            if tried is not None:
                remarks += tried.step_error(setup.maps.structure)
            return (*remarks, *self._departures(setup, tried))

        return self._linearized(say, TRYING)

    def _tried(self, setup: Setup) -> Tried:
        """Try a few samples, or read what an earlier command has found of them."""

        def simulate() -> Tried:
            return self._linearized(lambda: try_samples(setup), TRYING)

        if self._begun is not None:
            return simulate()
        return Tried(*self._kept.keep(("tried",), lambda: KeptNumbers(simulate().arrays)))

    @cached_property
    def _kept(self) -> KeptLoop:
        identity = identity_of(self.linearization, self.sizes, self._gates)
        return KeptLoop(self._object, self.spec, identity)

    def keeping(self, engine: Engine, seconds: float) -> Engine:
        """Return an engine of the scenario whose simulations are kept; `TooLong` where others take more seconds."""
        if self._begun is not None or self._shared is not None:
            return engine
        return KeptLoopEngine.of(engine, self._kept, seconds)

    def _departures(self, setup: Setup, tried: Tried | None) -> tuple[str, ...]:
        """Say what linear analysis says of the loop itself, and how a few samples, if any, depart from it."""
        names = tuple(output.name for output in self.outputs)
        start = self.sizes.true.start
        said = [*growth_of(self.readings, names, start), *singular_corrections(setup, self.readings, names)]
        if tried is None:
            return tuple(said)
        sigma = sigmas_of(self.readings, start)[-1]
        return tuple(said or departures_from_twins(setup, tried, sigma))

    @cached_property
    def _sigmas_of_times(self) -> dict[str, float]:
        """Linear sigmas of the times of events by trigger, s, by name."""
        if not self.maps.events:
            return {}
        end = self._read_out(self.linear_loop.at_instants((self.linearization.end,)), together=True)
        sigmas, names = sigmas_of(end, self.sizes.true.start)[-1], [output.name for output in self.outputs]
        places = [names.index(quantity.name) for quantity in self.maps.structure.clock.quantities]
        return {event.name: float(sigmas[place]) for event, place in zip(self.maps.events, places, strict=True)}

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine.

        Raises `ScenarioError` when the nominal flight fails, or samples depend on more than their errors and noise.
        """
        if self._shared is not None:
            return self.with_sizes(self.sizes).engine(engine, probes)
        if self._begun is None:
            self.remarks  # noqa: B018  fails where samples are not repeatable
        schema, epochs = self.filter_schema if self._begun is None else None, self.epochs
        width = len(self.outputs) + (0 if schema is None else schema.width)
        chunk = int(np.clip(CHUNK_NUMBERS // (width * len(epochs.times)), 32, MOST_SAMPLES))
        instants = {number: epoch for epoch, number in enumerate(self._chosen)}
        return ClosedLoopEngine(
            self.spec.pinned(self._object), self.sizes, self.plan, instants, len(self.outputs), chunk, self.accuracy,
            epochs, self.noisy, schema, self._gates,
        )  # fmt: skip

    def check_start_axes(self, axes: str) -> None:
        """Refuse axes of another instant, and loops whose navigator has no other start."""
        if axes != "start":
            raise ScenarioError("axes", f"got {axes!r}; a closed loop has axes of its own: leave it out")
        check_starts(self.maps)

    @cached_property
    def _starts(self) -> Starts:
        return self._linearized(lambda: plan_starts(self.linear_loop.loop, self._start, self.schedule))

    def start_times(self, count: int) -> Array:
        """Choose evenly spaced instants of the loop up to the first event by trigger, and those of corrections, s."""
        times = self._starts.times
        wanted = np.linspace(times[0], times[-1], min(count, MOST_STARTS))
        corrections = [instant.time for instant in self.schedule if instant.corrections and instant.time <= times[-1]]
        return times[self._starts.nearest(np.concatenate([wanted, corrections]))]

    def started_at(self, time: float, axes: str) -> ClosedLoopScenario:
        """Start the navigator at an instant of the loop, s; see `mcnav.systems.closed_loop.start_times`."""
        self.check_start_axes(axes)
        number = self._start_at(time)
        return self._linearized(
            lambda: type(self)(
                self.spec, self.sizes, self._starts.begun(self._starts.numbers[number]), gates=self._gates
            )
        )

    def _start_at(self, time: float) -> int:
        """Return the place of a start among all; `ScenarioError` where the navigator cannot start at a time."""
        times = self._starts.times
        (number,) = self._starts.nearest(np.array([time]))
        if abs(times[number] - time) > ROUNDING * self.linearization.end_time:
            message = (
                f"got {time:g} s; the navigator starts at instants of the loop, the nearest is {times[number]:g} s"
            )
            raise ScenarioError("start", message)
        return number

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives at the end for a navigator started at each time, (n, outputs, sources)."""
        return self._started_ends(times).partials

    def noise_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the covariance by noise at the end for a navigator started at each time, (n, outputs, outputs)."""
        none = np.zeros((len(times), len(self.outputs), len(self.outputs)))
        return np.asarray(sum(self._started_ends(times).processes.values(), none))

    def _started_ends(self, times: Array) -> LinearSystem:
        """Read out at the end for a navigator started at each time; the last times are kept."""
        key = tuple(times.tolist())
        if self._ends is None or self._ends[0] != key:
            starts = self._starts
            numbers = [starts.numbers[self._start_at(time)] for time in key]
            self._ends = key, starts.read_ends(numbers)
        return self._ends[1]

    def nominal(self) -> History:
        """Return the nominal truth and commands at all instants."""
        planned = self.linearization.instants
        x = np.array([self._start, *(step.nominal for step in planned)])
        x = np.where(np.abs(x).max(axis=0) > ROUNDING * self.linearization.steps, x, 0.0)
        times = np.array([0.0, *(step.instant.time for step in planned[:-1]), self.linearization.end_time])
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


def _same_maps(one: ClosedLoopScenario, other: ClosedLoopScenario, near: bool) -> bool:
    """Return whether two scenarios have the same maps along the same nominal, and, if asked, sizes of one order."""
    linear = other.linearization
    pairs = zip((one.sizes.true, one.sizes.believed), (other.sizes.true, other.sizes.believed), strict=True)
    if not all(np.array_equal(here.decay, there.decay) for here, there in pairs):
        return False
    if one.states is not None and not linear.settled:
        return False
    if not near:
        return True
    ratios = difference_steps(one.maps, one._start, one.sizes.true) / linear.steps
    return bool(np.all((ratios > 1.0 / RETUNED) & (ratios < RETUNED)))


def without_errors(spec: UserScenarioSpec) -> LoopSizes:
    """Return the sizes of a loop without errors."""
    loop = spec.build_current().value
    none = _read_loop(spec, lambda: Sizes.none(maps_of(with_navigator(loop), spec.name)))
    return LoopSizes(none, replace(none))


def _read_loop(spec: UserScenarioSpec, read: Callable[[], Read]) -> Read:
    """Read what a user's loop declares; `ScenarioError` when its code fails."""
    return spec.ask(f"while {spec.name} was read", spec.name, read)
