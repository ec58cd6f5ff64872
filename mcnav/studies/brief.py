"""A run on one sheet for a review board: verdicts, requirements, worst case, causes, and what would help."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav._threads import one_thread
from mcnav.analysis.brief import Advice, FilterRemedy
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.rejections import OnLinear
from mcnav.config.campaign import Campaign
from mcnav.config.overrides import document_of
from mcnav.config.read import parse_campaign
from mcnav.config.toml import Content
from mcnav.errors import CampaignError, reading_file
from mcnav.files import write_texts
from mcnav.progress import SILENT, Progress
from mcnav.report.brief import Links, page
from mcnav.report.gates import rejection_line
from mcnav.report.html import page_html
from mcnav.store.run_files import REPORT
from mcnav.store.run_folder import RunFolder
from mcnav.studies.allocate import allocate
from mcnav.studies.lincov import answer_linearly
from mcnav.systems.ins.recognition import is_ins
from mcnav.workflow.analyse import analyse
from mcnav.workflow.replay import campaign_of

HTML, PDF = "brief.html", "brief.pdf"

MOST: Final = 4
"""Neglected kinds of errors that are given to the filter one by one, the largest first."""

CODE: Final = "the run folder's code is not executed; give the campaign file with --campaign to add what would help"


def default_folder(run: Path) -> Path:
    """Return the folder beside a run folder that is named after it."""
    named = run if run.name not in ("", "..") else run.resolve()
    return named.with_name(f"{named.name}_brief")


def write_brief(run: Path, target: Path, campaign: Path | None = None, progress: Progress = SILENT) -> list[Path]:
    """Write a run as one sheet, a page and a PDF, and return the files.

    Parameters
    ----------
    target : Path
        Folder of the two files.
    campaign : Path, optional
        The campaign of the run, by default that of the run folder; needed for advice on a scenario of the user's own,
        because nothing in a run folder is executed.

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
        advice = advise(described.file, progress)
    report = run / REPORT
    links = Links(run.as_posix(), Path(os.path.relpath(report, target)).as_posix() if report.exists() else "")
    made = page(content, advice, links)
    (written,) = write_texts(target, {HTML: page_html(made)})
    from mcnav.report.sheet import write_pdf  # draws by matplotlib, whose import takes as long as all else

    return [written, write_pdf(made, target / PDF)]


def advise(campaign: str | Path | Mapping[str, Any], progress: Progress = SILENT) -> Advice:
    """Find what would help a campaign by linear analysis: other numbers, and another filter."""
    try:
        allocation = allocate(campaign, progress)
    except CampaignError:
        allocation = None
    content, file, stem = document_of(campaign)
    described = parse_campaign(content, file, stem)
    answer = answer_linearly(described) if allocation is None else allocation.answer
    verdict = answer.filter
    lacks = ""
    if answer.rejections is not None and answer.rejections.verdict != OnLinear.HOLDS:
        lacks = rejection_line(answer.rejections, [output.name for output in answer.outputs])
    settled = verdict is None or verdict.verdict in (Honesty.CONSISTENT, Honesty.UNDECIDED)
    if verdict is None or settled or not is_ins(described.scenario):
        return Advice(allocation, lacks=lacks)
    now = FilterRemedy("as it is", verdict, _sigma_at(answer, verdict))
    remedies = []
    for words, changed in _changed_filters(content, answer, file, stem):
        then = answer_linearly(changed)
        if then.filter is not None:
            remedies.append(FilterRemedy(words, then.filter, _sigma_at(then, verdict)))
    return Advice(allocation, now, tuple(remedies), lacks)


def _changed_filters(content: Content, answer: LinearAnswer, file: str, stem: str) -> Iterator[tuple[str, Campaign]]:
    """Yield campaigns whose filter knows more, with the change in words."""

    def changed(table: Mapping[str, Any]) -> Campaign | None:
        """Read the campaign with another table ``[filter]``; none where it is refused: an error may have no state."""
        try:
            return parse_campaign({**content, "filter": dict(table)}, file, stem)
        except CampaignError:
            return None

    table = content["filter"]
    estimates, considers = [*table["estimates"]], [*table.get("considers", ())]
    tried = [("believes the true sizes", {key: table[key] for key in table if key != "believes"})]
    tried *= "believes" in table
    kinds = [kind for kind in _kinds(answer) if kind not in (*estimates, *considers)]
    kinds = [kind for kind in kinds if changed(table | {"estimates": [*estimates, kind]}) is not None]
    for kind in kinds[:MOST]:
        tried.append((f"estimates {kind} too", table | {"estimates": [*estimates, kind]}))
        tried.append((f"considers {kind}", table | {"considers": [*considers, kind]}))
    if len(kinds) > 1:
        tried.append(
            (f"estimates all {len(kinds)} kinds that it neglects", table | {"estimates": [*estimates, *kinds]})
        )
    for words, filtered in tried:
        campaign = changed(filtered)
        if campaign is not None:
            yield words, campaign


def _kinds(answer: LinearAnswer) -> list[str]:
    """List kinds of errors, which are names of causes without the axis: those first that the filter neglects most."""
    neglected = [each.name for each in answer.filter.neglected] if answer.filter else []
    return list(
        dict.fromkeys(name.rpartition("_")[0] for name in (*neglected, *(each.name for each in answer.sources)))
    )


def _sigma_at(answer: LinearAnswer, at: LinearVerdict) -> float:
    """Return the true sigma of the output that departs most, or of the first of its group, at its worst reading."""
    history = answer.history
    if history is None or not at.output:
        return float("nan")
    place = next(number for number, output in enumerate(answer.outputs) if output.name == at.output)
    reading = int(np.argmin(np.abs(history.readings.times - at.worst)))
    return float(history.sigma[reading, place])
