"""All runs of a folder on one page: verdict, sigmas, date, and what went in."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import quote

from markupsafe import Markup

from mcnav.analysis.summary import Summary
from mcnav.errors import RunFolderError, reading_file
from mcnav.files import write_whole
from mcnav.report import filter_verdict, sentences
from mcnav.report.document import (
    CODE,
    UNIT,
    WRAPPED,
    Cell,
    Column,
    Listing,
    Page,
    Part,
    Section,
    Sentence,
    Table,
    counted,
)
from mcnav.report.format import number
from mcnav.report.html import page_html
from mcnav.report.names import humanize, shown_units
from mcnav.store.run_files import MANIFEST, REPORT, SUMMARY
from mcnav.store.run_folder import RunFolder

DEEPEST: Final = 3
"""Folders below the one that is looked through."""

INDEX: Final = "index.html"
CAPTION: Final = (
    "All runs with verdicts, the worst first, Monte Carlo sigmas (paired estimates), start date, and the first digits "
    "of the hash of campaign, engine and versions."
)

NOTHING: Final = Cell("–")
"""Cell of what a run does not have."""

HASH: Final = 10
"""Digits shown of what identifies a run."""


@dataclass(frozen=True)
class _Link:
    """A page in the folder."""

    href: str
    path: str


@dataclass(frozen=True)
class _Run:
    """A run folder: its report, and what the page says of it, or why it cannot be read."""

    folder: str
    report: _Link | None
    name: str
    failure: str = ""
    tone: str = ""
    verdicts: Cell = NOTHING
    samples: int | None = None
    failed: int | None = None
    sigmas: str = ""
    started: str = ""
    digest: str = ""


def write_index(folder: Path) -> tuple[Path, int]:
    """Write ``index.html`` of all runs in a folder and below it.

    Returns
    -------
    written : Path
    runs : int
        Number of runs on the page.
    """
    runs, others = list[_Run](), list[_Link]()
    for place in _below(folder, DEEPEST):
        if (place / MANIFEST).exists():
            runs.append(_read(folder, place))
        else:
            others += [_link(folder, page) for page in sorted(place.glob("*.html")) if page.name != INDEX]
    written = folder / INDEX
    write_whole(written, page_html(_page(runs, others)).encode())
    return written, len(runs)


def _below(folder: Path, depth: int) -> list[Path]:
    """Walk a folder and those in it in order of their names, but neither into run folders nor along links."""
    result = [folder]
    if depth and not (folder / MANIFEST).exists():
        entries = (entry for entry in folder.iterdir() if entry.is_dir() and not entry.is_symlink())
        inside = sorted(entry for entry in entries if not entry.name.startswith("."))
        result += [place for entry in inside for place in _below(entry, depth - 1)]
    return result


def _link(folder: Path, page: Path) -> _Link:
    path = Path(os.path.relpath(page, folder)).as_posix()
    return _Link(quote(path), path)


def _linked(link: _Link, words: str) -> Markup:
    return Markup('<a href="{}">{}</a>').format(link.href, words)


def _read(folder: Path, place: Path) -> _Run:
    """Read a run; one that cannot be read has the reason."""
    report = _link(folder, place / REPORT) if (place / REPORT).exists() else None
    try:
        with reading_file(place / SUMMARY):
            run = RunFolder(place)
            summary, manifest = Summary.of(run.summary()), run.existing_manifest()
            return _Run(
                place.name,
                report,
                summary.campaign,
                tone=sentences.statements(summary)[0].tone,
                verdicts=_verdicts(summary),
                samples=summary.samples,
                failed=summary.failed,
                sigmas=_sigmas(summary),
                started=manifest.started[:10],
                digest=manifest.identity.digest[:HASH],
            )
    except RunFolderError as failure:
        return _Run(place.name, report, place.name, str(failure).replace(str(place), place.name))


def _page(runs: Sequence[_Run], others: Sequence[_Link]) -> Page:
    """Return the page: runs with what their reports say, and other pages."""
    nothing = Markup("There is no finished run in this folder. Create one with {}.").format(
        CODE("mcnav run campaigns/NAME.toml")
    )
    parts: list[Part] = [_run_table(runs)] if runs else [Sentence(nothing)]
    sections = [Section("runs", f"{len(runs)} {'run' if len(runs) == 1 else 'runs'}", parts)]
    if others:
        links = Listing([_linked(page, page.path) for page in others])
        sections.append(Section("others", "Other pages", [links]))
    return Page("Runs", "Linear covariance analysis and Monte Carlo", "Runs", sections=sections)


def _run_table(runs: Sequence[_Run]) -> Table[_Run]:
    """Tabulate the runs, of one that cannot be read the reason."""

    def name(run: _Run) -> Cell:
        return Cell(run.name if run.report is None else _linked(run.report, run.name), below=run.folder)

    def verdict(run: _Run) -> Cell:
        return Cell(WRAPPED(run.failure), columns=6) if run.failure else run.verdicts

    columns: list[Column[_Run]] = [
        Column("Run", name, kind="words", of_user=True),
        Column("Verdicts", verdict, kind="text"),
        Column("Samples", lambda run: run.samples, form=counted),
        Column("Failed", lambda run: run.failed, form=counted),
        Column("1σ at the end", lambda run: run.sigmas, kind="words"),
        Column("Started", lambda run: run.started, kind="label"),
        Column("Identity", lambda run: CODE(run.digest), kind="label"),
    ]
    return Table(CAPTION, columns, runs, name="all-runs", verdict=lambda run: run.tone)


def _verdicts(summary: Summary) -> Cell:
    """Mark the verdicts on linear analysis, requirements and filter as labels, the worst first."""
    counts = summary.counts
    words = {
        "linear": f"linear {sentences.tone(summary)}",
        "requirements": "" if counts is None else f"{counts.met} of {counts.of} met",
        "filter": f"filter {filter_verdict.verdict(summary)}",
    }
    labels = [
        Markup('<span class="tag {}" title="{}">{}</span>').format(each.tone, each.words, words[each.subject])
        for each in sentences.statements(summary)
    ]
    reason = summary.unsettled
    return Cell(Markup("<br>").join(labels), below="" if reason is None else sentences.unsettled(reason))


def _sigmas(summary: Summary) -> Markup:
    """List the sigmas of the final errors, each with its unit on one line."""
    units, sigmas = shown_units(summary), summary.sigma_paired or summary.sigma_linear.tolist()
    listed = []
    for name, sigma in zip(summary.names, sigmas, strict=True):
        scale, unit = units[name]
        words = (humanize(name), number(sigma * scale, 4), UNIT(unit))
        listed.append(Markup("\N{NO-BREAK SPACE}").join(words))
    return Markup(", ").join(listed)
