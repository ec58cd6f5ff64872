"""Runs of all filters with the same draws, and how means of 100 of them scatter."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from time import thread_time
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.validation.reproduce.ukfm import flight
from mcnav.validation.reproduce.ukfm.kernel import SCORES, simulate
from mcnav.validation.reproduce.ukfm.printed import AS_PRINTED, MEANT, RUNS

ALL: Final = tuple(dict.fromkeys((*MEANT, *(each for filters in AS_PRINTED.values() for each in filters))))
"""All filters that are run."""

SAMPLES: Final = 10_000
SEED: Final = 2019
CHUNK: Final = 100
"""Runs of a chunk, whose draws take 14 MB."""

RESAMPLES: Final = 4000
"""Means of 100 runs from which a range is taken: its ends are known to a third of a percent of probability."""


@dataclass(frozen=True)
class Runs:
    """Runs of all f filters.

    Attributes
    ----------
    by_run : ndarray, shape (f, n, 5)
        Of each filter and run: means of the scores over time.
    by_time : ndarray, shape (f, 3000, 5)
        Of each filter and instant: means of the scores over the runs.
    seconds : ndarray, shape (f,)
        Computing time of a run of each filter with its draws, on one thread.
    """

    by_run: Array
    by_time: Array
    seconds: Array

    @property
    def count(self) -> int:
        """Number of runs."""
        return int(self.by_run.shape[1])

    def values(self) -> Array:
        """Return what ukfm prints, and the NEES of position in the right sense, of all runs: shape (f, 5)."""
        return in_printed_units(self.by_run.mean(axis=1))

    def errors(self) -> Array:
        """Return the standard errors of the means of NEES, shape (f, 3)."""
        return np.asarray(self.by_run[:, :, 2:].std(axis=1, ddof=1) / np.sqrt(self.count))

    @cached_property
    def of_hundred(self) -> Array:
        """Values of 100 runs that are drawn with replacement, often: shape (RESAMPLES, f, 5)."""
        generator = np.random.Generator(np.random.Philox(SEED))
        chosen = generator.integers(self.count, size=(RESAMPLES, RUNS))
        return np.array([in_printed_units(self.by_run[:, each].mean(axis=1)) for each in chosen])


def in_printed_units(means: Array) -> Array:
    """Take roots of mean squared errors, of attitude in degrees."""
    result = np.array(means)
    result[..., :2] = np.sqrt(result[..., :2])
    result[..., 0] = np.degrees(result[..., 0])
    return result


def _chunk(seed: int, first: int, count: int) -> tuple[Array, Array, Array]:
    """Simulate the runs of a chunk by all filters."""
    truth, begun = flight.truth(), thread_time()
    draws = flight.draw(seed, first, count)
    seconds = np.full(len(ALL), thread_time() - begun)
    sigmas = np.array([flight.GYRO, flight.ACCELEROMETER, flight.RANGING, flight.START_ATTITUDE, flight.START_POSITION])
    by_run = np.empty((len(ALL), count, SCORES))
    by_time = np.zeros((len(ALL), flight.INSTANTS, SCORES))
    for place, kind in enumerate(ALL):
        begun = thread_time()
        simulate(
            kind.definition, kind.sigma_points, truth.forces, truth.position, flight.GRAVITY, flight.LANDMARKS,
            flight.STEP, flight.BETWEEN_MEASUREMENTS, sigmas, kind.turned, draws.start, draws.readings, draws.landmarks,
            by_run[place], by_time[place],
        )  # fmt: skip
        seconds[place] += thread_time() - begun
    return by_run, by_time, seconds


def run(samples: int = SAMPLES, seed: int = SEED) -> Runs:
    """Simulate runs of all filters, on as many threads as there are processors; chunks are added in their order."""
    _chunk(seed, 0, 1)  # compiles, or loads, what the threads then share
    parts = [(first, min(CHUNK, samples - first)) for first in range(0, samples, CHUNK)]
    by_time, by_run, seconds = np.zeros((len(ALL), flight.INSTANTS, SCORES)), [], np.zeros(len(ALL))
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        for runs, instants, took in threads.map(lambda row: _chunk(seed, *row), parts):
            by_run.append(runs)
            by_time += instants
            seconds += took
    return Runs(np.concatenate(by_run, axis=1), by_time / samples, seconds / samples)
