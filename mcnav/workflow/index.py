"""All runs and studies of a folder on one page: answer, worst ratio, margin, date, and which runs to compare."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import accumulate
from pathlib import Path
from typing import Final
from urllib.parse import quote

from markupsafe import Markup

from mcnav.analysis.summary import Summary
from mcnav.errors import RunFolderError, reading_file
from mcnav.execution.shell import quote_word
from mcnav.files.whole import write_whole
from mcnav.report.document.html import page_html
from mcnav.report.document.page_head import PageHead, page_head
from mcnav.report.document.parts import Answers, Fold, Page, Part, Section, Sentence, Verdict
from mcnav.report.document.table import CODE, UNIT, WRAPPED, Cell, Column, Table, counted
from mcnav.report.drawing.strip import Strip
from mcnav.report.format import number
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements import fields, verdicts
from mcnav.report.statements.words import WORST
from mcnav.store.run_files import MANIFEST, REPORT, SUMMARY
from mcnav.store.run_folder import RunFolder

DEEPEST: Final = 3
"""Folders below the one that is looked through."""

INDEX: Final = "index.html"
CAPTION: Final = (
    "All runs, with their foremost answer. Linear ratio: Monte Carlo over linear sigma of the output that is farthest "
    "from linear analysis. Filter ratio: true over filter sigma where the verdict is decided. Margin: limit over "
    "estimate of the tightest requirement on sizes of errors; below one it is not met."
)
FOREMOST: Final = 7
"""Runs on the first screen at most, the worst first."""

ROOM: Final = 56
"""Words of their rows at most, names and verdicts, so that the screen stays below ninety."""

FIRST: Final = "True over filter sigma where there is a filter, else Monte Carlo over linear sigma."
"""Caption of the ratios on the first screen."""

STUDIES: Final = (
    "Pages of studies, comparisons and trajectories with their foremost answer, and when they were written."
)

BEGINNING: Final = 200_000
"""Bytes of a page in which its head is looked for."""

SIZES: Final = ("quantile", "cep", "r95", "sep")
"""Kinds of requirements whose estimate is a size, which a limit bounds from above."""

OF_TONES: Final = {"differs": "no", "partly": "partly", "undecided": "undecided", "agrees": "yes", "": "unreadable"}
"""Verdicts of runs in a word, by tone."""

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
class _Study:
    """A page that is not a run's: what its head says, and when it was written."""

    link: _Link
    head: PageHead
    written: str


@dataclass(frozen=True)
class _Worst:
    """A number and the name of what it is of; none where there is none."""

    value: float
    name: str = ""


@dataclass(frozen=True)
class _Run:
    """A run folder: its report, and what the page says of it, or why it cannot be read."""

    place: Path
    path: str
    report: _Link | None
    name: str
    failure: str = ""
    tone: str = ""
    answer: str = ""
    verdicts: Cell = NOTHING
    ratio: _Worst | None = None
    filter_ratio: _Worst | None = None
    strip: Strip | None = None
    margin: _Worst | None = None
    samples: int | None = None
    failed: int | None = None
    sigmas: str = ""
    started: str = ""
    digest: str = ""
    scenario: str = ""


def write_index(folder: Path) -> tuple[Path, int, list[Path]]:
    """Write ``index.html`` of all runs in a folder and below it.

    Returns
    -------
    written : Path
    runs : int
        Number of runs on the page.
    foremost : list of Path
        Folders of the latest two runs of one scenario, whose comparison says something, or else of the latest run.

    Raises
    ------
    RunFolderError
        When there is no such folder.
    """
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: is no folder; expected one that contains run folders, such as reports")
    runs, studies = list[_Run](), list[_Study]()
    for place in _below(folder, DEEPEST):
        if (place / MANIFEST).exists():
            runs.append(_read(folder, place))
        else:
            pages = sorted(page for page in place.glob("*.html") if page.name != INDEX and page.is_file())
            studies += [_study(folder, page) for page in pages]
    written = folder / INDEX
    write_whole(written, page_html(_page(folder, runs, studies)).encode())
    latest = sorted((run for run in runs if not run.failure), key=lambda run: run.started, reverse=True)
    return written, len(runs), _foremost(latest)


def _foremost(latest: Sequence[_Run]) -> list[Path]:
    """Return the latest run of a scenario that an earlier one has as well, and that one; or the latest run alone."""
    for place, run in enumerate(latest):
        for earlier in latest[place + 1 :]:
            if earlier.scenario == run.scenario:
                return [run.place, earlier.place]
    return [run.place for run in latest[:1]]


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


def _study(folder: Path, page: Path) -> _Study:
    with page.open("rb") as file:
        head = page_head(file.read(BEGINNING).decode("utf-8", errors="replace"))
    date = datetime.fromtimestamp(page.stat().st_mtime, UTC).date().isoformat()
    link = _link(folder, page)
    return _Study(link, head or PageHead(heading=link.path), date)


def _read(folder: Path, place: Path) -> _Run:
    """Read a run; one that cannot be read has the reason."""
    report = _link(folder, place / REPORT) if (place / REPORT).exists() else None
    path = Path(os.path.relpath(place, folder)).as_posix()
    try:
        with reading_file(place / SUMMARY):
            run = RunFolder(place)
            summary, manifest = Summary.of(run.summary()), run.existing_manifest()
            worst = verdicts.statements(summary)[0]
            return _Run(
                place,
                path,
                report,
                summary.campaign,
                tone=worst.tone,
                answer=worst.sentence,
                verdicts=_verdicts(summary),
                ratio=_worst_ratio(summary),
                filter_ratio=_filter_ratio(summary),
                strip=_strip(summary),
                margin=_least_margin(summary),
                samples=summary.samples,
                failed=summary.failed,
                sigmas=_sigmas(summary),
                started=manifest.started,
                digest=manifest.identity.digest[:HASH],
                scenario=json.dumps(manifest.identity.campaign.get("scenario"), sort_keys=True, default=str),
            )
    except RunFolderError as failure:
        return _Run(place, path, report, place.name, str(failure).replace(str(place), place.name))


def _worst_ratio(summary: Summary) -> _Worst | None:
    """Return the sigma ratio that is farthest from one, by its logarithm."""
    known = [
        _Worst(ratio, humanize(name))
        for name, ratio in zip(summary.names, summary.sigma_ratio_paired, strict=False)
        if ratio is not None and ratio > 0.0 and math.isfinite(ratio)
    ]
    return max(known, key=lambda ratio: abs(math.log(ratio.value)), default=None)


def _filter_ratio(summary: Summary) -> _Worst | None:
    """Return the ratio of true to filter sigma where the verdict on the filter is decided."""
    known = summary.filter
    if known is None or known.factor is None:
        return None
    return _Worst(known.factor, humanize(known.output or known.group))


def _strip(summary: Summary) -> Strip | None:
    """Return the mark of the ratio on the first screen: the filter's, or the one farthest from linear analysis."""
    known = summary.filter
    if known is not None and known.factor is not None:
        return Strip.of(known.factor, known.factor_interval, known.tolerance)
    ratios = [
        (abs(math.log(ratio)), ratio, ends)
        for ratio, ends in zip(summary.sigma_ratio_paired, summary.sigma_ratio_paired_interval, strict=False)
        if ratio is not None and ratio > 0.0 and math.isfinite(ratio)
    ]
    if not ratios:
        return None
    _, ratio, ends = max(ratios, key=lambda known: known[0])
    return Strip.of(ratio, ends, summary.tolerance)


def _least_margin(summary: Summary) -> _Worst | None:
    """Return the least of the limits of requirements on sizes over their estimates."""
    known = [
        _Worst(entry.limits[0] / entry.estimate, ", ".join(map(humanize, entry.outputs)))
        for entry in summary.requirements
        if entry.kind in SIZES and entry.estimate
    ]
    return min(known, key=lambda ratio: ratio.value, default=None)


def _page(folder: Path, runs: Sequence[_Run], studies: Sequence[_Study]) -> Page:
    """Return the page: runs with what their reports say, and other pages."""
    nothing = Markup("There is no finished run in this folder. Create one with {}.").format(
        CODE("mcnav run campaigns/NAME.toml")
    )
    parts: list[Part] = [Answers((_run_table(folder, runs),), "runs")] if runs else [Sentence(nothing)]
    if len([run for run in runs if not run.failure]) > 1:
        parts.insert(0, Sentence(_comparison(folder, studies)))
    count = f"{len(runs)} {'run' if len(runs) == 1 else 'runs'}"
    sections = [Section("runs", count, parts)]
    others = [Section("studies", "Studies and other pages", [Answers((_study_table(studies),), "runs")])]
    folds = [Fold("fold-runs", "All runs", f"{count}: answers, ratios, margins, comparison", [], sections)]
    if studies:
        folds.append(Fold("fold-studies", "Studies", f"{len(studies)} other pages", [], others))
    if not runs:
        return Page("Runs", "Index", "Runs", sections=[*sections, *(others if studies else [])])
    return Page("Runs", "Index", "Runs", _first_screen(runs), folds=folds, short=True)


def _first_screen(runs: Sequence[_Run]) -> list[Part]:
    """Count the verdicts, and list the worst runs with the ratio that their verdict is on."""
    worst = sorted(runs, key=lambda run: WORST.index(run.tone) if run.tone else -1)
    counts = {tone: sum(run.tone == tone for run in runs) for tone in WORST}
    unread = sum(not run.tone for run in runs)
    said = [
        (counts["differs"], "fail"), (counts["partly"], "hold partly"), (counts["undecided"], "undecided"),
        (counts["agrees"], "hold"), (unread, "unreadable"),
    ]  # fmt: skip
    words = ", ".join(f"{count} {word}" for count, word in said if count)
    headline = f"{len(runs)} {'run' if len(runs) == 1 else 'runs'}: {words}."
    columns: list[Column[_Run]] = [
        Column("Run", lambda run: run.name if run.report is None else _linked(run.report, run.name), kind="label",
               of_user=True),
        Column("Verdict", lambda run: Cell(OF_TONES[run.tone], tone=run.tone or "undecided"), kind="text"),
        Column("Ratio", _ratio),
    ]  # fmt: skip
    taken = accumulate(len(run.name.split()) + 1 for run in worst[:FOREMOST])
    shown = max(1, sum(words_so_far <= ROOM for words_so_far in taken))
    more = len(runs) - shown
    left = [Sentence(Markup('<a href="#fold-runs">and {} more</a>').format(more))] if more > 0 else []
    return [Verdict(headline, worst[0].tone or "undecided"), Answers((Table(FIRST, columns, worst[:shown]),)), *left]


def _ratio(run: _Run) -> Cell:
    known = run.filter_ratio or run.ratio
    return NOTHING if known is None else Cell(number(known.value, 3), strip=run.strip)


def _comparison(folder: Path, studies: Sequence[_Study]) -> Markup:
    """Mark the place where the script writes how to compare the runs that are ticked."""
    here = folder.is_absolute()
    pages = {study.link.path: study.link.href for study in studies if "/" not in study.link.path}
    return Markup(
        'Tick two runs, and the command that compares them stands here.<output data-compare="{}" data-out="{}" '
        'data-where="{}"></output>'
    ).format(
        json.dumps(pages), quote_word("." if here else folder.as_posix()), "in the folder of this page" if here else ""
    )


def _tick(folder: Path, run: _Run) -> Markup:
    """Mark the box by which a run is chosen for a comparison; the script shows it."""
    place = run.path if folder.is_absolute() else run.place.as_posix()
    return Markup(
        '<input type="checkbox" class="pick" value="{}" data-folder="{}" aria-label="Compare {}" hidden> '
    ).format(quote_word(place), (Path(folder.resolve().name) / run.path).as_posix(), run.name)


def _run_table(folder: Path, runs: Sequence[_Run]) -> Table[_Run]:
    """Tabulate the runs, of one that cannot be read the reason."""

    def name(run: _Run) -> Cell:
        tick = Markup("") if run.failure else _tick(folder, run)
        return Cell(tick + (run.name if run.report is None else _linked(run.report, run.name)), below=run.path)

    def answer(run: _Run) -> Cell:
        return Cell(WRAPPED(run.failure), columns=7) if run.failure else Cell(WRAPPED(run.answer), below=run.sigmas)

    def samples(run: _Run) -> Cell:
        return Cell(counted(run.samples), below=f"{run.failed:,} failed" if run.failed else "")

    columns: list[Column[_Run]] = [
        Column("Run", name, kind="words", of_user=True),
        Column("Answer", answer, kind="words"),
        Column("Verdicts", lambda run: run.verdicts, kind="text"),
        Column("Linear ratio", lambda run: _named(run.ratio, 5)),
        Column("Filter ratio", lambda run: _named(run.filter_ratio, 3)),
        Column("Margin", lambda run: _named(run.margin, 4)),
        Column("Samples", samples),
        Column("Started", lambda run: Cell(run.started[:10], below=CODE(run.digest)), kind="label", beside="started"),
    ]
    return Table(CAPTION, columns, runs, name="all-runs", verdict=lambda run: run.tone)


def _named(worst: _Worst | None, digits: int) -> Cell:
    return NOTHING if worst is None else Cell(number(worst.value, digits), below=WRAPPED(worst.name))


def _study_table(studies: Sequence[_Study]) -> Table[_Study]:
    """Tabulate the other pages."""

    def name(study: _Study) -> Cell:
        below = study.link.path if study.link.path != study.head.heading else ""
        return Cell(_linked(study.link, study.head.heading or study.link.path), below=below)

    def answer(study: _Study) -> Cell:
        tone = study.head.tone
        return Cell(tone, tone=tone, behind=study.head.answer) if tone else Cell(WRAPPED(study.head.answer or "–"))

    columns: list[Column[_Study]] = [
        Column("Page", name, kind="words", of_user=True),
        Column("Kind", lambda study: study.head.kind or "–", kind="text"),
        Column("Answer", answer, kind="words", of_user=True),
        Column("Written", lambda study: study.written, kind="label"),
    ]
    return Table(STUDIES, columns, studies, name="all-studies", verdict=lambda study: study.head.tone)


def _verdicts(summary: Summary) -> Cell:
    """Mark the verdicts on linear analysis, requirements, filter and smoother as labels, the worst first."""
    counts = summary.counts
    words = {
        "means": "means above one sigma",
        "linear": f"linear {verdicts.tone(summary)}",
        "requirements": "" if counts is None else f"{counts.met} of {counts.of} met",
        "filter": f"filter {summary.filter.verdict if summary.filter else ''}",
        "smoother": "" if summary.smoother is None else f"smoother {summary.smoother.verdict}",
    }
    labels = [
        Markup('<span class="tag {}" title="{}">{}</span>').format(
            statement.tone, statement.sentence, words[statement.subject]
        )
        for statement in verdicts.statements(summary)
    ]
    reason = summary.unsettled
    return Cell(Markup("<br>").join(labels), below="" if reason is None else fields.unsettled(reason))


def _sigmas(summary: Summary) -> Markup:
    """List the sigmas of the final errors, each with its unit on one line."""
    units, sigmas = shown_units(summary), summary.sigma_paired or summary.sigma_linear.tolist()
    listed = []
    nominals = summary.nominal or (None,) * len(sigmas)
    for name, sigma, nominal in zip(summary.names, sigmas, nominals, strict=True):
        scale, unit = units[name]
        known = nominal is not None and math.isfinite(nominal)
        about = [number(nominal * scale, 5), "±"] if known and nominal is not None else []
        words = (humanize(name), *about, number(sigma * scale, 4), UNIT(unit))
        listed.append(Markup("\N{NO-BREAK SPACE}").join(words))
    some = Markup("1σ of {} output{}").format(len(listed), "" if len(listed) == 1 else "s")
    return Markup("<details><summary>{}</summary>{}</details>").format(some, Markup(", ").join(listed))
