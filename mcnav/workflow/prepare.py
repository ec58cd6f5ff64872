"""A campaign's system before its samples are simulated: engine, linear model, and corrections to the linear model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.execution.chunks import DrawPlan
from mcnav.execution.processes import IsolatedEngine
from mcnav.files import parquet_bytes
from mcnav.lincov.nonlinear_corrections import nonlinear_corrections
from mcnav.lincov.partials import SimulationFailed, partials_throughout
from mcnav.lincov.polynomial import PolynomialFitError
from mcnav.lincov.polynomial_engine import MAP, PolynomialEngine, prepare_engine
from mcnav.lincov.simulated_budget import simulated_budgets
from mcnav.sampling.error_model import ErrorModel
from mcnav.scenarios.protocol import (
    Engine,
    HasPartialsHistory,
    History,
    Output,
    Scenario,
    ScenarioError,
    Source,
    TimeHistoryEngine,
)
from mcnav.scenarios.soundness import Unsettled, check_repeatable, unsettled
from mcnav.scenarios.user import UserScenario
from mcnav.store.histories import STORED, epochs_table, histories_table, read_power_sums
from mcnav.store.manifest import ModelRecord, PartialsRecord, UnsettledRecord, Variable
from mcnav.store.parts import Part
from mcnav.store.run_folder import EPOCHS, HISTORIES, RunFolder

DEVELOPMENT_POINTS: Final = 61
"""Times of the error budget's history, where the scenario has partial derivatives throughout the flight."""

FEWEST_FOLLOWED: Final = 2
"""Samples with a history, below which there are no moments."""


@dataclass(frozen=True)
class PreparedCampaign:
    """A campaign's system with its engine.

    Attributes
    ----------
    scenario : Scenario
    draws : DrawPlan
    engine : Engine
    engine_name : str
    model : ModelRecord
        The linear model.
    history : History
    unsettled : UnsettledRecord or None
        The partial derivative for which there is no linear model to compare with.
    file : str
        The campaign's, for messages.
    timeout : float or None
        Time that one sample may take, s.
    """

    scenario: Scenario
    draws: DrawPlan
    engine: Engine
    engine_name: str
    model: ModelRecord
    history: History
    unsettled: UnsettledRecord | None
    file: str
    timeout: float | None

    def corrections(self) -> dict[str, Any]:
        """Compute what goes beyond the linear model from further simulations, as fields of `ModelRecord`.

        Raises
        ------
        CampaignError
            When the scenario or an engine cannot be simulated.
        """
        draws = self.draws

        def guard(engine: Engine) -> Engine:
            return _guarded(self.scenario, engine, self.timeout)

        def first_engine(probes: Array) -> Engine:
            own = self.engine.exact if isinstance(self.engine, PolynomialEngine) else self.engine
            same = self.engine_name in (MAP, self.scenario.engines[0]) and np.array_equal(probes, draws.probes())
            return guard(own if same else self.scenario.engine(self.scenario.engines[0], probes))

        with _scenario_errors(self.file):
            budget = simulated_budgets(
                first_engine, draws.errors, self.model.partials, draws.design, draws.seed, draws.samples
            )
            return nonlinear_corrections(self.scenario, guard(self.engine), draws.errors) | {"budget": budget}

    def write_epochs(self, folder: RunFolder, parts: Sequence[Part]) -> None:
        """Store histories of the first samples, and moments at every epoch of all, or with a polynomial of the first.

        Nothing is stored when the engine has no histories.
        """
        engine = _time_history_engine(self.engine)
        if engine is None:
            return
        errors, outputs, first = self.draws.errors, self.scenario.outputs, self.draws.draw(0, STORED)
        histories = engine.histories(first)
        sums = read_power_sums(self.engine, folder.parts, parts) or engine.history_sums(first)
        if sums.count < FEWEST_FOLLOWED:
            return
        partials, nominal = partials_throughout(engine, _sizes(self.scenario))
        linear = nominal + partials @ errors.mean, partials @ errors.covariance @ partials.swapaxes(1, 2)
        folder.write(EPOCHS, parquet_bytes(epochs_table(engine.epochs, outputs, sums, linear, histories)))
        folder.write(HISTORIES, parquet_bytes(histories_table(engine.epochs, outputs, histories)))


def prepare_campaign(campaign: Campaign, draws: DrawPlan, engine_name: str, force: bool = False) -> PreparedCampaign:
    """Prepare the system of a campaign for one of its engines.

    Parameters
    ----------
    campaign : Campaign
    draws : DrawPlan
    engine_name : str
    force : bool
        Whether to go on where partial derivatives are not settled.

    Raises
    ------
    CampaignError
        When it cannot be simulated, or is no function that a linear model could be compared with.
    """
    scenario, errors, file = campaign.scenario, draws.errors, campaign.file
    with _scenario_errors(file):
        doubt = None
        if isinstance(scenario, UserScenario):
            doubt = _doubt(scenario, draws, campaign.tolerance, campaign.sample_timeout)
            if doubt is not None and not force:
                raise CampaignError([Problem(file, "scenario", str(doubt))])
        engine = prepare_engine(scenario, engine_name, draws.probes(), errors.mean, errors.standard_deviations)
        model, history = _linear(scenario, errors, engine), scenario.history()
    record = None if doubt is None else UnsettledRecord(**asdict(doubt))
    return PreparedCampaign(scenario, draws, engine, engine_name, model, history, record, file, campaign.sample_timeout)


def _doubt(scenario: UserScenario, draws: DrawPlan, tolerance: float, timeout: float | None) -> Unsettled | None:
    """Check that a user's scenario is a function; return a partial derivative that is not settled, if any."""
    engine = _guarded(scenario, scenario.engine(scenario.engines[0], draws.probes()), timeout)
    check_repeatable(engine, scenario.sizes)
    varied = (draws.errors.standard_deviations > 0.0) | (draws.errors.mean != 0.0)
    return unsettled(scenario, engine, scenario.linear_model(), varied, tolerance)


def _guarded(scenario: Scenario, engine: Engine, timeout: float | None) -> Engine:
    """Run a user's code in a process of its own where it may end the process."""
    at_risk = isinstance(scenario, UserScenario) and (engine.parallel == "processes" or timeout is not None)
    return IsolatedEngine(engine, len(scenario.outputs), timeout) if at_risk else engine


@contextmanager
def _scenario_errors(file: str) -> Iterator[None]:
    """Convert errors of scenarios and engines into `CampaignError`."""
    try:
        yield
    except ScenarioError as wrong:
        raise CampaignError([Problem(file, f"scenario.{wrong.key}", str(wrong))]) from None
    except SimulationFailed as wrong:
        raise CampaignError([Problem(file, "scenario", str(wrong))]) from None
    except PolynomialFitError as wrong:
        raise CampaignError([Problem(file, "engine", str(wrong))]) from None


def _linear(scenario: Scenario, errors: ErrorModel, engine: Engine) -> ModelRecord:
    """Compute the linear model, at the end and, where it is known, throughout the flight."""
    linear = scenario.linear_model()
    optional: dict[str, Any] = {}
    time_history_engine = _time_history_engine(engine)
    if isinstance(scenario, HasPartialsHistory):
        optional["development"] = PartialsRecord(**asdict(scenario.partials_history(DEVELOPMENT_POINTS)))
    elif time_history_engine is not None:
        partials, _ = partials_throughout(time_history_engine, _sizes(scenario))
        epochs = time_history_engine.epochs
        optional["development"] = PartialsRecord(label=epochs.label, times=epochs.times, partials=partials)
    return ModelRecord(
        sources=_variables(scenario.sources),
        outputs=_variables(scenario.outputs),
        partials=linear.partials,
        nominal=linear.nominal,
        start_mean=errors.mean,
        start_covariance=errors.covariance,
        **optional,
    )


def _variables(entries: Sequence[Source | Output]) -> tuple[Variable, ...]:
    return tuple(Variable(name=entry.name, unit=entry.unit, shown_in=entry.shown_in) for entry in entries)


def _sizes(scenario: Scenario) -> Array:
    return np.array([source.nominal for source in scenario.sources])


def _time_history_engine(engine: Engine) -> TimeHistoryEngine | None:
    """Return the engine that computes time histories, if any: a polynomial's is the one it was fitted to."""
    engine = engine.exact if isinstance(engine, PolynomialEngine) else engine
    return engine if isinstance(engine, TimeHistoryEngine) else None
