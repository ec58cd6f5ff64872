"""Linear response of the navigation errors over the steps of a grid, computed once and shared by all samples.

In inertial axes, with the rotation psi from true to indicated axes, deviations v and x of velocity and position, C from
instruments' axes to inertial ones, F = C f, and the gravity gradient G::

    psi' = C dw        v' = psi x F + C df + G x        x' = v

The errors of the instruments, dw and df, are linear in the constant errors, so that their response over a step is a
table; for white noise and the biases it drives it is a covariance. The tables are integrals over the truth at its own
rate, whatever the length of the step: a backward recursion of the response at the step's end, by the two-stage Gauss
method on intervals in which the truth is smooth (order 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.instruments import CROSS_AXES, Imu
from mcnav.physics.ins.truth import Platform, Truth
from mcnav.physics.jit import compiled

LONGEST_INTERVAL: Final = 0.25
"""Longest interval of the quadrature, s: a rate of 1 rad/s leaves an error of 1e-6."""

SHARE_OF_CORRELATION: Final = 0.25
"""Longest interval as a share of the shortest correlation time."""

_NODE: Final = 0.5 - np.sqrt(3.0) / 6.0
"""First node of the Gauss method as a share of the interval; the second is one less this."""

_ROW: Final = np.array(["xyz".index(pair[0]) for pair in CROSS_AXES])
_COLUMN: Final = np.array(["xyz".index(pair[1]) for pair in CROSS_AXES])


@dataclass(frozen=True)
class StepResponses:
    """Responses over K steps: of psi, v, x (9 rows), or of v, x alone (6 rows), at the end of a step.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
    attitude : ndarray, shape (K, 6, 3)
        To psi at the beginning, which itself does not change.
    motion : ndarray, shape (K, 6, 6)
        To v and x at the beginning.
    force : ndarray, shape (K, 6, 3, 3)
        To a velocity changing by ``N F`` with a constant matrix N, by its elements.
    gyro : ndarray, shape (K, 15, 9)
        To constant errors in the order of `mcnav.physics.ins.instruments.GYRO`.
    accelerometer : ndarray, shape (K, 15, 6)
    gyro_state, gyro_walk : ndarray, shape (K, 3, 9)
        To the Gauss-Markov bias, and to the rate random walk's, at the beginning, by axis.
    accelerometer_state, accelerometer_walk : ndarray, shape (K, 3, 6)
    gyro_white, accelerometer_white : ndarray, shape (K, 3, 9, 9), (K, 3, 6, 6)
        Covariance from white noise of unit density, by axis.
    gyro_driven, gyro_walked : ndarray, shape (K, 3, 10, 10)
        Covariance, together with the bias, from white noise of unit density that drives the Gauss-Markov bias, and the
        rate random walk.
    accelerometer_driven, accelerometer_walked : ndarray, shape (K, 3, 7, 7)
    """

    times: Array
    attitude: Array
    motion: Array
    force: Array
    gyro: Array
    accelerometer: Array
    gyro_state: Array
    gyro_walk: Array
    accelerometer_state: Array
    accelerometer_walk: Array
    gyro_white: Array
    accelerometer_white: Array
    gyro_driven: Array
    gyro_walked: Array
    accelerometer_driven: Array
    accelerometer_walked: Array


def intervals_of(truth: Truth, times: Array, longest: float) -> Array:
    """Return the boundaries of intervals, at most so long, in which the truth is smooth: all times are among them."""
    inside = truth.times[(truth.times > times[0]) & (truth.times < times[-1])]
    knots = np.union1d(times, inside)
    gaps = np.diff(knots)
    knots = knots[np.concatenate([[True], gaps > 1e-9]) | np.isin(knots, times)]
    gaps = np.diff(knots)
    pieces = np.maximum(1, np.ceil(gaps / longest - 1e-9)).astype(np.int64)
    first = np.repeat(knots[:-1], pieces)
    within = np.arange(len(first)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(first + within * np.repeat(gaps / pieces, pieces), knots[-1])


def respond(truth: Truth, platform: Platform, times: Array, imu: Imu) -> StepResponses:
    """Compute the responses over the steps between rising times, of which the first is the start of navigation."""
    constants = np.array([imu.gyro.correlation_time, imu.accelerometer.correlation_time])
    longest = min(LONGEST_INTERVAL, SHARE_OF_CORRELATION * float(constants.min()))
    bounds = intervals_of(truth, times, longest)
    lengths = np.diff(bounds)
    nodes = np.stack([bounds[:-1] + _NODE * lengths, bounds[1:] - _NODE * lengths], axis=1)
    states = truth.states(nodes.ravel(), platform, float(times[0]))
    gradient = truth.earth.gravity_gradient(0.5 * (states.position[0::2] + states.position[1::2]))
    steps = len(times) - 1
    shapes = (
        (6, 3), (6, 6), (6, 3, 3), (15, 9), (15, 6), (3, 9), (3, 9), (3, 6), (3, 6),
        (3, 9, 9), (3, 6, 6), (3, 10, 10), (3, 10, 10), (3, 7, 7), (3, 7, 7),
    )  # fmt: skip
    found = tuple(np.zeros((steps, *shape)) for shape in shapes)
    _respond(
        np.searchsorted(bounds, times), lengths, states.axes.reshape(-1, 2, 3, 3), states.force.reshape(-1, 2, 3),
        states.rate.reshape(-1, 2, 3), gradient, constants, _ROW, _COLUMN, *found,
    )  # fmt: skip
    return StepResponses(times, *found)


@compiled
def _add_products(total: Array, vector: Array, weight: float) -> None:
    """Add a weighted outer product."""
    for i in range(len(vector)):
        scaled = weight * vector[i]
        for j in range(len(vector)):
            total[i, j] += scaled * vector[j]


@compiled
def _respond(
    begins: IndexArray, lengths: Array, axes: Array, forces: Array, rates: Array, gradients: Array, correlation: Array,
    row: IndexArray, column: IndexArray, attitude: Array, motion: Array, force: Array, gyro: Array,
    accelerometer: Array, gyro_state: Array, gyro_walk: Array, accelerometer_state: Array, accelerometer_walk: Array,
    gyro_white: Array, accelerometer_white: Array, gyro_driven: Array, gyro_walked: Array, accelerometer_driven: Array,
    accelerometer_walked: Array,
) -> None:  # fmt: skip
    later = np.array([1.0 - _NODE, _NODE])  # from a node to the end of the interval, as a share
    ahead = np.array([[0.25, 0.25 + np.sqrt(3.0) / 6.0], [0.25 - np.sqrt(3.0) / 6.0, 0.25]])  # integrals to the end
    along = np.empty((2, 6, 3))  # response to v at the nodes
    turning = np.empty((2, 6, 3))  # response to psi changing there, for a constant psi
    to_gyro, to_accelerometer = np.empty((2, 3, 9)), np.empty((2, 3, 6))
    identity = np.eye(3)
    tilted = np.empty((6, 3))
    gyro_node, accelerometer_node = np.empty(10), np.empty(7)
    for k in range(len(begins) - 1):
        of_psi, of_v, of_x = np.zeros((6, 3)), np.zeros((6, 3)), np.zeros((6, 3))
        of_v[:3] = identity
        of_x[3:] = identity
        remaining = 0.0  # from the end of the interval to that of the step
        for j in range(begins[k + 1] - 1, begins[k] - 1, -1):
            h, gradient = lengths[j], gradients[j]
            weight = 0.5 * h
            through_gradient = of_x @ gradient
            for i in range(2):
                s = later[i] * h
                along[i] = of_v + s * of_x + (0.5 * s * s) * (of_v @ gradient) + (s**3 / 6.0) * through_gradient
                inertial = axes[j, i] @ forces[j, i]
                for r in range(6):
                    a, b, c = along[i, r]
                    turning[i, r, 0] = inertial[1] * c - inertial[2] * b
                    turning[i, r, 1] = inertial[2] * a - inertial[0] * c
                    turning[i, r, 2] = inertial[0] * b - inertial[1] * a
                    for m in range(3):
                        for n in range(3):
                            force[k, r, m, n] += weight * along[i, r, m] * inertial[n]
            for i in range(2):
                tilted[:] = of_psi + h * (ahead[i, 0] * turning[0] + ahead[i, 1] * turning[1])
                for a in range(3):
                    direction = axes[j, i, :, a].copy()
                    to_gyro[i, a, :3] = direction
                    to_gyro[i, a, 3:] = tilted @ direction
                    to_accelerometer[i, a] = along[i] @ direction
            for i in range(2):
                for a in range(3):
                    of_gyro, of_accelerometer = to_gyro[i, a], to_accelerometer[i, a]
                    f, w = forces[j, i, a], rates[j, i, a]
                    gyro[k, a] += weight * of_gyro
                    gyro[k, 3 + a] += (weight * w) * of_gyro
                    gyro[k, 12 + a] += (weight * f) * of_gyro
                    accelerometer[k, a] += weight * of_accelerometer
                    accelerometer[k, 3 + a] += (weight * f) * of_accelerometer
                    accelerometer[k, 12 + a] += (weight * f * f) * of_accelerometer
                    _add_products(gyro_white[k, a], of_gyro, weight)
                    _add_products(accelerometer_white[k, a], of_accelerometer, weight)
                for p in range(6):
                    gyro[k, 6 + p] += (weight * rates[j, i, column[p]]) * to_gyro[i, row[p]]
                    accelerometer[k, 6 + p] += (weight * forces[j, i, column[p]]) * to_accelerometer[i, row[p]]
            for a in range(3):
                for i in range(2):
                    s = later[i] * h
                    decay = np.exp(-s / correlation[0, a])
                    gyro_node[:9] = decay * gyro_state[k, a]
                    for other in range(2):
                        share = h * ahead[i, other] * np.exp((later[other] * h - s) / correlation[0, a])
                        gyro_node[:9] += share * to_gyro[other, a]
                    gyro_node[9] = np.exp(-(remaining + s) / correlation[0, a])
                    _add_products(gyro_driven[k, a], gyro_node, weight)
                    gyro_node[:9] = gyro_walk[k, a] + h * (ahead[i, 0] * to_gyro[0, a] + ahead[i, 1] * to_gyro[1, a])
                    gyro_node[9] = 1.0
                    _add_products(gyro_walked[k, a], gyro_node, weight)
                    decay = np.exp(-s / correlation[1, a])
                    accelerometer_node[:6] = decay * accelerometer_state[k, a]
                    for other in range(2):
                        share = h * ahead[i, other] * np.exp((later[other] * h - s) / correlation[1, a])
                        accelerometer_node[:6] += share * to_accelerometer[other, a]
                    accelerometer_node[6] = np.exp(-(remaining + s) / correlation[1, a])
                    _add_products(accelerometer_driven[k, a], accelerometer_node, weight)
                    accelerometer_node[:6] = accelerometer_walk[k, a] + h * (
                        ahead[i, 0] * to_accelerometer[0, a] + ahead[i, 1] * to_accelerometer[1, a]
                    )
                    accelerometer_node[6] = 1.0
                    _add_products(accelerometer_walked[k, a], accelerometer_node, weight)
                # to the beginning of the interval
                gyro_state[k, a] *= np.exp(-h / correlation[0, a])
                accelerometer_state[k, a] *= np.exp(-h / correlation[1, a])
                for i in range(2):
                    early = (1.0 - later[i]) * h
                    gyro_state[k, a] += weight * np.exp(-early / correlation[0, a]) * to_gyro[i, a]
                    accelerometer_state[k, a] += weight * np.exp(-early / correlation[1, a]) * to_accelerometer[i, a]
                    gyro_walk[k, a] += weight * to_gyro[i, a]
                    accelerometer_walk[k, a] += weight * to_accelerometer[i, a]
            of_psi += weight * (turning[0] + turning[1])
            half = 0.5 * h * h
            before = of_v + h * of_x + half * (of_v @ gradient) + (h**3 / 6.0) * through_gradient
            of_x = of_x + h * (of_v @ gradient) + half * through_gradient
            of_v = before
            remaining += h
        attitude[k] = of_psi
        motion[k, :, :3] = of_v
        motion[k, :, 3:] = of_x
