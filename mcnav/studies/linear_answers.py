"""Linear covariance of a campaign: at its end, over time, by cause, and against its requirements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_answer import LinearAnswer, judge_linearly, within_range
from mcnav.analysis.linear_covariance import LinearCovariance, covariance_over_time
from mcnav.analysis.linear_filter import LinearVerdict, judge_filter
from mcnav.analysis.linear_range import picked
from mcnav.analysis.model import Model
from mcnav.analysis.rejections import RejectionAnswer
from mcnav.analysis.requirements import requirements_from, smallest_limits
from mcnav.analysis.withheld import with_rejections
from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.linear import LinearModel, LinearSystem
from mcnav.contract.questions import Question, reason_against
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.errors import CampaignError, Problem
from mcnav.execution.threads import one_thread
from mcnav.linear.refusals import scenario_errors
from mcnav.physics.units import UnitError, quantity
from mcnav.systems.user.scenario import is_users
from mcnav.workflow.rejections import rejections_of


def answer_linearly(
    described: Campaign, times: Array | None = None, by_cause: bool = True, gates: bool | None = False
) -> LinearAnswer:
    """Compute what `linear_covariance` does, without what the scenario notices of itself.

    ``by_cause``: whether each process is known by itself, and not all together.
    """
    scenario, errors = described.scenario, described.errors
    names = tuple(source.name for source in scenario.sources)
    with one_thread(), scenario_errors(described.file):
        if not by_cause:
            scenario = scenario.with_processes_together()
        if times is not None:
            _check_times(described, times)
        _check_soundness(described)
        linear, readings = _linearize(scenario)
        model = end_model(described, linear)
        moments = errors.mean, errors.covariance
        history = None if readings is None else covariance_over_time(readings, names, *moments)
        required = requirements_from(described.requirements, [output.name for output in scenario.outputs])
        smoothed = None
        if scenario.parts.smoother:
            smoothed = covariance_over_time(scenario.smoothed(scenario.reading_times), names, *moments)
        judged = tuple(
            judge_linearly(
                [each], model.outcome_mean, model.outcome_covariance, None if known is None else known.moments,
                model.sizes, model.nominal, model.origin,
            )[0]
            for each in required
            for known in [smoothed if each.of else history]
        )  # fmt: skip
        asked = None
        if times is not None:
            asked = covariance_over_time(_linear_at(described, np.unique(times)), names, *moments)
        kind = str(described.resolved["scenario"]["type"])
        answer = LinearAnswer(
            described.name, scenario.sources, scenario.outputs, model, history, judged, asked, kind=kind
        )
        smoothed_asked = None
        if scenario.parts.smoother and times is not None:
            smoothed_asked = covariance_over_time(scenario.smoothed(np.unique(times)), names, *moments)
        epochs = None if history is None else history.moments.times
        known = [each for each in (history, asked) if each is not None]
        asked_epochs = sorted({epoch for record in described.requirements for epoch in record.epochs or ()})
        laws, rejections = rejections_of(scenario, described.errors, described.tolerance, asked_epochs, gates)
        filtered = judge_filter_of(answer, known, scenario, described.tolerance)
        smoother = None if smoothed is None else judge_filter_of(answer, [smoothed], scenario, described.tolerance)
        return replace(
            answer,
            requirements=within_range(
                with_rejections(judged, laws, rejections, model.outcome_mean), answer.beyond, epochs
            ),
            filter=_with_rejections(filtered, rejections),
            smoothed=smoothed,
            smoothed_asked=smoothed_asked,
            smoother=_with_rejections(smoother, rejections),
            rejections=rejections,
        )


def end_model(campaign: Campaign, linear: LinearModel) -> Model:
    """Return the linear model of a campaign at its end, with the limits of its requirements."""
    outputs, errors = campaign.scenario.outputs, campaign.errors
    required = requirements_from(campaign.requirements, [output.name for output in outputs])
    model = Model.of(linear, errors.mean, errors.covariance, outputs)
    return replace(model, limits=smallest_limits(required, len(outputs)))


def _with_rejections(verdict: LinearVerdict | None, rejections: RejectionAnswer | None) -> LinearVerdict | None:
    """Withhold that a filter is consistent where rejections of good measurements can break it."""
    if verdict is None or rejections is None or rejections.consistent or verdict.verdict != Honesty.CONSISTENT:
        return verdict
    return replace(verdict, verdict=Honesty.UNDECIDED)


def judge_filter_of(
    answer: LinearAnswer, known: Sequence[LinearCovariance], scenario: Scenario, tolerance: float
) -> LinearVerdict | None:
    """Judge a filter, or a smoother, at the readings that are known, within the range of linear analysis."""
    schema = scenario.filter_schema
    if schema is None:
        return None
    return judge_filter(
        [picked(each, ~answer.readings_beyond(each) & _stated(each)) for each in known],
        [output.name for output in answer.outputs],
        schema.groups,
        [source.name for source in answer.sources],
        answer.model.covariance,
        tolerance,
        [output.unit for output in answer.outputs],
        answer.model.floor,
        answer.model.scales,
    )


def _stated(covariance: LinearCovariance) -> NDArray[np.bool_]:
    """Tell at which readings, shape (r,), the navigator states a covariance of anything."""
    own = covariance.readings.own
    if own is None:
        return np.ones(len(covariance.readings.times), dtype=bool)
    return np.asarray(np.isfinite(np.diagonal(own, axis1=1, axis2=2)).any(axis=1))


def _check_times(campaign: Campaign, times: Array) -> None:
    """Refuse times for a scenario whose linear system is not known at any time, and those outside of its epochs."""
    scenario = campaign.scenario
    if reason := reason_against(Question.ANY_TIME, scenario.parts):
        raise CampaignError([Problem(campaign.file, "--at", reason)])
    if not len(scenario.reading_times):
        return
    first, last = (float(time) for time in scenario.reading_times[[0, -1]])
    outside = [float(time) for time in times if not first <= time <= last]
    if outside:
        message = f"got {outside[0]:.10g} s; navigation is from {first:.10g} s to {last:.10g} s"
        raise CampaignError([Problem(campaign.file, "--at", message)])


def _linear_at(campaign: Campaign, times: Array) -> LinearSystem:
    """Linearize at times, rising, s; `CampaignError` outside of the flight."""
    try:
        return campaign.scenario.linear(times)
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.file, f"--{wrong.key}", str(wrong))]) from None


def _check_soundness(campaign: Campaign) -> None:
    """Refuse a user's own scenario that has no linear model."""
    if not is_users(campaign.scenario):
        return
    from mcnav.runner.draws import DrawPlan  # with a run's files, which other scenarios do not need
    from mcnav.runner.soundness import exact_engine, find_doubt

    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    engine = exact_engine(campaign.scenario, draws.probes(), campaign.sample_timeout)
    doubt = find_doubt(campaign.scenario, engine, campaign.errors, campaign.tolerance)
    if doubt is not None:
        raise CampaignError([Problem(campaign.file, "scenario", str(doubt))])


def _linearize(scenario: Scenario) -> tuple[LinearModel, LinearSystem | None]:
    """Linearize a scenario at its end and, where it is known, over time: at the epochs of its requirements, if any."""
    if scenario.parts.readings == "any time" and len(scenario.reading_times):
        system = scenario.linear(scenario.reading_times)
        return system.end, system
    end = scenario.linear().end
    if scenario.parts.readings == "end":
        return end, None
    system = scenario.linear_over_time()
    schema, prediction = scenario.filter_schema, scenario.filter_prediction()
    if schema is not None and prediction is not None and np.array_equal(prediction.times, system.times):
        own, believed = prediction.covariance, dict(prediction.believed)
        system = replace(system, own=own, own_outputs=schema.known, believed=believed)
    return end, system


def read_times(written: str) -> Array:
    """Read times separated by commas, such as ``600 s, 25 min``; `CampaignError` when one is none."""
    try:
        return np.array([quantity(piece.strip(), "s") for piece in written.split(",")])
    except UnitError as wrong:
        raise CampaignError([Problem("--at", "", str(wrong))]) from None
