"""What would help a campaign where its filter or a requirement fails: every change is computed, the best first.

Numbers of the data sheet follow from the linear covariance as a function of them (`mcnav.analysis.what_if`), which has
the filter's gains held. Other changes, and numbers where a filter is re-tuned, are campaigns of their own, whose linear
covariance is computed; a run computes the one that promises most, and ``mcnav report --remedies`` all.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.improvements import Improvement, improvements
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.remedies import (
    Failing,
    Remedies,
    Remedy,
    Standing,
    helps,
    ranked,
    something_fails,
)
from mcnav.analysis.requirements import Finding
from mcnav.analysis.simulated_requirements import least_margin
from mcnav.config.documents import Document
from mcnav.config.read import Campaign, parse_campaign
from mcnav.errors import CampaignError, reading_file
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.physics.units import conversion
from mcnav.report.results.model import RunAnalysis
from mcnav.runner.executors import JOBS
from mcnav.statistics.demonstration import runs_to_show
from mcnav.store.run_files import CAMPAIGN
from mcnav.store.run_folder import RunFolder
from mcnav.studies.failing_campaign import Case, case_of_answer, case_of_run, document_and_place
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.remedy_changes import Change, changes_of_filter, changes_of_numbers, changes_of_sensors
from mcnav.studies.simulated_campaigns import MOST_SAMPLES, simulated
from mcnav.workflow.analyse import analyse, write_results
from mcnav.workflow.stored_remedies import keep_remedies

RETUNED: Final = 3
"""Numbers of which the filter is re-tuned, those that help most with its gains held."""

CONFIRMED: Final = 3
"""Remedies that are simulated, until samples confirm one."""

LISTED: Final = 8
"""Remedies that are kept."""

FEWEST: Final = 500
"""Samples of a remedy that is simulated; more where a requirement needs them."""

SPARE: Final = 4
"""Times the samples that bound a requirement if none lies beyond it: a bound close to the estimate."""

FAILS: Final = "linear analysis fails in this run: mcnav report --remedies simulates what would help"
NO_LINEAR: Final = "by samples the filter is {}; linear analysis finds it consistent, and cannot say what would help"
NO_NUMBER: Final = "no number of the campaign file sizes these errors"
NOTHING: Final = "nothing that was computed makes it better"
CODE: Final = "the run folder's code is not executed: --campaign FILE simulates what would help"
IN_FOLDER: Final = "in the folder of this report"
UNCONFIRMED: Final = "samples confirm nothing that linear analysis proposes"
NO_MODEL: Final = "there is no linear model of this run"


def find_remedies(case: Case, thorough: bool, progress: Progress = SILENT) -> Remedies:
    """Compute what would help, the best first.

    Parameters
    ----------
    thorough : bool
        Whether all changes are computed that take a linear covariance of their own; else the first of them.
    """
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
    return remedies.completed({"listed": tuple(listed[:LISTED]), "reason": reason or None, "left": left})


def _numbers(case: Case) -> list[tuple[Change, Remedy]]:
    """Return each number one grade finer, or half as large, with its effect where gains are held; the best first."""
    assert case.what_if is not None
    departing = case.departing if case.failing == "filter" else None
    found = improvements(case.what_if, departing).listed
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
            then = _standing(case, answer_linearly(campaign))
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


def linear_holds(content: RunAnalysis, failing: Failing) -> bool:
    """Return whether linear analysis predicts what fails in a run: the sigmas, and values of requirements."""
    summary = content.summary
    if failing == "requirement":
        unmet = [entry for entry in summary.requirements if entry.finding == Finding.NOT_MET]
        return all(entry.linear_meets is False and _within(entry.linear, entry.interval) for entry in unmet)
    return summary.verdict in ("agrees", "undecided")


def _within(value: float | None, interval: tuple[float | None, float | None]) -> bool:
    low, high = interval
    return value is not None and (low is None or low <= value) and (high is None or value <= high)


def confirm(case: Case, remedies: Remedies, content: RunAnalysis, jobs: int, progress: Progress) -> Remedies:
    """Simulate the first remedies with the draws of the run until samples confirm one; the others are withheld.

    Where linear analysis predicts what fails, the best is simulated, and others are kept as linear analysis has them.
    """
    holds = linear_holds(content, remedies.failing)
    samples = samples_for(content)
    listed, kept, withheld = list(remedies.listed), list[Remedy](), list[str]()
    for place, remedy in enumerate(listed):
        if place == 0 or (place < CONFIRMED and not holds and not any(done.confirmed for done in kept)):
            kept.append(_simulated(case, remedy, remedies.failing, samples, jobs, progress))
        elif holds:
            kept.append(remedy)
        else:
            withheld.append(remedy.words)
    if not holds:
        withheld = [*(remedy.words for remedy in kept if not remedy.confirmed), *withheld]
        kept = [remedy for remedy in kept if remedy.confirmed]
    reason = "" if kept else "samples confirm nothing that linear analysis proposes"
    return remedies.completed(
        {
            "listed": ranked(kept, remedies.failing),
            "withheld": tuple(withheld),
            "reason": reason or remedies.reason or None,
        }
    )


def samples_for(content: RunAnalysis) -> int:
    """Return the samples with which a remedy is simulated: enough to bound each requirement."""
    run = content.summary.samples + content.summary.failed
    needed = [
        runs_to_show(0.5 if entry.probability is None else entry.probability, content.summary.confidence) or 0
        for entry in content.summary.requirements
    ]
    return min(MOST_SAMPLES, max(run, FEWEST), max([FEWEST, *(SPARE * count for count in needed)]))


def _simulated(
    case: Case, remedy: Remedy, failing: Failing, samples: int, jobs: int, progress: Progress
) -> Remedy:  # fmt: skip
    summary = simulated(case.read(remedy), samples, jobs, progress)
    if failing == "requirement":
        finding = least_margin(summary.requirements).finding
    else:
        finding = summary.filter.verdict if summary.filter is not None else ""
    return remedy.completed({"simulated": finding, "samples": summary.samples})


def remedies_of_run(
    content: RunAnalysis, described: tuple[Document, str], thorough: bool = False, jobs: int = JOBS,
    progress: Progress = SILENT, simulate: bool = True,
) -> Remedies | None:  # fmt: skip
    """Return what would help a run; none where nothing fails.

    Parameters
    ----------
    described : tuple of Document and str
        The campaign, and where a changed file is to be saved.
    thorough : bool
        Whether all remedies are computed, and the best simulated.
    simulate : bool
        Whether the best is simulated then: not where that would execute code of a run folder.
    """
    with one_thread():
        case = case_of_run(content, *described)
        if case is None:
            return None
        remedies = find_remedies(case, thorough, progress)
    if not remedies.listed:
        return remedies
    if thorough and simulate:
        return confirm(case, remedies, content, jobs, progress)
    if linear_holds(content, remedies.failing):
        return remedies
    withheld = tuple(remedy.words for remedy in remedies.listed)
    return remedies.completed({"listed": (), "withheld": withheld, "reason": CODE if thorough else FAILS})


def remedies_of_answer(
    campaign: Campaign, answer: LinearAnswer, thorough: bool = False, progress: Progress = SILENT
) -> Remedies | None:
    """Return what would help a campaign by its linear covariance; none where nothing fails."""
    with one_thread():
        case = case_of_answer(campaign, answer)
        return None if case is None else find_remedies(case, thorough, progress)


def advise_run(campaign: Campaign, content: RunAnalysis) -> Remedies | None:
    """Return what a run says of remedies: those that it need not wait for."""
    return remedies_of_run(content, document_and_place(campaign))


def all_remedies(
    content: RunAnalysis, campaign_file: Path | None, jobs: int = JOBS, progress: Progress = SILENT
) -> Remedies | None:
    """Compute all remedies of a finished run, and simulate the best; none where nothing fails.

    Parameters
    ----------
    campaign_file : Path, optional
        The campaign of the run, by default that of the run folder; needed to simulate a scenario of the user's own,
        because nothing in a run folder is executed.

    Raises
    ------
    RunFolderError
        When the campaign is another's.
    """
    if not something_fails(content.summary):
        return None
    folder, manifest = content.folder, content.manifest
    if manifest.identity.code is not None and campaign_file is None:
        stored = Document(tomllib.loads(content.campaign), str(folder.path / CAMPAIGN), content.summary.campaign)
        return remedies_of_run(content, (stored, IN_FOLDER), True, jobs, progress, simulate=False)
    from mcnav.workflow.replay import campaign_of  # with pandas, which what is not simulated does not need

    described = document_and_place(campaign_of(folder, manifest, campaign_file)[0])
    return remedies_of_run(content, described, True, jobs, progress)


def add_remedies(path: Path, campaign_file: Path | None, jobs: int = JOBS, progress: Progress = SILENT) -> None:
    """Compute all remedies of a finished run, keep them in its folder, and write its report again; see `all_remedies`.

    Raises `RunFolderError` when the folder holds no finished run.
    """
    folder = RunFolder(path)
    with one_thread(), reading_file(path):
        content = analyse(folder)
    remedies = all_remedies(content, campaign_file, jobs, progress)
    with folder.lock(), one_thread():
        keep_remedies(folder, remedies)
        write_results(folder, content)
