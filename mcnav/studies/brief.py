"""A run on one sheet for a review board: verdicts, requirements, worst case, causes, and what would help."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from mcnav.analysis.brief import Advice, FilterRemedy
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.rejections import OnLinear
from mcnav.analysis.simulated_requirements import Basis
from mcnav.analysis.summary import Summary
from mcnav.config.documents import Description, document_of
from mcnav.config.overrides import parse_document
from mcnav.errors import CampaignError, reading_file
from mcnav.execution.progress import SILENT, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import write_texts
from mcnav.report.columns.gates import rejection_line
from mcnav.report.document.html import page_html
from mcnav.report.pages.brief import Links, page
from mcnav.runner.executors import JOBS
from mcnav.store.run_files import REPORT
from mcnav.store.run_folder import RunFolder
from mcnav.studies.allocate import CONFIRMED, allocate
from mcnav.studies.confirmed_changes import ConfirmationPlan
from mcnav.studies.filter_remedies import confirmed, find_remedies, sigma_at
from mcnav.studies.lincov import answer_linearly
from mcnav.studies.simulated_campaigns import MOST_SAMPLES
from mcnav.systems.ins.recognition import is_ins
from mcnav.workflow.analyse import analyse
from mcnav.workflow.replay import campaign_of

HTML, PDF = "brief.html", "brief.pdf"

CODE: Final = "the run folder's code is not executed; give the campaign file with --campaign to add what would help"


def default_folder(run: Path) -> Path:
    """Return the folder beside a run folder that is named after it."""
    named = run if run.name not in ("", "..") else run.resolve()
    return named.with_name(f"{named.name}_brief")


def write_brief(
    run: Path, target: Path, campaign: Path | None = None, progress: Progress = SILENT, confirm: int = CONFIRMED,
    jobs: int = JOBS,
) -> list[Path]:  # fmt: skip
    """Write a run as one sheet, a page and a PDF, and return the files.

    Parameters
    ----------
    target : Path
        Folder of the two files.
    campaign : Path, optional
        The campaign of the run, by default that of the run folder; needed for advice on a scenario of the user's own,
        because nothing in a run folder is executed.
    confirm, jobs
        As for `advise`.

    Raises
    ------
    RunFolderError
        When the folder holds no finished run, or the campaign is another's.
    CampaignError
        When the campaign cannot be read.
    """
    folder = RunFolder(run)
    with one_thread(), reading_file(run):
        content = analyse(folder)
    advice = Advice(lacks=CODE)
    if campaign is not None or content.manifest.identity.code is None:
        described, _ = campaign_of(folder, content.manifest, campaign)
        advice = advise(described.file, progress, content.summary, confirm, jobs)
    report = run / REPORT
    links = Links(run.as_posix(), Path(os.path.relpath(report, target)).as_posix() if report.exists() else "")
    made = page(content, advice, links)
    (written,) = write_texts(target, {HTML: page_html(made)})
    from mcnav.report.document.sheet import write_pdf  # draws by matplotlib, whose import takes as long as all else

    return [written, write_pdf(made, target / PDF)]


def advise(
    campaign: Description, progress: Progress = SILENT, run: Summary | None = None,
    confirm: int = CONFIRMED, jobs: int = JOBS,
) -> Advice:  # fmt: skip
    """Find what would help a campaign: other numbers, and another filter.

    Parameters
    ----------
    run : Summary, optional
        Of a run of the campaign. It scales linear analysis, and changes are simulated as it was; without it the advice
        is that of linear analysis alone.
    confirm : int
        Changes of numbers that are simulated; with none, no numbers are proposed where there is a run.
    jobs : int
        Workers of a simulation.
    """
    document = document_of(campaign)
    described, allocation, lacks = parse_document(document, {}), None, ""
    samples = None if run is None else min(run.samples + run.failed, MOST_SAMPLES)
    if run is None or confirm:
        try:
            if run is None:
                allocation = allocate(campaign, progress, confirm=0)
            else:
                allocation = allocate(campaign, progress, confirm, Basis.of(run), jobs, samples)
        except CampaignError as wrong:
            lacks = "; ".join(problem.message for problem in wrong.problems if problem.key == "samples")
    elif run.requirements:
        lacks = "--confirm 0 simulates nothing"
    answer = answer_linearly(described) if allocation is None else allocation.answer
    if answer.rejections is not None and answer.rejections.verdict != OnLinear.HOLDS:
        lacks = rejection_line(answer.rejections, [output.name for output in answer.outputs])
    settled = answer.filter is None or answer.filter.verdict in (Honesty.CONSISTENT, Honesty.UNDECIDED)
    if answer.filter is None or settled or not is_ins(described.scenario):
        return Advice(allocation, lacks=lacks)
    now = FilterRemedy("as it is", answer.filter, sigma_at(answer, answer.filter))
    remedies = find_remedies(document, answer)
    if samples is not None and confirm and remedies:
        best = confirmed(remedies[0], document, ConfirmationPlan(1, samples, jobs, progress))
        remedies = sorted([best, *remedies[1:]], key=lambda remedy: remedy.rank)
    return Advice(allocation, now, tuple(remedies), lacks)
