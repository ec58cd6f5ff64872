"""A sweep as a page, and its tables and sentences in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.analysis.accuracy_measures import Measure
from mcnav.analysis.curve_refinement import BEND
from mcnav.analysis.sweep import Confirmation, JustMet, Sweep, Variable
from mcnav.contract.quantities import end_words
from mcnav.report.columns.requirements import TONES
from mcnav.report.columns.result_table import Row
from mcnav.report.document.parts import Facts, Findings, Heading, Note, Page, Part, Section, Sentence, Verdict, Verdicts
from mcnav.report.document.table import STRONG, Cell, Column, Table, label
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures import sweep as drawn
from mcnav.report.format import interval, number
from mcnav.report.names import humanize
from mcnav.report.pages.screen import answered
from mcnav.report.pages.sweep import frame
from mcnav.report.statements import verdicts
from mcnav.report.statements.sweep import (
    confirmation_rows,
    confirmed_words,
    disagreements,
    doubt_of,
    examined_words,
    headline,
    linear_finding,
    mean_words,
    met_words,
    point_words,
    remarks,
    shown,
    title_of,
    tone_of,
    verdict_at,
)

VERDICTS: Final = ("agrees", "differs", "undecided")

FINDINGS: Final = {"differs": "not met", "partly": "in part", "agrees": "met"}
TIGHTNESS: Final = tuple(FINDINGS)
"""What is said of a limit by its tone, the worst first."""

MORE_LIMITS: Final = Markup('<a href="#limits">and {} more</a>').format

MOST_LINES: Final = 12
"""Points of a grid that the terminal shows."""


def terminal(sweep: Sweep) -> list[Part]:
    """List what the terminal shows: headline, limits, some points of the grid, Monte Carlo."""
    parts: list[Part] = [*_mean_errors(sweep), Verdict(*headline(sweep)), *map(Note, remarks(sweep))]
    confirmed = [Verdict(*confirmed_words(sweep))] if sweep.confirmations else []
    refuted = bool(confirmed) and confirmed[0].tone == "differs"
    if refuted:
        parts = [*confirmed, *parts]
    if sweep.just_met:
        parts.append(limit_table(sweep))
    parts += [point_table(sweep), *map(Note, _not_shown(sweep))]
    if sweep.confirmations:
        checks = confirmation_table(sweep, sweep.confirmations)
        parts += [Sentence(""), *([] if refuted else confirmed), checks]
    return parts


def page(sweep: Sweep) -> Page:
    """Return the page."""
    contours = len(sweep.variables) > 1 and not sweep.variables[0].words
    words, tone = headline(sweep)
    confirmed = [Verdict(*confirmed_words(sweep))] if sweep.confirmations else []
    examined = examined_words(sweep)
    verdict = Verdict(words, tone, [examined] if examined else [])
    stated: Part = Verdicts([*confirmed, verdict]) if tone else Sentence(words)
    others: list[Part] = [] if tone or not confirmed else [Verdicts(confirmed)]
    facts = Facts([
        (variable.path, ", ".join(variable.words) or
         f"{shown(variable, variable.values[0])} to {shown(variable, variable.values[-1])}, "
         f"{len(variable.values)} values")
        for variable in sweep.variables
    ])  # fmt: skip
    sections = [Section("accuracy", "Lines of equal accuracy" if contours else "Accuracy", _accuracy(sweep))]
    if sweep.just_met:
        sections.append(Section("limits", "Where limits are just met", [limit_table(sweep)]))
    if sweep.confirmations:
        sections.append(Section("monte-carlo", "Monte Carlo", _checks(sweep)))
    noted = [remark for remark in remarks(sweep) if not tone or remark != examined]
    head = [*_mean_errors(sweep), stated, *others, *map(Note, noted), facts]
    limits, figure = _tightest_first(sweep), None
    if len(limits) > 1:
        head.append(_tightest_limit(sweep, limits))
        (figure,) = (part for part in sections[0].parts if isinstance(part, Figure))
        figure = replace(figure, panels=[figure.panels[limits[0].measure]])
    title = f"{sweep.campaign}: sweep"
    return answered(Page(title, "Sweep by linear analysis", sweep.campaign, head, sections), figure)


def _tightest_first(sweep: Sweep) -> list[JustMet]:
    """List the limits along the only variable: those not met, those met in part, then those met with least to spare."""
    if len(sweep.variables) > 1:
        return []

    def spare(limit: JustMet) -> tuple[int, float]:
        return TIGHTNESS.index(tone_of(limit)), -limit.closest[1] if limit.closest else 0.0

    return sorted(sweep.just_met, key=spare)


def _tightest_limit(sweep: Sweep, limits: Sequence[JustMet]) -> Findings:
    """Say where the tightest of several limits is met, and how many others there are."""
    (variable,), first = sweep.variables, limits[0]
    words = met_words(first, variable)
    where = words.partition("; ")[2] or words
    row = (FINDINGS[tone_of(first)], tone_of(first), f"{title_of(sweep.measures[first.measure], sweep, True)}: {where}")
    return Findings([row], MORE_LIMITS(len(limits) - 1), "Tightest limit")


def _mean_errors(sweep: Sweep) -> list[Part]:
    """Say first where a mean error exceeds its sigma."""
    return [Sentence(words, "partly")] if (words := mean_words(sweep)) else []


def _accuracy(sweep: Sweep) -> list[Part]:
    """Draw the measures, say how they were computed, and tabulate them for the campaign as it is."""
    data = frame(sweep)
    titles = [title_of(measure, sweep) for measure in sweep.measures]
    figure = drawn.figure(sweep, titles, {name: data[name].to_numpy() for name in data})
    note = ["Every point is a linear covariance of its own, with the other keys as in the campaign."]
    if len(sweep.variables) > 1 and not sweep.variables[0].words:
        note.append("Lines are interpolated between the points of the grid; the points on a limit are solved for.")
    if np.isfinite(sweep.own).any():
        note.append("Linear analysis accepts every measurement; values are after the update of their time.")
    columns: list[Column[tuple[Measure, float]]] = [
        Column("Measure", lambda row: title_of(row[0], sweep), kind="words"),
        Column("Value", lambda row: f"{number(row[1])} {row[0].shown_in}"),
    ]
    rows = list(zip(sweep.measures, sweep.present * drawn.scales(sweep), strict=True))
    return [figure, Note(" ".join(note)), Table("The campaign as it is.", columns, rows)]


@dataclass(frozen=True)
class _Limit:
    """A value at which a limit is met, and rows of a page that its name covers."""

    just_met: JustMet
    rows: int


def limit_table(sweep: Sweep) -> Table[_Limit]:
    """Tabulate where each limit is met, one row for each value at which the first variable is fixed."""
    *first, last = sweep.variables
    numbers = list(dict.fromkeys(allocation.measure for allocation in sweep.just_met))
    rows = []
    for place in numbers:
        own = [allocation for allocation in sweep.just_met if allocation.measure == place]
        rows += [_Limit(each, 0 if position else len(own)) for position, each in enumerate(own)]

    def fixed(variable: Variable) -> Column[_Limit]:
        return Column(
            variable.path,
            lambda row: "" if row.just_met.fixed is None else shown(variable, row.just_met.fixed),
            kind="label",
        )

    doubted = any(doubt_of(sweep, allocation) for allocation in sweep.just_met)

    def met(row: _Limit) -> Cell:
        doubt = doubt_of(sweep, row.just_met)
        return Cell(met_words(row.just_met, last), tone="undecided" if doubt else tone_of(row.just_met), below=doubt)

    columns: list[Column[_Limit]] = [
        Column("Limit", lambda row: Cell(title_of(sweep.measures[row.just_met.measure], sweep, True), rows=row.rows),
               "limit", "words"),
        *map(fixed, first),
        Column(last.path, met, "met", "text"),
        *([Column[_Limit]("linear analysis", lambda row: doubt_of(sweep, row.just_met) or "–", kind="text",
                          place="terminal")] if doubted else []),
    ]  # fmt: skip
    at = f" At {'each value' if first[0].words else 'some values'} of {first[0].path}." if first else ""
    added = (
        f" Between distant points of the grid values were added, {len(sweep.added)} in all. They end where the curve "
        f"bends by less than {100.0 * BEND:g} %, or by less than half its distance from the limit."
    )
    caption = (
        f"Values of {last.path} at which a limit is met.{at}"
        if last.words
        else f"Values of {last.path} at which a limit is just met, solved by linear analyses between the points of the "
        f"grid, to six digits.{at}{added if sweep.added else ''}"
    )
    return Table(caption, columns, rows, f"Limits along {last.path}")


def point_table(sweep: Sweep) -> Table[tuple[int, ...]]:
    """Tabulate some points of the grid, the ends included."""
    places = list(np.ndindex(sweep.shape))
    chosen = np.unique(np.linspace(0, len(places) - 1, min(len(places), MOST_LINES)).round().astype(int))
    own, scale = np.isfinite(sweep.own), drawn.scales(sweep)

    def variable(axis: int) -> Column[tuple[int, ...]]:
        described = sweep.variables[axis]
        if described.words:
            return Column(described.label, lambda place: described.words[place[axis]], kind="label")
        return Column(described.label, lambda place: float(described.values[place[axis]]))

    def measure(index: int) -> Column[tuple[int, ...]]:
        def content(place: tuple[int, ...]) -> str:
            at = (*place, index)
            stated = f" ({number(float(sweep.own[at] * scale[index]))})" if own[at] else ""
            return number(float(sweep.values[at] * scale[index])) + stated

        described = sweep.measures[index]
        return Column(title_of(described, sweep), content, unit=described.shown_in)

    def beyond(index: int) -> Column[tuple[int, ...]]:
        probabilities = sweep.values if sweep.exceedances is None else sweep.exceedances
        return Column(
            "Beyond the limit" if len(sweep.measures) == 1 else f"{title_of(sweep.measures[index], sweep)}, beyond",
            lambda place: f"{float(probabilities[(*place, index)]):.2e}",
        )

    def examined(place: tuple[int, ...]) -> str:
        point = tuple(float(variable.values[at]) for variable, at in zip(sweep.variables, place, strict=True))
        verdict = sweep.verdict_at(point)
        return "–" if verdict is None else verdict.value

    count, indices = len(sweep.variables), range(len(sweep.measures))
    doubts = [Column[tuple[int, ...]]("linear analysis", examined, kind="text")] if sweep.doubted else []
    columns = [*map(variable, range(count)), *map(measure, indices), *map(beyond, filter(sweep.rare, indices)), *doubts]
    return Table("", columns, [places[position] for position in chosen], "Linear analysis", keys=count)


def _not_shown(sweep: Sweep) -> list[str]:
    """Say which points are not in the terminal's table."""
    count, notes = int(np.prod(sweep.shape)), []
    if count > MOST_LINES:
        notes.append(f"{MOST_LINES} of {count:,} points shown; sweep.csv and --format csv have all.")
    if sweep.added:
        points = "1 point was" if len(sweep.added) == 1 else f"{len(sweep.added):,} points were"
        notes.append(f"Besides them {points} added to find where limits are met; sweep.json has them.")
    return notes


@dataclass(frozen=True)
class _Checked:
    """Monte Carlo estimates of an output at a point."""

    point: str
    estimates: Row


def confirmation_table(sweep: Sweep, confirmations: Sequence[Confirmation]) -> Table[_Checked]:
    """Tabulate linear and Monte Carlo sigmas at points where Monte Carlo was run."""
    rows = [
        _Checked(point_words(sweep, confirmation), row)
        for confirmation in confirmations
        for row in confirmation_rows(sweep, confirmation)
    ]

    def verdict(row: _Checked) -> Cell:
        words = row.estimates["verdict"]
        return Cell(words or "–", tone=words if words in VERDICTS else None)

    def ends(row: _Checked) -> str:
        return interval(row.estimates["ratio_paired_from"], row.estimates["ratio_paired_to"])

    words = end_words(sweep.outputs)
    columns: list[Column[_Checked]] = [
        Column("point", lambda row: row.point, kind="text", place="terminal"),
        Column("Output", lambda row: Cell(humanize(row.estimates["output"]), row.estimates["unit"]), words.one,
               "label"),
        Column("Linear σ", lambda row: row.estimates["sigma_linear"], "linear σ"),
        Column("Paired σ", lambda row: row.estimates["sigma_paired"], "paired σ"),
        Column("Paired ratio", lambda row: row.estimates["ratio_paired"], "paired ratio"),
        Column("Interval", ends, "interval"),
        Column("Verdict", verdict, "verdict", "label"),
    ]  # fmt: skip
    return Table(f"{words.title}, 1σ.", columns, rows, "Monte Carlo", keys=2)


@dataclass(frozen=True)
class _Requirement:
    """A requirement by linear analysis and by Monte Carlo."""

    requirement: str
    linear: str
    linear_finding: str
    estimate: str
    finding: str


def requirement_table(sweep: Sweep, confirmation: Confirmation) -> Table[_Requirement]:
    """Tabulate the requirements by linear analysis and by Monte Carlo at a point."""
    rows = []
    for index, measure in enumerate(sweep.measures):
        if measure.requirement is None:
            continue
        entry, at = confirmation.summary.requirements[measure.requirement], (*confirmation.place, index)
        (scale,) = drawn.scales_of([measure])
        estimate = None if entry.estimate is None else entry.estimate * scale
        rows.append(_Requirement(
            title_of(measure, sweep, True),
            f"{number(sweep.values[at] * scale)} {measure.shown_in}",
            linear_finding(sweep, at),
            f"{number(estimate)} {measure.shown_in}",
            entry.finding,
        ))  # fmt: skip
    columns: list[Column[_Requirement]] = [
        Column("Requirement", lambda row: row.requirement, kind="words"),
        Column("Linear", lambda row: row.linear),
        Column("Finding", lambda row: Cell(row.linear_finding, tone=TONES[row.linear_finding])),
        Column("Monte Carlo", lambda row: row.estimate),
        Column("Finding", lambda row: Cell(row.finding, tone=TONES[row.finding])),
    ]
    return Table("Requirements.", columns, rows)


def _checks(sweep: Sweep) -> list[Part]:
    """Arrange what Monte Carlo says at each point where it was run."""
    summary = sweep.confirmations[0].summary
    within = f"{100.0 * summary.tolerance:g} % at {100.0 * summary.confidence:g} % confidence"
    parts: list[Part] = [Note(
        "Each point is an ordinary run of the campaign, judged by itself: a sigma agrees within "
        f"{within}. {end_words(sweep.outputs).title} are compared, and requirements at their own times."
    )]  # fmt: skip
    for confirmation in sweep.confirmations:
        tone = verdict_at(sweep, confirmation)
        folder = confirmation.folder.relative_to(confirmation.folder.parent.parent).as_posix()
        said = Markup('{} {} <a href="{}/report.html">Report</a>, {:,} samples.').format(
            label(tone, tone), verdicts.headline(confirmation.summary), folder, confirmation.summary.samples
        )
        requirements = requirement_table(sweep, confirmation)
        parts += [
            Heading(point_words(sweep, confirmation, True)), Sentence(said),
            *(Sentence(STRONG(f"{line}.")) for line in disagreements(sweep, confirmation)),
            confirmation_table(sweep, [confirmation]), *([requirements] if requirements.rows else []),
        ]  # fmt: skip
    return parts
