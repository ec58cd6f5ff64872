"""A system before its samples are simulated: its engine, its linear model, and what is noticed of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.analysis.gates import predict_faults
from mcnav.analysis.mean_errors import rounding_of_means
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement, requirements_from
from mcnav.analysis.what_if import pairs_over_time
from mcnav.config.campaign import Campaign
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction
from mcnav.contract.history import History
from mcnav.contract.linear import LinearModel, LinearSystem
from mcnav.contract.members import ready_engine
from mcnav.contract.scenario import Scenario
from mcnav.errors import CampaignError, Problem
from mcnav.linear.at_epochs import differenced_at_epochs, filter_at_epochs, linear_throughout, stated_at_epochs
from mcnav.linear.polynomial_engine import MAP, exact_name, fit_polynomial_engine
from mcnav.linear.refusals import scenario_errors
from mcnav.runner.draws import DrawPlan
from mcnav.runner.soundness import find_doubt, isolated
from mcnav.runner.tail_outputs import tail_outputs
from mcnav.store.manifest import ModelRecord, UnsettledRecord
from mcnav.store.model_record import (
    end_record,
    fault_record,
    filter_record,
    partials_record,
    smoother_record,
    unsettled_record,
)
from mcnav.systems.histories import drawable_history
from mcnav.workflow.rejections import DoubtAboutGates

DEVELOPMENT_POINTS: Final = 61
"""Times of the error budget's history, where the scenario has partial derivatives throughout the flight."""


@dataclass(frozen=True)
class PreparedSystem:
    """A campaign whose samples can be simulated by one of its scenario's engines.

    Attributes
    ----------
    draws : DrawPlan
        The samples' errors.
    engine : Engine
        That simulates samples, made and checked once.
    exact, flown : Engine
        The engine that is no polynomial, and ``engine``, for simulations beside the samples: in a process of its own
        where a user's code may end the process.
    engine_name : str
    model : ModelRecord
        The linear model, as it is stored.
    linear : Model
        The same, as samples are compared with it.
    requirements : tuple of Requirement
        Those of the campaign.
    differenced : LinearSystem or None
        Partial derivatives at the engine's epochs by differences; none where the engine has no histories.
    prediction : FilterPrediction or None
        What linear analysis says of the filter at the engine's epochs; none where it says nothing of them.
    unsettled : UnsettledRecord or None
        The partial derivative for which there is no linear model to compare with.
    remarks : tuple of str
        What the scenario notices of itself.
    """

    campaign: Campaign
    draws: DrawPlan
    engine: Engine
    exact: Engine
    flown: Engine
    engine_name: str
    model: ModelRecord
    linear: Model
    requirements: tuple[Requirement, ...]
    differenced: LinearSystem | None
    prediction: FilterPrediction | None
    history: History
    unsettled: UnsettledRecord | None
    remarks: tuple[str, ...]

    @property
    def scenario(self) -> Scenario:
        """The campaign's scenario."""
        return self.campaign.scenario

    @cached_property
    def at_epochs(self) -> LinearSystem | None:
        """Partial derivatives at the engine's epochs, by differences or else as the scenario states them; or none."""
        return stated_at_epochs(self.scenario, self.exact) if self.differenced is None else self.differenced

    @property
    def timeout(self) -> float | None:
        """Time limit of one sample, s."""
        return self.campaign.sample_timeout


def prepare_system(campaign: Campaign, engine_name: str, force: bool = False) -> PreparedSystem:
    """Prepare a campaign's system for one of its scenario's engines.

    With ``force`` it goes on when partial derivatives do not converge.

    Raises
    ------
    CampaignError
        When it cannot be simulated, or is no function that a linear model could be compared with.
    """
    scenario, errors, timeout = campaign.scenario, campaign.errors, campaign.sample_timeout
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    with scenario_errors(campaign.file):
        gates = DoubtAboutGates.of(campaign)
        engine = ready_engine(scenario, exact_name(scenario, engine_name), draws.probes())
        exact = isolated(scenario, engine, timeout)
        doubt = find_doubt(scenario, exact, errors, campaign.tolerance)
        if doubt is not None and not force:
            raise CampaignError([Problem(campaign.file, "scenario", str(doubt))])
        requirements = requirements_from(campaign.requirements, [output.name for output in scenario.outputs])
        pairs = pairs_over_time(scenario.outputs, requirements)
        if engine_name == MAP:
            engine = fit_polynomial_engine(engine, errors.mean, errors.standard_deviations)
        end = scenario.linear().end
        linear = Model.of(end, errors.mean, errors.covariance, scenario.outputs)
        flown = isolated(scenario, engine, timeout)
        tails = tail_outputs(scenario.outputs, draws, flown, linear)
        unsettled = None if doubt is None else unsettled_record(doubt)
        history = drawable_history(scenario.nominal(), campaign.file)
        remarks = (*campaign.remarks, *scenario.remarks_on(errors.mean, errors.covariance), *gates.unseen)
        differenced, prediction = differenced_at_epochs(scenario, engine), filter_at_epochs(scenario, engine)
        model = _describe(campaign, engine, end, linear, differenced, prediction, pairs)
    return PreparedSystem(
        campaign=campaign,
        draws=draws,
        engine=engine,
        exact=exact,
        flown=flown,
        engine_name=engine_name,
        model=model.completed({"tail_outputs": tails, "gates": gates.doubt}),
        linear=linear,
        requirements=requirements,
        differenced=differenced,
        prediction=prediction,
        history=history,
        unsettled=unsettled,
        remarks=remarks,
    )


def _describe(
    campaign: Campaign, engine: Engine, end: LinearModel, linear: Model, differenced: LinearSystem | None,
    prediction: FilterPrediction | None, pairs: Sequence[tuple[int, int]],
) -> ModelRecord:  # fmt: skip
    """Describe the linear model for the manifest: at the end, over time, of the filter, smoother and faults."""
    scenario, mean, covariance = campaign.scenario, campaign.errors.mean, campaign.errors.covariance
    sigma = np.sqrt(np.diag(linear.outcome_covariance))
    rounding = rounding_of_means(scenario.outputs, scenario.sources, end.partials, linear.outcome_mean, sigma)
    faults = predict_faults(scenario, mean, covariance)
    system = linear_throughout(scenario, DEVELOPMENT_POINTS, differenced)
    return end_record(scenario.sources, scenario.outputs, end, mean, covariance).completed(
        {
            "mean_rounding": rounding,
            "faults": tuple(fault_record(*fault, scenario.reading_times) for fault in faults) or None,
            "development": None if system is None else partials_record(system, covariance, pairs),
            "smoother": smoother_record(engine, scenario, covariance),
            "filter": filter_record(engine, prediction, mean, covariance),
        }
    )
