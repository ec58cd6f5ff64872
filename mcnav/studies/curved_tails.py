"""Linear tails of requirements with the curvature of the outputs, by some simulations without noise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement
from mcnav.analysis.tail_curves import Curvature
from mcnav.config.read import Campaign
from mcnav.contract.engine import without_noise
from mcnav.contract.scenario import runs_user_code
from mcnav.linear.higher_order import second_order
from mcnav.linear.partials import QUICK, SimulationFailed
from mcnav.linear.polynomial_engine import prepare_engine

MOST_SIMULATIONS: Final = 2_000
"""Simulations for second derivatives, at most; r directions take ``2 r^2 + 2 r + 1``."""


def with_curvature(answer: LinearAnswer, campaign: Campaign) -> tuple[LinearRequirement, ...]:
    """Add the tail with curvature to requirements whose linear tail is known at the end.

    Nothing is added where sources are not normal, a user's code or a filter would have to be simulated, the engine is
    slow, or a simulation fails.
    """
    rare = [
        math.isfinite(requirement.beyond) and not requirement.requirement.epochs for requirement in answer.requirements
    ]
    curvature = _curvature(campaign) if any(rare) and answer.beyond is None else None
    if curvature is None:
        return answer.requirements
    return tuple(
        replace(requirement, curved=curvature.beyond(requirement.requirement, answer.model)) if known else requirement
        for requirement, known in zip(answer.requirements, rare, strict=True)
    )


def _curvature(campaign: Campaign) -> Curvature | None:
    """Return the outputs as quadratic functions of the sources, by the scenario's first engine."""
    scenario, errors = campaign.scenario, campaign.errors
    directions = int(np.count_nonzero(errors.standard_deviations))
    filtered = scenario.filter_schema is not None
    simulations = 2 * directions**2 + 2 * directions + 1
    if not errors.normal or runs_user_code(scenario) or filtered or simulations > MOST_SIMULATIONS:
        return None
    from mcnav.runner.draws import DrawPlan  # with a run's files, which other answers do not need

    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    engine = prepare_engine(scenario, scenario.engines[0], draws.probes(), errors.mean, errors.standard_deviations)
    if engine.chunk < QUICK:
        return None
    try:
        order = second_order(without_noise(engine), errors.mean, errors.covariance)
    except SimulationFailed:
        return None
    return Curvature(order.centre, *order.along_axes)
