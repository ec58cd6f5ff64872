"""Linear response to noise given step by step: the linear side of a sample of the reference engine.

The system is that of `mcnav.systems.ins.linear.response`, here by the midpoint of short steps with constant noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.truth.trajectory import Platform, Truth


@dataclass(frozen=True)
class NoiseResponse:
    """The linear system at the middles of S steps, with m epochs.

    Attributes
    ----------
    durations : ndarray, shape (S,)
    axes, forces, gradients : ndarray, shape (S, 3, 3), (S, 3), (S, 3, 3)
        Instruments' to inertial axes, specific force in inertial axes, gravity gradient.
    epochs : ndarray of int, shape (m,)
        Step before which an epoch lies.
    output_maps : ndarray, shape (m, 9, 9)
    """

    durations: Array
    axes: Array
    forces: Array
    gradients: Array
    epochs: IndexArray
    output_maps: Array

    @classmethod
    def along(cls, truth: Truth, platform: Platform, step_times: Array, epochs: Array) -> NoiseResponse:
        """Prepare the system for steps between rising times, and epochs, shape (m,), nearest to which it is read."""
        middles = 0.5 * (step_times[1:] + step_times[:-1])
        states = truth.states(middles, platform, float(step_times[0]))
        numbers = np.abs(np.searchsorted(step_times, epochs - 1e-9)).astype(np.int64)
        return cls(
            np.diff(step_times),
            states.axes,
            np.einsum("nij,nj->ni", states.axes, states.force),
            truth.earth.gravity_gradient(states.position),
            numbers,
            np.stack([output_map(truth, float(time)) for time in epochs]),
        )

    def respond(self, gyro: Array, accelerometer: Array) -> Array:
        """Compute the outputs at the epochs, shape (m, 9), from noise of shape (S, 3)."""
        states = np.zeros((len(self.epochs), 9))
        _respond(
            self.durations, self.axes, self.forces, self.gradients, self.epochs, np.ascontiguousarray(gyro),
            np.ascontiguousarray(accelerometer), states,
        )  # fmt: skip
        return np.asarray(np.einsum("mij,mj->mi", self.output_maps, states))


def respond_from_rest(
    truth: Truth, platform: Platform, step_times: Array, times: Array, gyro: Array, accelerometer: Array
) -> Array:
    """Compute what noise given step by step adds to psi, v and x between coarser times, each time from rest.

    Parameters
    ----------
    step_times : ndarray, shape (S + 1,)
    times : ndarray, shape (K + 1,)
        Some of the step times.
    gyro, accelerometer : ndarray, shape (S, 3)

    Returns
    -------
    ndarray, shape (K, 9)
    """
    whole = NoiseResponse.along(truth, platform, step_times, times[-1:])
    begins = np.searchsorted(step_times, times - 1e-9)
    result = np.zeros((len(times) - 1, 1, 9))
    for k, (begin, end) in enumerate(pairwise(begins)):
        rows = slice(begin, end)
        _respond(
            whole.durations[rows], whole.axes[rows], whole.forces[rows], whole.gradients[rows],
            np.array([end - begin]), gyro[rows].copy(), accelerometer[rows].copy(), result[k],
        )  # fmt: skip
    return result[:, 0]


@compiled
def _respond(
    durations: Array, axes: Array, forces: Array, gradients: Array, epochs: IndexArray, gyro: Array,
    accelerometer: Array, states: Array,
) -> None:  # fmt: skip
    state = np.zeros(9)
    turned, added, drawn, pushed, pulled = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    reached = 0
    for step in range(len(durations) + 1):
        while reached < len(epochs) and epochs[reached] <= step:
            states[reached] = state
            reached += 1
        if step == len(durations):
            break
        # over a step: psi' = C n, v' = psi x F + C m + G x, x' = v, with even noise n and m
        h, f = durations[step], forces[step]
        for i in range(3):
            turned[i] = added[i] = pulled[i] = 0.0
            for j in range(3):
                turned[i] += h * axes[step, i, j] * gyro[step, j]
                added[i] += h * axes[step, i, j] * accelerometer[step, j]
                pulled[i] += gradients[step, i, j] * (state[6 + j] + 0.5 * h * state[3 + j])
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            drawn[i] = turned[a] * f[b] - turned[b] * f[a]
            pushed[i] = state[a] * f[b] - state[b] * f[a] + pulled[i]
        for i in range(3):
            state[6 + i] += h * (state[3 + i] + h * (0.5 * pushed[i] + drawn[i] / 6.0) + 0.5 * added[i])
            state[3 + i] += h * (pushed[i] + 0.5 * drawn[i]) + added[i]
            state[i] += turned[i]
