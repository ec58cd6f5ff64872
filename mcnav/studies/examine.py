"""Examination of a campaign's linear analysis by simulations of its first engine; see `mcnav.analysis.examination`."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.corrected_moments import CorrectedMoments
from mcnav.analysis.examination import CheckFlights, Examination, Linearity, examine, refuse
from mcnav.analysis.model import Model
from mcnav.analysis.moment_correction import correct_moments
from mcnav.config.read import Campaign
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import runs_user_code
from mcnav.execution.progress import COMPILATION, NotCompiled, TooLong, duration
from mcnav.linear.departure_model import DepartureModel, RotatedAxes
from mcnav.linear.higher_order import second_order
from mcnav.linear.partials import QUICK, SimulationFailed
from mcnav.sampler.error_model import ErrorModel
from mcnav.studies.curved_tails import MOST_SIMULATIONS
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.user.scenario import is_users

SEED: Final = 1_965
"""Seed of the check simulations: none of a campaign's samples is among them."""


@dataclass(frozen=True)
class Effort:
    """Leading axes whose pairs are simulated, pairs of check simulations, and how often each has noise."""

    leading: int
    pairs: int
    noises: int


FIRST: Final = Effort(3, 16, 1)
SECOND: Final = Effort(8, 64, 4)
"""Effort where the first one cannot say, and the engine is quick."""

CORRECTING: Final = replace(SECOND, pairs=256)
"""Effort where the uncertainty of a corrected sigma, which is needed, is too large."""

STEP: Final = 0.2
"""Step of the differences of corrected moments, in sigmas: they are expansions about the mean errors."""

NOTABLE: Final = 0.001
"""Difference of a sigma ratio from one, or of that of all outputs together, from which moments are corrected."""

DRAWN: Final = 8_192
"""Draws over which the polynomial is averaged where errors are not normal."""


def examine_campaign(campaign: Campaign, model: Model, seconds: float = math.inf) -> Examination | str:
    """Examine a campaign's linear model by simulations, or say in a clause why that was left out.

    They are those to which a polynomial is fitted, and pairs of check simulations, once without noise and, where there
    is noise, once with it. Where these cannot say and the engine is quick, more are simulated.

    Parameters
    ----------
    seconds : float, optional
        Seconds that it may take; without a limit code is compiled where that is needed, and flights may have many
        updates, else not. A class of the user's is asked for one simulation before, unless an earlier command has kept
        them all.
    """
    aided = campaign.scenario.navigation.aided if is_ins(campaign.scenario) else None
    if aided is not None and aided.too_long and math.isfinite(seconds):
        return aided.too_long if aided.can_be_flown else ""
    with nullcontext() if math.isinf(seconds) else COMPILATION.refusing():
        try:
            return _examine_within(seconds, campaign, model)
        except NotCompiled:
            return "the simulator has not been compiled on this machine yet"
        except TooLong as long:
            return f"it would take about {duration(long.seconds)}"


def _examine_within(seconds: float, campaign: Campaign, model: Model) -> Examination:
    errors, scenario = campaign.errors, campaign.scenario
    if is_ins(scenario) and scenario.filter_schema is not None:
        # halved steps cost more than all simulations; the error of the coarsest ones is a share of the departure
        untested = ready_engine(scenario, scenario.engines[0], np.empty((0, len(errors.names))))
        coarse = examine_model(model, errors, untested, campaign.tolerance)
        if coarse.holds:
            return coarse
    engine = _engine_of(campaign, seconds)
    examined = examine_model(model, errors, engine, campaign.tolerance)
    if examined.failed or engine.chunk < QUICK:
        return examined
    return replace(examined, corrected=_corrected(errors, model, engine, examined))


def _engine_of(campaign: Campaign, seconds: float) -> Engine:
    """Prepare the engine that simulates; `TooLong` where a loop of the user's would take more than it may."""
    from mcnav.runner.draws import DrawPlan  # with a run's files, which other answers do not need
    from mcnav.runner.soundness import exact_engine

    scenario, errors = campaign.scenario, campaign.errors
    probes = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples).probes()
    if is_users(scenario):
        return scenario.keeping(exact_engine(scenario, probes, campaign.sample_timeout), seconds)
    if not runs_user_code(scenario) or campaign.sample_timeout is not None:
        return exact_engine(scenario, probes, campaign.sample_timeout)
    # a loop, whose remarks are of samples that were simulated in this process: another would cost a second
    return scenario.keeping(ready_engine(scenario, scenario.engines[0], probes), seconds)


def examine_model(model: Model, errors: ErrorModel, engine: Engine, tolerance: float) -> Examination:
    """Examine a linear model by simulations of an engine; where the first cannot say and it is quick, by more."""
    first = _examine_by(FIRST, model, errors, engine, tolerance)
    if first.failed or first.decided or engine.chunk < QUICK:
        return first
    return first.completed_by(_examine_by(SECOND, model, errors, engine, tolerance))


def _corrected(errors: ErrorModel, model: Model, engine: Engine, examined: Examination) -> CorrectedMoments | None:
    """Correct moments by second and third derivatives; none where a sigma is linear, or too many are needed.

    Where few check simulations do not bound a correction that is needed, more do.
    """
    ratios = [row.ratio for row in (*examined.outputs, examined.joint) if row is not None]
    directions = int(np.count_nonzero(errors.standard_deviations))
    simulations = 2 * directions**2 + 2 * directions + 1
    bent = np.nanmax(np.abs(np.array(ratios) - 1.0), initial=0.0) > NOTABLE
    if not bent or not errors.normal or simulations > MOST_SIMULATIONS:
        return None
    try:
        order = second_order(without_noise(engine), errors.mean, errors.covariance, STEP)
    except SimulationFailed:
        return None
    moments, linear = correct_moments(model, order, examined), np.sqrt(np.diag(model.outcome_covariance))
    needed = np.array([output.verdict != Linearity.HOLDS for output in examined.outputs])
    if not np.any(needed & ~moments.improves(linear)):
        return moments
    further = _examine_by(CORRECTING, model, errors, engine, examined.tolerance)
    return moments if further.failed else correct_moments(model, order, further)


def _examine_by(effort: Effort, model: Model, errors: ErrorModel, engine: Engine, tolerance: float) -> Examination:
    """Examine a linear model with some effort."""
    sigma = np.sqrt(np.diag(model.outcome_covariance))
    axes = RotatedAxes.of(model.partials, errors.mean, errors.covariance, sigma, effort.leading)
    checks = errors.draw("antithetic", SEED, 2 * effort.pairs, 0, 2 * effort.pairs)
    fitted = axes.errors_at(axes.nodes)
    steady = without_noise(engine)(np.vstack([fitted, checks]))
    count, again = len(checks), effort.noises * len(checks)
    noisy = (
        engine.simulate(Batch(np.arange(again), np.tile(checks, (effort.noises, 1)), SEED)) if engine.noisy else None
    )
    simulated = len(fitted) + count + (again if engine.noisy else 0)
    failed = len(steady.failures) + (0 if noisy is None else len(noisy.failures))
    if failed:
        return refuse(simulated, failed, tolerance, len(sigma))
    linear = (checks - errors.mean) @ model.partials.T
    at_nodes, at_checks = np.split(steady.values - model.outcome_mean, [len(fitted)])
    departures = at_checks - linear
    noise = None
    if noisy is not None and noisy.linear_values is not None:
        values, by_linear = (table.reshape(-1, *linear.shape) for table in (noisy.values, noisy.linear_values))
        noise = by_linear - model.outcome_mean - linear, values - by_linear - departures
    departure = DepartureModel.fit(axes, at_nodes - axes.nodes @ axes.slopes.T)
    flights = CheckFlights(axes.normals_of(checks), linear, departures, noise)
    drawn = None if errors.normal else axes.normals_of(errors.draw("random", SEED, DRAWN, 0, DRAWN))
    return examine(model, departure, flights, tolerance, simulated, drawn)
