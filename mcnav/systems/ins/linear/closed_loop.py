"""Linear covariance of an aided navigator: its true errors and its filter's own covariance in one recursion.

The filter's gains are computed along the truth from what it believes. With its estimates e^ subtracted in the navigator
(feedback), the true deviations y = (psi, v, x) and the estimates obey, over a step and in an update (Gelb 1974, chapter
7; Maybeck 1979, section 6.8)::

    y' = Phi y + (errors of the instruments) - C e^          e^' = D e^
    n = H y + (errors of the measurement) - H_e e^           y+ = y - K_y n          e^+ = e^ + K_e n

This is linear in each cause: a column of sensitivities for each constant error, and a covariance for each process, both
by the recursions of `mcnav.systems.ins.linear.recursions`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.filter.tables import FilterTables, same_memory, tabulate_filter
from mcnav.systems.ins.imu.gravity import add_by_cause
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import (
    constant_inputs,
    map_covariances,
    output_map,
    process_systems,
    transitions,
)
from mcnav.systems.ins.linear.recursions import (
    ReadingTimes,
    StepNoise,
    Steps,
    Updates,
    design_gains,
    run_covariance,
    run_responses,
)
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.linear.same_content import same_content
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.flexure import Flexure, flexure_process
from mcnav.systems.ins.sensors.measurements import Measurements, flexure_rows, measure, rate_error, white_sigmas
from mcnav.systems.ins.truth.trajectory import Platform, Truth

NOWHERE: Final = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class ClosedLoop:
    """An aided navigator along the truth, on a grid of K steps.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
    first_updates : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    gains : ndarray, shape (U, 9 + q, M)
    roots : ndarray, shape (U, M, M)
        Cholesky factors of the innovations' covariance.
    own_at : ndarray of int, shape (r,)
        Numbers of times.
    own : ndarray, shape (r, 9 + q, 9 + q)
        The filter's covariance there, after their updates.
    """

    truth: Truth
    platform: Platform
    imu: Imu
    sensors: tuple[Sensor, ...]
    model: FilterModel
    responses: StepResponses
    transition: Array
    measurements: Measurements
    filter: FilterTables
    first_updates: IndexArray
    gains: Array
    roots: Array
    own_at: IndexArray
    own: Array

    @property
    def times(self) -> Array:
        """Times of the grid."""
        return self.responses.times


@dataclass(frozen=True)
class ClosedLoopErrors:
    """Errors of an aided navigator at m readings.

    Attributes
    ----------
    times : ndarray, shape (m,)
    partials : ndarray, shape (m, 9, sources)
        Of the outputs to the constant sources: those of the instruments, then those of aiding.
    processes : mapping of str to ndarray, shape (m, 9, 9)
        Covariance of the outputs from each process, by name.
    own : ndarray, shape (m, 9, 9)
        The filter's own covariance of the outputs.
    nominal : ndarray, shape (m, 9)
        Errors of the outputs by faults of the sensors.
    state_partials, state_variances, own_variances : ndarray, shapes (m, q, sources), name to (m, q), (m, q)
        The same of the true errors of the other states' estimates.
    """

    times: Array
    partials: Array
    processes: dict[str, Array]
    own: Array
    nominal: Array
    state_partials: Array
    state_variances: Mapping[str, Array]
    own_variances: Array


def close_loop(
    truth: Truth, platform: Platform, times: Array, imu: Imu, sensors: tuple[Sensor, ...], model: FilterModel,
    respond: Callable[[Truth, Platform, Array, Imu], StepResponses] = respond, own_at: IndexArray = NOWHERE,
    shared: ClosedLoop | None = None,
) -> ClosedLoop:  # fmt: skip
    """Compute the filter's gains along the truth.

    Parameters
    ----------
    times : ndarray, shape (K + 1,)
        Rising, with all instants of the sensors among them; the first is the start of navigation.
    respond : callable
        Computes the responses over the steps.
    own_at : ndarray of int, shape (r,)
        Rising numbers of times at which the filter's covariance is kept.
    shared : ClosedLoop, optional
        A loop along the same truth, the same object, whose tables are taken over where they hold.
    """
    responses, measurements = _shared_tables(truth, platform, times, imu, sensors, shared)
    if responses is None:
        responses = respond(truth, platform, times, imu)
    if measurements is None:
        measurements = measure(truth, platform, float(times[0]), sensors)
    same_tables = shared is not None and shared.responses is responses and shared.measurements is measurements
    same_filter = shared is not None and same_tables and same_content(_beliefs(shared.model), _beliefs(model))
    if shared is not None and same_filter and np.array_equal(shared.own_at, own_at):
        return replace(shared, imu=imu, sensors=sensors, model=model)
    tables = tabulate_filter(truth, platform, imu, responses, model, measurements)
    first = np.append(np.searchsorted(measurements.times, times, side="left"), len(measurements.times))
    transition = transitions(responses)
    gains, roots, own = design_gains(
        *_filter_steps(transition, tables), _filter_updates(first, measurements, tables), tables.variances,
        tables.corrected, tables.initial, ReadingTimes(own_at, np.ones(len(own_at), np.bool_)),
    )  # fmt: skip
    return ClosedLoop(
        truth, platform, imu, sensors, model, responses, transition, measurements, tables, first, gains, roots, own_at,
        own,
    )  # fmt: skip


def _shared_tables(
    truth: Truth, platform: Platform, times: Array, imu: Imu, sensors: tuple[Sensor, ...], shared: ClosedLoop | None
) -> tuple[StepResponses | None, Measurements | None]:
    """Return the responses and the measurements of a loop that hold for another one as well."""
    if shared is None or shared.truth is not truth or shared.platform != platform:
        return None, None
    same_grid = np.array_equal(shared.times, times)
    same_imu = same_memory(shared.imu, imu) and shared.imu.quantized == imu.quantized
    same_sensors = shared.times[0] == times[0] and same_content(_geometry(shared.sensors), _geometry(sensors))
    return shared.responses if same_grid and same_imu else None, shared.measurements if same_sensors else None


def _geometry(sensors: tuple[Sensor, ...]) -> tuple[object, ...]:
    """Return what the responses of innovations depend on."""
    return tuple(
        (
            sensor.name, sensor.times, sensor.lever_arm, sensor.has_lever_arm,
            tuple((each.quantity, each.axis, each.label) for each in sensor.components), sensor.faults,
            sensor.flexure is not None, sensor.offsets, sensor.arrangement,
        )
        for sensor in sensors
    )  # fmt: skip


def _beliefs(model: FilterModel) -> tuple[object, ...]:
    """Return what a filter's gains depend on."""
    beliefs = model.beliefs
    return model.states, beliefs.covariance, beliefs.imu, beliefs.sensors


def propagate_closed_loop(loop: ClosedLoop, readings: IndexArray, after: Array) -> ClosedLoopErrors:
    """Propagate the true errors and the filter's covariance.

    Parameters
    ----------
    readings : ndarray of int, shape (m,)
        Numbers of the times at which errors are read out, in order.
    after : ndarray of bool, shape (m,)
        Whether after the updates at that time, or before.
    """
    own = own_covariances(loop, readings, after)
    partials, estimates, faulted = propagate_constants(loop, readings, after)
    names, covariances = propagate_processes(loop, readings, after)
    maps = np.stack([output_map(loop.truth, float(time)) for time in loop.times[readings]])
    count = len(loop.filter.constants)
    state_partials, pairs = -estimates, ShownPairs.of(loop, readings)
    for place, number in enumerate(loop.filter.constants):
        if number >= 0:
            state_partials[:, place, number] += 1.0
    if pairs is not None:
        state_partials = pairs.of_values(state_partials)
    state_variances = {}
    processes = {}
    for number, name in enumerate(names):
        covariance = covariances[..., number]
        processes[name] = maps @ covariance[:, :NAVIGATION, :NAVIGATION] @ maps.swapaxes(1, 2)
        if pairs is not None:
            state_variances[name] = pairs.of_covariances(_left_of_states(loop, readings, name, covariance))
            continue
        variance = np.diagonal(covariance, axis1=1, axis2=2)[:, NAVIGATION : NAVIGATION + count].copy()
        for place, modelled in enumerate(loop.filter.processes):
            if name in modelled:
                variance[:, place] += covariance[:, -1, -1] - 2.0 * covariance[:, -1, NAVIGATION + place]
        state_variances[name] = variance
    return ClosedLoopErrors(
        loop.times[readings],
        maps @ partials,
        add_by_cause(processes),
        map_covariances(maps, own[:, :NAVIGATION, :NAVIGATION]),
        np.einsum("mij,mj->mi", maps, faulted[:, :NAVIGATION]),
        state_partials,
        add_by_cause(state_variances),
        (
            np.diagonal(own, axis1=1, axis2=2)[:, NAVIGATION:].copy()
            if pairs is None
            else pairs.of_covariances(own[:, NAVIGATION:, NAVIGATION:])
        ),
    )


@dataclass(frozen=True)
class ShownPairs:
    """States as they are shown at m readings: of a flexure the angle and its rate.

    Attributes
    ----------
    natural, partners : ndarray, shapes (m, q, 2), (q,)
        As `mcnav.systems.ins.filter.tables.FilterTables` has them.
    """

    natural: Array
    partners: IndexArray

    @classmethod
    def of(cls, loop: ClosedLoop, readings: IndexArray) -> ShownPairs | None:
        """Return those of a loop; none where all states are shown as they are."""
        tables = loop.filter
        if np.array_equal(tables.partners, np.arange(len(tables.partners))):
            return None
        return cls(tables.natural[readings], tables.partners)

    def of_values(self, values: Array) -> Array:
        """Return values of the states, shape (m, q, s), as they are shown."""
        own, other = self.natural[:, :, 0, None], self.natural[:, :, 1, None]
        return np.asarray(own * values + other * values[:, self.partners])

    def of_covariances(self, covariance: Array) -> Array:
        """Return the variances of the states as shown from their covariance, shapes (m, q), (m, q, q)."""
        rows = self.of_values(covariance)
        both = self.of_values(rows.swapaxes(1, 2))
        return np.diagonal(both, axis1=1, axis2=2).copy()


def _left_of_states(loop: ClosedLoop, readings: IndexArray, name: str, covariance: Array) -> Array:
    """Return the covariance of the errors of the states' estimates by a process, shape (m, q, q).

    Parameters
    ----------
    covariance : ndarray, shape (m, 9 + q + b, 9 + q + b)
        Of y, the estimates and the process's biases.
    """
    count = len(loop.filter.constants)
    first, true = NAVIGATION + count, {sensor.name: sensor.flexure for sensor in loop.sensors}
    errors = np.zeros((len(readings), count, covariance.shape[1]))
    errors[:, :, NAVIGATION:first] = -np.eye(count)
    for place, (modelled, state) in enumerate(zip(loop.filter.processes, loop.model.states, strict=True)):
        if name not in modelled:
            continue
        of = state.flexure
        if of is None:
            errors[:, place, first] = 1.0
        elif not of.rate and (flexure := true[of.sensor]) is not None:
            # the filter's states s of the true angle and rate
            since = loop.times[readings] - loop.times[0]
            true_states = np.linalg.solve(of.flexure.natural(since), flexure.natural(since))
            errors[:, place : place + 2, first : first + 2] = true_states
    return np.asarray(errors @ covariance @ errors.swapaxes(1, 2))


def own_covariances(loop: ClosedLoop, readings: IndexArray, after: Array) -> Array:
    """Compute the filter's covariance at readings, shape (m, 9 + q, 9 + q)."""
    tables, (steps, updates) = loop.filter, filter_system(loop)
    return run_covariance(
        *steps, updates, tables.variances, loop.gains, tables.initial, ReadingTimes(readings, after.astype(np.bool_)),
        len(tables.initial),
    )  # fmt: skip


def filter_system(loop: ClosedLoop) -> tuple[tuple[Steps, StepNoise], Updates]:
    """Return F and Q, and H, of the filter's own states."""
    return (
        _filter_steps(loop.transition, loop.filter),
        _filter_updates(loop.first_updates, loop.measurements, loop.filter),
    )


def _filter_steps(transition: Array, tables: FilterTables) -> tuple[Steps, StepNoise]:
    """Return F and Q of the filter's own states."""
    white, cross = tables.noise[:, :NAVIGATION, :NAVIGATION], tables.noise[:, :NAVIGATION, NAVIGATION:]
    driven = np.diagonal(tables.noise, axis1=1, axis2=2)[:, NAVIGATION:]
    paired = np.zeros_like(driven)
    paired[:, 1:] = np.diagonal(tables.noise[:, NAVIGATION:, NAVIGATION:], -1, axis1=1, axis2=2)
    return (
        Steps(np.concatenate([transition, tables.coupling], axis=2), tables.decay),
        StepNoise(*(np.ascontiguousarray(each) for each in (white, cross, driven, paired))),
    )


def _filter_updates(first: IndexArray, measurements: Measurements, tables: FilterTables) -> Updates:
    """Return H of the filter's own states."""
    return Updates(first, measurements.sizes, np.concatenate([measurements.rows, tables.rows], axis=2))


@dataclass(frozen=True)
class TrueLoop:
    """The closed loop of the true deviations y and the estimates e^, and of n biases that drive them.

    Attributes
    ----------
    steps : Steps
        F of (y, e^, b).
    updates : Updates
        H of (y, e^, b), whose part of e^ is ``-H_e``.
    gains : ndarray, shape (U, 9 + q, M)
        K_y and ``-K_e``.
    """

    steps: Steps
    updates: Updates
    gains: Array


def true_loop(loop: ClosedLoop, biases: int = 0) -> TrueLoop:
    """Return the closed loop with room for a number of biases, which so far neither decay nor drive anything."""
    tables, measurements, steps = loop.filter, loop.measurements, len(loop.transition)
    rows = np.concatenate([loop.transition, -tables.coupling, np.zeros((steps, NAVIGATION, biases))], axis=2)
    responses = (measurements.rows, -tables.rows, np.zeros((*measurements.components.shape, biases)))
    return TrueLoop(
        Steps(rows, np.concatenate([tables.decay, np.ones((steps, biases))], axis=1)),
        Updates(loop.first_updates, measurements.sizes, np.concatenate(responses, axis=2)),
        np.concatenate([loop.gains[:, :NAVIGATION], -loop.gains[:, NAVIGATION:]], axis=1),
    )


def constant_disturbances(loop: ClosedLoop) -> tuple[Array, Array]:
    """Return what constant errors add to psi, v, x in steps, shape (K, 9, s), and to innovations, shape (U, M, s)."""
    fixed, initial, measurements = len(CONSTANTS), len(OUTPUTS), loop.measurements
    sources = fixed + len(aiding_constants(loop.sensors))
    inputs = np.zeros((len(loop.transition), NAVIGATION, sources))
    inputs[:, :, initial:fixed] = constant_inputs(loop.responses)
    disturbances = np.zeros((*measurements.components.shape, sources))
    disturbances[:, :, fixed:] = measurements.constants
    disturbances[:, :, initial : initial + measurements.swings.shape[2]] = measurements.swings
    return inputs, disturbances


def with_faults(loop: ClosedLoop, inputs: Array, disturbances: Array) -> tuple[Array, Array]:
    """Return the same with a last column, the faults of the sensors as one error of size one, where there are some."""
    faults = loop.measurements.faults
    if not faults.any():
        return inputs, disturbances
    nothing = np.zeros((*inputs.shape[:2], 1))
    return np.concatenate([inputs, nothing], axis=2), np.concatenate([disturbances, -faults[:, :, None]], axis=2)


def propagate_constants(loop: ClosedLoop, readings: IndexArray, after: Array) -> tuple[Array, Array, Array]:
    """Compute what constant errors and faults make of the closed loop.

    Returns
    -------
    y, estimates : ndarray, shapes (m, 9, sources), (m, q, sources)
        Of each constant error.
    faulted : ndarray, shape (m, 9 + q)
        Of both by all faults.
    """
    inputs, disturbances = constant_disturbances(loop)
    sources = inputs.shape[2]
    inputs, disturbances = with_faults(loop, inputs, disturbances)
    true = true_loop(loop)
    start = np.zeros((NAVIGATION + len(loop.filter.constants), inputs.shape[2]))
    start[:NAVIGATION, : len(OUTPUTS)] = np.linalg.inv(output_map(loop.truth, float(loop.times[0])))
    seen = run_responses(
        true.steps,
        inputs,
        true.updates,
        disturbances,
        true.gains,
        start,
        ReadingTimes(readings, after.astype(np.bool_)),
    )
    faulted = seen[:, :, sources] if seen.shape[2] > sources else np.zeros(seen.shape[:2])
    return seen[:, :NAVIGATION, :sources], seen[:, NAVIGATION:, :sources], faulted


def propagate_processes(
    loop: ClosedLoop, readings: IndexArray, after: Array, driving: Mapping[str, DrivingProcess] | None = None
) -> tuple[list[str], Array]:
    """Compute the covariance of y, the estimates and a process's own b biases.

    Parameters
    ----------
    driving : mapping of str to DrivingProcess, optional
        What `driving_processes` has, where it is known.

    Returns
    -------
    names : list of str
    covariances : ndarray, shape (m, 9 + q + b, 9 + q + b, processes)
    """
    processes, biases = driving_processes(loop) if driving is None else driving, count_biases(loop)
    true, times = true_loop(loop, biases), ReadingTimes(readings, after.astype(np.bool_))
    size = true.updates.rows.shape[2]
    covariances = np.zeros((len(readings), size, size, len(processes)))
    for number, process in enumerate(processes.values()):
        true.steps.rows[:, :, -biases:], true.steps.decay[:, -biases:] = process.response, process.decay
        true.updates.rows[:, :, -biases:] = process.seen
        start = np.zeros((size, size))
        start[-biases:, -biases:] = process.variance
        covariances[..., number] = run_covariance(
            true.steps, process.noise, true.updates, process.measured, true.gains, start, times, size
        )
    return list(processes), covariances


def count_biases(loop: ClosedLoop) -> int:
    """Return how many biases each process has room for: two where a sensor flexes, else one."""
    return 2 if any(sensor.flexure is not None for sensor in loop.sensors) else 1


def driving_processes(loop: ClosedLoop) -> dict[str, DrivingProcess]:
    """List the processes of the instruments, of gravity and of the sensors, by name."""
    components = [component for sensor in loop.sensors for component in sensor.components]
    quiet, systems = _quiet(loop), process_systems(loop.responses, loop.imu)
    processes = {name: _process_of_imu(loop, quiet, name, *system) for name, system in systems.items()}
    names = [name for sensor in loop.sensors for name in sensor.processes()]
    return processes | {name: _process_of_sensors(loop, quiet, name, components) for name in names}


@dataclass(frozen=True)
class DrivingProcess:
    """A process that drives the loop, and its b biases, over K steps and U updates; what it has not is zero.

    Attributes
    ----------
    response, decay : ndarray, shapes (K, 9, b), (K, b)
        Of psi, v, x to the biases, and what is left of these.
    noise : StepNoise
        The other states are the estimates and the biases.
    variance : ndarray, shape (b, b)
        Covariance of the biases at the start.
    seen, measured : ndarray, shapes (U, M, b), (U, M)
        Responses of the innovations to the biases; variance of the measurements.
    """

    response: Array
    decay: Array
    noise: StepNoise
    variance: Array
    seen: Array
    measured: Array


def _quiet(loop: ClosedLoop) -> DrivingProcess:
    """Return a process that does nothing."""
    steps, biases = len(loop.transition), count_biases(loop)
    others, measured = len(loop.filter.constants) + biases, loop.measurements.components.shape
    noise = StepNoise(
        np.zeros((steps, NAVIGATION, NAVIGATION)), np.zeros((steps, NAVIGATION, others)), np.zeros((steps, others)),
        np.zeros((steps, others)),
    )  # fmt: skip
    return DrivingProcess(
        np.zeros((steps, NAVIGATION, biases)), np.ones((steps, biases)), noise, np.zeros((biases, biases)),
        np.zeros((*measured, biases)), np.zeros(measured),
    )  # fmt: skip


def _process_of_imu(
    loop: ClosedLoop, quiet: DrivingProcess, name: str, response: Array, added: Array, variance: Array
) -> DrivingProcess:
    """Return a process of the instruments, whose system `process_systems` has."""
    swings, gyro, first = loop.measurements.swings, rate_error(name), len(loop.filter.constants)
    noise = quiet.noise._replace(white=np.ascontiguousarray(added[:, :NAVIGATION, :NAVIGATION]))
    if response.any():
        cross, driven = noise.cross.copy(), noise.driven.copy()
        cross[:, :, first], driven[:, first] = added[:, NAVIGATION, :NAVIGATION], added[:, NAVIGATION, NAVIGATION]
        noise = noise._replace(cross=cross, driven=driven)
    process = _with_first_bias(quiet, response[:, :NAVIGATION], response[:, NAVIGATION], float(variance))
    if gyro >= 0 and swings.size:
        process.seen[:, :, 0] = swings[:, :, gyro]
    return replace(process, noise=noise)


def _with_first_bias(quiet: DrivingProcess, response: Array, decay: Array, variance: float) -> DrivingProcess:
    """Return a process with one bias; its noise is still none, and it is not measured."""
    process = replace(
        quiet, response=quiet.response.copy(), decay=quiet.decay.copy(), variance=quiet.variance.copy(),
        seen=quiet.seen.copy(),
    )  # fmt: skip
    process.response[:, :, 0], process.decay[:, 0], process.variance[0, 0] = response, decay, variance
    return process


def _process_of_sensors(
    loop: ClosedLoop, quiet: DrivingProcess, name: str, components: list[Component]
) -> DrivingProcess:
    """Return a process of the sensors: correlated errors or white noise of a component."""
    for number, component in enumerate(components):
        at = loop.measurements.components == number
        if component.correlated > 0.0 and name == component.error_name("correlated"):
            driven = quiet.noise.driven.copy()
            decay, driven[:, len(loop.filter.constants)] = gauss_markov(component, np.diff(loop.times))
            process = _with_first_bias(quiet, np.zeros(NAVIGATION), decay, component.correlated**2)
            process.seen[:, :, 0] = -1.0 * at
            return replace(process, noise=quiet.noise._replace(driven=driven))
        if name == component.error_name("noise"):
            return replace(quiet, measured=white_sigmas(loop.sensors, loop.measurements) ** 2 * at)
    for place, sensor in enumerate(loop.sensors):
        if sensor.flexure is not None:
            for axis in sensor.flexure.axes:
                if name == flexure_process(sensor.name, axis):
                    return _process_of_flexure(loop, quiet, place, sensor.flexure, axis)
    raise ValueError(f"no sensor has a process {name!r}")


def _process_of_flexure(
    loop: ClosedLoop, quiet: DrivingProcess, number: int, flexure: Flexure, axis: int
) -> DrivingProcess:
    """Return the process of a sensor's flexure about an axis, whose two biases are its states s."""
    since, first, variance = loop.times - loop.times[0], len(loop.filter.constants), flexure.sigma[axis] ** 2
    driven, paired, added = quiet.noise.driven.copy(), quiet.noise.paired.copy(), variance * flexure.noise(since)
    driven[:, first], driven[:, first + 1], paired[:, first + 1] = added[:, 0, 0], added[:, 1, 1], added[:, 1, 0]
    return replace(
        quiet, decay=np.repeat(flexure.decay(np.diff(since))[:, None], 2, axis=1),
        noise=quiet.noise._replace(driven=driven, paired=paired), variance=variance * flexure.covariance(since[:1])[0],
        seen=flexure_rows(loop.measurements, number, flexure, axis, float(loop.times[0])),
    )  # fmt: skip


def gauss_markov(component: Component, durations: Array) -> tuple[Array, Array]:
    """Return what is left of a component's correlated errors after durations, s, and the variance that is added."""
    shares = durations / component.correlation_time
    return np.exp(-shares), -(component.correlated**2) * np.expm1(-2.0 * shares)
