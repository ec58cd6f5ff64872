"""The brief: a run on one sheet for a review board. Every claim names where its figures, data and formulas are."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.analysis.allocation import Allocation
from mcnav.analysis.brief import Advice, FilterRemedy
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.filter_remarks import group_words
from mcnav.report.columns.filter_columns import foremost_neglected
from mcnav.report.columns.requirements import RequirementRow, requirement_rows
from mcnav.report.document.parts import Note, Page, Part, Section, Sentence, Tile, Tiles, headed, joined
from mcnav.report.document.table import CODE, Cell, Column, Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize, shown_units
from mcnav.report.pages.allocate import basis_words, change_row, change_table, goal_title, unconfirmed_words
from mcnav.report.pages.run.page import figures
from mcnav.report.pages.run.tiles import headline, tiles
from mcnav.report.pages.run.worst_case import worst_case
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import verdicts
from mcnav.report.statements.requirements import worst_requirement
from mcnav.report.statements.words import listed

LISTED: Final = 5
"""Remedies of a filter that are listed."""

REFUTED: Final = ("optimistic", "pessimistic")
FILTER_TONES: Final = {"consistent": "agrees", "optimistic": "differs", "pessimistic": "differs"}

NO_REMEDY: Final = (
    "The samples show that the filter is {}. Linear analysis finds the filter consistent, and therefore cannot say "
    "what would help."
)

LINK: Final = Markup('<a href="{}">{}</a>').format


@dataclass(frozen=True)
class Links:
    """Places where the claims lead: the run folder for commands, and its report as seen from the sheet; empty: none."""

    run: str
    report: str

    def to(self, words: str, section: str = "") -> Markup:
        """Return words that lead to a section of the report."""
        return LINK(f"{self.report}{f'#{section}' if section else ''}", words) if self.report else Markup(words)


def page(content: RunAnalysis, advice: Advice, links: Links) -> Page:
    """Return the brief of a run."""
    summary = content.summary
    made = [replace(tile, details=()) for tile in tiles(summary, verdicts.statements(summary), (), content.time_unit)]
    drawn = figures(content)
    worst = worst_requirement(summary, content.time_unit)
    sections = [
        _requirements(content, links),
        _worst_case(content, drawn, made[0], links),
        _causes(content, drawn, worst, made[0].subject, links),
        _advice(content, advice),
        _sources(content, worst, links),
    ]
    return Page(
        f"{summary.campaign}, brief", "Brief", summary.campaign, [Tiles(made)], [*joined_sections(sections)],
        status=headline(made[0]), tone=made[0].tone,
    )  # fmt: skip


def joined_sections(sections: Sequence[Section | None]) -> list[Section]:
    """Return the sections that there are."""
    return [section for section in sections if section is not None]


def _requirements(content: RunAnalysis, links: Links) -> Section | None:
    """Tabulate the requirements with their margins; none without any."""
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    if not rows:
        return None

    def margin(row: RequirementRow) -> str:
        entry = row.entry
        if entry.kind in ("box", "sigma_ratio") or not entry.estimate:
            return "–"
        return f"× {number(entry.limits[0] / entry.estimate, 3)}"

    def bounds(row: RequirementRow) -> str:
        low, high = row.entry.interval
        return f"{row.shown(low, '–')} to {row.shown(high)}"

    columns: list[Column[RequirementRow]] = [
        Column("Requirement", lambda row: row.words, kind="words"),
        Column("Finding", lambda row: Cell(row.entry.finding, tone=row.tone), kind="label"),
        Column("Monte Carlo", lambda row: Cell(row.shown(row.entry.estimate, "–"), below=bounds(row))),
        Column("Limit over estimate", margin),
        Column("Linear", lambda row: row.linear),
        Column("Largest causes", lambda row: listed(row.causes), kind="words"),
    ]
    more = Note(Markup("All numbers: {}.").format(links.to("section Requirements of the report", "requirements")))
    return Section("requirements", "Requirements", [Table("", columns, rows), more])


def _worst_case(content: RunAnalysis, drawn: dict[str, Figure], tile: Tile, links: Links) -> Section | None:
    """Show the panel of the worst case; none where nothing shows it."""
    shown = worst_case(content, drawn, tile)
    if shown is None:
        return None
    return Section("worst", "Worst case", [shown, Note(Markup("All panels: {}.").format(links.to("the report")))])


def _causes(
    content: RunAnalysis, drawn: dict[str, Figure], worst: RequirementRow | None, subject: str, links: Links
) -> Section | None:
    """Show what causes what is worst: what a filter does not model, a requirement's errors, or those of all outputs."""
    unmodelled = foremost_neglected(content.summary) if subject == "Filter" else None
    figure = (limit_to_causes(worst) if worst else None) or drawn.get("budget")
    if figure is None and unmodelled is None:
        return None
    of = [Sentence(f"Requirement: {worst.words}.")] if worst and figure and figure.name == "waterfall" else []
    more = Note(Markup("All shares: {}.").format(links.to("section Error budget of the report", "budget")))
    shown = [unmodelled] if unmodelled is not None else [*of, *joined(figure)]
    return Section("causes", "Causes", [*shown, more])


def _advice(content: RunAnalysis, advice: Advice) -> Section:
    """Tabulate what would help: of numbers what simulation confirms, of filters the best first."""
    parts: list[Part] = []
    if advice.lacks:
        parts.append(Note(f"Not looked for: {advice.lacks}."))
    if advice.now is not None:
        parts += headed("The filter", *_filter_advice(content, advice.now, advice.remedies))
    elif content.summary.filter is not None and content.summary.filter.verdict in REFUTED and not advice.lacks:
        parts.append(Sentence(NO_REMEDY.format(content.summary.filter.verdict)))
    if advice.allocation is not None:
        parts += _numbers(advice.allocation)
    if not parts:
        parts.append(Sentence("Nothing: there is no requirement that linear analysis can judge, nor a filter."))
    return Section("advice", "What would help", parts)


def _numbers(allocation: Allocation) -> list[Part]:
    """Tabulate the changes of numbers that simulation confirms."""
    goal = allocation.goals[-1]
    rows = [change_row(allocation, goal, change) for change in goal.changes if change.simulated is not None]
    title, notes = goal_title(allocation, goal), [Note(words) for words in unconfirmed_words(goal)]
    if not rows:
        nothing = "Simulation confirms no change that linear analysis proposes." if goal.unconfirmed else (
            f"{title}: no number of the data sheet does it alone.")  # fmt: skip
        return [Sentence(nothing), *notes, Note(basis_words(allocation))]
    return [*headed(title, change_table(goal, "", rows)), *notes, Note(basis_words(allocation))]


def _filter_advice(content: RunAnalysis, now: FilterRemedy, remedies: Sequence[FilterRemedy]) -> list[Part]:
    """State the best remedy with its entry of the campaign file, and tabulate it with the others."""
    parts: list[Part] = []
    best = remedies[0] if remedies else None
    if best is not None and best.verdict.verdict == Honesty.CONSISTENT and not best.rank[0]:
        simulated = f"; {best.simulated.verdict} by {best.samples:,} samples" if best.simulated else ""
        parts.append(Sentence(f"A filter that {best.words} is consistent by linear analysis{simulated}:"))
        parts += [Sentence(CODE(filter_line(name, entry))) for name, entry in best.entries.items() if entry]
    parts.append(_remedies(content, now, remedies[:LISTED]))
    if len(remedies) > LISTED:
        parts.append(Note(f"{len(remedies) - LISTED} further filters depart more."))
    return parts


def filter_line(name: str, entry: Sequence[str]) -> str:
    """Write an entry of ``[filter]`` as a campaign file has it.

    >>> filter_line("considers", ["gyro_misalignment"])
    'considers = ["gyro_misalignment"]'
    """
    listed = ", ".join(f'"{kind}"' for kind in entry)
    return f"{name} = [{listed}]"


def _remedies(content: RunAnalysis, now: FilterRemedy, remedies: Sequence[FilterRemedy]) -> Table[FilterRemedy]:
    """Tabulate changes of the filter; each verdict is on the changed filter, each sigma true."""
    output, units = now.verdict.output, shown_units(content.summary)

    def of(row: FilterRemedy) -> str:
        name = group_words(row.verdict.group) if row.verdict.group else humanize(row.verdict.output)
        return f"{rounded(row.verdict.factor)} in {name}" if name else rounded(row.verdict.factor)

    def simulated(row: FilterRemedy) -> Cell:
        result = content.summary.filter if row is now else row.simulated
        if result is None:
            return Cell("–")
        samples = content.summary.samples if row is now else row.samples
        return Cell(result.verdict, below=f"{samples:,} samples", tone=FILTER_TONES.get(result.verdict, "undecided"))

    scale, unit = units.get(output, (1.0, ""))
    columns: list[Column[FilterRemedy]] = [
        Column("A filter that", lambda row: row.words, kind="words"),
        Column("Linear verdict", lambda row: Cell(row.verdict.verdict, tone=_tone(row)), kind="label"),
        Column("Simulated", simulated, kind="label"),
        Column("True over filter σ at worst", of, kind="text"),
    ]
    if output:
        minutes = content.time_unit == "min"
        at = f"{now.verdict.worst / 60.0:.3g} min" if minutes else f"{now.verdict.worst:.4g} {content.time_unit}"
        heading = f"True σ of {humanize(output)} at {at}, linear"
        columns.append(Column(heading, lambda row: Cell(number(row.sigma * scale, 4), unit)))
    return Table("", columns, [now, *remedies])


def _tone(row: FilterRemedy) -> str:
    return "agrees" if row.verdict.verdict == "consistent" else "differs"


def _sources(content: RunAnalysis, worst: RequirementRow | None, links: Links) -> Section:
    """Say where the numbers come from."""
    run, manifest = shlex.quote(links.run), content.manifest
    entries = [
        f"{content.summary.samples:,} samples, seed {manifest.seed}, engine {manifest.identity.engine}, "
        f"run {manifest.identity.digest[:12]}.",
        Markup("Figures and intervals: {}. Data behind each figure: {}. Formulas: {} and {}.").format(
            links.to("the report"), CODE(f"mcnav export {run}"), CODE("mcnav docs method"), CODE("mcnav docs notation")
        ),
    ]
    farthest = _farthest(content)
    if farthest is not None:
        words = "The sample farthest from the mean, flown again: {}."
        entries.append(Markup(words).format(CODE(f"mcnav replay {run} {farthest}")))
    if worst is not None and worst.way:
        entries.append(f"{worst.way.replace('RUN', run)}.".capitalize())
    return Section("sources", "Where this comes from", [*map(Sentence, entries)])


def _farthest(content: RunAnalysis) -> int | None:
    """Return the stored sample whose outputs, in units of their sigma, are the largest; none without dispersion."""
    known = np.isfinite(content.outputs).all(axis=1)
    outputs = content.outputs[known]
    spread = outputs.std(axis=0) if len(outputs) else np.zeros(0)
    if not content.dispersed or not spread.any():
        return None
    sizes = ((outputs - outputs.mean(axis=0))[:, spread > 0.0] / spread[spread > 0.0]) ** 2
    return int(content.index[known][sizes.sum(axis=1).argmax()])
