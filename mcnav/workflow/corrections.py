"""Corrections to the linear model of a prepared system, from further simulations beside its samples."""

from __future__ import annotations

import math

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.linear.corrections import Corrections
from mcnav.linear.nonlinear_corrections import noise_corrections, nonlinear_corrections
from mcnav.linear.polynomial_engine import MAP
from mcnav.linear.refusals import scenario_errors
from mcnav.linear.simulated_budget import simulated_budgets
from mcnav.runner.soundness import exact_engine
from mcnav.workflow.prepare import PreparedSystem


def compute_corrections(system: PreparedSystem) -> Corrections:
    """Compute the corrections to the linear model.

    Raises `CampaignError` when the scenario or an engine cannot be simulated.
    """
    draws, scenario = system.draws, system.scenario

    def first_engine(probes: Array) -> Engine:
        same = system.engine_name in (MAP, scenario.engines[0]) and np.array_equal(probes, draws.probes())
        return system.exact if same else exact_engine(scenario, probes, system.timeout)

    if scenario.parts.noise:
        flown = system.flown if system.engine_name == MAP else scenario.keeping(system.exact, math.inf)
        return noise_corrections(flown, draws.errors, system.model.processes or {}, draws.samples)
    with scenario_errors(system.campaign.file):
        budget = simulated_budgets(
            first_engine, draws.errors, system.model.partials, draws.design, draws.seed, draws.samples
        )
        return nonlinear_corrections(scenario, system.flown, draws.errors, budget, draws.samples)
