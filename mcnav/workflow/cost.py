"""Cost of a run of a user's class, told before it: the time of its samples, and of what is simulated beside them."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.contract.engine import Engine
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.execution.pace import FEW, Pace, measure_pace
from mcnav.execution.progress import duration
from mcnav.linear.simulated_budget import count_flights
from mcnav.runner.executors import JOBS
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.finite_differences import SHARES
from mcnav.systems.user.conformance import Check
from mcnav.systems.user.kept import KEPT_FROM
from mcnav.systems.user.noise_soundness import RESPONSES
from mcnav.systems.user.scenario import UserScenario, is_users
from mcnav.systems.user.soundness import FLOWN_TWICE, SEED
from mcnav.systems.user.stochastic_scenario import is_users_with_noise

LONG: Final = 10.0
"""Seconds from which on advice is given about them, and studies tell them beforehand."""


def cost_check(scenario: Scenario, errors: ErrorModel, samples: int) -> tuple[Check, ...]:
    """Return what a run of a user's class will take, by the pace of a few samples; none of other scenarios."""
    if not is_users(scenario):
        return ()
    sigmas = np.where(errors.standard_deviations > 0.0, errors.standard_deviations, 0.0)
    engine = scenario.engine(scenario.engines[0], np.zeros((1, len(sigmas))))
    normals = np.random.default_rng(SEED).standard_normal((min(samples, engine.chunk), len(sigmas)))
    drawn = errors.mean + normals * sigmas

    def simulate(count: int) -> None:
        engine.simulate(Batch(np.arange(count), drawn[:count], SEED))

    simulate(1)  # the first may compile
    pace = measure_pace(simulate, FEW * len(drawn), engine.parallel == "threads")
    return (Check("cost", True, _told(scenario, engine, pace, samples, int(np.count_nonzero(sigmas)))),)


def _told(scenario: UserScenario, engine: Engine, pace: Pace, samples: int, dispersed: int) -> str:
    chunk = engine.chunk
    whole = pace.of_workers(samples, chunk, JOBS)
    simulations = _linear_simulations(scenario) + 1
    of_these = "" if simulations == 1 else f" for {simulations} simulations"
    of_one = Pace(pace.start / simulations, pace.each / simulations)
    beside = _beside(scenario, of_one)
    if not is_users_with_noise(scenario):
        beside += of_one.seconds(*count_flights(engine, dispersed, samples))
    each = pace.seconds(min(samples, chunk)) / min(samples, chunk)
    told = (
        f"a sample takes {_precisely(each)}{of_these}; {samples:,} on {JOBS} workers {_about(whole)}, "
        f"and {_about(beside)} of other simulations"
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


def _beside(scenario: UserScenario, pace: Pace) -> float:
    """Return the time of simulations before the samples of a run, s; those that the check has kept take none."""
    sources = len(scenario.sources)
    differences = pace.seconds(2 * len(SHARES) * sources)
    count = 3 * FLOWN_TWICE + (2 * sources if len(scenario.reading_times) else 0)
    count += 2 * FLOWN_TWICE + 4 * RESPONSES + 3 if is_users_with_noise(scenario) else 0
    return pace.seconds(count) + (differences if differences < KEPT_FROM else 0.0)
