"""A system before its samples are simulated: its engine, its linear model, and what is noticed of both."""

from __future__ import annotations

from dataclasses import dataclass
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
from mcnav.contract.linear import LinearSystem
from mcnav.contract.scenario import Scenario
from mcnav.errors import CampaignError, Problem
from mcnav.linear.at_epochs import differenced_at_epochs, filter_at_epochs, linear_throughout
from mcnav.linear.polynomial_engine import prepare_engine
from mcnav.linear.refusals import scenario_errors
from mcnav.runner.draws import DrawPlan
from mcnav.runner.soundness import find_doubt
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
from mcnav.workflow.rejections import doubt_about_gates

DEVELOPMENT_POINTS: Final = 61
"""Times of the error budget's history, where the scenario has partial derivatives throughout the flight."""


@dataclass(frozen=True)
class PreparedSystem:
    """A campaign whose samples can be simulated by one of its scenario's engines.

    Attributes
    ----------
    draws : DrawPlan
        The samples' errors.
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
    scenario, errors, file = campaign.scenario, campaign.errors, campaign.file
    mean, covariance = errors.mean, errors.covariance
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    with scenario_errors(file):
        doubt = find_doubt(scenario, draws, campaign.tolerance, campaign.sample_timeout)
        if doubt is not None and not force:
            raise CampaignError([Problem(file, "scenario", str(doubt))])
        engine = prepare_engine(scenario, engine_name, draws.probes(), mean, errors.standard_deviations)
        differenced = differenced_at_epochs(scenario, engine)
        prediction = filter_at_epochs(scenario, engine)
        end, system = scenario.linear().end, linear_throughout(scenario, DEVELOPMENT_POINTS, differenced)
        linear = Model.of(end, mean, covariance, scenario.outputs)
        requirements = requirements_from(campaign.requirements, [output.name for output in scenario.outputs])
        pairs = pairs_over_time(scenario.outputs, requirements)
        moments = linear.outcome_mean, np.sqrt(np.diag(linear.outcome_covariance))
        rounding = rounding_of_means(scenario.outputs, scenario.sources, end.partials, *moments)
        faults = predict_faults(scenario, mean, covariance)
        gates = doubt_about_gates(scenario, errors, campaign.tolerance)
        tails = tail_outputs(scenario, draws, engine, linear, campaign.sample_timeout)
        record = end_record(scenario.sources, scenario.outputs, end, mean, covariance).completed(
            {
                "mean_rounding": rounding,
                "development": None if system is None else partials_record(system, covariance, pairs),
                "filter": filter_record(engine, prediction, mean, covariance),
                "smoother": smoother_record(engine, scenario, covariance),
                "faults": tuple(fault_record(*fault, scenario.reading_times) for fault in faults) or None,
                "tail_outputs": tails,
                "gates": gates,
            }
        )
        unsettled = None if doubt is None else unsettled_record(doubt)
        history = drawable_history(scenario.nominal(), file)
        remarks = (*campaign.remarks, *scenario.remarks_on(mean, covariance))
    return PreparedSystem(
        campaign, draws, engine, engine_name, record, linear, requirements, differenced, prediction, history,
        unsettled, remarks,
    )  # fmt: skip
