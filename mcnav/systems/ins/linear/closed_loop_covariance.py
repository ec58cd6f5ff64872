"""Mean and covariance of an aided navigator's true errors from all causes at once.

The deviations y, the filter's estimates e^ and the biases b that drive them (constant errors, Gauss-Markov processes,
random walks, correlated errors of the sensors) are one state of the closed loop of
`mcnav.systems.ins.linear.closed_loop`::

    y' = Phi y - C e^ + B b + noise      e^' = D e^      b' = d b + noise
    n = H y - H_e e^ + H_b b + noise     y+ = y - K_y n  e^+ = e^ + K_e n

so that one recursion of its covariance has what `mcnav.systems.ins.linear.closed_loop.propagate_closed_loop` has by
cause.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.covariance import constant_inputs, map_covariances, output_map, process_systems
from mcnav.systems.ins.sensors.measurements import rate_error


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
    cross, noise : ndarray, shape (K, 9, n), (K, n)
        Covariance with psi, v, x, and variance, that a step adds.
    rows : ndarray, shape (U, M, n)
        Responses of the innovations.
    mean, initial : ndarray, shapes (9 + n,), (9 + n, 9 + n)
        Mean and covariance of psi, v, x and the biases at the start.
    white : ndarray, shape (K, 9, 9)
        Covariance of psi, v, x that all processes add in a step.
    """

    response: Array
    decay: Array
    cross: Array
    noise: Array
    rows: Array
    mean: Array
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
    readings = loop.own_at
    tables, measurements, biases = loop.filter, loop.measurements, _biases(loop, mean, sources)
    components = [component for sensor in loop.sensors for component in sensor.components]
    variances = np.array([component.noise for component in components])[measurements.components] ** 2
    states, count = len(tables.constants), biases.response.shape[2]
    covariance, means = np.zeros((len(readings), NAVIGATION, NAVIGATION)), np.zeros((len(readings), NAVIGATION))
    initial, start = np.zeros((NAVIGATION + states + count,) * 2), np.zeros(NAVIGATION + states + count)
    kept = np.r_[0:NAVIGATION, NAVIGATION + states : len(initial)]
    initial[np.ix_(kept, kept)], start[kept] = biases.initial, biases.mean
    full = np.concatenate([measurements.rows, -tables.rows, biases.rows], axis=2)
    over = np.concatenate([loop.transition, -tables.coupling, biases.response], axis=2)
    decay = np.concatenate([tables.decay, biases.decay], axis=1)
    _propagate(
        over, decay, biases.white, biases.cross, biases.noise, start, initial, full, variances, measurements.sizes,
        loop.gains, loop.first_updates, readings, means, covariance,
    )  # fmt: skip
    if shared is not None and shared.loop.responses is loop.responses and shared.loop.own_at is readings:
        maps = shared.maps
    else:
        maps = np.stack([output_map(loop.truth, float(time)) for time in loop.times[readings]])
    own, means = loop.own[:, :NAVIGATION, :NAVIGATION], (maps @ means[:, :, None])[:, :, 0]
    return ClosedLoopCovariance(loop, maps, means, map_covariances(maps, covariance), map_covariances(maps, own))


def _biases(loop: ClosedLoop, mean: Array, sources: Array) -> _Biases:
    """Collect the biases: constant errors that are not zero, processes that are biases, correlated errors."""
    steps, durations, fixed = len(loop.transition), np.diff(loop.times), len(CONSTANTS)
    sized = np.flatnonzero((np.diag(sources) > 0.0) | (mean != 0.0)).tolist()
    constants = [number for number in sized if number >= len(OUTPUTS)]
    imu, responses = loop.imu, loop.responses
    quiet = Imu(*(replace(each, random_walk=np.zeros(3)) for each in (imu.gyro, imu.accelerometer)))
    systems = process_systems(responses, quiet)
    driving = {name: system for name, system in systems.items() if system[0].any()}
    swings = loop.measurements.swings
    components = [component for sensor in loop.sensors for component in sensor.components]
    correlated = [number for number, component in enumerate(components) if component.correlated > 0.0]
    count, first = len(constants) + len(driving) + len(correlated), len(constants)
    response, decay = np.zeros((steps, NAVIGATION, count)), np.ones((steps, count))
    cross, noise = np.zeros((steps, NAVIGATION, count)), np.zeros((steps, count))
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
        decay[:, place] = np.exp(-durations / component.correlation_time)
        noise[:, place] = -(component.correlated**2) * np.expm1(-2.0 * durations / component.correlation_time)
        initial[NAVIGATION + place, NAVIGATION + place] = component.correlated**2
    given = np.r_[0 : len(OUTPUTS), constants].astype(np.int64)
    to_state = np.eye(len(given))
    to_state[:NAVIGATION, :NAVIGATION] = np.linalg.inv(output_map(loop.truth, float(loop.times[0])))
    initial[: len(given), : len(given)] = to_state @ sources[np.ix_(given, given)] @ to_state.T
    means = np.zeros(len(initial))
    means[: len(given)] = to_state @ mean[given]
    white = np.zeros((steps, NAVIGATION, NAVIGATION))
    for axis in range(3):
        white += imu.gyro.random_walk[axis] ** 2 * responses.gyro_white[:, axis]
        white[:, 3:, 3:] += imu.accelerometer.random_walk[axis] ** 2 * responses.accelerometer_white[:, axis]
    for _, added, _ in systems.values():
        white += added[:, :NAVIGATION, :NAVIGATION]
    return _Biases(response, decay, cross, noise, rows, means, initial, white)


@compiled
def _propagate(
    over: Array, decay: Array, white: Array, cross_noise: Array, noise: Array, mean: Array, initial: Array,
    rows: Array, variances: Array, sizes: IndexArray, gains: Array, first: IndexArray, readings: IndexArray,
    means: Array, result: Array,
) -> None:  # fmt: skip
    """Run mean and covariance of y, e^ and b through the closed loop; updates in Joseph's form."""
    size, moved, most = len(initial), gains.shape[1], rows.shape[1]
    biases = size - moved
    c, product = initial.copy(), np.zeros((9, size))
    cross, gain, again = np.zeros((most, size)), np.zeros((most, moved)), np.zeros((most, moved))
    turned, x, shifted, innovation = np.zeros((size, 9)), mean.copy(), np.zeros(9), np.zeros(most)
    reached = 0
    for k in range(len(first) - 1):
        for u in range(first[k], first[k + 1]):
            m = sizes[u]
            for e in range(m):
                innovation[e] = 0.0
                for i in range(moved):
                    gain[e, i] = gains[u, i, e] if i < 9 else -gains[u, i, e]
                for j in range(size):
                    cross[e, j] = 0.0
                for i in range(size):
                    weight = rows[u, e, i]
                    if weight != 0.0:
                        innovation[e] += weight * x[i]
                        for j in range(size):
                            cross[e, j] += weight * c[i, j]
            for e in range(m):
                for i in range(moved):
                    x[i] -= gain[e, i] * innovation[e]
            for i in range(moved):
                for e in range(m):
                    weight = gain[e, i]
                    for j in range(size):
                        c[i, j] -= weight * cross[e, j]
            for i in range(moved):
                for e in range(m):
                    total = variances[u, e] * gain[e, i]
                    for j in range(size):
                        total -= rows[u, e, j] * c[i, j]
                    again[e, i] = total
            for i in range(moved):
                for e in range(m):
                    weight = again[e, i]
                    for j in range(moved):
                        c[i, j] += weight * gain[e, j]
            for i in range(moved):
                for j in range(i):
                    c[j, i] = c[i, j]
                for j in range(moved, size):
                    c[j, i] = c[i, j]
        while reached < len(readings) and readings[reached] == k:
            for i in range(9):
                means[reached, i] = x[i]
                for j in range(9):
                    result[reached, i, j] = c[i, j]
            reached += 1
        if k == len(over):
            break
        for i in range(9):
            shifted[i] = 0.0
            for j in range(size):
                product[i, j] = 0.0
            for e in range(size):
                weight = over[k, i, e]
                turned[e, i] = weight
                if weight != 0.0:
                    shifted[i] += weight * x[e]
                    for j in range(size):
                        product[i, j] += weight * c[e, j]
        for i in range(9, size):
            x[i] *= decay[k, i - 9]
        for i in range(9):
            x[i] = shifted[i]
            for j in range(9):
                c[i, j] = white[k, i, j]
            for e in range(size):
                weight = product[i, e]
                for j in range(9):
                    c[i, j] += weight * turned[e, j]
            for j in range(9, size):
                c[i, j] = decay[k, j - 9] * product[i, j]
            for j in range(biases):
                c[i, moved + j] += cross_noise[k, i, j]
            for j in range(9, size):
                c[j, i] = c[i, j]
        for i in range(9):
            for j in range(i):
                c[j, i] = c[i, j]
        for i in range(9, size):
            weight = decay[k, i - 9]
            for j in range(9, size):
                c[i, j] *= weight * decay[k, j - 9]
        for i in range(biases):
            c[moved + i, moved + i] += noise[k, i]
