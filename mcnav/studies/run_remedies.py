"""What would help a run in which something fails: computed where a run ends, or all of it, the best simulated."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

from mcnav.analysis.remedies import Failing, Remedies, Remedy, ranked, something_fails
from mcnav.analysis.requirements import Finding
from mcnav.analysis.simulated_requirements import least_margin
from mcnav.config.documents import Document
from mcnav.config.read import Campaign
from mcnav.errors import reading_file
from mcnav.execution.progress import SILENT, Progress
from mcnav.execution.threads import one_thread
from mcnav.report.results.model import RunAnalysis
from mcnav.runner.executors import JOBS
from mcnav.statistics.demonstration import runs_to_show
from mcnav.store.run_files import CAMPAIGN
from mcnav.store.run_folder import RunFolder
from mcnav.studies.failing_campaign import Case, case_of_run, document_and_place
from mcnav.studies.remedies import find_remedies
from mcnav.studies.simulated_campaigns import MOST_SAMPLES, simulated
from mcnav.workflow.analyse import analyse, write_results
from mcnav.workflow.stored_campaign import campaign_of
from mcnav.workflow.stored_remedies import keep_remedies

CONFIRMED: Final = 3
"""Remedies that are simulated, until samples confirm one."""

FEWEST: Final = 500
"""Samples of a remedy that is simulated; more where a requirement needs them."""

SPARE: Final = 4
"""Times the samples that bound a requirement if none lies beyond it: a bound close to the estimate."""

FAILS: Final = "linear analysis fails in this run: mcnav report --remedies simulates what would help"
CODE: Final = "the run folder's code is not executed: --campaign FILE simulates what would help"
FAULTY: Final = (
    "linear analysis, which accepts every measurement, computes no remedy against faults: try another gate, "
    "and run the changed campaign"
)
IN_FOLDER: Final = "in the folder of this report"
UNCONFIRMED: Final = "samples confirm nothing that linear analysis proposes"


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
    reason = "" if kept else UNCONFIRMED
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
        remedies = find_remedies(case, thorough, progress, None if simulate else False)
    if not remedies.listed and content.summary.faults:
        return remedies.completed({"reason": FAULTY})
    if not remedies.listed:
        return remedies
    if thorough and simulate:
        return confirm(case, remedies, content, jobs, progress)
    if linear_holds(content, remedies.failing):
        return remedies
    withheld = tuple(remedy.words for remedy in remedies.listed)
    return remedies.completed({"listed": (), "withheld": withheld, "reason": CODE if thorough else FAILS})


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
