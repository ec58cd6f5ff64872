"""Linear covariance of a campaign as commands ask for it: examined, with its gates and its ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

from mcnav.analysis.corrected_requirements import judge_by_order
from mcnav.analysis.gates import GateAnswer, answer_gates
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.requirements import requirements_from
from mcnav.arrays.types import Array
from mcnav.config.documents import Description
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.scenario import has_gates
from mcnav.execution.threads import one_thread
from mcnav.linear.refusals import scenario_errors
from mcnav.report.pages.lincov_page import card
from mcnav.studies.curved_tails import with_curvature
from mcnav.studies.examine import examine_campaign
from mcnav.studies.linear_answers import answer_linearly
from mcnav.systems.ins.recognition import is_ins


def linear_covariance(
    campaign: Description, times: Array | None = None, examine: bool | None = False, gates: bool | None = False
) -> LinearAnswer:
    """Compute the linear covariance of a campaign and judge its requirements for normal errors.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        Campaign file, campaign, or dictionary shaped like a campaign file.
    times : ndarray, shape (r,), optional
        Further times, in the trajectory's time, s.
    examine : bool, optional
        Whether simulations examine where linear analysis holds (`mcnav.analysis.examination`); with none, where that
        costs less than the answer and the simulator is compiled already.
    gates : bool, optional
        Whether flights that begin with a rejection answer what the laws of gates leave open; with none, where
        rejections are rare.

    Raises
    ------
    CampaignError
        When the campaign has mistakes, its scenario has no linear model, or a time lies outside its navigation.

    Examples
    --------
    >>> import mcnav as mc
    >>> answer = mc.linear_covariance({"scenario": {"type": "reentry", "trajectory": 1}, "errors": {"altitude": 5e3}})
    >>> round(float(answer.sigma[0]))  # m
    6126
    """
    began = perf_counter()
    described = campaign_from(campaign)
    answer = answer_linearly(described, times, gates=gates)
    with one_thread(), scenario_errors(described.file):
        answer = replace(answer, requirements=with_curvature(answer, described))
        about = described.scenario.remarks_on(described.errors.mean, described.errors.covariance)
        stopped = _gates(described)
        if examine is not False and answer.beyond is None:
            answer = _examined(answer, described, math.inf if examine else perf_counter() - began)
        if described.ranges:
            from mcnav.studies.box import answer_box  # which loads systems that others do without

            answer = replace(answer, box=answer_box(described, answer))
    return replace(
        answer, remarks=(*described.remarks, *about), gates=stopped, card=partial(card, outages=outages_of(described))
    )


def _examined(answer: LinearAnswer, campaign: Campaign, seconds: float) -> LinearAnswer:
    """Add the examination of an answer, which may take so many seconds, or the reason why it has none."""
    began = perf_counter()
    examined = examine_campaign(campaign, answer.model, seconds)
    if isinstance(examined, str):
        return replace(answer, unexamined=examined)
    return replace(
        answer, examination=examined, examined_in=perf_counter() - began,
        requirements=judge_by_order(answer.requirements, answer.model, examined),
    )  # fmt: skip


def _gates(campaign: Campaign) -> tuple[GateAnswer, ...]:
    """Answer what the gates of sensors stop; nothing without a gate."""
    scenario, errors = campaign.scenario, campaign.errors
    if not has_gates(scenario):
        return ()
    requirements = requirements_from(campaign.requirements, [output.name for output in scenario.outputs])
    return answer_gates(scenario.gate_laws(errors.mean, errors.covariance), scenario.gate_question, requirements)


def outages_of(campaign: Campaign) -> Mapping[str, Sequence[tuple[float, float]]]:
    """Return the outages of aiding sensors by their names."""
    if not is_ins(campaign.scenario):
        return {}
    return {sensor.name: sensor.outages for sensor in campaign.scenario.navigation.sensors}
