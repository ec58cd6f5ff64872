"""Many samples of an aided navigator, each with its own filter, and the linear closed loop of the same draws.

A sample is a deviation from the shared truth (`mcnav.systems.ins.ensemble.free`). Its twin in the linear closed loop
has the gains along the truth and the same noise; the twin's errors are a sum (`mcnav.systems.ins.ensemble.adjoint`).
What a filter has estimated is subtracted from the errors of the instruments; of a constant that a state models exactly,
only the difference is propagated. The filter's covariance is propagated with the step's tables turned to the sample's
own indicated attitude and force; its gains are its own, or with shared gains those along the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import ENTRIES, THREE, blocks_of, count_threes
from mcnav.compiled.jit import allocation_free_loop, allocation_free_subroutine, inlined
from mcnav.compiled.shapes import check_shapes
from mcnav.compiled.vectors import LANES, STORED, Store, load, parts_of, room, store
from mcnav.sampler.normals import draw_normals
from mcnav.systems.ins.ensemble.adjoint import Adjoint, add_linear, adjoint_of_closed
from mcnav.systems.ins.ensemble.deviations import deviate
from mcnav.systems.ins.ensemble.estimate_steps import EstimateSteps, subtract_estimates
from mcnav.systems.ins.ensemble.filters import (
    BEYOND,
    SOUND,
    Covariances,
    FilterSteps,
    begin_covariances,
    covariances_in_lanes,
    covariances_of,
    factor_innovations,
    filter_steps,
    filter_updates,
    project_along_samples,
    project_along_truth,
    update_covariances,
)
from mcnav.systems.ins.ensemble.flexures import SensorFlexure, draw_flexures, sensor_flexures
from mcnav.systems.ins.ensemble.free import EnsembleTables
from mcnav.systems.ins.ensemble.gains import SharedGains
from mcnav.systems.ins.ensemble.innovations import places_of
from mcnav.systems.ins.ensemble.kind_updates import UPDATE, KindRooms, kind_rooms, number_of
from mcnav.systems.ins.ensemble.lateness import delay_tables, draw_jitters, late_errors
from mcnav.systems.ins.ensemble.normalization import share_covariances
from mcnav.systems.ins.ensemble.offsets import offset_tables
from mcnav.systems.ins.ensemble.propagation import propagate_covariances
from mcnav.systems.ins.ensemble.records import (
    EpochTables,
    ReadingRooms,
    Readings,
    change_correlated_errors,
    keep_innovation,
    read,
    reading_rooms,
    width_of_record,
)
from mcnav.systems.ins.ensemble.sample_groups import STEPS_OF_BLOCK, SampleGroups, put_aside, sample_groups, take_back
from mcnav.systems.ins.ensemble.sigma_points import POINTS, count_points, points_of
from mcnav.systems.ins.ensemble.steps import (
    SHORT,
    DeviationParts,
    Deviations,
    StepTables,
    add_given,
    advance,
    advance_short,
    deviations_of,
    parts_of_deviations,
    place,
    respond,
    start,
)
from mcnav.systems.ins.ensemble.updates import (
    Estimates,
    RateTables,
    UpdateTables,
    add_constant_errors,
    add_faults,
    add_rate_errors,
    along_truth,
    disturb,
    estimates_of,
    feed_back_own,
    feed_back_shared,
    innovate,
    judge,
    whiten_by_own,
    whiten_by_shared,
)
from mcnav.systems.ins.filter.consistency import COUNTS
from mcnav.systems.ins.filter.model import EKF, NAVIGATION, UKF
from mcnav.systems.ins.filter.tables import noise_matrices
from mcnav.systems.ins.imu.instruments import CONSTANTS, IMU_STREAM
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, ShownPairs
from mcnav.systems.ins.linear.response_blocks import BLOCK
from mcnav.systems.ins.sensors.aiding import aiding_constants, gate_limits
from mcnav.systems.ins.sensors.measurements import rate_error, white_sigmas

Made = TypeVar("Made")

MEASUREMENT_STREAM: Final = 2
"""Stream of the measurements' white noise."""

CORRELATED_STREAM: Final = 3
"""Stream of the measurements' correlated errors."""

CAREFUL: Final = 1e6
"""Variance of an innovation, as a multiple of the measurement's, from which on an update needs Joseph's form.

Without it the covariance keeps all but as many of its sixteen digits as this has.
"""

OWN_NOISE: Final = 3e-4
"""Position that noise adds to a step independently of the velocity, in sigma, below which it is left out.

It would add 1e-7 of the position's variance.
"""

EPOCH_STREAM: Final = 4
"""Stream of the correlated errors' change from the last measurement to an epoch."""


@dataclass(frozen=True)
class AidedTables:
    """All that samples of an aided navigator share.

    Attributes
    ----------
    ensemble : EnsembleTables
        On the closed loop's grid.
    bounds : ndarray of int, shape (U, M, 2)
        First and last of the navigation states that a component depends on.
    walks, drifts : ndarray of int, shape (q,)
        Numbers of the biases of processes that a state models, and of the component whose correlated error it models;
        -1 for none.
    correlated, memory : ndarray, shape (U, M)
        Standard deviation of the correlated errors, and what is left of them since the sensor's update before.
    drift_sigmas, faded : ndarray, shapes (G,), (m, G)
        Standard deviation of all components' correlated errors, and what is left of them at the epochs since the
        sensor's update or the epoch before.
    white : ndarray, shape (U, M)
        Standard deviation of the white noise.
    limits : ndarray, shape (U,)
        Largest normalized innovation squared that is accepted.
    shared : SharedGains
        Of the filter along the truth, with its covariances at the epochs.
    rate_errors : ndarray of int, shape (b,)
        Number of the gyros' constant error as which a bias of a process enters a navigator's rate, -1 for none.
    """

    loop: ClosedLoop
    ensemble: EnsembleTables
    bounds: IndexArray
    biases: IndexArray
    drifts: IndexArray
    correlated: Array
    memory: Array
    drift_sigmas: Array
    faded: Array
    white: Array
    limits: Array
    shared: SharedGains
    rate_errors: IndexArray

    @cached_property
    def estimate_steps(self) -> EstimateSteps:
        """Tables of the estimates over the steps, for compiled code."""
        model, steps, states = self.loop.filter, len(self.ensemble.durations), len(self.loop.filter.states)
        coupling, decay = np.empty((steps, NAVIGATION, states)), np.empty((steps, states))
        for first in range(0, steps, BLOCK):
            block = slice(first, min(first + BLOCK, steps))
            over, decay[block] = model.between(block.start, block.stop)
            coupling[block] = over[:, :, NAVIGATION:]
        coupled = np.any(coupling, axis=0)
        return EstimateSteps(
            coupling, decay, model.corrected, np.flatnonzero(np.any(coupled[:3], axis=0)),
            np.flatnonzero(np.any(coupled[3:], axis=0)), np.flatnonzero(np.any(decay != 1.0, axis=0)),
        )  # fmt: skip

    @cached_property
    def adjoint(self) -> Adjoint:
        """Responses of the linear errors at the last epoch, with the gains along the truth."""
        return adjoint_of_closed(
            self.loop, self.shared.gains, int(self.ensemble.epochs[-1]), self.ensemble.output_maps[-1]
        )

    @cached_property
    def delays(self) -> IndexArray:
        """Number of the constant source that is each sensor's delay, -1 for none, shape (sensors,)."""
        names = (*CONSTANTS, *aiding_constants(self.loop.sensors))
        return np.array([names.index(each.delay_name) if each.has_delay else -1 for each in self.loop.sensors])

    @cached_property
    def exact(self) -> IndexArray:
        """Numbers of the states that model constant errors of the instruments exactly."""
        return np.flatnonzero(self.loop.filter.exact)

    @cached_property
    def filter_steps(self) -> FilterSteps:
        """Tables of the filters over the steps, for compiled code."""
        return self._filter_steps(len(self.ensemble.durations))

    @cached_property
    def no_filter_steps(self) -> FilterSteps:
        """Tables over no steps, where all samples have the gains along the truth."""
        return self._filter_steps(0)

    def _filter_steps(self, count: int) -> FilterSteps:
        """Return the tables over the first steps."""
        model, shared, estimated = self.loop.filter, self.ensemble, self.estimate_steps
        threes = THREE + count_threes(len(model.constants))
        noises = np.empty((count, threes, threes, ENTRIES))
        for steps, over in model.blocks() if count else ():
            noises[steps] = blocks_of(noise_matrices(over.noise))
        of_steps = (shared.durations, shared.motion, shared.thrust, estimated.coupling, estimated.decay)
        durations, motion, thrust, coupling, decay = (table[:count] for table in of_steps)
        return filter_steps(
            durations, motion, thrust, coupling, decay, noises, model.corrected,
            self._sigmas[:, NAVIGATION:].max(axis=0), self.smallest_position,
        )  # fmt: skip

    @cached_property
    def _sigmas(self) -> Array:
        """Sigmas of the filter along the truth at the start and at the epochs, shape (m + 1, 9 + q)."""
        covariances = np.concatenate([self.loop.filter.initial[None], self.shared.covariances])
        return np.asarray(np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0)))

    @property
    def smallest_position(self) -> float:
        """Smallest sigma of a position among them."""
        return float(self._sigmas[:, NAVIGATION - 3 : NAVIGATION].min())

    @cached_property
    def _of_active(self) -> dict[tuple[str, bytes], Any]:
        """Tables made for constant errors that are not zero; those of all chunks of a campaign are the same."""
        return {}

    def _once(self, name: str, active: IndexArray, make: Callable[[IndexArray], Made]) -> Made:
        key = name, active.tobytes()
        if key not in self._of_active:
            self._of_active[key] = make(active)
        return cast(Made, self._of_active[key])

    def steps(self, active: IndexArray) -> StepTables:
        """Return what compiled code takes of the steps.

        Parameters
        ----------
        active : ndarray of int
            Numbers of the constant errors of the instruments that are not zero.
        """
        return self._once("steps", active, self._steps)

    def _steps(self, active: IndexArray) -> StepTables:
        steps = self.ensemble.steps(active, self.adjoint)
        position = np.abs(steps.factors[:, NAVIGATION - 3 :, NAVIGATION - 3 : NAVIGATION])
        if (
            position.any()
            and np.all(position < OWN_NOISE * self.smallest_position)
            and np.all(steps.durations <= SHORT)
        ):
            return steps._replace(factors=np.delete(steps.factors, np.s_[NAVIGATION - 3 : NAVIGATION], axis=2))
        return steps

    def updates(self, active: IndexArray, instruments: IndexArray) -> UpdateTables:
        """Return what compiled code takes of the updates.

        Parameters
        ----------
        active, instruments : ndarray of int
            Numbers of the constant errors of the sensors, and of the instruments, that are not zero.
        """
        swings, measured = self._once("swings", instruments, self._swings), self.loop.measurements
        return self._once("updates", active, self._updates)._replace(swings=swings, innovations=places_of(measured))

    def _swings(self, active: IndexArray) -> RateTables:
        measured, of_states = self.loop.measurements, self.loop.filter.rate_errors
        rates, gyros = measured.rates, measured.rates.shape[2]
        none = np.zeros(0, dtype=np.int64)
        drifting, estimated = (np.flatnonzero(each >= 0) if gyros else none for each in (self.rate_errors, of_states))
        errors, biases, states = (
            np.ascontiguousarray(rates[:, :, each])
            for each in (active[active < gyros], self.rate_errors[drifting], of_states[estimated])
        )
        return RateTables(
            measured.swinging, measured.swung, measured.levers, errors, biases, states, drifting, estimated
        )  # fmt: skip

    def _updates(self, active: IndexArray) -> UpdateTables:
        measured, model, roots = self.loop.measurements, self.loop.filter, self.shared.roots
        of_sensors = np.where(model.rate_errors >= 0, 0.0, model.rows)
        with np.errstate(divide="ignore", invalid="ignore"):
            known = np.diagonal(roots, axis1=1, axis2=2) ** 2 / model.variances
        careful = np.any(np.nan_to_num(known, nan=0.0) > CAREFUL, axis=1)
        lags, scales = np.zeros(len(measured.sensors), dtype=np.bool_), self._scales
        offsets, delays = offset_tables(self.loop, active), delay_tables(self.loop)
        for sensor in range(len(self.loop.sensors)):
            lags[np.flatnonzero(measured.sensors == sensor)[1:]] = True
        return UpdateTables(
            measured.sensors, measured.sizes, measured.components, measured.kinds, measured.directions,
            measured.parameters, np.ascontiguousarray(measured.constants[:, :, active]), measured.places,
            self.correlated, self.memory, self.white, self.limits, of_sensors, self.shared.gains, roots,
            self.adjoint.updates, lags, np.flatnonzero(np.any(of_sensors, axis=(0, 1))), scales,
            filter_updates(
                measured.rows, model.rows, self.bounds, model.variances, along_truth(measured) & ~delays.present,
                careful, np.concatenate([offsets.states, delays.states, scales], axis=1),
            ),
            self._swings(np.zeros(0, dtype=np.int64)), np.any(measured.faults != 0.0, axis=1), measured.faults,
            offsets, delays,
        )  # fmt: skip

    @property
    def _scales(self) -> IndexArray:
        """Number of the state that is the scale factor of each update's components, -1 for none, shape (U, M)."""
        names, measured = [state.name for state in self.loop.model.states], self.loop.measurements
        scaled = [each.error_name("scale_factor") for sensor in self.loop.sensors for each in sensor.components]
        numbers = np.array([names.index(name) if name in names else -1 for name in scaled], dtype=np.int64)
        used = np.arange(measured.components.shape[1]) < measured.sizes[:, None]
        return np.where(used, numbers[measured.components], -1)

    @cached_property
    def epochs(self) -> EpochTables:
        """Tables of the epochs and of the start, for compiled code."""
        shared, model = self.ensemble, self.loop.filter
        chosen = np.flatnonzero(model.corrected)
        covariances = share_covariances(self.shared.covariances, chosen, shared.output_maps)
        if (pairs := ShownPairs.of(self.loop, shared.epochs)) is not None:
            covariances = covariances._replace(variances=pairs.of_covariances(self.shared.covariances[:, 9:, 9:]))
        stops = np.diff(self.loop.first_updates) > 0
        stops[0], stops[shared.epochs] = True, True
        return EpochTables(
            shared.epochs, shared.truth, shared.output_maps, covariances, self.loop.first_updates, shared.sizes,
            blocks_of(model.initial), self.biases, self.drifts, self.drift_sigmas, self.faded, chosen,
            np.ascontiguousarray(model.natural(shared.epochs)), model.partners, stops,
        )  # fmt: skip

    @cached_property
    def flexures(self) -> tuple[SensorFlexure, ...]:
        """Flexures of the sensors."""
        return sensor_flexures(self.loop, self.ensemble.epochs)


def tabulate_aided(loop: ClosedLoop, ensemble: EnsembleTables, biases: tuple[str, ...]) -> AidedTables:
    """Prepare the tables for samples.

    Parameters
    ----------
    biases : tuple of str
        Processes whose biases the ensemble's tables have, in their order.
    """
    measurements, sensors = loop.measurements, loop.sensors
    components = [component for sensor in sensors for component in sensor.components]
    which = measurements.components
    correlated = np.array([each.correlated for each in components])[which]
    times = np.array([each.correlation_time for each in components])[which]
    since = np.full(len(measurements.times), np.inf)
    for number in range(len(sensors)):
        rows = np.flatnonzero(measurements.sensors == number)
        since[rows[1:]] = np.diff(measurements.times[rows])
    epochs = loop.times[ensemble.epochs]
    faded = np.zeros((len(epochs), len(components)))
    by_component = [(sensor, component) for sensor in sensors for component in sensor.components]
    for number, (sensor, component) in enumerate(by_component):
        known = np.append(sensor.times, -np.inf)  # the last one is that before all others
        latest = known[np.searchsorted(sensor.times, epochs + 1e-9) - 1]
        elapsed = np.maximum(epochs - np.maximum(latest, np.append(-np.inf, epochs[:-1])), 0.0)
        faded[:, number] = np.exp(-elapsed / component.correlation_time)
    limits = gate_limits(sensors)
    bounds = np.empty((*which.shape, 2), dtype=np.int64)
    used = measurements.rows != 0.0
    # a turned row has the same blocks of three
    blocks = used.reshape(*which.shape, 3, 3).any(axis=3)
    bounds[..., 0] = 3 * np.argmax(blocks, axis=2)
    bounds[..., 1] = 9 - 3 * np.argmax(blocks[..., ::-1], axis=2)
    named = {name: number for number, name in enumerate(biases)}
    drifting = {each.error_name("correlated"): number for number, each in enumerate(components)}
    links = loop.filter.processes
    return AidedTables(
        loop,
        ensemble,
        bounds,
        np.array([next((named[name] for name in each if name in named), -1) for each in links], dtype=np.int64),
        np.array([next((drifting[name] for name in each if name in drifting), -1) for each in links], dtype=np.int64),
        correlated,
        np.exp(-since[:, None] / times),
        np.array([each.correlated for each in components]),
        faded,
        white_sigmas(sensors, measurements),
        limits[measurements.sensors],
        SharedGains.along(loop, ensemble.epochs),
        np.array([rate_error(name) for name in biases], dtype=np.int64),
    )


class _Given(NamedTuple):
    """Errors of n samples, and what their filters have estimated at the start."""

    indices: NDArray[np.uint64]
    equipment: Array
    aiding: Array
    of_states: Array
    estimates: Array
    state: Array
    linear: Array


class _Noise(NamedTuple):
    """Noise of n samples: drawn by counter, or given as `GivenNoise` has it, flat; and what flexures add, if any."""

    seed: np.uint64
    drawn: bool
    measured: bool
    drifting: bool
    added: Array
    disturbances: Array
    flexed: Array


class _LaneRooms(NamedTuple):
    """Room for LANES samples at work, and for all of them between two blocks of steps.

    Attributes
    ----------
    parts : DeviationParts
        Memory of `samples`.
    accepted, whitened : ndarray, shape (..., PARTS, PART)
        Rows of `own`, by parts.
    covariances, covariance_parts : ndarray, shapes (9 + q, 9 + q, LANES), (9 + q, 9 + q, PARTS, PART)
        Of the filters, as they are read.
    """

    samples: Deviations
    own: Estimates
    filters: Covariances
    normals: Array
    white: Array
    drifting: Array
    cause: Array
    parts: DeviationParts
    accepted: Array
    whitened: Array
    covariances: Array
    covariance_parts: Array
    numbers: NDArray[np.uint64]
    shown: Array
    reading: ReadingRooms
    groups: SampleGroups
    of_kind: KindRooms


@dataclass(frozen=True)
class AidedErrors:
    """Errors and filters of n samples at m epochs.

    Attributes
    ----------
    values : ndarray, shape (n, m, 9)
    linear : ndarray, shape (n, 9)
        At the last epoch, by the linear closed loop from the same draws.
    outcome : ndarray of int, shape (n,)
    records : ndarray, shape (n, m, width)
        Of the filters, as `mcnav.systems.ins.ensemble.records` has them.
    states, innovations : ndarray, shapes (n, m, 10), (n, U, M)
        As `mcnav.systems.ins.ensemble.records.Readings` has them for a smoother; else of no samples.
    """

    values: Array
    linear: Array
    outcome: IndexArray
    records: Array
    states: Array
    innovations: Array


@dataclass(frozen=True)
class GivenNoise:
    """Noise that is given; what is not given is zero.

    Attributes
    ----------
    added : ndarray, shape (n, K, 9 + b), optional
        What the instruments' processes add to psi, v, x and the biases in each step; biases start at zero.
    measured : ndarray, shape (n, U, M), optional
        What white noise, correlated errors and flexures add to each measurement.
    jitters : ndarray, shape (n, U), optional
        By how much each measurement is late besides the sensor's delay, s.
    """

    added: Array | None = None
    measured: Array | None = None
    jitters: Array | None = None


def simulate_aided(
    tables: AidedTables, errors: Array, seed: int, samples: IndexArray, own: bool, given: GivenNoise | None = None,
    smoothed: bool = False,
) -> AidedErrors:  # fmt: skip
    """Simulate samples.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        Constant errors: of the instruments, and of aiding.
    samples : ndarray of int, shape (n,)
        Indices, which together with the seed make the noise.
    own : bool
        Whether each sample computes its own gains.
    smoothed : bool
        Whether states and innovations are kept for a smoother: gains must be those along the truth.
    """
    errors, shared = np.ascontiguousarray(errors, dtype=float), tables.ensemble
    _check_samples(tables, errors, samples, given)
    count, epochs = len(errors), len(shared.epochs)
    of_samples, active, active_aiding = _share_errors(tables, errors, samples)
    nothing = np.zeros((0, 0))
    flexed = nothing
    if given is None and tables.flexures:
        added, values = draw_flexures(tables.flexures, tables.loop, seed, samples)
        of_samples = of_samples._replace(of_states=of_samples.of_states + values)
        flexed = added.reshape(count, -1)
    late, of_samples = _measure_late(tables, errors, seed, samples, given, of_samples)
    if late is not None:
        flexed = late.reshape(count, -1) + (flexed if flexed.size else 0.0)
    noise = _Noise(
        np.uint64(seed), given is None and bool(shared.factors.any() or shared.sizes.any()), given is None,
        given is None and bool(tables.correlated.any()),
        nothing if given is None or given.added is None else np.ascontiguousarray(given.added.reshape(count, -1)),
        nothing if given is None or given.measured is None else np.ascontiguousarray(given.measured.reshape(count, -1)),
        flexed,
    )  # fmt: skip
    steps, updates = tables.steps(active), tables.updates(active_aiding, active)
    rooms = _lane_rooms(tables, count, len(active), len(active_aiding), steps.factors.shape[2], own, noise.drifting)
    kept = count if smoothed else 0
    results = Readings(
        np.empty((count, epochs, 9)), np.empty((count, 9)), np.zeros(count, dtype=np.int64),
        np.empty((epochs, count, len(rooms.reading.record))), np.empty((kept, epochs, 10)),
        np.zeros((kept, *tables.white.shape)),
    )  # fmt: skip
    of_filter = tables.filter_steps if own else tables.no_filter_steps
    given_kind = (
        0, 0, steps.constants, of_filter, updates, rooms.samples, rooms.own, rooms.filters, rooms.accepted,
        rooms.whitened, rooms.cause, rooms.of_kind,
    )  # fmt: skip
    kind, estimated = tables.loop.model.kind if own else EKF, tables.estimate_steps
    given_points = (
        0, False, tables.epochs.stops, steps, estimated, rooms.samples, rooms.own, rooms.filters,
        rooms.of_kind.kept, rooms.of_kind.points,
    )  # fmt: skip
    numbers = number_of(kind, given_kind), points_of(kind, given_points)
    _run(steps, estimated, of_filter, updates, tables.epochs, of_samples, noise, rooms, own, *numbers, results)
    beyond = (results.outcomes == SOUND) & ~np.isfinite(results.values).all(axis=(1, 2))
    outcome = np.where(beyond, BEYOND, results.outcomes)
    return AidedErrors(
        results.values, results.linear, outcome, results.records.swapaxes(0, 1), results.states, results.innovations
    )  # fmt: skip


def _check_samples(tables: AidedTables, errors: Array, samples: IndexArray, given: GivenNoise | None) -> None:
    """Raise ValueError where samples have not the sizes that the tables have."""
    count, measurements = len(errors), tables.loop.measurements
    sources = len(CONSTANTS) + measurements.constants.shape[2]
    check_shapes((("errors", errors, (None, sources)), ("samples", samples, (count,))))
    if given is not None and given.added is not None:
        check_shapes((("added", given.added, (count, *tables.ensemble.factors.shape[:2])),))
    if given is not None and given.measured is not None:
        check_shapes((("measured", given.measured, (count, *measurements.components.shape)),))


def _share_errors(tables: AidedTables, errors: Array, samples: IndexArray) -> tuple[_Given, IndexArray, IndexArray]:
    """Share constant errors out between samples and their filters.

    A constant error that a state models exactly is not propagated: at the start the state's estimate is its negative.

    Returns
    -------
    given : _Given
    active, active_aiding : ndarray of int
        Numbers of the constant errors of the instruments and of the sensors that are not zero.
    """
    shared, constants, exact, of_start = (
        tables.ensemble,
        tables.loop.filter.constants,
        tables.exact,
        tables.adjoint.start,
    )
    of_states = np.ascontiguousarray(np.where(constants >= 0, errors[:, np.maximum(constants, 0)], 0.0))
    estimates = np.zeros((len(errors), len(constants)))
    estimates[:, exact] = -of_states[:, exact]
    of_states[:, exact] = 0.0
    left = errors[:, NAVIGATION:].copy()
    left[:, constants[exact] - NAVIGATION] = 0.0
    left[:, tables.delays[tables.delays >= 0] - NAVIGATION] = 0.0  # evaluated at times of their own
    instruments, aiding = left[:, : len(CONSTANTS) - NAVIGATION], left[:, len(CONSTANTS) - NAVIGATION :]
    active, active_aiding = np.flatnonzero(instruments.any(axis=0)), np.flatnonzero(aiding.any(axis=0))
    linear = np.einsum("nj,ij->ni", errors[:, :NAVIGATION], of_start[:, :NAVIGATION] @ shared.start_map)
    linear += np.einsum("ns,is->ni", estimates, of_start[:, NAVIGATION:])
    given = _Given(
        samples.astype(np.uint64), np.ascontiguousarray(instruments[:, active]),
        np.ascontiguousarray(aiding[:, active_aiding]), of_states[:, None], estimates,
        deviate(shared.start, errors[:, :9]), linear,
    )  # fmt: skip
    return given, active, active_aiding


def _measure_late(
    tables: AidedTables, errors: Array, seed: int, samples: IndexArray, given: GivenNoise | None, of_samples: _Given
) -> tuple[Array | None, _Given]:
    """Measure at the times of late samples: what delays and jitter add to measurements, shape (n, U, M), if anything.

    The linear closed loop of the same draws has the first order of that alone: the difference is taken from it.
    """
    loop, epochs = tables.loop, tables.ensemble.epochs
    numbers = tables.delays[loop.measurements.sensors]
    delays = np.where(numbers >= 0, errors[:, numbers], 0.0)
    if given is None and any(sensor.jitter > 0.0 for sensor in loop.sensors):
        jitters, values = draw_jitters(loop, epochs, seed, samples)
        delays, of_samples = delays + jitters, of_samples._replace(of_states=of_samples.of_states + values)
    if given is not None and given.jitters is not None:
        delays = delays + given.jitters
    if not delays.any():
        return None, of_samples
    late = late_errors(loop, delays)
    beyond = -delays[:, :, None] * loop.measurements.changes - late
    linear = of_samples.linear + np.einsum("uoc,nuc->no", tables.adjoint.updates, beyond)
    return late, of_samples._replace(linear=linear)


def _lane_rooms(
    tables: AidedTables, count: int, errors: int, aiding: int, width: int, own: bool, drifting: bool
) -> _LaneRooms:
    """Return room for samples.

    Parameters
    ----------
    errors, aiding : int
        Constant errors of the instruments and of the sensors that are not zero.
    width : int
        Variates of a step.
    drifting : bool
        Whether correlated errors are drawn.
    """
    loop, shared, states = tables.loop, tables.ensemble, len(tables.loop.filter.constants)
    most, components = loop.measurements.components.shape[1], len(tables.drift_sigmas)
    # the last block may end with the epoch after all steps
    blocks = np.append(loop.first_updates[:-1:STEPS_OF_BLOCK], loop.first_updates[-1])
    disturbed_together = int(np.diff(blocks).max())
    kind = loop.model.kind if own else EKF
    keep = Store(STORED + (NAVIGATION + 1 + states) * count_points(states) * (kind == UKF))
    deviations = deviations_of(errors, len(shared.sizes), keep)
    filtered = estimates_of(
        states, aiding, components, len(loop.sensors), keep, keep if drifting else room, most
    )  # fmt: skip
    covariances, of_kind = room(9 + states, 9 + states), kind_rooms(states, kind, most, keep)
    return _LaneRooms(
        deviations,
        filtered,
        covariances_of(states, own, keep if own else room, most),
        room(max(STEPS_OF_BLOCK * width, len(shared.sizes))),
        room(disturbed_together * most),
        room(disturbed_together * most if drifting else 0),
        keep(1),
        parts_of_deviations(deviations),
        parts_of(filtered.accepted),
        parts_of(filtered.whitened),
        covariances,
        parts_of(covariances),
        np.zeros((1, LANES), dtype=np.uint64),
        room(components if drifting else 0),
        reading_rooms(states, width_of_record(len(tables.epochs.chosen), states, len(loop.sensors)), own),
        sample_groups(count, keep),
        of_kind,
    )


@allocation_free_subroutine
def _begin(begin: int, size: int, given: _Given, samples: Deviations, own: Estimates, cause: Array) -> None:
    """Put samples at their start into the lanes; the last one fills what is left of them."""
    for i in range(LANES):
        n = begin + min(i, size - 1)
        place(i, given.equipment[n], given.linear[n], given.state[n], samples)
        cause[0, i] = SOUND
        for a in range(len(own.aiding)):
            own.aiding[a, i] = given.aiding[n, a]
        for s in range(len(own.estimate)):
            own.estimate[s, i] = given.estimates[n, s]
    for c in range(len(own.drifts)):
        store(own.drifts, c, 0.0)
        store(own.shown, c, 0.0)
    for sensor in range(len(own.tally)):
        for c in range(COUNTS):
            store(own.tally, (sensor, c), 0.0)


@inlined
def _draw_disturbances(begin: int, end: int, most: int, noise: _Noise, lanes: _LaneRooms) -> None:
    """Draw the normal variates of the measurements from one update to before another."""
    first, count = begin * most, (end - begin) * most
    draw_normals(noise.seed, lanes.numbers, MEASUREMENT_STREAM, first, count, lanes.white)
    if noise.drifting:
        draw_normals(noise.seed, lanes.numbers, CORRELATED_STREAM, first, count, lanes.drifting)


@inlined
def _disturb(
    u: int, m: int, row: int, begin: int, size: int, updates: UpdateTables, noise: _Noise, lanes: _LaneRooms
) -> None:
    """Compute the errors of an update's measurements from their variates or as given, and add the constant ones.

    Parameters
    ----------
    row : int
        Of the update's first variate.
    """
    own, most = lanes.own, updates.components.shape[1]
    if noise.measured:
        disturb(u, m, updates, lanes.white, lanes.drifting, row, own)
    elif len(noise.disturbances) > 0:
        for i in range(LANES):
            for c in range(m):
                own.disturbance[c, i] = noise.disturbances[begin + min(i, size - 1), u * most + c]
    else:
        for c in range(m):
            store(own.disturbance, c, 0.0)
    if len(noise.flexed) > 0:
        for i in range(LANES):
            for c in range(m):
                own.disturbance[c, i] += noise.flexed[begin + min(i, size - 1), u * most + c]
    if len(own.aiding) > 0:
        add_constant_errors(u, m, updates, own)
    if updates.faulty[u]:
        add_faults(u, m, updates, own)
    if updates.swings.swinging[u]:
        add_rate_errors(u, m, updates, lanes.samples, own)
    add_linear(updates.adjoint, u, m, own.disturbance, lanes.samples.linear)


@inlined
def _update(
    u: int, m: int, constants: Array, corrected: Array, of_filter: FilterSteps, updates: UpdateTables, own_gains: bool,
    lanes: _LaneRooms,
) -> None:  # fmt: skip
    """Update samples and their error-state filters with a measurement."""
    samples, own, filters, sensor = lanes.samples, lanes.own, lanes.filters, updates.sensors[u]
    innovate(u, m, constants, updates, samples, filters.rows, own)
    if own_gains:
        if updates.of_filter.along_truth[u]:
            project_along_truth(u, m, updates.of_filter, filters)
        else:
            project_along_samples(u, m, updates.of_filter, filters)
        factor_innovations(u, m, updates.of_filter.variances, samples.sound, lanes.cause, filters)
        whiten_by_own(m, filters.root, filters.inverse, own)
    else:
        whiten_by_shared(u, m, updates.roots, own)
    judge(m, updates.limits[u], updates.lags[u], sensor, own)
    if own_gains:
        update_covariances(u, m, lanes.accepted, lanes.whitened, of_filter, updates.of_filter, filters)
        feed_back_own(filters.correction, corrected, samples, own)
    else:
        feed_back_shared(u, m, updates.gains, samples, own)


@inlined
def _respond(
    k: int, first: int, begin: int, size: int, steps: StepTables, estimated: EstimateSteps, noise: _Noise,
    lanes: _LaneRooms,
) -> None:  # fmt: skip
    """Compute the responses of samples in a step to all that drives them, and add them to the linear errors.

    Parameters
    ----------
    first : int
        Row of the step's first variate.
    """
    samples, width = lanes.samples, steps.factors.shape[1]
    respond(k, steps, noise.drawn, lanes.normals, first, samples)
    if not noise.drawn and noise.added.shape[1] > 0:
        for i in range(LANES):
            add_given(noise.added[begin + min(i, size - 1), k * width :], i, samples)
    add_linear(steps.adjoint, k, 9, samples.response, samples.linear)
    subtract_estimates(k, estimated, samples.response, lanes.own.estimate)


@allocation_free_loop
def _run(
    steps: StepTables, estimated: EstimateSteps, of_filter: FilterSteps, updates: UpdateTables, epochs: EpochTables,
    given: _Given, noise: _Noise, lanes: _LaneRooms, own_gains: bool, of_kind: int, of_points: int,
    results: Readings,
) -> None:  # fmt: skip
    """Simulate all samples, LANES at a time: each group over a block of steps, whose tables stay in the cache."""
    samples, own, filters, constants = lanes.samples, lanes.own, lanes.filters, steps.constants
    count, width, all_steps = len(epochs.sizes), steps.factors.shape[2], len(steps.durations)
    groups, passed, most = len(lanes.groups.others), 0, updates.components.shape[1]
    for block in range(0, all_steps + 1, STEPS_OF_BLOCK):
        end = min(block + STEPS_OF_BLOCK, all_steps + 1)
        reached, drawn = passed, (min(end, all_steps) - block) * width
        started, ended = epochs.first_updates[block], epochs.first_updates[end]
        for group in range(groups):
            begin = group * LANES
            size, reached, fresh = min(LANES, len(given.state) - begin), passed, True
            # a group's samples; the last one fills what is left of the lanes
            for i in range(LANES):
                lanes.numbers[0, i] = given.indices[begin + min(i, size - 1)]
            # at the start: deviations, P, and biases of processes by their sigmas
            if block == 0:
                _begin(begin, size, given, samples, own, lanes.cause)
                if own_gains:
                    begin_covariances(epochs.initial, filters)
                if noise.drawn:
                    draw_normals(noise.seed, lanes.numbers, IMU_STREAM, 0, count, lanes.normals)
                for q in range(count):
                    nothing = 0.0 * load(samples.turn, 0)
                    store(samples.bias, q, epochs.sizes[q] * load(lanes.normals, q) if noise.drawn else nothing)
            elif groups > 1:
                take_back(group, lanes.groups)
            if noise.drawn:
                draw_normals(noise.seed, lanes.numbers, IMU_STREAM, count + block * width, drawn, lanes.normals)
            if noise.measured:
                _draw_disturbances(started, ended, most, noise, lanes)
            for k in range(block, end):
                first, last = epochs.first_updates[k], epochs.first_updates[k + 1]
                # updates at the beginning of step k
                for u in range(first, last):
                    m = updates.sizes[u]
                    _disturb(u, m, (u - started) * most, begin, size, updates, noise, lanes)
                    if of_kind != 0:
                        UPDATE(
                            of_kind, u, m, constants, of_filter, updates, samples, own, filters, lanes.accepted,
                            lanes.whitened, lanes.cause, lanes.of_kind,
                        )  # fmt: skip
                    else:
                        _update(u, m, constants, estimated.corrected, of_filter, updates, own_gains, lanes)
                    if len(results.innovations) > 0:
                        keep_innovation(u, m, begin, size, own.innovation, results.innovations)
                # errors and records of the filters at an epoch
                if reached < len(epochs.numbers) and epochs.numbers[reached] == k:
                    if noise.drifting and noise.measured:
                        shown = len(own.shown)
                        draw_normals(noise.seed, lanes.numbers, EPOCH_STREAM, reached * shown, shown, lanes.shown)
                        change_correlated_errors(reached, epochs, lanes.shown, own)
                    if own_gains:
                        covariances_in_lanes(filters, lanes.covariance_parts)
                    read(
                        reached, begin, size, constants, epochs, given.of_states, own_gains, samples, own,
                        lanes.covariances, lanes.reading, results,
                    )  # fmt: skip
                    reached += 1
                if k == all_steps:
                    break
                # the step: response to errors less what is estimated, deviations, P' = F P F^T + Q
                _respond(k, (k - block) * width, begin, size, steps, estimated, noise, lanes)
                if of_points != 0:
                    POINTS(
                        of_points, k, False, epochs.stops, steps, estimated, samples, own, filters, lanes.of_kind.kept,
                        lanes.of_kind.points,
                    )  # fmt: skip
                if steps.durations[k] <= SHORT:
                    advance_short(k, steps, samples, lanes.parts, own_gains)
                    fresh = True
                else:
                    if fresh or first < last:
                        start(k, steps, samples)
                    advance(k, steps, samples)
                    fresh = False
                if own_gains:
                    propagate_covariances(k, of_filter, lanes.parts.response, lanes.parts.turned, filters)
                if of_points != 0:
                    POINTS(
                        of_points, k, True, epochs.stops, steps, estimated, samples, own, filters, lanes.of_kind.kept,
                        lanes.of_kind.points,
                    )  # fmt: skip
            if end > all_steps:
                for i in range(size):
                    of_lane = int(lanes.cause[0, i])
                    beyond = of_lane == SOUND and not samples.sound[0, i] > 0.0
                    results.outcomes[begin + i] = BEYOND if beyond else of_lane
            elif groups > 1:
                put_aside(group, lanes.groups)
        passed = reached
