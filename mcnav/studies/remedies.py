"""What would help a campaign where its filter or a requirement fails: every change is computed, the best first.

Numbers of the data sheet follow from the linear covariance as a function of them (`mcnav.analysis.what_if`), which has
the filter's gains held. Other changes, and numbers where a filter is re-tuned, are campaigns of their own, whose linear
covariance is computed. A run computes the most promising remedy, ``mcnav report --remedies`` all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from time import perf_counter
from typing import Final

import numpy as np

from mcnav.analysis.examination import Linearity
from mcnav.analysis.improvements import Improvement, improvements
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.remedies import (
    Remedies,
    Remedy,
    Standing,
    doubted_last,
    helps,
    ranked,
)
from mcnav.config.read import Campaign, parse_campaign
from mcnav.errors import CampaignError
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.physics.units import conversion
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.failing_campaign import Case, case_of_answer
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.remedy_changes import Change, changes_of_filter, changes_of_numbers, changes_of_sensors

RETUNED: Final = 3
"""Numbers of which the filter is re-tuned, those that help most with its gains held."""

QUICK: Final = 1.0 / 3.0
"""Share of the time of answers that their examination may take where nobody asked for all remedies."""

LISTED: Final = 8
"""Remedies that are kept."""

NO_LINEAR: Final = "by samples the filter is {}; linear analysis finds it consistent, and cannot say what would help"
NO_NUMBER: Final = "no number of the campaign file sizes these errors"
NOTHING: Final = "nothing that was computed makes it better"
NOT_HERE: Final = "linear analysis does not hold here: mcnav run, then mcnav report RUN --remedies simulates what helps"
NO_MODEL: Final = "there is no linear model of this run"


def find_remedies(
    case: Case, thorough: bool, progress: Progress = SILENT, examine: bool | None = None, expected: float = math.inf
) -> Remedies:
    """Compute what would help, the best first; behind them those of which linear analysis does not hold.

    Parameters
    ----------
    thorough : bool
        Whether all changes are computed that take a linear covariance of their own; else the first of them.
    examine : bool, optional
        Whether flights examine linear analysis of what is listed; by default while that takes less than `QUICK` of the
        answers, or where they are thorough than the answers.
    expected : float
        What an examination is expected to take, s.
    """
    began = perf_counter()
    remedies = Remedies(
        failing=case.failing, at=case.at, now=case.now, beside=case.beside, missed=case.missed,
        output="" if case.departing is None else case.outputs[case.departing.output],
    )  # fmt: skip
    if case.what_if is None:
        return remedies.completed({"reason": NO_MODEL})
    if case.what_if.gates:
        return remedies.completed({"reason": case.what_if.gates})
    if case.failing == "filter" and case.departing is None and not case.unmodelled:
        return remedies.completed({"reason": NO_LINEAR.format(case.verdict)})
    numbers = _numbers(case)
    own = [] if case.has_code else [*changes_of_filter(case.document.content, case.unmodelled)]
    if case.failing == "requirement" and not case.has_code:
        own += changes_of_sensors(case.document.content)
    if thorough and case.tuned:
        own += [change for change, _ in numbers[:RETUNED]]
    computed, left = _computed(case, own if thorough else own[:1], progress), 0 if thorough else max(len(own) - 1, 0)
    known = {remedy.words for remedy in computed}
    held = [remedy for change, remedy in numbers if change.words not in known]
    listed = [remedy for remedy in ranked([*computed, *held], case.failing) if helps(remedy, remedies)]
    reason = "" if listed else NOTHING if case.what_if.campaign.sliders else NO_NUMBER
    seconds = perf_counter() - began
    examiner = Examiner(examine, seconds) if thorough else Examiner(examine, QUICK * seconds, expected)
    examined = [_examined(case, remedy, examiner) for remedy in listed[:LISTED]]
    return remedies.completed(
        {"listed": doubted_last(examined), "reason": reason or None, "left": left, "unexamined": examiner.reason}
    )


def _examined(case: Case, remedy: Remedy, examiner: Examiner) -> Remedy:
    """Examine linear analysis of a changed campaign, for what fails."""
    if not examiner.open:
        return remedy
    try:
        campaign = case.read(remedy)
    except CampaignError:
        return remedy
    examined = examiner.examine(campaign)
    if examined is None:
        return remedy
    return remedy.completed({"linearity": examined.verdict_on(_concerned(case, campaign)).value})


def _concerned(case: Case, campaign: Campaign) -> Sequence[int]:
    """Return the outputs that what fails is about: those of requirements, or that of a filter that departs the most."""
    names = [output.name for output in campaign.scenario.outputs]
    if case.failing == "requirement":
        return sorted({names.index(name) for record in campaign.requirements for name in record.outputs})
    return range(len(names)) if case.departing is None else [case.departing.output]


def _numbers(case: Case) -> list[tuple[Change, Remedy]]:
    """Return each number one grade finer, or half as large, with its effect where gains are held; the best first."""
    assert case.what_if is not None
    departing = case.departing if case.failing == "filter" else None
    found = improvements(case.what_if, departing)
    by_path = {each.slider.path: each for each in found}
    changes = changes_of_numbers(case.document.content, case.sources, found)
    return [(change, case.remedy(change, _then(case, by_path[change.path]), case.tuned)) for change in changes]


def _then(case: Case, better: Improvement) -> Standing:
    """Return the effect of a better number where gains are held."""
    ratio = 1.0 if math.isnan(better.departing) else better.departing
    used = math.nan if better.used is None else better.used
    return case.now.completed({"ratio": case.ratio * ratio, "sigma": case.now.sigma * ratio, "used": used})


def _computed(case: Case, changes: Sequence[Change], progress: Progress) -> list[Remedy]:
    """Answer campaigns with a change each by linear covariance; those that are refused are left out."""
    remedies = []
    if len(changes) > 1:
        progress.phase(Phase.SIMULATING, len(changes), "remedies")
    for change in changes:
        try:
            campaign = parse_campaign(change.content, case.document.file, case.document.stem, code=case.document.code)
            then = _standing(case, answer_linearly(campaign, by_cause=False))
        except CampaignError:
            continue  # such as an error that has no state
        remedies.append(case.remedy(change, then))
        if len(changes) > 1:
            progress.advance(1)
    return remedies


def _standing(case: Case, answer: LinearAnswer) -> Standing:
    """Return what a linear answer says of what fails."""
    shares = [
        (scale if scale > 0.0 else 1.0) / row.margin
        for row, scale in zip(answer.requirements, case.scales or [1.0] * len(answer.requirements), strict=True)
        if row.judged and row.requirement.kind != "box" and row.margin > 0.0
    ]  # fmt: skip
    sigma, history = math.nan, answer.history
    if case.departing is not None and history is not None:
        time = case.departing.time * conversion(_unit(case.label), _unit(history.readings.label))
        reading = int(np.argmin(np.abs(history.readings.times - time)))
        sigma = float(history.sigma[reading, case.departing.output])
    judged = answer.filter
    return Standing(
        verdict="" if judged is None else judged.verdict.value, ratio=math.nan if judged is None else judged.factor,
        sigma=sigma, used=max(shares, default=math.nan),
    )  # fmt: skip


def _unit(label: str) -> str:
    return label.partition(" [")[2].removesuffix("]")


def remedies_of_answer(
    campaign: Campaign, answer: LinearAnswer, thorough: bool = False, progress: Progress = SILENT,
    examine: bool | None = None,
) -> Remedies | None:  # fmt: skip
    """Return what would help a campaign by its linear covariance; none where nothing fails.

    There is no advice where linear analysis does not hold of what fails.
    """
    with one_thread():
        case = case_of_answer(campaign, answer)
        if case is None:
            return None
        examined = answer.examination
        if examined is not None and examined.verdict_on(_concerned(case, campaign)) == Linearity.FAILS:
            return Remedies(failing=case.failing, at=case.at, now=case.now, beside=case.beside, reason=NOT_HERE)
        return find_remedies(case, thorough, progress, examine, answer.examined_in)
