"""Covariance of the noise of a user's class that does not state it, measured from linear simulations.

The linear system maps the Z variates of a simulation, in multiples of their sigmas, to outputs: r = J w, and the
covariance is J Jᵀ. With orthogonal probes w of length √Z it is the mean of r rᵀ over all Z of them, exactly. The mean
over n of them, chosen at random, is unbiased.

Probe j is row j of the cosine transform of type IV, whose columns have signs at random (a subsampled randomized
trigonometric transform). For any row x of J, c = w·x then has a fourth moment of at most 3 ‖x‖⁴ over signs and rows;
sampling rows without replacement gives the measured variance a relative variance of at most

    2 (Z − n) / (n (Z − 1)),

that of n independent samples of noise, 2 / n, less what is known when n = Z.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.scenario import ScenarioError
from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.execution.progress import MEASUREMENT
from mcnav.systems.sample_loop import format_exception
from mcnav.systems.user.measured_noise import INDEPENDENT, MeasuredNoise, probe_count
from mcnav.systems.user.sample_noise import MEASURED, ProbedNoise, ScaledNoise, sample_noise
from mcnav.systems.user.stochastic_engine import SCALE, StochasticUserEngine

SEED: Final = 1963

WORKERS: Final = 2

SHARED_FROM: Final = 10.0
"""Seconds of simulations from which worker processes share them: they take some two seconds to start."""


class OtherVariates(Exception):
    """Raised where a simulation draws another number of variates than the one without noise."""


@dataclass(frozen=True)
class Probes:
    """Linear simulations of a class with probes of its noise, by number.

    Attributes
    ----------
    sources : int
        Number of sources, whose errors are zero.
    variates : int or None
        See `MeasuredNoise`.
    nominal : ndarray, shape (m, outputs)
        ``fly_linear`` without errors and noise; zero for a class without.
    """

    engine: StochasticUserEngine
    sources: int
    variates: int | None
    nominal: Array

    @classmethod
    def of(cls, engine: StochasticUserEngine, sources: int) -> Probes:
        """Count the variates of a simulation; `ScenarioError` when it fails."""
        noise = ProbedNoise(np.zeros(0))
        fly = engine.linear_flight if engine.own_linear else engine.flight
        try:
            nominal = fly(np.zeros(sources), noise)
        except Exception as failure:
            raise ScenarioError("type", _message(engine, failure)) from failure
        return cls(engine, sources, noise.used, nominal if engine.own_linear else np.zeros(nominal.shape))

    @property
    def count(self) -> int:
        """Number of probes."""
        return INDEPENDENT if self.variates is None else probe_count(self.variates)

    def deviations(self, number: int) -> Array:
        """Return a probe, shape (variates,): √Z times a row of the cosine transform of type IV, with the signs."""
        assert self.variates is not None
        signs, rows = _signs_and_rows(self.variates)
        size = self.variates
        turns = (2 * int(rows[number]) + 1) * (2 * np.arange(size) + 1) % (8 * size)
        return np.asarray(signs * np.sqrt(2.0) * np.cos(np.pi / (4 * size) * turns))

    def response(self, number: int) -> Array:
        """Compute the linear response to a probe, shape (m, outputs).

        By ``fly_linear``, or by differences of ``fly``. Raises what the class raises, and `OtherVariates`.
        """
        if self.engine.own_linear:
            return np.asarray(self._simulate(number, 1.0) - self.nominal)
        values = (self._simulate(number, SCALE) - self._simulate(number, -SCALE)) / (2.0 * SCALE)
        if not np.isfinite(values).all():
            raise ValueError("the linear response to the noise is not finite")
        return np.asarray(values)

    def _simulate(self, number: int, scale: float) -> Array:
        fly, none = self.engine.linear_flight if self.engine.own_linear else self.engine.flight, np.zeros(self.sources)
        if self.variates is None:
            return fly(none, ScaledNoise(SEED, number, scale, MEASURED))
        noise = ProbedNoise(scale * self.deviations(number))
        values = fly(none, noise)
        if noise.used != self.variates:
            raise OtherVariates
        return values


@lru_cache(maxsize=1)
def _signs_and_rows(variates: int) -> tuple[Array, NDArray[np.int64]]:
    """Draw the signs of the transform's columns, and the order of its rows."""
    draw = sample_noise(SEED, 0, MEASURED)
    return np.where(draw.random(variates) < 0.5, -1.0, 1.0), draw.permutation(variates)


def _message(engine: StochasticUserEngine, failure: BaseException) -> str:
    """Describe a linear simulation that failed."""
    which = "fly_linear" if engine.own_linear else "with its noise scaled down"
    return f"{which}: {format_exception(failure, engine.spec.code.file)}"


def respond(probes: Probes, number: int) -> Array | str:
    """Compute the response to a probe in any process; a text where the simulation fails. Raises `OtherVariates`."""
    try:
        return probes.response(number)
    except OtherVariates:
        raise
    except Exception as failure:
        return _message(probes.engine, failure)


def measure(probes: Probes, tell: Callable[[float], None]) -> MeasuredNoise:
    """Measure the covariance of the noise.

    Parameters
    ----------
    tell : callable
        Told how long it will take, s, by the time of the first simulation.

    Raises
    ------
    ScenarioError
        When a simulation fails.
    """
    try:
        return _measure(probes, tell)
    except OtherVariates:
        return _measure(independent(probes), tell)


def independent(probes: Probes) -> Probes:
    """Return independent samples of noise in place of probes."""
    return replace(probes, variates=None)


def _measure(probes: Probes, tell: Callable[[float], None]) -> MeasuredNoise:
    outputs = probes.nominal.shape[-1]
    covariance, first = np.zeros((*probes.nominal.shape, outputs)), np.zeros(probes.nominal.shape)
    began = time.perf_counter()
    for first in _responses(probes, range(min(1, probes.count))):
        covariance += first[:, :, None] * first[:, None, :]
    left = range(1, probes.count)
    seconds = (time.perf_counter() - began) * len(left)
    workers = min(WORKERS, os.cpu_count() or 1) if seconds > SHARED_FROM else 1
    tell(seconds / workers)
    with MEASUREMENT.of(len(left)):
        for response in _responses(probes, left, workers):
            covariance += response[:, :, None] * response[:, None, :]
            MEASUREMENT.done += 1
    return MeasuredNoise(covariance / max(probes.count, 1), first, probes.variates)


def _responses(probes: Probes, numbers: range, workers: int = 1) -> Iterator[Array]:
    """Yield the responses to some probes in order; `ScenarioError` when a simulation fails."""
    try:
        for response in _in_processes(probes, numbers, workers) if workers > 1 else _here(probes, numbers):
            if isinstance(response, str):
                raise ScenarioError("type", response)
            yield response
    except BrokenExecutor:
        raise ScenarioError("type", "a worker process died while measuring the covariance of the noise") from None


def _here(probes: Probes, numbers: range) -> Iterator[Array | str]:
    return (respond(probes, number) for number in numbers)


def _in_processes(probes: Probes, numbers: range, workers: int) -> Iterator[Array | str]:
    from joblib import Parallel, delayed

    with interrupts_blocked():
        responses = Parallel(
            n_jobs=workers,
            return_as="generator",
            backend="loky",
            max_nbytes=None,
            initializer=end_with_parent,
            initargs=(os.getpid(),),
        )(delayed(respond)(probes, number) for number in numbers)
    yield from responses
