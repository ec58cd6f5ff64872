"""Examination of a campaign's linear analysis by simulations of its first engine; see `mcnav.analysis.examination`."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.analysis.comparison import Model
from mcnav.analysis.examination import CheckFlights, Examination, examine, refuse
from mcnav.config.read import Campaign
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.samples import Batch
from mcnav.linear.departure_model import DepartureModel, RotatedAxes
from mcnav.linear.partials import QUICK
from mcnav.linear.polynomial_engine import prepare_engine

SEED: Final = 1_965
"""Seed of the check simulations: none of a campaign's samples is among them."""

PAIRS: Final = 16
"""Pairs of check simulations."""

MORE_PAIRS: Final = 64
"""Pairs where the first cannot say, and the engine is quick."""

DRAWN: Final = 8_192
"""Draws over which the polynomial is averaged where errors are not normal."""


def examine_campaign(campaign: Campaign, model: Model) -> Examination:
    """Examine a campaign's linear model by simulations.

    They are those to which a polynomial is fitted, and pairs of check simulations, once without noise and, where there
    is noise, once with it. The pairs are `PAIRS`, or `MORE_PAIRS` for what these cannot say where the engine is quick.
    """
    from mcnav.runner.draws import DrawPlan  # with a run's files, which other answers do not need

    scenario, errors = campaign.scenario, campaign.errors
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    engine = prepare_engine(scenario, scenario.engines[0], draws.probes(), errors.mean, errors.standard_deviations)
    first = _examine_by(PAIRS, campaign, model, engine)
    if first.failed or first.decided or engine.chunk < QUICK:
        return first
    return first.completed_by(_examine_by(MORE_PAIRS, campaign, model, engine))


def _examine_by(pairs: int, campaign: Campaign, model: Model, engine: Engine) -> Examination:
    """Examine a linear model by so many pairs of check simulations."""
    errors, sigma = campaign.errors, np.sqrt(np.diag(model.outcome_covariance))
    axes = RotatedAxes.of(model.partials, errors.mean, errors.covariance, sigma)
    checks = errors.draw("antithetic", SEED, 2 * pairs, 0, 2 * pairs)
    fitted = axes.errors_at(axes.nodes)
    steady = without_noise(engine)(np.vstack([fitted, checks]))
    noisy = engine.simulate(Batch(np.arange(len(checks)), checks, SEED)) if engine.noisy else None
    simulated = len(fitted) + len(checks) * (2 if engine.noisy else 1)
    failed = len(steady.failures) + (0 if noisy is None else len(noisy.failures))
    if failed:
        return refuse(simulated, failed, campaign.tolerance, len(sigma))
    linear = (checks - errors.mean) @ model.partials.T
    at_nodes, at_checks = np.split(steady.values - model.outcome_mean, [len(fitted)])
    departures = at_checks - linear
    noise = None
    if noisy is not None and noisy.linear_values is not None:
        by_noise = noisy.linear_values - model.outcome_mean - linear
        noise = by_noise, noisy.values - noisy.linear_values - departures
    departure = DepartureModel.fit(axes, at_nodes - axes.nodes @ axes.slopes.T)
    flights = CheckFlights(axes.normals_of(checks), linear, departures, noise)
    drawn = None if errors.normal else axes.normals_of(errors.draw("random", SEED, DRAWN, 0, DRAWN))
    return examine(model, departure, flights, campaign.tolerance, simulated, drawn)
