"""filterpy's `KalmanFilter` sample by sample, joblib sharing the samples among processes.

The strapdown and the transition matrix are the compiled ones of the loop written by hand: what is left is what the
filter itself costs, its prediction and its update by six components at once.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter

from mcnav.arrays.types import Array
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.peer import Peer, Simulate
from tests.benchmarks.inertial.peers.arrange import initial_covariance, level_axes, quaternions, returned
from tests.benchmarks.inertial.peers.compiled_filter import STATES, feed_back, noise_of_step, strapdown, transition

MEASURED = [6, 7, 8, 3, 4, 5]
"""States of position and velocity."""


class Flight:
    """All that samples share; it is pickled for processes."""

    def __init__(self, case: Case, interval: int) -> None:
        self.case, self.interval = case, interval
        self.readings, self.level = np.ascontiguousarray(case.increments), level_axes(case)
        self.truth, self.covariance = np.ascontiguousarray(case.measured[:, :6]), initial_covariance(case)

    def fly(self, samples: Samples, seed: int) -> Array:
        """Return the states at the epochs of one sample, shape (m, 10)."""
        case, generator = self.case, np.random.default_rng(seed)
        state, left = quaternions(case.started(samples))[0], samples.biases[0] * READING
        kalman = KalmanFilter(dim_x=STATES, dim_z=6)
        kalman.P, kalman.H, kalman.R = self.covariance.copy(), np.eye(STATES)[MEASURED], np.diag(case.measurement**2)
        phi, q = np.eye(STATES), np.zeros((STATES, STATES))
        rows, added, last = np.empty((9, STATES)), np.empty((9, 9)), np.zeros(6)
        sums, axes, found = np.empty(6), np.empty((3, 3)), []
        sizes, first = case.noise * np.sqrt(READING), 0
        for u, end in enumerate(case.updates.tolist()):
            while first < end:
                steps = min(self.interval, end - first)
                if samples.given:
                    noise = samples.increments[0, first : first + steps]
                else:
                    noise = generator.standard_normal((steps, 6)) * sizes
                strapdown(state, left, last, READING, self.readings, noise, first, steps, sums, axes)
                transition(state, steps * READING, sums, axes, rows)
                noise_of_step(steps * READING, sums, case.noise[0] ** 2, case.noise[3] ** 2, added)
                phi[:9], q[:9, :9] = rows, added
                kalman.predict(F=phi, Q=q)
                first += steps
            if samples.given:
                error = (samples.measurements[0, u].reshape(2, 3) @ self.level[u].T).ravel()
            else:
                error = generator.standard_normal(6) * case.measurement
            innovation = np.concatenate([state[7:], state[4:7]]) - self.truth[u] - error
            kalman.update(innovation[:, None])
            feed_back(state, left, kalman.x[:, 0], READING)
            kalman.x = np.zeros((STATES, 1))
            if end in case.epochs:
                found.append(state.copy())
        return np.array(found)


def prepare(case: Case, setting: float, cores: int) -> Simulate:
    """One sample after the other; the setting is the step of the covariance, s."""
    flight = Flight(case, round(setting / READING))

    def simulate(samples: Samples, seed: int) -> Array:
        return returned(np.stack([flight.fly(samples[row : row + 1], seed + row) for row in range(len(samples))]))

    return simulate


PEER = Peer(prepare, "covariance step [s]", (1.0,), 1, "processes")
