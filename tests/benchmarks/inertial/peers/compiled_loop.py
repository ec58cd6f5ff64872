"""A loop over readings at 100 Hz and updates at 1 Hz, written out by hand and compiled with numba, sample by sample.

The covariance is propagated once a second, with the integrals of force that the strapdown adds up. Noise is drawn for
one second at a time, by numpy's generator (SFC64, the fastest it has) and its ziggurat, into a block that stays in the
cache. Samples are shared among threads: nothing holds the interpreter lock.
"""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.peer import Peer, Simulate
from tests.benchmarks.inertial.peers.arrange import initial_covariance, level_axes, quaternions, returned
from tests.benchmarks.inertial.peers.compiled_filter import (
    STATES,
    compiled,
    feed_back,
    noise_of_step,
    predict,
    strapdown,
    transition,
    update,
)


@compiled
def fly(  # type: ignore[no-untyped-def]
    increments, updates, epochs, truth, densities, sizes, variances, start, biases, given, measured, level, covariance,
    generator, interval, states,
):  # fmt: skip
    """Fly samples; states at the epochs, shape (n, m, 10), quaternion, velocity, position.

    Parameters
    ----------
    truth : ndarray, shape (U, 6)
        Position and velocity at the updates.
    densities : ndarray, shape (2,)
        Variance per second of the noise of gyros and accelerometers, as the filter has it.
    sizes : ndarray, shape (6,)
        Sigma of what noise adds to an increment.
    variances : ndarray, shape (6,)
        Of the measurements.
    start : ndarray, shape (n, 10)
    biases : ndarray, shape (n, 6)
        What biases add to an increment.
    given, measured : ndarray, shape (n, K, 6), (n, U, 6)
        Noise, if any is given.
    level : ndarray, shape (U, 3, 3)
        From north, east, down to earth-fixed axes, for measurement errors that are given.
    covariance : ndarray, shape (15, 15)
        At the start.
    interval : int
        Readings in a step of the covariance.
    """
    p, phi, q, product = np.empty((STATES, STATES)), np.empty((9, STATES)), np.empty((9, 9)), np.empty((9, STATES))
    axes, sums, last = np.empty((3, 3)), np.empty(6), np.empty(6)
    innovation, correction, gain = np.empty(6), np.empty(STATES), np.empty(STATES)
    block, left, state = np.empty((interval, 6)), np.empty(6), np.empty(10)
    for n in range(len(start)):
        for r in range(10):
            state[r] = start[n, r]
        for r in range(6):
            left[r], last[r] = biases[n, r], 0.0
        for r in range(STATES):
            for c in range(STATES):
                p[r, c] = covariance[r, c]
        reached, first = 0, np.int64(0)  # what is called with a literal would be compiled twice
        for u in range(len(updates)):
            while first < updates[u]:
                steps = min(interval, updates[u] - first)
                for k in range(steps):
                    for r in range(6):
                        block[k, r] = (
                            given[n, first + k, r] if given.shape[1] > 0 else sizes[r] * generator.standard_normal()
                        )
                strapdown(state, left, last, READING, increments, block, first, steps, sums, axes)
                transition(state, steps * READING, sums, axes, phi)
                noise_of_step(steps * READING, sums, densities[0], densities[1], q)
                predict(p, phi, q, product)
                first += steps
            for r in range(3):
                for quantity in range(2):  # position, then velocity
                    place = 3 * quantity + r
                    error = 0.0
                    if measured.shape[1] > 0:
                        for c in range(3):
                            error += level[u, r, c] * measured[n, u, 3 * quantity + c]
                    else:
                        error = np.sqrt(variances[place]) * generator.standard_normal()
                    indicated = state[7 + r] if quantity == 0 else state[4 + r]
                    innovation[place] = indicated - truth[u, place] - error
            update(p, innovation, variances, correction, gain)
            feed_back(state, left, correction, READING)
            if reached < len(epochs) and epochs[reached] == updates[u]:
                for r in range(10):
                    states[n, reached, r] = state[r]
                reached += 1


def prepare(case: Case, setting: float, cores: int) -> Simulate:
    """All that is done once; the setting is the step of the covariance, s."""
    readings, level, covariance = np.ascontiguousarray(case.increments), level_axes(case), initial_covariance(case)
    truth, interval = np.ascontiguousarray(case.measured[:, :6]), round(setting / READING)
    densities = np.array([case.noise[0] ** 2, case.noise[3] ** 2])
    sizes, variances = case.noise * np.sqrt(READING), case.measurement**2

    def simulate(samples: Samples, seed: int) -> Array:
        states = np.empty((len(samples), len(case.epochs), 10))
        fly(
            readings, case.updates, case.epochs, truth, densities, sizes, variances,
            quaternions(case.started(samples)), np.ascontiguousarray(samples.biases) * READING,
            samples.increments, samples.measurements, level, covariance, np.random.Generator(np.random.SFC64(seed)),
            interval, states,
        )  # fmt: skip
        return returned(states)

    return simulate


PEER = Peer(prepare, "covariance step [s]", (1.0, 0.1), 8, "threads")
