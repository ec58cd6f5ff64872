"""Check of a user's own scenario before its linear model is used: its code runs where it cannot end the program."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.members import ready_engine
from mcnav.contract.scenario import Scenario, runs_user_code
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.user.noise_soundness import find_unsettled_noise
from mcnav.systems.user.scenario import is_users
from mcnav.systems.user.soundness import Unsettled, find_unsettled
from mcnav.systems.user.stochastic_scenario import is_users_with_noise


def exact_engine(scenario: Scenario, probes: Array, timeout: float | None) -> Engine:
    """Prepare the scenario's first engine, isolated where that is needed."""
    return isolated(scenario, ready_engine(scenario, scenario.engines[0], probes), timeout)


def isolated(scenario: Scenario, engine: Engine, timeout: float | None) -> Engine:
    """Run a user's code in a process of its own where it may end the process."""
    if not (runs_user_code(scenario) and (engine.parallel == "processes" or timeout is not None)):
        return engine
    from mcnav.runner.processes import isolated_engine  # a tenth of a second, which other scenarios do not need

    return isolated_engine(engine, len(scenario.outputs), timeout)


def find_doubt(scenario: Scenario, engine: Engine, errors: ErrorModel, tolerance: float) -> Unsettled | None:
    """Find out why a user's own scenario has no linear model; none where it has one, and for other scenarios.

    Parameters
    ----------
    engine : Engine
        That of `exact_engine`.
    tolerance : float
        Relative difference between linear analysis and Monte Carlo that the campaign tolerates.

    Raises
    ------
    ScenarioError
        When the scenario is not a function of the errors.
    """
    if not is_users(scenario):
        return None
    varied = np.asarray((errors.standard_deviations > 0.0) | (errors.mean != 0.0))
    doubt = find_unsettled(scenario, without_noise(engine), varied, tolerance)
    if doubt is None and is_users_with_noise(scenario):
        doubt = find_unsettled_noise(scenario, engine, varied, tolerance)
    return doubt
