"""Mean and covariance of an aided navigator's true errors from all causes at once.

The deviations y, the filter's estimates e^ and the biases b that drive them (constant errors, Gauss-Markov processes,
random walks, correlated errors of the sensors) are one state of the closed loop of
`mcnav.systems.ins.linear.closed_loop`::

    y' = Phi y - C e^ + B b + noise      e^' = D e^      b' = d b + noise
    n = H y - H_e e^ + H_b b + noise     y+ = y - K_y n  e^+ = e^ + K_e n

so that one recursion of its covariance has what `mcnav.systems.ins.linear.closed_loop.propagate_closed_loop` has by
cause. The mean is the response to the constant errors' mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcnav._types import Array
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.linear.closed_loop import (
    ClosedLoop,
    TrueLoop,
    constant_disturbances,
    gauss_markov,
    true_loop,
)
from mcnav.systems.ins.linear.covariance import constant_inputs, map_covariances, output_map, process_systems
from mcnav.systems.ins.linear.recursions import ReadingTimes, StepNoise, Steps, run_covariance, run_responses
from mcnav.systems.ins.sensors.measurements import flexure_rows, rate_error, white_sigmas


@dataclass(frozen=True)
class ClosedLoopCovariance:
    """Errors of an aided navigator at m readings.

    Attributes
    ----------
    loop : ClosedLoop
    maps : ndarray, shape (m, 9, 9)
        From psi, v, x to the outputs.
    mean : ndarray, shape (m, 9)
        Of the outputs.
    true, own : ndarray, shape (m, 9, 9)
        Covariance of the outputs, and as the filter states it.
    """

    loop: ClosedLoop
    maps: Array
    mean: Array
    true: Array
    own: Array


@dataclass(frozen=True)
class _Biases:
    """Biases, n of them, over K steps and U updates.

    Attributes
    ----------
    response : ndarray, shape (K, 9, n)
        Of psi, v, x.
    decay : ndarray, shape (K, n)
        What is left at the end of a step.
    cross, noise, paired : ndarray, shape (K, 9, n), (K, n), (K, n)
        Covariance with psi, v, x, variance, and covariance with the bias before, that a step adds.
    rows : ndarray, shape (U, M, n)
        Responses of the innovations.
    initial : ndarray, shape (9 + n, 9 + n)
        Covariance of psi, v, x and the biases at the start.
    white : ndarray, shape (K, 9, 9)
        Covariance of psi, v, x that all processes add in a step.
    """

    response: Array
    decay: Array
    cross: Array
    noise: Array
    paired: Array
    rows: Array
    initial: Array
    white: Array


def propagate_covariance(
    loop: ClosedLoop, mean: Array, sources: Array, shared: ClosedLoopCovariance | None = None
) -> ClosedLoopCovariance:
    """Propagate mean and covariance of the true errors to the loop's ``own_at``, after the updates there.

    Parameters
    ----------
    mean, sources : ndarray, shapes (s,), (s, s)
        Mean and covariance of the constant sources: those of the instruments, then those of aiding.
    shared : ClosedLoopCovariance, optional
        Covariance of another loop, whose maps are taken over where they hold.
    """
    readings = ReadingTimes(loop.own_at, np.ones(len(loop.own_at), dtype=np.bool_))
    biases, true = _biases(loop, sources), true_loop(loop)
    variances = white_sigmas(loop.sensors, loop.measurements) ** 2
    states = len(loop.filter.constants)
    size = NAVIGATION + states + biases.response.shape[2]
    start, kept = np.zeros((size, size)), np.r_[0:NAVIGATION, NAVIGATION + states : size]
    start[np.ix_(kept, kept)] = biases.initial
    covariance = run_covariance(
        Steps(
            np.concatenate([true.steps.rows, biases.response], axis=2),
            np.concatenate([true.steps.decay, biases.decay], axis=1),
        ),
        StepNoise(
            biases.white, *(_after_zeros(states, each) for each in (biases.cross, biases.noise, biases.paired))
        ),
        true.updates._replace(rows=np.concatenate([true.updates.rows, biases.rows], axis=2)),
        variances, true.gains, start, readings, NAVIGATION,
    )  # fmt: skip
    if shared is not None and shared.loop.responses is loop.responses and shared.loop.own_at is loop.own_at:
        maps = shared.maps
    else:
        maps = np.stack([output_map(loop.truth, float(time)) for time in loop.times[loop.own_at]])
    own, means = loop.own[:, :NAVIGATION, :NAVIGATION], (maps @ _propagate_mean(loop, true, mean, readings))[:, :, 0]
    return ClosedLoopCovariance(loop, maps, means, map_covariances(maps, covariance), map_covariances(maps, own))


def _after_zeros(count: int, table: Array) -> Array:
    """Return a table with zeros of so many states before its last axis."""
    return np.concatenate([np.zeros((*table.shape[:-1], count)), table], axis=-1)


def _propagate_mean(loop: ClosedLoop, true: TrueLoop, mean: Array, readings: ReadingTimes) -> Array:
    """Compute the mean of psi, v, x at readings, shape (m, 9, 1), from that of the constant sources, and by faults."""
    faults = loop.measurements.faults[:, :, None]
    if not mean.any() and not faults.any():
        return np.zeros((len(readings.numbers), NAVIGATION, 1))
    inputs, disturbances = constant_disturbances(loop)
    start = np.zeros((NAVIGATION + len(loop.filter.constants), 1))
    start[:NAVIGATION, 0] = np.linalg.solve(output_map(loop.truth, float(loop.times[0])), mean[:NAVIGATION])
    together = mean[:, None]
    return run_responses(
        true.steps, inputs @ together, true.updates, disturbances @ together - faults, true.gains, start, readings
    )[:, :NAVIGATION]


def _biases(loop: ClosedLoop, sources: Array) -> _Biases:
    """Collect the biases: constant errors that have a variance, processes that are biases, correlated errors."""
    steps, durations, fixed = len(loop.transition), np.diff(loop.times), len(CONSTANTS)
    sized = np.flatnonzero(np.diag(sources) > 0.0).tolist()
    constants = [number for number in sized if number >= len(OUTPUTS)]
    imu, responses = loop.imu, loop.responses
    gyro, accelerometer = (replace(each, random_walk=np.zeros(3)) for each in (imu.gyro, imu.accelerometer))
    quiet = Imu(gyro, accelerometer, imu.gravity)
    systems = process_systems(responses, quiet)
    driving = {name: system for name, system in systems.items() if system[0].any()}
    swings = loop.measurements.swings
    components = [component for sensor in loop.sensors for component in sensor.components]
    correlated = [number for number, component in enumerate(components) if component.correlated > 0.0]
    flexures = [
        (number, sensor.flexure, axis)
        for number, sensor in enumerate(loop.sensors)
        if sensor.flexure is not None
        for axis in sensor.flexure.axes
    ]
    alone, first = len(constants) + len(driving) + len(correlated), len(constants)
    count = alone + 2 * len(flexures)
    response, decay = np.zeros((steps, NAVIGATION, count)), np.ones((steps, count))
    cross, noise, paired = np.zeros((steps, NAVIGATION, count)), np.zeros((steps, count)), np.zeros((steps, count))
    rows = np.zeros((*loop.measurements.components.shape, count))
    initial = np.zeros((NAVIGATION + count,) * 2)
    inputs = constant_inputs(responses)
    for place, number in enumerate(constants):
        if number < fixed:
            response[:, :, place] = inputs[:, :, number - len(OUTPUTS)]
            if number - len(OUTPUTS) < swings.shape[2]:
                rows[:, :, place] = swings[:, :, number - len(OUTPUTS)]
        else:
            rows[:, :, place] = loop.measurements.constants[:, :, number - fixed]
    for place, (name, (over, added, variance)) in enumerate(driving.items(), first):
        if swings.size and rate_error(name) >= 0:
            rows[:, :, place] = swings[:, :, rate_error(name)]
        response[:, :, place], decay[:, place] = over[:, :NAVIGATION], over[:, NAVIGATION]
        cross[:, :, place], noise[:, place] = added[:, NAVIGATION, :NAVIGATION], added[:, NAVIGATION, NAVIGATION]
        initial[NAVIGATION + place, NAVIGATION + place] = variance
    for place, number in enumerate(correlated, first + len(driving)):
        component = components[number]
        rows[:, :, place] = -1.0 * (loop.measurements.components == number)
        decay[:, place], noise[:, place] = gauss_markov(component, durations)
        initial[NAVIGATION + place, NAVIGATION + place] = component.correlated**2
    since = loop.times - loop.times[0]
    for place, (number, flexure, axis) in zip(range(alone, count, 2), flexures, strict=True):
        pair, within = slice(place, place + 2), slice(NAVIGATION + place, NAVIGATION + place + 2)
        rows[:, :, pair] = flexure_rows(loop.measurements, number, flexure, axis, float(loop.times[0]))
        decay[:, pair] = flexure.decay(durations)[:, None]
        added = flexure.sigma[axis] ** 2 * flexure.noise(since)
        noise[:, place], noise[:, place + 1], paired[:, place + 1] = added[:, 0, 0], added[:, 1, 1], added[:, 1, 0]
        initial[within, within] = flexure.sigma[axis] ** 2 * flexure.covariance(since[:1])[0]
    given = np.r_[0 : len(OUTPUTS), constants].astype(np.int64)
    to_state = np.eye(len(given))
    to_state[:NAVIGATION, :NAVIGATION] = np.linalg.inv(output_map(loop.truth, float(loop.times[0])))
    initial[: len(given), : len(given)] = to_state @ sources[np.ix_(given, given)] @ to_state.T
    white = np.zeros((steps, NAVIGATION, NAVIGATION))
    for axis in range(3):
        white += imu.gyro.random_walk[axis] ** 2 * responses.gyro_white[:, axis]
        white[:, 3:, 3:] += imu.accelerometer.random_walk[axis] ** 2 * responses.accelerometer_white[:, axis]
    for _, added, _ in systems.values():
        white += added[:, :NAVIGATION, :NAVIGATION]
    return _Biases(response, decay, cross, noise, paired, rows, initial, white)
