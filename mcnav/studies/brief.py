"""A run on one slide and one sheet for a review board: requirements, worst case, causes, and what would help."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from mcnav.errors import reading_file
from mcnav.execution.progress import SILENT, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.pages.brief import Links, page
from mcnav.runner.executors import JOBS
from mcnav.store.run_files import REPORT
from mcnav.store.run_folder import RunFolder
from mcnav.studies.run_remedies import all_remedies
from mcnav.workflow.analyse import analyse

HTML, SLIDE, SHEET = "brief.html", "slide.pdf", "brief.pdf"


def default_folder(run: Path) -> Path:
    """Return the folder beside a run folder that is named after it."""
    named = run if run.name not in ("", "..") else run.resolve()
    return named.with_name(f"{named.name}_brief")


def write_brief(
    run: Path, target: Path, campaign: Path | None = None, progress: Progress = SILENT, jobs: int = JOBS
) -> list[Path]:  # fmt: skip
    """Write a run as a page, one slide and one sheet, and return the files.

    Parameters
    ----------
    target : Path
        Folder of the three files.
    campaign, jobs
        As for `mcnav.studies.run_remedies.all_remedies`.

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
    remedies = all_remedies(content, campaign, jobs, progress)
    content = replace(content, remedies=None if remedies is None else remedies.advisable)
    report = run / REPORT
    links = Links(run.as_posix(), Path(os.path.relpath(report, target)).as_posix() if report.exists() else "")
    made = page(content, links)
    (written,) = write_texts(target, {HTML: page_html(made)})
    from mcnav.report.document.sheet import (  # matplotlib, whose import takes as long as all else
        write_sheet,
        write_slide,
    )

    return [written, write_slide(made, target / SLIDE), write_sheet(made, target / SHEET)]
