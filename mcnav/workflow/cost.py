"""Cost of a run of a user's class, told before it: the time of some samples, and of what is simulated before them."""

from __future__ import annotations

import time
from typing import Final

import numpy as np

from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.execution.progress import duration
from mcnav.runner.executors import JOBS
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.finite_differences import SHARES
from mcnav.systems.user.conformance import Check
from mcnav.systems.user.noise_soundness import RESPONSES
from mcnav.systems.user.scenario import UserScenario, is_users
from mcnav.systems.user.soundness import FLOWN_TWICE, SEED
from mcnav.systems.user.stochastic_scenario import is_users_with_noise

LEAST: Final = 0.05
"""Seconds of samples from which their pace is known."""

LONG: Final = 10.0
"""Seconds from which on advice is given about them, and studies tell them beforehand."""

MOST: Final = 4_096
"""Samples that are timed at most."""


def cost_check(scenario: Scenario, errors: ErrorModel, samples: int) -> tuple[Check, ...]:
    """Return what a run of a user's class will take, by the pace of a few samples; none of other scenarios.

    The number that are timed is doubled until they take `LEAST` s.
    """
    if not is_users(scenario):
        return ()
    sigmas = np.where(errors.standard_deviations > 0.0, errors.standard_deviations, 0.0)
    engine = scenario.engine(scenario.engines[0], np.zeros((1, len(sigmas))))
    drawn = errors.mean + np.random.default_rng(SEED).standard_normal((MOST, len(sigmas))) * sigmas
    count, seconds = 1, 0.0
    engine.simulate(Batch(np.arange(1), drawn[:1], SEED))  # the first may compile
    while seconds < LEAST and count <= MOST // 2:
        count *= 2
        began = time.perf_counter()
        engine.simulate(Batch(np.arange(count), drawn[:count], SEED))
        seconds = time.perf_counter() - began
    return (Check("cost", True, _told(scenario, seconds / count, samples, engine.chunk)),)


def time_of(samples: int, each: float, chunk: int, jobs: int) -> float:
    """Return the time that workers take for samples in chunks, s.

    >>> time_of(300, each=0.5, chunk=128, jobs=2)  # one of them simulates two chunks
    128.0
    """
    rounds = -(-samples // (chunk * jobs))
    return each * min(samples, rounds * chunk)


def _told(scenario: UserScenario, each: float, samples: int, chunk: int) -> str:
    whole = time_of(samples, each, chunk, JOBS)
    simulations = _linear_simulations(scenario) + 1
    of_these = "" if simulations == 1 else f" for {simulations} simulations"
    before = _before(scenario) * each / simulations
    told = (
        f"a sample takes {_precisely(each)}{of_these}; {samples:,} on {JOBS} workers {_about(whole)}, "
        f"after {_about(before)} of simulations beforehand"
    )
    if samples <= chunk and whole > LONG:
        told += f"; they are one chunk, which one worker takes: chunk = {-(-samples // JOBS)} in the class shares them"
    return told


def _about(seconds: float) -> str:
    return f"about {duration(seconds)}" if seconds >= 1.0 else "less than a second"


def _precisely(seconds: float) -> str:
    """Format the time of a sample.

    >>> _precisely(0.3456), _precisely(0.0021), _precisely(2e-7)
    ('0.35 s', '2.1 ms', '0.2 µs')
    """
    size, unit = next(
        (unit_of_time for unit_of_time in ((1.0, "s"), (1e-3, "ms")) if seconds >= unit_of_time[0]), (1e-6, "µs")
    )
    return f"{seconds:.2g} s" if seconds >= 0.1 else f"{seconds / size:.2g} {unit}"


def _linear_simulations(scenario: UserScenario) -> int:
    """Return the simulations of a sample besides its own: for its linear outcome, where it has noise."""
    if not is_users_with_noise(scenario):
        return 0
    return 1 if scenario.own_linear else 2


def _before(scenario: UserScenario) -> int:
    """Return the simulations before the samples of a run, with a covariance of the noise that is kept."""
    sources = len(scenario.sources)
    count = 2 * len(SHARES) * sources + 3 * FLOWN_TWICE + (2 * sources if len(scenario.reading_times) else 0)
    return count + (2 * FLOWN_TWICE + 4 * RESPONSES + 3 if is_users_with_noise(scenario) else 0)
