"""The brief: a run on one sheet for a review board. Every claim names where its figures, data and formulas are."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav._dataclasses import dataclass
from mcnav.analysis.brief import Advice, FilterRemedy
from mcnav.analysis.filter_remarks import group_words
from mcnav.report import sentences
from mcnav.report.allocate import change_row, change_table, goal_title
from mcnav.report.document import CODE, Cell, Column, Note, Page, Part, Section, Sentence, Table, Tiles, headed
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.figures.figure import Figure
from mcnav.report.format import number, rounded
from mcnav.report.model import RunAnalysis
from mcnav.report.names import humanize, shown_units
from mcnav.report.page import figures
from mcnav.report.requirements import RequirementRow, listed, requirement_rows
from mcnav.report.tiles import headline, tiles, worst_requirement

WORST_CASE: Final = {
    "Mean errors": ("envelopes", "histograms"),
    "Requirements": ("requirements_over_time", "tails", "histograms"),
    "Filter": ("sigma_history", "nees_history"),
    "Smoother": ("sigma_history",),
    "Linear analysis": ("combination", "ratios"),
}
"""Figures that show the worst case of each tile, the foremost first."""

CHANGES: Final = 5
"""Changes of numbers that are listed."""

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
    made = [replace(each, details=()) for each in tiles(summary, sentences.statements(summary), (), content.time_unit)]
    drawn = figures(content)
    worst = worst_requirement(summary, content.time_unit)
    sections = [
        _requirements(content, links),
        _worst_case(content, drawn, made[0].subject, links),
        _causes(drawn, worst, links),
        _advice(content, advice, worst),
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


def _worst_case(content: RunAnalysis, drawn: dict[str, Figure], subject: str, links: Links) -> Section | None:
    """Show the figure of the worst tile, of its panels the one on what is worst; none where there is none."""
    known = [drawn[name] for name in (*WORST_CASE[subject], "envelopes", "ratios") if name in drawn]
    if not known:
        return None
    figure, result = known[0], content.summary.filter
    row = worst_requirement(content.summary, content.time_unit)
    foremost = [result.group, humanize(result.output)] if subject == "Filter" and result else []
    foremost += [*map(humanize, row.entry.outputs)] if subject == "Requirements" and row else []
    panels = [each for each in figure.panels if each.title in foremost] or figure.panels
    shown = replace(figure, panels=panels[:1], shown=0)
    return Section("worst", "Worst case", [shown, Note(Markup("All panels: {}.").format(links.to("the report")))])


def _causes(drawn: dict[str, Figure], worst: RequirementRow | None, links: Links) -> Section | None:
    """Show what causes the worst requirement's errors, or those of all outputs."""
    figure = (limit_to_causes(worst) if worst else None) or drawn.get("budget")
    if figure is None:
        return None
    of = [Sentence(f"Requirement: {worst.words}.")] if worst and figure.name == "waterfall" else []
    more = Note(Markup("All shares: {}.").format(links.to("section Error budget of the report", "budget")))
    return Section("causes", "Causes", [*of, figure, more])


def _advice(content: RunAnalysis, advice: Advice, worst: RequirementRow | None) -> Section:
    """Tabulate what would help by linear analysis."""
    parts: list[Part] = []
    if advice.lacks:
        parts.append(Note(f"Not looked for: {advice.lacks}."))
    if advice.allocation is not None:
        goal = advice.allocation.goals[-1]
        rows = [change_row(advice.allocation, goal, each) for each in goal.changes if each.reached][:CHANGES]
        words = goal_title(advice.allocation, goal)
        if rows:
            parts += headed(words, change_table(goal, "", rows))
        else:
            parts.append(Sentence(f"{words}: no number of the data sheet does it alone."))
    if advice.now is not None:
        parts += headed("The filter", _remedies(content, advice.now, advice.remedies))
    if not parts:
        parts.append(Sentence("Nothing: there is no requirement that linear analysis can judge, nor a filter."))
    elif advice.allocation is not None or advice.now is not None:
        parts.append(Note("By linear analysis of the changed campaign; mcnav run tests a change by Monte Carlo."))
    return Section("advice", "What would help", parts)


def _remedies(content: RunAnalysis, now: FilterRemedy, remedies: Sequence[FilterRemedy]) -> Table[FilterRemedy]:
    """Tabulate changes of the filter; each verdict is on the changed filter, each sigma true."""
    output, units = now.verdict.output, shown_units(content.summary)

    def of(row: FilterRemedy) -> str:
        name = group_words(row.verdict.group) if row.verdict.group else humanize(row.verdict.output)
        return f"{rounded(row.verdict.factor)} in {name}" if name else rounded(row.verdict.factor)

    scale, unit = units.get(output, (1.0, ""))
    columns: list[Column[FilterRemedy]] = [
        Column("A filter that", lambda row: row.words, kind="words"),
        Column("Linear verdict", lambda row: Cell(row.verdict.verdict, tone=_tone(row)), kind="label"),
        Column("True over filter σ at worst", of, kind="text"),
    ]
    if output:
        minutes = content.time_unit == "min"
        at = f"{now.verdict.worst / 60.0:.3g} min" if minutes else f"{now.verdict.worst:.4g} {content.time_unit}"
        heading = f"True σ of {humanize(output)} at {at}"
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
