"""Engines of an aided navigation, and what linear analysis says of it and of its filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.execution.child_processes import side_threads
from mcnav.linear.engine.propagate import Propagated
from mcnav.linear.engine.starts import start_times
from mcnav.systems.ins.ensemble.adjoint import Adjoint, adjoint_of_closed
from mcnav.systems.ins.ensemble.aided import (
    AidedErrors,
    AidedTables,
    GivenNoise,
    simulate_aided,
    tabulate_aided,
)
from mcnav.systems.ins.ensemble.conditional import ConditionalSamples, Measured, NoiseSystem
from mcnav.systems.ins.ensemble.filters import BEYOND, INDEFINITE, SOUND
from mcnav.systems.ins.ensemble.free import tabulate
from mcnav.systems.ins.ensemble.smoothed import GROUPS, SmootherTables, smooth_samples
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.imu.gravity import cause_of
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, process_sizes
from mcnav.systems.ins.imu.linear_noise import respond_from_rest
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from mcnav.systems.ins.kept import keep_of, settle
from mcnav.systems.ins.linear.aided_errors import (
    ClosedLoopErrors,
    SmoothedErrors,
    propagate_closed_loop,
    smooth_closed_loop,
    stated_covariances,
)
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, close_loop
from mcnav.systems.ins.linear.covariance import biased_processes
from mcnav.systems.ins.linear.response_blocks import Responses, recent_responses
from mcnav.systems.ins.reference.mechanization import Diverged, longest_step
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants, aiding_processes
from mcnav.systems.ins.truth.trajectory import Platform, Truth
from mcnav.systems.sample_loop import simulate_each

if TYPE_CHECKING:
    from mcnav.systems.ins.reference.aided import AidedMechanization

OWN_CHUNK: Final = 64
REFERENCE_CHUNK: Final = 8
SHARED_CHUNK: Final = 256
SMOOTHED_CHUNK: Final = 128

MOST_STEPS: Final = 60_000
"""Steps of the grid when it is halved."""

MOST_FLOWN: Final = 100_000
"""Steps of the grid of samples, whose tables take some 20 kB a step. Linear analysis computes its own in blocks."""

QUICKLY_FLOWN: Final = 20_000
"""Steps up to which flights examine linear analysis unasked: memory would grow by more than a quarter of a gigabyte."""

PROBES: Final = 8
"""Samples on which the steps are settled."""

TOLERANCE: Final = 3e-5
"""Largest numerical error of any probe at any epoch, as a share of the filter's sigma or of the probes' errors."""

LARGEST_DIVISION: Final = 16

WORDS: Final = {
    BEYOND: "errors too large for the ensemble engine; the reference engine takes them",
    INDEFINITE: "the filter's covariance lost its definiteness",
}


@dataclass(frozen=True)
class AidedNavigation:
    """An aided navigation along a trajectory.

    Attributes
    ----------
    start : float
        s, in the trajectory's time.
    epochs : Epochs
        In minutes of navigation.
    times : ndarray, shape (m,)
        Epochs in the trajectory's time, the start first, s.
    together : bool
        Whether processes are propagated all together, not each by itself.
    """

    truth: Truth
    platform: Platform
    start: float
    imu: Imu
    sensors: tuple[Sensor, ...]
    filter: FilterModel
    epochs: Epochs
    times: Array
    together: bool = False

    def grid(self, division: int, times: Array | None = None) -> Array:
        """Return the times of epochs, or of others, and of updates, each step between them divided."""
        updates = [sensor.times for sensor in self.sensors]
        knots = np.unique(np.concatenate([self.times if times is None else times, *updates]))
        apart = np.concatenate([[True], np.diff(knots) > 1e-9])
        knots = knots[apart]
        parts = np.arange(division) / division
        inner = knots[:-1, None] + parts * np.diff(knots)[:, None]
        return np.append(inner.ravel(), knots[-1])

    @property
    def steps(self) -> int:
        """Steps of the coarsest grid."""
        return len(self.loop.times) - 1

    @property
    def can_be_flown(self) -> bool:
        """True where there is room for the tables of samples."""
        return self.steps <= MOST_FLOWN

    @property
    def too_long(self) -> str:
        """Clause that says why flights do not examine linear analysis unasked; empty where they may."""
        return f"flights with {self.steps:,} steps take much memory" if self.steps > QUICKLY_FLOWN else ""

    def check_steps(self) -> None:
        """Refuse samples with more updates and epochs than there is room for, with `ScenarioError`."""
        if not self.can_be_flown:
            raise ScenarioError(
                "aiding",
                f"got {self.steps:,} instants of updates and epochs; samples take at most {MOST_FLOWN:,}. "
                "mcnav lincov takes them all",
            )

    @cached_property
    def loop(self) -> ClosedLoop:
        """The closed loop on the coarsest grid."""
        return close_loop(
            self.truth, self.platform, self.grid(1), self.imu, self.sensors, self.filter, recent_responses
        )

    def _close(self, division: int) -> ClosedLoop:
        """Return the closed loop on a finer grid, of which samples take tables of their own once."""
        once, known = partial(Responses, kept=0), self.loop.schedule
        grid = self.grid(division)
        return close_loop(self.truth, self.platform, grid, self.imu, self.sensors, self.filter, once, known)

    def places(self, loop: ClosedLoop) -> IndexArray:
        """Return the numbers of the epochs in a loop's grid."""
        return np.asarray(np.searchsorted(loop.times, self.times - 1e-9), dtype=np.int64)

    @cached_property
    def linear(self) -> ClosedLoopErrors:
        """The linear closed loop at the epochs, after the updates."""

        def compute() -> dict[str, object]:
            places = self.places(self.loop)
            return vars(propagate_closed_loop(self.loop, places, np.ones(len(places))))

        return ClosedLoopErrors(**keep_of(self, "linear", (), compute))

    def read_out(
        self, times: Array | None = None
    ) -> tuple[tuple[Literal["before", "after"] | None, ...], ClosedLoopErrors]:
        """Propagate the linear closed loop and read it out at the epochs or at other rising times.

        There are two readings where an update falls on a time.
        """
        updates, loop, readings, after = self._readings(times)
        errors = keep_of(
            self, "linear", times, lambda: vars(propagate_closed_loop(loop, readings, after, not self.together))
        )
        return updates, ClosedLoopErrors(**errors)

    def smoothed(
        self, times: Array | None = None
    ) -> tuple[tuple[Literal["before", "after"] | None, ...], SmoothedErrors]:
        """Compute what is left of the errors behind the smoother, at the readings of `read_out`."""
        updates, loop, readings, after = self._readings(times)
        return updates, smooth_closed_loop(loop, readings, after, self._lag)

    @cached_property
    def smoothed_at_epochs(self) -> SmoothedErrors:
        """Errors left behind the smoother at the epochs, after the updates."""
        places = self.places(self.loop)
        return smooth_closed_loop(self.loop, places, np.ones(len(places)), self._lag)

    @property
    def _lag(self) -> float:
        return np.inf if self.filter.lag is None else self.filter.lag

    def smoother_tables(self, tables: AidedTables) -> SmootherTables:
        """Prepare the tables of the samples' smoother."""
        return SmootherTables.of(tables, self._lag, self.smoothed_at_epochs.own)

    def _readings(
        self, times: Array | None
    ) -> tuple[tuple[Literal["before", "after"] | None, ...], ClosedLoop, IndexArray, Array]:
        """Return updates at readings, the closed loop, numbers of their times, and which are after updates."""
        if times is None:
            loop, times = self.loop, self.times
        else:
            grid = self.grid(1, np.concatenate([[self.start], times]))
            loop = close_loop(self.truth, self.platform, grid, self.imu, self.sensors, self.filter)
        readings: list[int] = []
        updates: list[Literal["before", "after"] | None] = []
        for place in np.searchsorted(loop.times, times - 1e-9).tolist():
            updated = loop.first_updates[place] < loop.first_updates[place + 1]
            readings += [place, place] if updated else [place]
            updates += ["before", "after"] if updated else [None]
        after = np.array([update == "after" for update in updates])
        return tuple(updates), loop, np.array(readings), after

    def started(self, starts: Array, end: float) -> Propagated:
        """Compute the linear system at the end for navigation from each start, s, with a filter that starts there."""
        first = float(starts.min())
        later = replace(
            self, sensors=tuple(sensor.since(first) for sensor in self.sensors), filter=self.filter.since(first)
        )
        grid = later.grid(1, np.append(np.unique(starts), end))
        loop = close_loop(self.truth, self.platform, grid, self.imu, later.sensors, later.filter, recent_responses)
        numbers = np.searchsorted(grid, starts - 1e-9)
        positions, timeline = loop.positions(numbers, np.ones(len(numbers))), loop.timeline
        return start_times(timeline, timeline.end, timeline.readout(timeline.end, end), positions)

    def tables(self, division: int) -> AidedTables:
        """Prepare the tables of the ensemble."""
        loop = self.loop if division == 1 else self._close(division)
        shared = tabulate(self.truth, self.platform, loop.responses, self.imu, self.places(loop))
        return tabulate_aided(loop, shared, biased_processes(loop.responses.between(0, 1), self.imu))

    def refined(self, probes: Array) -> tuple[AidedTables, float]:
        """Divide the steps until probes without noise, shape (n, sources), agree; return the tables and the error.

        Without a probe the coarsest steps are taken, and no error is known.
        """
        probes = probes[:PROBES]
        if not len(probes):
            return self.tables(1), float("nan")
        return settle(self, probes, lambda: self._search(probes), self.tables)

    def _search(self, probes: Array) -> tuple[int, AidedTables, float]:
        """Return the division of the steps with which probes agree, its tables, and the error.

        The tables of half the coarsest steps are computed in a thread beside what needs those of the coarsest ones.
        """
        division, most = 1, MOST_STEPS // 2
        with side_threads(1) as beside:
            halved = beside.submit(self.tables, 2) if len(self.loop.times) - 1 <= most else None
            tables = self.tables(1)
            coarse = self._without_noise(tables, probes)
            if halved is None:
                return 1, tables, float("nan")
            sigma = self._own_sigma
            finer = halved.result()
        while True:
            fine = self._without_noise(finer, probes)
            # the filter's sigma, or the errors themselves where it is optimistic
            scale = np.maximum(sigma, np.abs(fine).max(axis=0))
            sizes = np.where(scale > 0.0, scale, 1.0)
            error = float((np.abs(coarse - fine) / sizes).max(initial=0.0)) / 3.0  # of the finer one
            if 4.0 * error <= TOLERANCE:
                return division, tables, 4.0 * error
            if error <= TOLERANCE or 2 * division >= LARGEST_DIVISION:
                return 2 * division, finer, error
            division, tables, coarse = 2 * division, finer, fine
            if len(tables.loop.times) - 1 > most:
                return division, tables, float("nan")
            finer = self.tables(2 * division)

    @cached_property
    def _own_sigma(self) -> Array:
        """The filter's sigmas at the epochs, shape (m, 9); variances of errors that it believes absent are rounded."""
        places = self.places(self.loop)
        own = stated_covariances(self.loop, places, np.ones(len(places)))
        return np.asarray(np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2), 0.0)))

    def _without_noise(self, tables: AidedTables, probes: Array) -> Array:
        values, outcomes = self.propagate(tables, probes, False)
        return np.asarray(np.where((outcomes == SOUND)[:, None, None], values, 0.0))

    def difference_of_gains(self, tables: AidedTables, probes: Array) -> float:
        """Compute the largest difference between shared gains and gains of each sample's own, in the filter's sigmas.

        Of probe samples, shape (n, sources), with noise, at all epochs after the start.
        """
        index = np.arange(min(len(probes), PROBES))
        own, shared = (simulate_aided(tables, probes[:PROBES], 0, index, apart) for apart in (True, False))
        good = (own.outcome == SOUND) & (shared.outcome == SOUND)
        sigma = self._own_sigma[1:]
        apart = np.abs(own.values - shared.values)[good, 1:]
        return float((apart / np.where(sigma > 0.0, sigma, np.inf)).max(initial=0.0))

    def propagate(self, tables: AidedTables, errors: Array, own: bool) -> tuple[Array, IndexArray]:
        """Simulate samples without noise, shape (n, sources): errors at the epochs, (n, m, 9), and outcomes."""
        values, outcomes = np.empty((len(errors), len(self.times), len(OUTPUTS))), np.empty(len(errors), dtype=np.int64)
        for begin in range(0, len(errors), OWN_CHUNK):
            piece = errors[begin : begin + OWN_CHUNK]
            aided = simulate_aided(tables, piece, 0, np.arange(len(piece)), own, GivenNoise())
            values[begin : begin + len(piece)], outcomes[begin : begin + len(piece)] = aided.values, aided.outcome
        return values, outcomes


def filter_schema(
    sensors: tuple[Sensor, ...], model: FilterModel, units: Mapping[str, tuple[str, str]]
) -> FilterSchema:
    """Return the columns of a filter's records.

    Parameters
    ----------
    units : mapping of str to (str, str)
        Of constant sources and processes: SI unit, and unit shown.
    """
    states = model.states
    estimated = sum(not state.considered for state in states)
    groups = {"all": NAVIGATION + estimated, "navigation": NAVIGATION, "position": 3, "velocity": 3, "attitude": 3}
    if estimated:
        groups["sensors"] = estimated
    names = tuple(state.name for state in states)
    sizes = {sensor.name: len(sensor.components) for sensor in sensors}
    shown = tuple(units[name] for name in names)
    return FilterSchema(groups, len(OUTPUTS), names, shown, sizes, model.considers)


def believed_shares(
    imu: Imu, sensors: tuple[Sensor, ...], model: FilterModel, sigmas: Mapping[str, float]
) -> dict[str, float]:
    """Return the variance that a filter believes of each cause over its true mean square; zero for what it neglects.

    Parameters
    ----------
    sigmas : mapping of str to float
        True root mean squares of the constant sources.
    """
    beliefs, states = model.beliefs, {cause_of(state.name): state for state in model.states}
    shares: dict[str, float] = {}
    for name in (*CONSTANTS, *aiding_constants(sensors)):
        true = sigmas.get(name, 0.0)
        known = name in OUTPUTS or name in states
        if true > 0.0:
            shares[name] = (beliefs.sigmas.get(name, 0.0) / true) ** 2 if known else 0.0
    believed = process_sizes(beliefs.imu) | aiding_processes(beliefs.sensors)
    for name, true in (process_sizes(imu) | aiding_processes(sensors)).items():
        white = name.rpartition("_")[0].endswith(("angle_random_walk", "velocity_random_walk", "noise"))
        walks = "rate_random_walk" in name and name.replace("_rate_random_walk_", "_bias_") in states
        known = white or walks or name in states or name.endswith("_noise")
        shares[name] = (believed.get(name, 0.0) / true) ** 2 if known else 0.0
    return shares


def smoother_schema() -> FilterSchema:
    """Return the columns of a smoother's records."""
    return FilterSchema({name: len(range(len(OUTPUTS))[group]) for name, group in GROUPS.items()}, len(OUTPUTS))


@dataclass(frozen=True)
class AidedReferenceEngine:
    """The navigator's own equations at the instruments' rate, with filterpy's filter: one sample at a time."""

    navigation: AidedNavigation
    filter: FilterSchema
    accuracy: str = (
        "mechanization in earth-fixed axes, Gauss collocation of order 6 with steps of at most 0.1 s. Its filter: "
        "earth-fixed axes, steps of at most 0.2 s"
    )
    parallel: str = "processes"  # Python holds the interpreter's lock
    chunk: int = REFERENCE_CHUNK
    noisy: bool = True

    @property
    def epochs(self) -> Epochs:
        """Instants of the histories."""
        return self.navigation.epochs

    @cached_property
    def mechanization(self) -> AidedMechanization:
        """The navigator."""
        from mcnav.systems.ins.reference.aided import AidedMechanization  # which no other engine needs

        navigation = self.navigation
        end = float(navigation.times[-1])
        return AidedMechanization(
            navigation.truth, navigation.platform, navigation.start, end, navigation.times, navigation.sensors,
            navigation.filter, longest_step(navigation.imu),
        )  # fmt: skip

    @cached_property
    def _tables(self) -> AidedTables:
        return self.navigation.tables(1)

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without; the linear ones by the closed loop along the truth."""
        if not noise:
            return self._without_noise(batch.errors)
        count, epochs = len(batch.errors), len(self.navigation.times)
        histories, linear = np.full((count, epochs, len(OUTPUTS)), np.nan), np.full((count, len(OUTPUTS)), np.nan)
        records = np.full((count, epochs, self.filter.width), np.nan)

        def simulate(row: int) -> Array:
            drawn = self.mechanization.draw(self.navigation.imu, batch.seed, int(batch.index[row]))
            linear[row] = self.linear(batch.errors[row], drawn)
            histories[row], records[row] = self.mechanization.simulate(batch.errors[row], drawn)
            return np.asarray(histories[row, -1])

        values = np.empty((count, len(OUTPUTS)))
        failures = simulate_each(simulate, range(count), values, Diverged)
        return SimulationResult(values, failures, linear_values=linear, history=histories, filter_values=records)

    def linear(self, errors: Array, noise: SampleNoise) -> Array:
        """Simulate one sample by the linear closed loop with given noise: errors at the last epoch, shape (9,)."""
        return np.asarray(
            simulate_aided(self._tables, errors[None], 0, np.zeros(1, int), False, self.given(noise)).linear[0]
        )

    def given(self, noise: SampleNoise) -> GivenNoise:
        """Arrange the noise of one sample for the ensemble's steps and updates."""
        navigation, tables = self.navigation, self._tables
        steps, width = tables.ensemble.factors.shape[:2]
        added = np.zeros((1, steps, width))
        added[0, :, :NAVIGATION] = respond_from_rest(
            navigation.truth, navigation.platform, self.mechanization.step_times, tables.loop.times, noise.gyro,
            noise.accelerometer,
        )  # fmt: skip
        measured, swings = np.zeros((1, *tables.white.shape)), tables.loop.measurements.swings
        jitters = np.zeros((1, len(measured[0])))
        for number, sensor in enumerate(navigation.sensors):
            rows = np.flatnonzero(tables.loop.measurements.sensors == number)
            if sensor.name in noise.measurements:
                measured[0, rows, : len(sensor.components)] = noise.measurements[sensor.name]
            if swings.size and noise.drifts is not None:
                # what a drift of the gyros adds to the antenna's velocity acts as an error of the measurement
                drifts = noise.drifts[self.mechanization.updated(number)]
                measured[0, rows] -= np.einsum("umj,uj->um", swings[rows, :, :3], drifts)
            if sensor.name in noise.jitters:
                jitters[0, rows] = noise.jitters[sensor.name]
        return GivenNoise(added, measured, jitters)

    def _without_noise(self, errors: Array) -> SimulationResult:
        values = np.empty((len(errors), len(OUTPUTS)))
        rows = range(len(errors))
        failures = simulate_each(lambda row: self.mechanization.simulate(errors[row])[0][-1], rows, values, Diverged)
        return SimulationResult(values, failures)


@dataclass(frozen=True)
class AidedEngine:
    """Deviations over shared tables, with a filter in the loop: of each sample's own gains, or of shared ones."""

    navigation: AidedNavigation
    tables: AidedTables
    filter: FilterSchema
    own: bool
    accuracy: str
    parallel: str = "threads"
    noisy: bool = True
    smoothing: SmootherTables | None = None

    @property
    def chunk(self) -> int:
        """Samples per chunk; fewer behind a smoother, since the innovations of each are kept."""
        if self.smoothing is not None:
            return SMOOTHED_CHUNK
        return OWN_CHUNK if self.own else SHARED_CHUNK

    @property
    def smoother(self) -> FilterSchema | None:
        """Columns of the smoother's records."""
        return None if self.smoothing is None else smoother_schema()

    @property
    def epochs(self) -> Epochs:
        """Instants of the histories."""
        return self.navigation.epochs

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without."""
        if not noise:
            return self._without_noise(batch.errors)
        smoothing = self.smoothing
        aided = simulate_aided(
            self.tables, batch.errors, batch.seed, batch.index, self.own, smoothed=smoothing is not None
        )
        result = self._result(aided)
        if smoothing is None:
            return result
        smoothed = smooth_samples(smoothing, aided)
        smoothed.values[aided.outcome != SOUND] = np.nan
        return replace(result, smoothed_history=smoothed.values, smoother_values=smoothed.records)

    @cached_property
    def noise(self) -> NoiseSystem:
        """The noise of samples as a linear system."""
        return NoiseSystem(self.tables.ensemble, self.tables.adjoint, Measured.of(self.tables))

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalSamples:
        """Return the samples with conditions on what noise adds to some outputs."""
        return ConditionalSamples.of(self.noise, outputs, epochs, self._adjoint_at, self.chunk, self._simulate_given)

    def _adjoint_at(self, epoch: int) -> Adjoint:
        shared = self.tables.ensemble
        gains = self.tables.shared.gains
        return adjoint_of_closed(self.tables.loop, gains, int(shared.epochs[epoch]), shared.output_maps[epoch])

    def _simulate_given(self, batch: Batch, noise: GivenNoise) -> SimulationResult:
        return self._result(simulate_aided(self.tables, batch.errors, batch.seed, batch.index, self.own, noise))

    def _without_noise(self, errors: Array) -> SimulationResult:
        values, outcomes = self.navigation.propagate(self.tables, errors, self.own)
        return SimulationResult(np.where((outcomes == SOUND)[:, None], values[:, -1], np.nan), _failures(outcomes))

    def _result(self, errors: AidedErrors) -> SimulationResult:
        values = errors.values
        values[errors.outcome != SOUND] = np.nan
        return SimulationResult(
            values[:, -1],
            _failures(errors.outcome),
            linear_values=errors.linear,
            history=values,
            filter_values=errors.records,
        )


def _failures(outcomes: IndexArray) -> dict[int, Failure]:
    return {int(row): Failure(Reason.STATED, WORDS[int(outcomes[row])]) for row in np.flatnonzero(outcomes != SOUND)}
