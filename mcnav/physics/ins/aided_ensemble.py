"""Many samples of an aided navigator, each with its own filter, and the linear closed loop of the same draws.

Between updates a sample is a deviation from the shared truth (`mcnav.physics.ins.ensemble`), and what its filter has
estimated is subtracted from the errors of its instruments. Its filter's covariance is propagated with the step's tables
turned to the sample's own indicated attitude and force; its gains are its own, or with shared gains those along the
truth. The twin is linear, has the gains along the truth and the same noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.closed_loop import ClosedLoop, own_covariances
from mcnav.physics.ins.deviations import deviate, locate, navigation_errors
from mcnav.physics.ins.ensemble import LANES, EnsembleTables, advance, bend, room
from mcnav.physics.ins.filter_lanes import (
    BEYOND,
    INDEFINITE,
    SIX,
    SOUND,
    correct_covariances,
    factor_innovations,
    invert_innovations,
    propagate_covariances,
    record_consistency,
    turn_tables,
)
from mcnav.physics.ins.instruments import CONSTANTS
from mcnav.physics.ins.noise import IMU_STREAM, draw_normals
from mcnav.physics.ins.update_lanes import (
    correct_twins,
    disturb,
    feed_back,
    innovate_lanes,
    judge,
    rotation_vector,
)
from mcnav.physics.jit import compiled

MEASUREMENT_STREAM: Final = 2
"""Stream of the measurements' white noise."""

CORRELATED_STREAM: Final = 3
"""Stream of the measurements' correlated errors."""

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
    covariances : ndarray, shape (m, 9 + q, 9 + q)
        Of the filter along the truth, at the epochs.
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
    covariances: Array


def tabulate_aided(loop: ClosedLoop, ensemble: EnsembleTables, biases: tuple[str, ...]) -> AidedTables:
    """Prepare the tables for samples.

    Parameters
    ----------
    biases : tuple of str
        Processes whose biases the ensemble's tables have, in their order.
    """
    from scipy.stats import chi2

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
    limits = np.array([
        np.inf if sensor.gate is None else float(chi2.ppf(sensor.gate, len(sensor.components))) for sensor in sensors
    ])  # fmt: skip
    bounds = np.zeros((*which.shape, 2), dtype=np.int64)
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
        np.array([each.noise for each in components])[which],
        limits[measurements.sensors],
        own_covariances(loop, ensemble.epochs, np.ones(len(ensemble.epochs))),
    )


@dataclass(frozen=True)
class AidedErrors:
    """Errors and filters of n samples at m epochs.

    Attributes
    ----------
    values, linear : ndarray, shape (n, m, 9)
        Nonlinear, and by the linear closed loop from the same draws.
    outcome : ndarray of int, shape (n,)
    nees : ndarray, shape (n, m, 6)
        Normalized estimation errors squared of all estimated states, navigation, position, velocity, attitude and
        the other estimated states.
    covariance : ndarray, shape (n, m, 45)
        The filter's, of the outputs: lower triangle by rows.
    state_error, state_variance : ndarray, shape (n, m, q)
        Of the other states.
    counted : ndarray, shape (n, m, sensors, 5)
        As `mcnav.scenarios.filter_record.BY_SENSOR` has them.
    """

    values: Array
    linear: Array
    outcome: IndexArray
    nees: Array
    covariance: Array
    state_error: Array
    state_variance: Array
    counted: Array


@dataclass(frozen=True)
class GivenNoise:
    """Noise that is given.

    Attributes
    ----------
    added : ndarray, shape (n, K, 9 + b)
        What the instruments' processes add to psi, v, x and the biases in each step; biases start at zero.
    measured : ndarray, shape (n, U, M)
        What white noise and correlated errors add to each measurement.
    """

    added: Array
    measured: Array


def simulate_aided(
    tables: AidedTables, errors: Array, seed: int, samples: IndexArray, own: bool, given: GivenNoise | None = None
) -> AidedErrors:
    """Simulate samples.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
        Constant errors: of the instruments, and of aiding.
    samples : ndarray of int, shape (n,)
        Indices, which together with the seed make the noise.
    own : bool
        Whether each sample computes its own gains.
    """
    loop, shared = tables.loop, tables.ensemble
    truth, measured, model = loop.truth, loop.measurements, loop.filter
    errors = np.ascontiguousarray(errors, dtype=float)
    count, epochs, states = len(errors), len(shared.epochs), len(model.constants)
    turn, velocity, position = deviate(truth, float(loop.times[0]), errors[:, :9])
    state = np.hstack([turn, velocity, position])
    linear = np.einsum("nj,ij->ni", errors[:, :9], shared.start_map)
    instruments, aiding = errors[:, 9 : len(CONSTANTS)], errors[:, len(CONSTANTS) :]
    active = np.flatnonzero(instruments.any(axis=0))
    of_states = np.ascontiguousarray(np.where(model.constants >= 0, errors[:, np.maximum(model.constants, 0)], 0.0))
    turns, deviations = np.empty((count, epochs, 4)), np.empty((count, epochs, 6))
    predicted, outcome = np.empty((count, epochs, 9)), np.zeros(count, dtype=np.int64)
    nees, covariance = np.zeros((count, epochs, 6)), np.zeros((count, epochs, 45))
    state_error, state_variance = np.zeros((count, epochs, states)), np.zeros((count, epochs, states))
    counted = np.zeros((count, epochs, len(loop.sensors), 5))
    nothing = np.zeros((0, 0))
    added = nothing if given is None else np.ascontiguousarray(given.added.reshape(count, -1))
    disturbed = nothing if given is None else np.ascontiguousarray(given.measured.reshape(count, -1))
    noisy = bool(shared.factors.any() or shared.sizes.any())
    constants = truth.earth.constants
    _run(
        (constants, shared.epochs, shared.durations, shared.motion, shared.force, shared.thrust,
         np.ascontiguousarray(shared.inputs[:, active]), shared.biases, shared.decays, shared.sizes, shared.factors,
         shared.places, shared.fields, shared.gradients, shared.output_maps),
        (model.coupling, model.decay, model.noise, model.initial, model.rows, model.variances, model.corrected,
         tables.biases, tables.drifts, loop.first_updates, loop.gains, loop.roots, tables.covariances),
        (measured.sensors, measured.sizes, measured.components, measured.kinds, measured.directions, measured.arms,
         measured.constants, measured.rows, measured.forward, measured.places, tables.bounds, tables.correlated,
         tables.memory, tables.drift_sigmas, tables.faded, tables.white, tables.limits),
        (np.ascontiguousarray(instruments[:, active]), np.ascontiguousarray(aiding), of_states, state, linear),
        np.uint64(seed), samples.astype(np.uint64), added, disturbed, noisy, bool(tables.correlated.any()), own,
        (turns, deviations, predicted, outcome, nees, covariance, state_error, state_variance, counted),
    )  # fmt: skip
    indicated = locate(constants, shared.angles, shared.states, deviations)
    values = navigation_errors(constants, shared.truth, indicated, turns)
    outcome = np.where((outcome == SOUND) & ~np.isfinite(values).all(axis=(1, 2)), BEYOND, outcome)
    return AidedErrors(values, predicted, outcome, nees, covariance, state_error, state_variance, counted)


@compiled
def _force(
    k: int, noisy: bool, theta: Array, inputs: Array, bias: Array, biases: Array, decays: Array, factors: Array,
    normals: Array, drawn: Array, local: Array,
) -> None:  # fmt: skip
    """Compute the linear response of a step to the errors of the instruments, and take the biases to its end.

    Parameters
    ----------
    normals : ndarray, shape (LANES, 9 + b) or (LANES, 0)
        Normal variates of the step; without any, ``drawn`` is given.
    """
    local[:] = 0.0
    for q in range(len(theta)):
        for r in range(9):
            weight = inputs[k, q, r]
            for i in range(LANES):
                local[r, i] += weight * theta[q, i]
    for b in range(len(bias)):
        for r in range(9):
            weight = biases[k, b, r]
            for i in range(LANES):
                local[r, i] += weight * bias[b, i]
        for i in range(LANES):
            bias[b, i] *= decays[k, b]
    if not noisy:
        return
    if normals.shape[1] > 0:
        drawn[:] = 0.0
        for c in range(len(drawn)):
            for r in range(c, len(drawn)):
                weight = factors[k, r, c]
                for i in range(LANES):
                    drawn[r, i] += weight * normals[i, c]
    for r in range(9):
        for i in range(LANES):
            local[r, i] += drawn[r, i]
    for b in range(len(bias)):
        for i in range(LANES):
            bias[b, i] += drawn[9 + b, i]


@compiled
def _advance_twin(k: int, motion: Array, coupling: Array, local: Array, estimate: Array, twin: Array) -> None:
    """Take the linear samples over a step."""
    forced = local.copy()
    for r in range(9):
        for s in range(len(estimate)):
            weight = coupling[k, r, s]
            if weight != 0.0:
                for i in range(LANES):
                    forced[r, i] -= weight * estimate[s, i]
    for r in range(6):
        for c in range(9):
            weight = motion[k, r, c]
            for i in range(LANES):
                forced[3 + r, i] += weight * twin[c, i]
    for r in range(9):
        for i in range(LANES):
            twin[r, i] = forced[r, i] + (twin[r, i] if r < 3 else 0.0)


@compiled
def _advance(
    k: int, constants: Array, durations: Array, motion: Array, force: Array, thrust: Array, places: Array,
    fields: Array, gradients: Array, forced: Array, z: Array, turn: Array, d: Array, first: Array, here: Array,
    scratch: tuple[Array, Array, Array, Array, Array, Array, Array, Array], sound: NDArray[np.bool_],
) -> None:  # fmt: skip
    advance(
        k, constants, durations, motion, force, thrust, places, fields, gradients, forced, z, turn, d, first, here,
        scratch, sound,
    )  # fmt: skip


@compiled
def _run(
    shared: tuple[Any, ...], filtered: tuple[Any, ...], measured: tuple[Any, ...], given: tuple[Any, ...],
    seed: np.uint64, samples: NDArray[np.uint64], added_noise: Array, disturbances: Array, noisy: bool,
    drifting: bool, own: bool, results: tuple[Any, ...],
) -> None:  # fmt: skip
    (constants, epochs, durations, motion, force, thrust, inputs, biases, decays, sizes, factors, places, fields,
     gradients, output_maps) = shared  # fmt: skip
    (coupling, decay, noise, initial, state_rows, variances, corrected, state_biases, state_drifts, first_updates,
     shared_gains, shared_roots, shared_covariances) = filtered  # fmt: skip
    (sensors, counts_of, components, kinds, directions, arms, constant_rows, truth_rows, forward, spots, bounds,
     correlated, memory, drift_sigmas, faded, white, limits) = measured  # fmt: skip
    equipment, aiding, of_states, state, linear = given
    turns, deviations, predicted, outcomes, nees, covariances, state_errors, state_variances, counts = results
    steps, count, width = len(durations), len(sizes), factors.shape[1]
    size, states, most, updates = len(initial), len(initial) - 9, components.shape[1], len(sensors)
    drawing = noisy and added_noise.shape[1] == 0
    normals = np.zeros((LANES, count + steps * width if drawing else 0))
    measuring = disturbances.shape[1] == 0
    white_normals = np.zeros((LANES, updates * most if measuring else 0))
    drift_normals = np.zeros((LANES, updates * most if measuring and drifting else 0))
    epoch_normals = np.zeros((LANES, faded.size if measuring and drifting else 0))
    drifts, shown = np.zeros((len(drift_sigmas), LANES)), np.zeros((len(drift_sigmas), LANES))
    theta, bias, drawn = np.zeros((inputs.shape[1], LANES)), np.zeros((count, LANES)), np.zeros((width, LANES))
    step_normals = np.zeros((LANES, width if drawing else 0))
    z, turn, d, twin = np.zeros((9, LANES)), np.zeros((4, LANES)), np.zeros((6, LANES)), np.zeros((9, LANES))
    local, first, here, forced = np.zeros((9, LANES)), np.zeros((3, LANES)), np.zeros((3, LANES)), np.zeros((9, LANES))
    estimate, twin_estimate = np.zeros((states, LANES)), np.zeros((states, LANES))
    scratch, sound = room(), np.zeros(LANES, dtype=np.bool_)
    outcome, cause = np.zeros(LANES, dtype=np.int64), np.zeros(LANES, dtype=np.int64)
    whole = 9 + SIX * ((states + SIX - 1) // SIX)
    p, left = np.zeros((whole, whole, LANES)), np.zeros((whole, whole, LANES))
    product, transition = np.zeros((9, whole, LANES)), np.zeros((6, 3, LANES))
    coupled, added = np.zeros((9, whole - 9, LANES)), np.zeros((whole, 9, LANES))
    full, root, inverse = np.zeros((most, 9, LANES)), np.zeros((most, most, LANES)), np.zeros((most, LANES))
    cross, gain = np.zeros((whole, SIX, LANES)), np.zeros((whole, SIX, LANES))
    low, precision = np.zeros((SIX, SIX, LANES)), np.zeros((SIX, SIX, LANES))
    share = np.zeros(whole)
    share[:size] = corrected
    innovation, whitened = np.zeros((most, LANES)), np.zeros((most, LANES))
    disturbance, accepted, over = np.zeros((most, LANES)), np.zeros(LANES), np.zeros((9, LANES))
    before, has_before = np.zeros((counts.shape[2], most, LANES)), np.zeros(counts.shape[2], dtype=np.bool_)
    tally = np.zeros((counts.shape[2], 5, LANES))
    matrix, vector, psi = np.zeros((size, size)), np.zeros(size), np.zeros(3)
    for begin in range(0, len(state), LANES):
        lanes = min(LANES, len(state) - begin)
        drifts[:], shown[:], tally[:], before[:] = 0.0, 0.0, 0.0, 0.0
        has_before[:] = False
        estimate[:], twin_estimate[:], outcome[:] = 0.0, 0.0, SOUND
        cause[:] = SOUND
        for i in range(LANES):
            n = begin + min(i, lanes - 1)
            sound[i] = True
            for q in range(len(theta)):
                theta[q, i] = equipment[n, q]
            for r in range(9):
                z[r, i] = twin[r, i] = linear[n, r]
            for r in range(4):
                turn[r, i] = state[n, r]
            for r in range(6):
                d[r, i] = state[n, 4 + r] - z[3 + r, i]
            for r in range(3):
                here[r, i] = z[6 + r, i] + d[3 + r, i]
            if drawing:
                draw_normals(seed, samples[n], IMU_STREAM, normals[i])
            if measuring:
                draw_normals(seed, samples[n], MEASUREMENT_STREAM, white_normals[i])
                if drifting:
                    draw_normals(seed, samples[n], CORRELATED_STREAM, drift_normals[i])
                    draw_normals(seed, samples[n], EPOCH_STREAM, epoch_normals[i])
            for b in range(count):
                bias[b, i] = sizes[b] * normals[i, b] if drawing else 0.0
            for r in range(size):
                for c in range(size):
                    p[r, c, i] = initial[r, c]
        bend(constants, places[0], fields[0], gradients[0], here, first)
        reached = 0
        for k in range(steps + 1):
            updated = first_updates[k] < first_updates[k + 1]
            if updated:
                for r in range(6):
                    for i in range(LANES):
                        z[3 + r, i] += d[r, i]
                        d[r, i] = 0.0
            for u in range(first_updates[k], first_updates[k + 1]):
                m, sensor = counts_of[u], sensors[u]
                for i in range(LANES):
                    disturb(
                        begin + min(i, lanes - 1), i, u, m, components, constant_rows, aiding, correlated, memory,
                        white, white_normals, drift_normals, drifts, disturbances, disturbance,
                    )  # fmt: skip
                for c in range(m):
                    shown[components[u, c]] = drifts[components[u, c]]
                correct_twins(
                    m, truth_rows[u], state_rows[u], shared_gains[u], bounds[u], disturbance, innovation, twin,
                    twin_estimate,
                )  # fmt: skip
                innovate_lanes(
                    u, m, constants, kinds, directions, arms, forward, spots, state_rows, turn, z, estimate,
                    disturbance, over, innovation, full,
                )  # fmt: skip
                if own:
                    factor_innovations(
                        p, full, bounds[u], state_rows[u], variances[u], m, cross, root, inverse, outcome
                    )
                    for i in range(LANES):  # what came first, as each brings about the other
                        if cause[i] == SOUND and outcome[i] == INDEFINITE:
                            cause[i] = INDEFINITE if sound[i] else BEYOND
                else:
                    for c in range(m):
                        for e in range(c + 1):
                            root[c, e, :] = shared_roots[u, c, e]
                judge(
                    m, limits[u], root, innovation, whitened, before[sensor], has_before[sensor], tally[sensor],
                    accepted,
                )  # fmt: skip
                has_before[sensor] = True
                if own:
                    invert_innovations(root, inverse, m, low, precision)
                    correct_covariances(
                        p,
                        full,
                        bounds[u],
                        state_rows[u],
                        variances[u],
                        m,
                        share,
                        accepted,
                        cross,
                        precision,
                        gain,
                        left,
                    )
                else:
                    for r in range(size):
                        for c in range(m):
                            for i in range(LANES):
                                gain[r, c, i] = shared_gains[u, r, c] * accepted[i]
                feed_back(m, gain, innovation, turn, z, estimate)
            if updated:
                for i in range(LANES):
                    rotation_vector(turn, i, psi)
                    for r in range(3):
                        z[r, i] = psi[r]
                        here[r, i] = z[6 + r, i]
                bend(constants, places[2 * k], fields[2 * k], gradients[2 * k], here, first)
            if reached < len(epochs) and epochs[reached] == k:
                if epoch_normals.shape[1] > 0:
                    for c in range(len(shown)):
                        kept = faded[reached, c]
                        driven = drift_sigmas[c] * np.sqrt(1.0 - kept * kept)
                        for i in range(LANES):
                            shown[c, i] = kept * shown[c, i] + driven * epoch_normals[i, reached * len(shown) + c]
                for i in range(lanes):
                    n = begin + i
                    rotation_vector(turn, i, psi)
                    for r in range(4):
                        turns[n, reached, r] = turn[r, i]
                    for r in range(6):
                        deviations[n, reached, r] = vector[3 + r] = z[3 + r, i] + d[r, i]
                    for r in range(3):
                        vector[r] = psi[r]
                    for r in range(9):
                        total = 0.0
                        for c in range(9):
                            total += output_maps[reached, r, c] * twin[c, i]
                        predicted[n, reached, r] = total
                    for r in range(size):
                        for c in range(size):
                            matrix[r, c] = p[r, c, i] if own else shared_covariances[reached, r, c]
                    for s in range(states):
                        value = of_states[n, s] - estimate[s, i]
                        if state_biases[s] >= 0:
                            value += bias[state_biases[s], i]
                        if state_drifts[s] >= 0:
                            value += shown[state_drifts[s], i]
                        vector[9 + s] = state_errors[n, reached, s] = value
                        state_variances[n, reached, s] = matrix[9 + s, 9 + s]
                    record_consistency(
                        matrix, vector, corrected, output_maps[reached], nees[n, reached], covariances[n, reached]
                    )
                    for sensor in range(counts.shape[2]):
                        for c in range(5):
                            counts[n, reached, sensor, c] = tally[sensor, c, i]
                tally[:] = 0.0
                reached += 1
            if k == steps:
                break
            if drawing:
                for i in range(LANES):
                    for c in range(width):
                        step_normals[i, c] = normals[i, count + k * width + c]
            elif noisy:
                for i in range(LANES):
                    for r in range(width):
                        drawn[r, i] = added_noise[begin + min(i, lanes - 1), k * width + r]
            _force(k, noisy, theta, inputs, bias, biases, decays, factors, step_normals, drawn, local)
            _advance_twin(k, motion, coupling, local, twin_estimate, twin)
            for r in range(9):
                for i in range(LANES):
                    forced[r, i] = local[r, i]
                for s in range(states):
                    weight = coupling[k, r, s]
                    if weight != 0.0:
                        for i in range(LANES):
                            forced[r, i] -= weight * estimate[s, i]
            _advance(
                k, constants, durations, motion, force, thrust, places, fields, gradients, forced, z, turn, d, first,
                here, scratch, sound,
            )  # fmt: skip
            if own:
                turn_tables(k, motion, thrust, coupling, noise, forced, scratch[0], transition, coupled, added)
                propagate_covariances(k, motion, decay, noise, transition, coupled, added, p, product)
            for s in range(states):
                for i in range(LANES):
                    estimate[s, i] *= decay[k, s]
                    twin_estimate[s, i] *= decay[k, s]
        for i in range(lanes):
            outcomes[begin + i] = BEYOND if cause[i] == SOUND and not sound[i] else cause[i]
