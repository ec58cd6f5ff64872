"""A system before its samples are simulated: its engine, its linear model, and what is noticed of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Model
from mcnav.analysis.gates import predict_fault
from mcnav.analysis.mean_errors import rounding_of_means
from mcnav.analysis.requirements import Requirement, requirements_from
from mcnav.analysis.what_if import entries_of, picked_entries
from mcnav.config.campaign import Campaign
from mcnav.contract.engine import Engine, smoother_of
from mcnav.contract.filter_record import FilterPrediction
from mcnav.contract.history import History
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output
from mcnav.contract.scenario import Scenario, has_gates
from mcnav.errors import CampaignError, Problem
from mcnav.linear.at_epochs import differenced_at_epochs, filter_at_epochs
from mcnav.linear.polynomial_engine import prepare_engine
from mcnav.linear.refusals import scenario_errors
from mcnav.runner.chunks import DrawPlan
from mcnav.runner.soundness import find_doubt
from mcnav.sampler.error_model import ErrorModel
from mcnav.store.manifest import (
    FaultRecord,
    FilterRecord,
    ModelRecord,
    PartialsRecord,
    SmootherRecord,
    UnsettledRecord,
)
from mcnav.store.model_record import (
    fault_record,
    filter_record,
    origin_of,
    partials_record,
    smoother_record,
    unsettled_record,
    variables,
)
from mcnav.systems.histories import drawable_history
from mcnav.workflow.heavy_tails import tail_outputs
from mcnav.workflow.recorded_model import linear_model
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
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    with scenario_errors(file):
        doubt = find_doubt(scenario, draws, campaign.tolerance, campaign.sample_timeout)
        if doubt is not None and not force:
            raise CampaignError([Problem(file, "scenario", str(doubt))])
        engine = prepare_engine(scenario, engine_name, draws.probes(), errors.mean, errors.standard_deviations)
        differenced = differenced_at_epochs(scenario, engine)
        prediction = filter_at_epochs(scenario, engine)
        record = _record_at_end(scenario, errors)
        linear = linear_model(record)
        described = [output.model_dump() for output in record.outputs]
        requirements = requirements_from([entry.model_dump() for entry in campaign.requirements], described)
        moments = linear.outcome_mean, np.sqrt(np.diag(linear.outcome_covariance))
        record = record.completed(
            {
                "mean_rounding": rounding_of_means(scenario.outputs, scenario.sources, linear.partials, *moments),
                "development": _development(scenario, errors, differenced, requirements),
                "filter": _filter_record(engine, errors, prediction),
                "smoother": _smoother_record(engine, scenario, errors),
                "faults": _fault_records(scenario, errors) or None,
                "gates": doubt_about_gates(scenario, errors, campaign.tolerance),
            }
        )
        tails = tail_outputs(scenario, draws, engine, linear, campaign.sample_timeout)
        record = record.completed({"tail_outputs": tails})
        history = drawable_history(scenario.nominal(), file)
        remarks = scenario.remarks_on(errors.mean, errors.covariance)
    return PreparedSystem(
        campaign, draws, engine, engine_name, record, linear, requirements, differenced, prediction, history,
        None if doubt is None else unsettled_record(doubt), remarks,
    )  # fmt: skip


def _record_at_end(scenario: Scenario, errors: ErrorModel) -> ModelRecord:
    """Describe the linear model at the end."""
    end = scenario.linear().end
    record = ModelRecord(
        sources=variables(scenario.sources),
        outputs=variables(scenario.outputs),
        partials=end.partials,
        nominal=end.nominal,
        start_mean=errors.mean,
        start_covariance=errors.covariance,
    )
    return record.completed(
        {"origin": origin_of(scenario.outputs, end.origin), "processes": dict(end.processes) or None}
    )


def _development(
    scenario: Scenario, errors: ErrorModel, differenced: LinearSystem | None, requirements: Sequence[Requirement]
) -> PartialsRecord | None:
    """Describe the linear system throughout the flight; none where it is not known."""
    if scenario.parts.readings == "end":
        if differenced is None:
            return None
        return PartialsRecord(label=differenced.label, times=differenced.times, partials=differenced.partials)
    system = scenario.linear_over_time(DEVELOPMENT_POINTS)
    record = partials_record(system, errors.covariance)
    pairs = _pairs(scenario.outputs, requirements) if record.processes else ()
    if not pairs:
        return record
    added = {name: picked_entries(covariance, pairs) for name, covariance in system.processes.items()}
    return record.completed({"pairs": pairs, "process_pairs": added})


def _pairs(outputs: Sequence[Output], requirements: Sequence[Requirement]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of outputs that requirements over time limit together; the size of some stands for them."""
    places = {output.name: place for place, output in enumerate(outputs)}
    groups = list[Sequence[int]]()
    for requirement in requirements:
        if requirement.epochs and not requirement.of:
            size_of = outputs[requirement.outputs[0]].size_of if len(requirement.outputs) == 1 else ()
            groups.append([places[name] for name in size_of] or requirement.outputs)
    return entries_of(len(outputs), groups)[len(outputs) :]


def _filter_record(engine: Engine, errors: ErrorModel, prediction: FilterPrediction | None) -> FilterRecord | None:
    """Describe the filter of an engine; none without one."""
    if engine.filter is None or engine.epochs is None:
        return None
    return filter_record(engine.filter, engine.epochs, prediction, errors.mean, errors.covariance)


def _smoother_record(engine: Engine, scenario: Scenario, errors: ErrorModel) -> SmootherRecord | None:
    """Describe the smoother of an engine; none without one, and where linear analysis says nothing of it."""
    schema = smoother_of(engine)
    if schema is None or not scenario.parts.smoother:
        return None
    return smoother_record(schema, scenario.smoothed(), errors.covariance)


def _fault_records(scenario: Scenario, errors: ErrorModel) -> tuple[FaultRecord, ...]:
    """Describe the faults of sensors, with what linear analysis expects of their gates."""
    if not has_gates(scenario):
        return ()
    laws = scenario.fault_laws(errors.mean, errors.covariance)
    expected = ((law, predict_fault(law)) for law in laws)
    times = scenario.reading_times
    return tuple(fault_record(law, fault.rejections, fault.alarm, times) for law, fault in expected)
