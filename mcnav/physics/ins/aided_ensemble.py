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
from mcnav.physics.ins.instruments import CONSTANTS
from mcnav.physics.ins.measurements import (
    ALTITUDE,
    BODY_VELOCITY,
    HEADING,
    POSITION,
    VELOCITY,
    altitude_change,
    fill_row,
    heading_change,
    innovate,
)
from mcnav.physics.ins.noise import IMU_STREAM, draw_normals
from mcnav.physics.jit import compiled, uncontracted

MEASUREMENT_STREAM: Final = 2
"""Stream of the measurements' white noise."""

CORRELATED_STREAM: Final = 3
"""Stream of the measurements' correlated errors."""

EPOCH_STREAM: Final = 4
"""Stream of the correlated errors' change from the last measurement to an epoch."""

SIX: Final = 6
"""Components of the largest measurement, and states that are added up together."""

SOUND, BEYOND, INDEFINITE = 0, 1, 2
"""Outcomes of a sample: good; beyond the validity of the scheme; a covariance that is not positive definite."""


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


@uncontracted
def _quadratic(matrix: Array, vector: Array, begin: int, end: int, root: Array, out: Array) -> float:
    """Compute ``e^T P^-1 e`` of a block by Cholesky's method; states without variance count nothing."""
    total = 0.0
    for i in range(begin, end):
        value = vector[i]
        for c in range(begin, i):
            value -= root[i, c] * out[c]
        pivot = matrix[i, i]
        for c in range(begin, i):
            pivot -= root[i, c] * root[i, c]
        if pivot <= 1e-14 * matrix[i, i]:
            out[i] = 0.0
            for j in range(i, end):
                root[j, i] = 0.0
            continue
        diagonal = np.sqrt(pivot)
        for j in range(i + 1, end):
            entry = matrix[j, i]
            for c in range(begin, i):
                entry -= root[j, c] * root[i, c]
            root[j, i] = entry / diagonal
        out[i] = value / diagonal
        total += out[i] * out[i]
    return total


@uncontracted
def _rotation_vector(turn: Array, i: int, out: Array) -> None:
    """Compute the rotation vector of a quaternion."""
    b, c, e = turn[1, i], turn[2, i], turn[3, i]
    sine = np.sqrt(b * b + c * c + e * e)
    factor = 2.0
    if sine > 0.0:
        factor = 2.0 * np.arctan2(sine, turn[0, i]) / sine
    out[0], out[1], out[2] = factor * b, factor * c, factor * e


@compiled
def _turn_block(over: Array, block: Array, half: Array, out: Array) -> None:
    """Compute ``R B R^T`` of a block, shape (3, 3), with R - I of each lane: shape (3, 3, LANES)."""
    for r in range(3):
        for c in range(3):
            x, y, z = block[0, c], block[1, c], block[2, c]
            for i in range(LANES):
                half[r, c, i] = block[r, c] + (over[3 * r, i] * x + over[3 * r + 1, i] * y + over[3 * r + 2, i] * z)
    for r in range(3):
        for c in range(3):
            for i in range(LANES):
                out[r, c, i] = half[r, c, i] + (
                    half[r, 0, i] * over[3 * c, i]
                    + half[r, 1, i] * over[3 * c + 1, i]
                    + half[r, 2, i] * over[3 * c + 2, i]
                )


@compiled
def _turn_tables(
    k: int, motion: Array, thrust: Array, coupling: Array, noise: Array, local: Array, over: Array, transition: Array,
    coupled: Array, added: Array,
) -> None:  # fmt: skip
    """Turn a step's tables to the attitude and the force that each sample indicates."""
    states = coupling.shape[2]
    block = np.empty((3, 3, LANES))
    for half in range(2):
        _turn_block(over, motion[k, 3 * half : 3 * half + 3, :3], block, transition[3 * half : 3 * half + 3])
        fx, fy, fz = thrust[k, 3 * half], thrust[k, 3 * half + 1], thrust[k, 3 * half + 2]
        share = 0.5 if half == 0 else 1.0 / 3.0
        for i in range(LANES):
            ax, ay, az = local[0, i], local[1, i], local[2, i]
            ux = local[3 + 3 * half, i] - share * (ay * fz - az * fy)
            uy = local[4 + 3 * half, i] - share * (az * fx - ax * fz)
            uz = local[5 + 3 * half, i] - share * (ax * fy - ay * fx)
            transition[3 * half, 1, i] += uz
            transition[3 * half, 2, i] -= uy
            transition[3 * half + 1, 0, i] -= uz
            transition[3 * half + 1, 2, i] += ux
            transition[3 * half + 2, 0, i] += uy
            transition[3 * half + 2, 1, i] -= ux
    for row in range(3):
        for column in range(row + 1):
            _turn_block(
                over, noise[k, 3 * row : 3 * row + 3, 3 * column : 3 * column + 3], block,
                added[3 * row : 3 * row + 3, 3 * column : 3 * column + 3],
            )  # fmt: skip
    for s in range(states):
        for row in range(3):
            x, y, z = coupling[k, 3 * row, s], coupling[k, 3 * row + 1, s], coupling[k, 3 * row + 2, s]
            a, b, c = noise[k, 3 * row, 9 + s], noise[k, 3 * row + 1, 9 + s], noise[k, 3 * row + 2, 9 + s]
            for r in range(3):
                at = 3 * row + r
                one, other = coupling[k, at, s], noise[k, at, 9 + s]
                for i in range(LANES):
                    u, v, w = over[3 * r, i], over[3 * r + 1, i], over[3 * r + 2, i]
                    coupled[at, s, i] = one + (u * x + v * y + w * z)
                    added[9 + s, at, i] = other + (u * a + v * b + w * c)


@compiled
def _propagate(
    k: int, motion: Array, decay: Array, noise: Array, transition: Array, coupled: Array, added: Array, p: Array,
    product: Array,
) -> None:  # fmt: skip
    """Take the filters' covariances over a step.

    The other states are padded to a multiple of six, with zeros: a loop over the lanes costs more than its products.
    """
    size = len(p)
    states, others = decay.shape[1], size - 9
    for r in range(9):
        for j in range(size):
            if r < 3:
                for i in range(LANES):
                    product[r, j, i] = p[r, j, i]
            else:
                a, b, c = motion[k, r - 3, 3], motion[k, r - 3, 4], motion[k, r - 3, 5]
                d, e, f = motion[k, r - 3, 6], motion[k, r - 3, 7], motion[k, r - 3, 8]
                for i in range(LANES):
                    product[r, j, i] = (
                        transition[r - 3, 0, i] * p[0, j, i]
                        + transition[r - 3, 1, i] * p[1, j, i]
                        + transition[r - 3, 2, i] * p[2, j, i]
                        + (a * p[3, j, i] + b * p[4, j, i] + c * p[5, j, i])
                        + (d * p[6, j, i] + e * p[7, j, i] + f * p[8, j, i])
                    )
            for s in range(0, others, SIX):
                for i in range(LANES):
                    product[r, j, i] += (
                        coupled[r, s, i] * p[9 + s, j, i]
                        + coupled[r, s + 1, i] * p[10 + s, j, i]
                        + coupled[r, s + 2, i] * p[11 + s, j, i]
                    ) + (
                        coupled[r, s + 3, i] * p[12 + s, j, i]
                        + coupled[r, s + 4, i] * p[13 + s, j, i]
                        + coupled[r, s + 5, i] * p[14 + s, j, i]
                    )
    for r in range(9):
        for j in range(r + 1):
            if j < 3:
                for i in range(LANES):
                    p[r, j, i] = added[r, j, i] + product[r, j, i]
            else:
                a, b, c = motion[k, j - 3, 3], motion[k, j - 3, 4], motion[k, j - 3, 5]
                d, e, f = motion[k, j - 3, 6], motion[k, j - 3, 7], motion[k, j - 3, 8]
                for i in range(LANES):
                    p[r, j, i] = (
                        added[r, j, i]
                        + (
                            product[r, 0, i] * transition[j - 3, 0, i]
                            + product[r, 1, i] * transition[j - 3, 1, i]
                            + product[r, 2, i] * transition[j - 3, 2, i]
                        )
                        + (a * product[r, 3, i] + b * product[r, 4, i] + c * product[r, 5, i])
                        + (d * product[r, 6, i] + e * product[r, 7, i] + f * product[r, 8, i])
                    )
            for s in range(0, others, SIX):
                for i in range(LANES):
                    p[r, j, i] += (
                        product[r, 9 + s, i] * coupled[j, s, i]
                        + product[r, 10 + s, i] * coupled[j, s + 1, i]
                        + product[r, 11 + s, i] * coupled[j, s + 2, i]
                    ) + (
                        product[r, 12 + s, i] * coupled[j, s + 3, i]
                        + product[r, 13 + s, i] * coupled[j, s + 4, i]
                        + product[r, 14 + s, i] * coupled[j, s + 5, i]
                    )
            for i in range(LANES):
                p[j, r, i] = p[r, j, i]
        for s in range(states):
            weight = decay[k, s]
            for i in range(LANES):
                p[9 + s, r, i] = p[r, 9 + s, i] = weight * product[r, 9 + s, i] + added[9 + s, r, i]
    for s in range(states):
        for e in range(s + 1):
            weight, more = decay[k, s] * decay[k, e], noise[k, 9 + s, 9 + e]
            for i in range(LANES):
                p[9 + s, 9 + e, i] = p[9 + e, 9 + s, i] = weight * p[9 + s, 9 + e, i] + more


@compiled
def _project(p: Array, full: Array, bounds: IndexArray, state_rows: Array, m: int, cross: Array) -> None:
    """Add ``P H^T`` to ``cross``, shape (size, M, LANES); rows of H are in blocks of three."""
    for r in range(len(p)):
        for c in range(m):
            for j in range(bounds[c, 0], bounds[c, 1], 3):
                for i in range(LANES):
                    cross[r, c, i] += (
                        p[r, j, i] * full[c, j, i]
                        + p[r, j + 1, i] * full[c, j + 1, i]
                        + p[r, j + 2, i] * full[c, j + 2, i]
                    )
            for s in range(state_rows.shape[1]):
                weight = state_rows[c, s]
                if weight != 0.0:
                    for i in range(LANES):
                        cross[r, c, i] += p[r, 9 + s, i] * weight


@compiled
def _factor_innovations(
    p: Array, full: Array, bounds: IndexArray, state_rows: Array, variances: Array, m: int, cross: Array, root: Array,
    inverse: Array, outcome: IndexArray,
) -> None:  # fmt: skip
    """Compute ``P H^T`` and the Cholesky factor of the innovations' covariance, with its diagonal inverted."""
    for r in range(len(p)):
        for c in range(cross.shape[1]):
            for i in range(LANES):
                cross[r, c, i] = 0.0
    _project(p, full, bounds, state_rows, m, cross)
    for c in range(m):
        for e in range(c + 1):
            for i in range(LANES):
                root[c, e, i] = variances[c] if c == e else 0.0
            for j in range(bounds[c, 0], bounds[c, 1], 3):
                for i in range(LANES):
                    root[c, e, i] += (
                        full[c, j, i] * cross[j, e, i]
                        + full[c, j + 1, i] * cross[j + 1, e, i]
                        + full[c, j + 2, i] * cross[j + 2, e, i]
                    )
            for s in range(state_rows.shape[1]):
                weight = state_rows[c, s]
                if weight != 0.0:
                    for i in range(LANES):
                        root[c, e, i] += weight * cross[9 + s, e, i]
            for j in range(e):
                for i in range(LANES):
                    root[c, e, i] -= root[c, j, i] * root[e, j, i]
            if c > e:
                for i in range(LANES):
                    root[c, e, i] *= inverse[e, i]
        for i in range(LANES):
            if not root[c, c, i] > 0.0:
                outcome[i] = INDEFINITE
                root[c, c, i] = 1.0
            root[c, c, i] = np.sqrt(root[c, c, i])
            inverse[c, i] = 1.0 / root[c, c, i]


@compiled
def _invert(root: Array, inverse: Array, m: int, low: Array, s: Array) -> None:
    """Invert ``L L^T``, shape (m, m, LANES), given the inverted diagonal of L; s is padded with zeros."""
    s[:] = 0.0
    for c in range(m):
        for i in range(LANES):
            low[c, c, i] = inverse[c, i]
        for r in range(c + 1, m):
            for i in range(LANES):
                low[r, c, i] = 0.0
            for j in range(c, r):
                for i in range(LANES):
                    low[r, c, i] -= root[r, j, i] * low[j, c, i]
            for i in range(LANES):
                low[r, c, i] *= inverse[r, i]
    for r in range(m):
        for c in range(r + 1):
            for j in range(r, m):
                for i in range(LANES):
                    s[r, c, i] += low[j, r, i] * low[j, c, i]
            for i in range(LANES):
                s[c, r, i] = s[r, c, i]


@compiled
def _correct(
    p: Array, full: Array, bounds: IndexArray, state_rows: Array, variances: Array, m: int, corrected: Array,
    accepted: Array, cross: Array, s: Array, gain: Array, left: Array,
) -> None:  # fmt: skip
    """Compute the gains and the covariance after an update, in Joseph's form, with the inverse s of the innovations'.

    Components are padded to six, which is the most that a sensor has, with zeros.
    """
    size = len(p)
    for r in range(size):
        share = corrected[r]
        for c in range(SIX):
            for i in range(LANES):
                gain[r, c, i] = (share * accepted[i]) * (
                    (cross[r, 0, i] * s[0, c, i] + cross[r, 1, i] * s[1, c, i] + cross[r, 2, i] * s[2, c, i])
                    + (cross[r, 3, i] * s[3, c, i] + cross[r, 4, i] * s[4, c, i] + cross[r, 5, i] * s[5, c, i])
                )
    for r in range(size):
        for j in range(size):
            for i in range(LANES):
                left[r, j, i] = p[r, j, i] - (
                    (gain[r, 0, i] * cross[j, 0, i] + gain[r, 1, i] * cross[j, 1, i] + gain[r, 2, i] * cross[j, 2, i])
                    + (gain[r, 3, i] * cross[j, 3, i] + gain[r, 4, i] * cross[j, 4, i] + gain[r, 5, i] * cross[j, 5, i])
                )
    for r in range(size):
        for c in range(m):
            weight = -variances[c]
            for i in range(LANES):
                cross[r, c, i] = weight * gain[r, c, i]
    _project(left, full, bounds, state_rows, m, cross)
    for r in range(size):
        for j in range(r + 1):
            for i in range(LANES):
                p[r, j, i] = p[j, r, i] = left[r, j, i] - (
                    (cross[r, 0, i] * gain[j, 0, i] + cross[r, 1, i] * gain[j, 1, i] + cross[r, 2, i] * gain[j, 2, i])
                    + (cross[r, 3, i] * gain[j, 3, i] + cross[r, 4, i] * gain[j, 4, i] + cross[r, 5, i] * gain[j, 5, i])
                )


@compiled
def _disturb(
    n: int, i: int, u: int, m: int, components: IndexArray, constant_rows: Array, aiding: Array, correlated: Array,
    memory: Array, white: Array, white_normals: Array, drift_normals: Array, drifts: Array, given: Array,
    disturbance: Array,
) -> None:  # fmt: skip
    """Compute the errors of an update's measurements: drawn, or given, and those of constant errors."""
    most = components.shape[1]
    for c in range(m):
        if given.shape[1] > 0:
            value = given[n, u * most + c]
        else:
            value = white[u, c] * white_normals[i, u * most + c]
            if correlated[u, c] > 0.0:
                at, kept = components[u, c], memory[u, c]
                driven = correlated[u, c] * np.sqrt(1.0 - kept * kept)
                drifts[at, i] = kept * drifts[at, i] + driven * drift_normals[i, u * most + c]
                value += drifts[at, i]
        for a in range(aiding.shape[1]):
            value -= constant_rows[u, c, a] * aiding[n, a]
        disturbance[c, i] = value


@compiled
def _correct_twin(
    m: int, rows: Array, state_rows: Array, gains: Array, bounds: IndexArray, disturbance: Array, innovation: Array,
    twin: Array, estimate: Array,
) -> None:  # fmt: skip
    """Update the linear samples with the gains along the truth."""
    states = len(estimate)
    for c in range(m):
        for i in range(LANES):
            innovation[c, i] = -disturbance[c, i]
        for j in range(bounds[c, 0], bounds[c, 1]):
            weight = rows[c, j]
            for i in range(LANES):
                innovation[c, i] += weight * twin[j, i]
        for s in range(states):
            weight = state_rows[c, s]
            if weight != 0.0:
                for i in range(LANES):
                    innovation[c, i] -= weight * estimate[s, i]
    for c in range(m):
        for j in range(9):
            weight = gains[j, c]
            for i in range(LANES):
                twin[j, i] -= weight * innovation[c, i]
        for s in range(states):
            weight = gains[9 + s, c]
            for i in range(LANES):
                estimate[s, i] += weight * innovation[c, i]


@compiled
def _innovate_of_antenna(
    direction: Array, arm: Array, spin: float, of_velocity: bool, over: Array, z: Array, innovation: Array, full: Array
) -> None:
    """Compute what `innovate` and `fill_row` do for a position or a velocity, of all lanes at once.

    Parameters
    ----------
    innovation : ndarray, shape (LANES,)
    full : ndarray, shape (9, LANES)
    """
    dx, dy, dz = direction[0], direction[1], direction[2]
    first = 3 if of_velocity else 6
    for i in range(LANES):
        innovation[i] = dx * z[first, i] + dy * z[first + 1, i] + dz * z[first + 2, i]
        full[first, i], full[first + 1, i], full[first + 2, i] = dx, dy, dz
    if of_velocity:
        for i in range(LANES):
            innovation[i] += spin * (dx * z[7, i] - dy * z[6, i])
            full[6, i], full[7, i], full[8, i] = -spin * dy, spin * dx, 0.0
    ax, ay, az = arm[0], arm[1], arm[2]
    if ax == 0.0 and ay == 0.0 and az == 0.0:
        return
    if not of_velocity:
        for r in range(3, 6):
            for i in range(LANES):
                full[r, i] = 0.0
    for i in range(LANES):
        lx = over[0, i] * ax + over[1, i] * ay + over[2, i] * az
        ly = over[3, i] * ax + over[4, i] * ay + over[5, i] * az
        lz = over[6, i] * ax + over[7, i] * ay + over[8, i] * az
        innovation[i] += dx * lx + dy * ly + dz * lz
        full[0, i] = (ay + ly) * dz - (az + lz) * dy
        full[1, i] = (az + lz) * dx - (ax + lx) * dz
        full[2, i] = (ax + lx) * dy - (ay + ly) * dx


@compiled
def _innovate_lane(
    i: int, kind: int, constants: Array, direction: Array, arm: Array, forward: Array, place: Array, turn: Array,
    turns: Array, z: Array, innovation: Array, full: Array,
) -> None:  # fmt: skip
    """Compute the innovation of another component, and its response to errors, of one lane."""
    psi, velocity, away, there, row = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(9)
    over, turned = np.zeros((3, 3)), np.zeros((3, 3))
    spin = constants[3]
    _rotation_vector(turn, i, psi)
    for r in range(3):
        for c in range(3):
            over[r, c] = turns[3 * r + c, i]
            turned[r, c] = over[r, c] + (1.0 if r == c else 0.0)
        velocity[r], away[r], there[r] = z[3 + r, i], z[6 + r, i], arm[r]
    if kind == BODY_VELOCITY:  # the navigator's own velocity over the earth
        there[0] += velocity[0] + spin * away[1]
        there[1] += velocity[1] - spin * away[0]
        there[2] += velocity[2]
    fill_row(kind, direction, there, spin, turned, row)
    for j in range(9):
        full[j, i] = row[j]
    if kind == ALTITUDE:
        innovation[i] = altitude_change(constants, place, away)
    elif kind == HEADING:
        innovation[i] = heading_change(forward, over, arm, away)
    else:
        innovation[i] = innovate(kind, direction, arm, spin, over, psi, velocity, away)


@compiled
def _innovate(
    u: int, m: int, constants: Array, kinds: IndexArray, directions: Array, arms: Array, forward: Array, spots: Array,
    state_rows: Array, turn: Array, z: Array, estimate: Array, disturbance: Array, over: Array, innovation: Array,
    full: Array,
) -> None:  # fmt: skip
    """Compute the innovations of the samples and their responses to errors, about each sample's own attitude."""
    for i in range(LANES):
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        over[0, i], over[4, i], over[8, i] = -2.0 * (c * c + e * e), -2.0 * (b * b + e * e), -2.0 * (b * b + c * c)
        over[1, i], over[2, i] = 2.0 * (b * c - a * e), 2.0 * (b * e + a * c)
        over[3, i], over[5, i] = 2.0 * (b * c + a * e), 2.0 * (c * e - a * b)
        over[6, i], over[7, i] = 2.0 * (b * e - a * c), 2.0 * (c * e + a * b)
    for q in range(m):
        kind = kinds[u, q]
        if kind in (POSITION, VELOCITY):
            _innovate_of_antenna(
                directions[u, q], arms[u, q], constants[3], kind == VELOCITY, over, z, innovation[q], full[q]
            )
        else:
            for i in range(LANES):
                _innovate_lane(
                    i, kind, constants, directions[u, q], arms[u, q], forward[u], spots[u], turn, over, z,
                    innovation[q], full[q],
                )  # fmt: skip
        for s in range(len(estimate)):
            weight = state_rows[u, q, s]
            if weight != 0.0:
                for i in range(LANES):
                    innovation[q, i] -= weight * estimate[s, i]
        for i in range(LANES):
            innovation[q, i] -= disturbance[q, i]


@compiled
def _judge(
    m: int, limit: float, root: Array, innovation: Array, whitened: Array, before: Array, has_before: bool,
    tally: Array, accepted: Array,
) -> None:  # fmt: skip
    """Normalize the innovations of a sensor, count them, and accept or reject the measurement."""
    normalized = np.zeros(LANES)
    for c in range(m):
        for i in range(LANES):
            value = innovation[c, i]
            for e in range(c):
                value -= root[c, e, i] * whitened[e, i]
            whitened[c, i] = value / root[c, c, i]
            normalized[i] += whitened[c, i] * whitened[c, i]
    for i in range(LANES):
        accepted[i] = 1.0 if normalized[i] <= limit else 0.0
        tally[0, i] += normalized[i]
        tally[1, i] += accepted[i]
        tally[2, i] += 1.0 - accepted[i]
        if has_before:
            value = 0.0
            for c in range(m):
                value += whitened[c, i] * before[c, i]
            tally[3, i] += value / m
            tally[4, i] += 1.0
        for c in range(m):
            before[c, i] = whitened[c, i]


@compiled
def _feed_back(m: int, gain: Array, innovation: Array, turn: Array, z: Array, estimate: Array) -> None:
    """Correct the navigators, and the estimates of the other states."""
    psi, velocity, away = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(LANES):
        for r in range(3):
            psi[r] = velocity[r] = away[r] = 0.0
            for c in range(m):
                psi[r] += gain[r, c, i] * innovation[c, i]
                velocity[r] += gain[3 + r, c, i] * innovation[c, i]
                away[r] += gain[6 + r, c, i] * innovation[c, i]
        for r in range(3):
            z[3 + r, i] -= velocity[r]
            z[6 + r, i] -= away[r]
        angle = np.sqrt(psi[0] * psi[0] + psi[1] * psi[1] + psi[2] * psi[2])
        sine = -0.5
        if angle > 0.0:
            sine = -np.sin(0.5 * angle) / angle
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        w, x, y, v = np.cos(0.5 * angle), sine * psi[0], sine * psi[1], sine * psi[2]
        turn[0, i] = w * a - (x * b + y * c + v * e)
        turn[1, i] = w * b + (x * a + y * e - v * c)
        turn[2, i] = w * c + (y * a + v * b - x * e)
        turn[3, i] = w * e + (v * a + x * c - y * b)
    for s in range(len(estimate)):
        for c in range(m):
            for i in range(LANES):
                estimate[s, i] += gain[9 + s, c, i] * innovation[c, i]


@compiled
def _record(
    matrix: Array, vector: Array, corrected: Array, to_outputs: Array, nees: Array, covariance: Array,
) -> None:  # fmt: skip
    """Record the covariance of the outputs and the normalized errors squared of one sample at an epoch.

    Parameters
    ----------
    matrix : ndarray, shape (9 + q, 9 + q)
    vector : ndarray, shape (9 + q,)
        Errors of all states.
    """
    size = len(vector)
    estimated, low, solved = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
    mapped, half, errors, kept_errors = np.zeros((9, 9)), np.zeros((9, 9)), np.zeros(9), vector.copy()
    kept = 0
    for r in range(size):
        if r < 9 or corrected[r] > 0.0:
            other = 0
            for c in range(r + 1):
                if c < 9 or corrected[c] > 0.0:
                    estimated[kept, other] = matrix[r, c]
                    other += 1
            kept_errors[kept] = vector[r]
            kept += 1
    nees[0] = _quadratic(estimated, kept_errors, 0, kept, low, solved)
    nees[1] = _quadratic(estimated, kept_errors, 0, 9, low, solved)
    nees[5] = _quadratic(estimated, kept_errors, 9, kept, low, solved)
    for r in range(9):
        for c in range(9):
            value = 0.0
            for j in range(9):
                value += to_outputs[r, j] * matrix[j, c]
            half[r, c] = value
            errors[r] += to_outputs[r, c] * vector[c]
    place = 0
    for r in range(9):
        for c in range(r + 1):
            value = 0.0
            for j in range(9):
                value += half[r, j] * to_outputs[c, j]
            mapped[r, c] = covariance[place] = value
            place += 1
    for group in range(3):
        nees[2 + group] = _quadratic(mapped, errors, 3 * group, 3 * group + 3, low, solved)


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
    outcome = np.zeros(LANES, dtype=np.int64)
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
                    _disturb(
                        begin + min(i, lanes - 1), i, u, m, components, constant_rows, aiding, correlated, memory,
                        white, white_normals, drift_normals, drifts, disturbances, disturbance,
                    )  # fmt: skip
                for c in range(m):
                    shown[components[u, c]] = drifts[components[u, c]]
                _correct_twin(
                    m, truth_rows[u], state_rows[u], shared_gains[u], bounds[u], disturbance, innovation, twin,
                    twin_estimate,
                )  # fmt: skip
                _innovate(
                    u, m, constants, kinds, directions, arms, forward, spots, state_rows, turn, z, estimate,
                    disturbance, over, innovation, full,
                )  # fmt: skip
                if own:
                    _factor_innovations(
                        p, full, bounds[u], state_rows[u], variances[u], m, cross, root, inverse, outcome
                    )
                else:
                    for c in range(m):
                        for e in range(c + 1):
                            root[c, e, :] = shared_roots[u, c, e]
                _judge(
                    m, limits[u], root, innovation, whitened, before[sensor], has_before[sensor], tally[sensor],
                    accepted,
                )  # fmt: skip
                has_before[sensor] = True
                if own:
                    _invert(root, inverse, m, low, precision)
                    _correct(
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
                _feed_back(m, gain, innovation, turn, z, estimate)
            if updated:
                for i in range(LANES):
                    _rotation_vector(turn, i, psi)
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
                    _rotation_vector(turn, i, psi)
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
                    _record(matrix, vector, corrected, output_maps[reached], nees[n, reached], covariances[n, reached])
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
                _turn_tables(k, motion, thrust, coupling, noise, forced, scratch[0], transition, coupled, added)
                _propagate(k, motion, decay, noise, transition, coupled, added, p, product)
            for s in range(states):
                for i in range(LANES):
                    estimate[s, i] *= decay[k, s]
                    twin_estimate[s, i] *= decay[k, s]
        for i in range(lanes):
            outcomes[begin + i] = outcome[i] if sound[i] else BEYOND
