"""Linear covariance of an aided navigator: its true errors and its filter's own covariance in one recursion.

The filter's gains are computed along the truth from what it believes. With its estimates e^ subtracted in the navigator
(feedback), the true deviations y = (psi, v, x) and the estimates obey, over a step and in an update (Gelb 1974, chapter
7; Maybeck 1979, section 6.8)::

    y' = Phi y + (errors of the instruments) - C e^          e^' = D e^
    n = H y + (errors of the measurement) - H_e e^           y+ = y - K_y n          e^+ = e^ + K_e n

This is linear in each cause: a column of sensitivities for each constant error, and a covariance for each process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import compiled, inlined
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.filter.tables import FilterTables, same_memory, tabulate_filter
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import (
    constant_inputs,
    map_covariances,
    output_map,
    process_systems,
    transitions,
)
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.linear.same_content import same_content
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.measurements import Measurements, measure, rate_error
from mcnav.systems.ins.truth.trajectory import Platform, Truth

LANES: Final = 8
"""Processes are handled in multiples of this number."""

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
    state_partials, state_variances, own_variances : ndarray, shapes (m, q, sources), name to (m, q), (m, q)
        The same of the true errors of the other states' estimates.
    """

    times: Array
    partials: Array
    processes: dict[str, Array]
    own: Array
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
    updates, most = measurements.components.shape
    gains, roots = np.zeros((updates, len(tables.corrected), most)), np.zeros((updates, most, most))
    transition, own = transitions(responses), np.zeros((len(own_at), *tables.initial.shape))
    _design(
        transition, tables.coupling, tables.decay, tables.noise, tables.initial, measurements.rows, tables.rows,
        tables.variances, tables.corrected, measurements.sizes, first, gains, roots, own_at,
        np.ones(len(own_at), np.bool_), own,
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
            tuple((each.quantity, each.axis, each.label) for each in sensor.components),
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
    partials, estimates = _propagate_constants(loop, readings, after)
    names, covariances = _propagate_processes(loop, readings, after)
    maps = np.stack([output_map(loop.truth, float(time)) for time in loop.times[readings]])
    count = len(loop.filter.constants)
    state_partials = -estimates
    for place, number in enumerate(loop.filter.constants):
        if number >= 0:
            state_partials[:, place, number] += 1.0
    state_variances = {}
    processes = {}
    for number, name in enumerate(names):
        covariance = covariances[..., number]
        processes[name] = maps @ covariance[:, :NAVIGATION, :NAVIGATION] @ maps.swapaxes(1, 2)
        variance = np.diagonal(covariance, axis1=1, axis2=2)[:, NAVIGATION : NAVIGATION + count].copy()
        for place, modelled in enumerate(loop.filter.processes):
            if name in modelled:
                variance[:, place] += covariance[:, -1, -1] - 2.0 * covariance[:, -1, NAVIGATION + place]
        state_variances[name] = variance
    return ClosedLoopErrors(
        loop.times[readings],
        maps @ partials,
        processes,
        map_covariances(maps, own[:, :NAVIGATION, :NAVIGATION]),
        state_partials,
        state_variances,
        np.diagonal(own, axis1=1, axis2=2)[:, NAVIGATION:].copy(),
    )


def own_covariances(loop: ClosedLoop, readings: IndexArray, after: Array) -> Array:
    """Compute the filter's covariance at readings, shape (m, 9 + q, 9 + q)."""
    tables, measurements = loop.filter, loop.measurements
    covariances = np.zeros((len(readings), *tables.initial.shape))
    _design(
        loop.transition, tables.coupling, tables.decay, tables.noise, tables.initial, measurements.rows, tables.rows,
        tables.variances, tables.corrected, measurements.sizes, loop.first_updates, np.zeros_like(loop.gains),
        np.zeros_like(loop.roots), readings, after.astype(np.bool_), covariances,
    )  # fmt: skip
    return covariances


def _propagate_constants(loop: ClosedLoop, readings: IndexArray, after: Array) -> tuple[Array, Array]:
    """Compute what each constant error makes of y, shape (m, 9, sources), and of the estimates, (m, q, sources)."""
    tables, measurements, gains = loop.filter, loop.measurements, loop.gains
    inputs = constant_inputs(loop.responses)
    fixed, count = len(CONSTANTS), len(tables.constants)
    sources = fixed + len(aiding_constants(loop.sensors))
    y = np.zeros((NAVIGATION, sources))
    y[:, : len(OUTPUTS)] = np.linalg.inv(output_map(loop.truth, float(loop.times[0])))
    seen = np.empty((len(readings), NAVIGATION + count, sources))
    _carry_constants(
        loop.transition, tables.coupling, tables.decay, inputs, measurements.rows, tables.rows, measurements.constants,
        measurements.swings, measurements.sizes, gains, loop.first_updates, readings, after.astype(np.bool_), y, seen,
    )  # fmt: skip
    return seen[:, :NAVIGATION], seen[:, NAVIGATION:]


def _propagate_processes(loop: ClosedLoop, readings: IndexArray, after: Array) -> tuple[list[str], Array]:
    """Compute the covariance of y, the estimates and a process's own bias, shape (m, 10 + q, 10 + q, processes)."""
    steps, durations = len(loop.transition), np.diff(loop.times)
    systems = process_systems(loop.responses, loop.imu)
    components = [component for sensor in loop.sensors for component in sensor.components]
    correlated = {c.error_name("correlated"): n for n, c in enumerate(components) if c.correlated > 0.0}
    white = {c.error_name("noise"): n for n, c in enumerate(components)}
    names = [name for sensor in loop.sensors for name in sensor.processes()]
    names = [*systems, *names]
    lanes = -(-len(names) // LANES) * LANES
    response, decay = np.zeros((steps, NAVIGATION, lanes)), np.ones((steps, lanes))
    noise, bias_noise = np.zeros((steps, 10, NAVIGATION, lanes)), np.zeros((steps, lanes))
    variance, of_component, measured = np.zeros(lanes), np.full(lanes, -1), np.full(lanes, -1)
    sigmas, rate_errors = np.zeros(lanes), np.full(lanes, -1)
    for number, name in enumerate(names):
        if name in systems:
            rate_errors[number] = rate_error(name) if loop.measurements.swings.size else -1
            over, added, variance[number] = systems[name]
            response[:, :, number], decay[:, number] = over[:, :NAVIGATION], over[:, NAVIGATION]
            noise[:, :NAVIGATION, :, number] = added[:, :NAVIGATION, :NAVIGATION]
            noise[:, NAVIGATION, :, number] = added[:, NAVIGATION, :NAVIGATION]
            bias_noise[:, number] = added[:, NAVIGATION, NAVIGATION]
        elif name in correlated:
            component = components[correlated[name]]
            of_component[number], variance[number] = correlated[name], component.correlated**2
            decay[:, number] = np.exp(-durations / component.correlation_time)
            bias_noise[:, number] = -(component.correlated**2) * np.expm1(-2.0 * durations / component.correlation_time)
        else:
            measured[number], sigmas[number] = white[name], components[white[name]].noise
    size = NAVIGATION + len(loop.filter.constants) + 1
    processes = np.zeros((len(readings), size, size, lanes))
    tables, measurements = loop.filter, loop.measurements
    _add_up(
        loop.transition, tables.coupling, tables.decay, response, decay, noise, bias_noise, variance, of_component,
        measured, sigmas, rate_errors, measurements.swings, measurements.rows, tables.rows, measurements.components,
        measurements.sizes, loop.gains, loop.first_updates, readings, after.astype(np.bool_), processes,
    )  # fmt: skip
    return names, processes[..., : len(names)]


@compiled
def _carry_constants(
    transition: Array, coupling: Array, decay: Array, inputs: Array, rows: Array, state_rows: Array, constants: Array,
    swings: Array, sizes: IndexArray, gains: Array, first: IndexArray, readings: IndexArray, after: Array,
    start: Array, seen: Array,
) -> None:  # fmt: skip
    """Run the sensitivities of y and of the estimates, to all constant errors, through the closed loop."""
    sources, states, most = start.shape[1], decay.shape[1], rows.shape[1]
    fixed = sources - constants.shape[2]
    y, following = start.copy(), np.zeros_like(start)
    estimates, innovation = np.zeros((states, sources)), np.zeros((most, sources))
    reached = 0
    for k in range(len(first) - 1):
        while reached < len(readings) and readings[reached] == k and not after[reached]:
            seen[reached, :9], seen[reached, 9:] = y, estimates
            reached += 1
        for u in range(first[k], first[k + 1]):
            innovation[:] = 0.0
            for c in range(sizes[u]):
                for i in range(9):
                    _add_row(innovation[c], rows[u, c, i], y[i])
                for i in range(states):
                    _add_row(innovation[c], -state_rows[u, c, i], estimates[i])
                for j in range(fixed, sources):
                    innovation[c, j] += constants[u, c, j - fixed]
                for j in range(swings.shape[2]):
                    innovation[c, 9 + j] += swings[u, c, j]
            for c in range(sizes[u]):
                for i in range(9):
                    _add_row(y[i], -gains[u, i, c], innovation[c])
                for i in range(states):
                    _add_row(estimates[i], gains[u, 9 + i, c], innovation[c])
        while reached < len(readings) and readings[reached] == k:
            seen[reached, :9], seen[reached, 9:] = y, estimates
            reached += 1
        if k == len(transition):
            break
        following[:] = 0.0
        for i in range(9):
            for j in range(9):
                _add_row(following[i], transition[k, i, j], y[j])
            for j in range(states):
                _add_row(following[i], -coupling[k, i, j], estimates[j])
            for j in range(inputs.shape[2]):
                following[i, 9 + j] += inputs[k, i, j]
        y[:] = following
        for i in range(states):
            for j in range(sources):
                estimates[i, j] *= decay[k, i]


@inlined
def _add_row(row: Array, weight: float, other: Array) -> None:
    """Add a multiple of a row to another one."""
    if weight != 0.0:
        for j in range(len(row)):
            row[j] += weight * other[j]


@compiled
def _design(
    transition: Array, coupling: Array, decay: Array, noise: Array, initial: Array, rows: Array, state_rows: Array,
    variances: Array, corrected: Array, sizes: IndexArray, first: IndexArray, gains: Array, roots: Array,
    readings: IndexArray, after: Array, covariances: Array,
) -> None:  # fmt: skip
    """Run the filter's covariance along the truth: Joseph form, states that are considered are not corrected.

    Loops over states are innermost, where they run in vectors; responses that are zero are skipped.
    """
    size, most = len(initial), rows.shape[1]
    p = initial.copy()
    product, full, turned = np.zeros((9, size)), np.zeros((most, size)), np.zeros((size, 9))
    cross, gain, weights = np.zeros((most, size)), np.zeros((most, size)), np.zeros((most, size))
    s, root = np.zeros((most, most)), np.zeros((most, most))
    left = np.zeros((size, size))  # its transpose
    reached = 0
    for k in range(len(first) - 1):
        while reached < len(readings) and readings[reached] == k and not after[reached]:
            covariances[reached] = p
            reached += 1
        for u in range(first[k], first[k + 1]):
            m = sizes[u]
            for c in range(m):
                full[c, :9] = rows[u, c]
                full[c, 9:] = state_rows[u, c]
                for i in range(size):
                    cross[c, i] = 0.0
                for j in range(size):
                    weight = full[c, j]
                    if weight != 0.0:
                        for i in range(size):
                            cross[c, i] += weight * p[j, i]
            for c in range(m):
                for e in range(m):
                    total = 0.0
                    for j in range(size):
                        total += full[c, j] * cross[e, j]
                    s[c, e] = total
                s[c, c] += variances[u, c]
            for c in range(m):
                for e in range(c + 1):
                    total = s[c, e]
                    for j in range(e):
                        total -= root[c, j] * root[e, j]
                    root[c, e] = np.sqrt(total) if c == e else total / root[e, e]
            roots[u] = root
            for c in range(m):
                for i in range(size):
                    gain[c, i] = cross[c, i]
                for j in range(c):
                    weight = root[c, j]
                    for i in range(size):
                        gain[c, i] -= gain[j, i] * weight
                for i in range(size):
                    gain[c, i] /= root[c, c]
            for c in range(m - 1, -1, -1):
                for j in range(c + 1, m):
                    weight = root[j, c]
                    for i in range(size):
                        gain[c, i] -= gain[j, i] * weight
                for i in range(size):
                    gain[c, i] /= root[c, c]
            for c in range(m):
                for i in range(size):
                    gain[c, i] *= corrected[i]
                    gains[u, i, c] = gain[c, i]
            for j in range(size):
                for i in range(size):
                    left[j, i] = p[j, i]
                for c in range(m):
                    weight = cross[c, j]
                    for i in range(size):
                        left[j, i] -= gain[c, i] * weight
            for c in range(m):
                for i in range(size):
                    cross[c, i] = 0.0
                for j in range(size):
                    weight = full[c, j]
                    if weight != 0.0:
                        for i in range(size):
                            cross[c, i] += weight * left[j, i]
                for i in range(size):
                    weights[c, i] = variances[u, c] * gain[c, i] - cross[c, i]
            for j in range(size):
                for i in range(j, size):
                    p[j, i] = left[j, i]
                for c in range(m):
                    weight = gain[c, j]
                    for i in range(j, size):
                        p[j, i] += weights[c, i] * weight
                for i in range(j, size):
                    p[i, j] = p[j, i]
        while reached < len(readings) and readings[reached] == k:
            covariances[reached] = p
            reached += 1
        if k == len(transition):
            break
        for i in range(9):
            for c in range(9):
                turned[c, i] = transition[k, i, c]
            for c in range(size - 9):
                turned[9 + c, i] = coupling[k, i, c]
            for j in range(size):
                product[i, j] = 0.0
            for c in range(size):
                weight = turned[c, i]
                if weight != 0.0:
                    for j in range(size):
                        product[i, j] += weight * p[c, j]
        for i in range(9):
            for j in range(i + 1):
                p[i, j] = noise[k, i, j]
            for c in range(size):
                weight = product[i, c]
                for j in range(i + 1):
                    p[i, j] += weight * turned[c, j]
            for j in range(i + 1):
                p[j, i] = p[i, j]
        for c in range(size - 9):
            for i in range(9):
                p[i, 9 + c] = p[9 + c, i] = product[i, 9 + c] * decay[k, c] + noise[k, i, 9 + c]
            for e in range(c + 1):
                total = p[9 + c, 9 + e] * decay[k, c] * decay[k, e] + noise[k, 9 + c, 9 + e]
                p[9 + c, 9 + e] = p[9 + e, 9 + c] = total


@compiled
def _add_up(
    transition: Array, coupling: Array, decay: Array, response: Array, own_decay: Array, noise: Array,
    bias_noise: Array, variance: Array, of_component: IndexArray, measured: IndexArray, sigmas: Array,
    rate_errors: IndexArray, swings: Array, rows: Array, state_rows: Array, components: IndexArray, sizes: IndexArray,
    gains: Array, first: IndexArray, readings: IndexArray, after: Array, result: Array,
) -> None:  # fmt: skip
    """Run the covariances of all processes through the closed loop; processes are the last axis."""
    lanes, size = result.shape[3], result.shape[1]
    states, last, most = size - 10, size - 1, rows.shape[1]
    c = np.zeros((size, size, lanes))
    c[last, last] = variance
    product = np.zeros((9, size, lanes))
    cross = np.zeros((size, most, lanes))
    left = np.zeros((size, size, lanes))
    full, gain = np.zeros((most, size - 1)), np.zeros((size - 1, most))
    own = np.zeros((most, lanes))
    reached = 0
    for k in range(len(first) - 1):
        while reached < len(readings) and readings[reached] == k and not after[reached]:
            result[reached] = c
            reached += 1
        for u in range(first[k], first[k + 1]):
            m = sizes[u]
            for e in range(m):
                full[e, :9] = rows[u, e]
                for i in range(states):
                    full[e, 9 + i] = -state_rows[u, e, i]
                for n in range(lanes):
                    own[e, n] = -1.0 if of_component[n] == components[u, e] else 0.0
                    if rate_errors[n] >= 0:
                        own[e, n] = swings[u, e, rate_errors[n]]
                for i in range(size - 1):
                    gain[i, e] = gains[u, i, e] if i < 9 else -gains[u, i, e]
            _project(c, full, own, m, cross)
            for i in range(size):
                for j in range(size):
                    for n in range(lanes):
                        left[i, j, n] = c[i, j, n]
                    if i < last:
                        for e in range(m):
                            weight = gain[i, e]
                            for n in range(lanes):
                                left[i, j, n] -= weight * cross[j, e, n]
            _project(left, full, own, m, cross)
            for i in range(size):
                for j in range(i + 1):
                    for n in range(lanes):
                        c[i, j, n] = left[i, j, n]
                    if j < last:
                        for e in range(m):
                            weight = gain[j, e]
                            for n in range(lanes):
                                c[i, j, n] -= weight * cross[i, e, n]
                    for n in range(lanes):
                        c[j, i, n] = c[i, j, n]
            for e in range(m):
                for n in range(lanes):
                    if measured[n] == components[u, e]:
                        for i in range(size - 1):
                            for j in range(size - 1):
                                c[i, j, n] += sigmas[n] * sigmas[n] * gain[i, e] * gain[j, e]
        while reached < len(readings) and readings[reached] == k:
            result[reached] = c
            reached += 1
        if k == len(transition):
            break
        for i in range(9):
            for j in range(size):
                for n in range(lanes):
                    product[i, j, n] = response[k, i, n] * c[last, j, n]
                for e in range(9):
                    weight = transition[k, i, e]
                    if weight != 0.0:
                        for n in range(lanes):
                            product[i, j, n] += weight * c[e, j, n]
                for e in range(states):
                    weight = coupling[k, i, e]
                    if weight != 0.0:
                        for n in range(lanes):
                            product[i, j, n] -= weight * c[9 + e, j, n]
        for i in range(9):
            for j in range(i + 1):
                for n in range(lanes):
                    c[i, j, n] = noise[k, i, j, n] + product[i, last, n] * response[k, j, n]
                for e in range(9):
                    weight = transition[k, j, e]
                    if weight != 0.0:
                        for n in range(lanes):
                            c[i, j, n] += weight * product[i, e, n]
                for e in range(states):
                    weight = coupling[k, j, e]
                    if weight != 0.0:
                        for n in range(lanes):
                            c[i, j, n] -= weight * product[i, 9 + e, n]
                for n in range(lanes):
                    c[j, i, n] = c[i, j, n]
            for e in range(states):
                weight = decay[k, e]
                for n in range(lanes):
                    c[i, 9 + e, n] = weight * product[i, 9 + e, n]
                    c[9 + e, i, n] = c[i, 9 + e, n]
            for n in range(lanes):
                c[i, last, n] = own_decay[k, n] * product[i, last, n] + noise[k, 9, i, n]
                c[last, i, n] = c[i, last, n]
        for e in range(states):
            for f in range(states):
                weight = decay[k, e] * decay[k, f]
                for n in range(lanes):
                    c[9 + e, 9 + f, n] *= weight
            for n in range(lanes):
                c[9 + e, last, n] *= decay[k, e] * own_decay[k, n]
                c[last, 9 + e, n] = c[9 + e, last, n]
        for n in range(lanes):
            c[last, last, n] = c[last, last, n] * own_decay[k, n] * own_decay[k, n] + bias_noise[k, n]


@compiled
def _project(c: Array, full: Array, own: Array, m: int, cross: Array) -> None:
    """Multiply covariances by the responses of innovations, shape (m, size)."""
    size, lanes = c.shape[1], c.shape[2]
    for i in range(size):
        for e in range(m):
            for n in range(lanes):
                cross[i, e, n] = own[e, n] * c[i, size - 1, n]
            for j in range(size - 1):
                weight = full[e, j]
                if weight != 0.0:
                    for n in range(lanes):
                        cross[i, e, n] += weight * c[i, j, n]
