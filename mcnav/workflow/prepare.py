"""A campaign's system before its samples fly: the engine, the linear model, and what goes beyond linear."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.execution.processes import IsolatedEngine
from mcnav.files import parquet_bytes
from mcnav.lincov.corrections import nonlinear_corrections, simulated_budgets
from mcnav.lincov.partials import SimulationFailed, partials_throughout
from mcnav.lincov.polynomial import PolynomialFitError
from mcnav.lincov.polynomial_engine import PolynomialEngine, prepare_engine
from mcnav.scenarios.protocol import Engine, HasPartialsHistory, History, ScenarioError, TimeHistoryEngine
from mcnav.scenarios.soundness import check_repeatable, unsettled
from mcnav.scenarios.user import UserScenario
from mcnav.store import histories as epochs
from mcnav.store.parts import Part
from mcnav.store.run_folder import EPOCHS, HISTORIES, RunFolder

DEVELOPMENT_POINTS: Final = 61
"""Times at which the error budget is shown, where the scenario knows it throughout the flight."""

FEWEST_FOLLOWED: Final = 2
"""Samples followed throughout the flight, below which there are no moments."""


@dataclass(frozen=True)
class PreparedCampaign:
    """A campaign's system, ready to fly.

    Attributes
    ----------
    prepared : Engine
        The engine.
    model : dict
        The linear model, as the manifest keeps it.
    history : History
    beyond : callable
        What goes beyond the linear model, from flights on the side: more of what the manifest keeps.
    unsettled : dict or None
        The partial derivative for which there is no linear model to compare with, as the manifest keeps it.
    """

    engine: Engine
    model: dict[str, Any]
    history: History
    beyond: Callable[[], dict[str, Any]]
    unsettled: dict[str, Any] | None = None


def prepare_campaign(campaign: Campaign, engine: str, probes: Array, force: bool = False) -> PreparedCampaign:
    """The system of a campaign for one of its engines.

    Parameters
    ----------
    campaign : Campaign
    engine : str
    probes : ndarray, shape (n, sources)
    force : bool
        Whether to go on where partial derivatives are not settled.

    Raises
    ------
    CampaignError
        When it cannot be flown, or is no function that a linear model could be compared with; also by
        `System.beyond`.
    """
    errors = campaign.errors
    with _told(campaign):
        doubt = _doubt(campaign, probes, force) if isinstance(campaign.scenario, UserScenario) else None
        prepared = prepare_engine(campaign.scenario, engine, probes, errors.mean, errors.standard_deviations)
        model = _linear(campaign, prepared)
        return PreparedCampaign(
            prepared, model, campaign.scenario.history(), partial(_beyond, campaign, prepared, model), doubt
        )


def _doubt(campaign: Campaign, probes: Array, force: bool) -> dict[str, Any] | None:
    """Try out whether a user's scenario is a function, and has derivatives; `CampaignError` unless forced to go on."""
    scenario, errors = campaign.scenario, campaign.errors
    if not isinstance(scenario, UserScenario):
        return None
    prepared = _guarded(campaign, scenario.engine(scenario.engines[0], probes))
    check_repeatable(prepared, scenario.sizes)
    varied = (errors.standard_deviations > 0.0) | (errors.mean != 0.0)
    found = unsettled(scenario, prepared, scenario.linear_model(), varied, campaign.tolerance)
    if found is None:
        return None
    if not force:
        raise CampaignError([Problem(campaign.file, "scenario", str(found))])
    return found.described()


def _guarded(campaign: Campaign, engine: Engine) -> Engine:
    """Let flights of a user's code end their process, but not this one."""
    at_risk = isinstance(campaign.scenario, UserScenario) and (
        engine.parallel == "processes" or campaign.sample_timeout is not None
    )
    return IsolatedEngine(engine, len(campaign.scenario.outputs), campaign.sample_timeout) if at_risk else engine


@contextmanager
def _told(campaign: Campaign) -> Iterator[None]:
    """What a scenario or an engine cannot do is a mistake of the campaign."""
    try:
        yield
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.file, f"scenario.{wrong.key}", str(wrong))]) from None
    except SimulationFailed as wrong:
        raise CampaignError([Problem(campaign.file, "scenario", str(wrong))]) from None
    except PolynomialFitError as wrong:
        raise CampaignError([Problem(campaign.file, "engine", str(wrong))]) from None


def _linear(campaign: Campaign, prepared: Engine) -> dict[str, Any]:
    """The linear model, at the end and throughout."""
    scenario, errors = campaign.scenario, campaign.errors
    linear = scenario.linear_model()
    model: dict[str, Any] = {
        "sources": [
            {"name": source.name, "unit": source.unit, "shown_in": source.shown_in} for source in scenario.sources
        ],
        "outputs": [
            {"name": output.name, "unit": output.unit, "shown_in": output.shown_in} for output in scenario.outputs
        ],
        "partials": linear.partials,
        "nominal": linear.nominal,
        "start_mean": errors.mean,
        "start_covariance": errors.covariance,
    }
    followed = _followed(prepared)
    if isinstance(scenario, HasPartialsHistory):
        known = scenario.partials_history(DEVELOPMENT_POINTS)
        model["development"] = {"label": known.label, "times": known.times, "partials": known.partials}
    elif followed is not None:
        throughout, _ = partials_throughout(followed, np.array([source.nominal for source in scenario.sources]))
        known_at = followed.epochs
        model["development"] = {"label": known_at.label, "times": known_at.times, "partials": throughout}
    return model


def _beyond(campaign: Campaign, prepared: Engine, model: Mapping[str, Any]) -> dict[str, Any]:
    """Unscented transform, derivatives of higher order and the error budget by flights."""
    scenario, errors = campaign.scenario, campaign.errors

    guard = partial(_guarded, campaign)
    with _told(campaign):
        budgets = simulated_budgets(
            lambda probes: guard(scenario.engine(scenario.engines[0], probes)),
            errors, model["partials"], campaign.design, campaign.seed, campaign.samples,
        )  # fmt: skip
        return nonlinear_corrections(scenario, guard(prepared), errors) | {"budget": budgets}


def _followed(prepared: Engine) -> TimeHistoryEngine | None:
    """The engine that knows errors throughout the flight, if there is one: a map's is the one it was fitted to."""
    engine = prepared.exact if isinstance(prepared, PolynomialEngine) else prepared
    return engine if isinstance(engine, TimeHistoryEngine) else None


def write_epochs(campaign: Campaign, prepared: Engine, folder: RunFolder, parts: list[Part]) -> None:
    """Histories of the first samples; moments of all of them, or with a map of the first, at every epoch."""
    followed = _followed(prepared)
    if followed is None:
        return
    scenario, errors = campaign.scenario, campaign.errors
    first = errors.draw(campaign.design, campaign.seed, campaign.samples, 0, min(epochs.STORED, campaign.samples))
    histories = followed.histories(first)
    sums = epochs.read_power_sums(prepared, folder.parts, parts) or followed.history_sums(first)
    if sums.count < FEWEST_FOLLOWED:
        return
    partials, nominal = partials_throughout(followed, np.array([source.nominal for source in scenario.sources]))
    linear = nominal + partials @ errors.mean, partials @ errors.covariance @ partials.swapaxes(1, 2)
    known = followed.epochs
    table = epochs.epochs_table(known, scenario.outputs, sums, linear, histories)
    folder.write(EPOCHS, parquet_bytes(table))
    folder.write(HISTORIES, parquet_bytes(epochs.histories_table(known, scenario.outputs, histories)))
