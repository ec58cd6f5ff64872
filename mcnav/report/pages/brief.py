"""The brief: a run on one sheet for a review board. Every claim names where its figures, data and formulas are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.execution.shell import quote_word
from mcnav.report.columns.filter_columns import foremost_neglected
from mcnav.report.columns.requirements import RequirementRow, requirement_rows
from mcnav.report.document.parts import WARNINGS, Note, Page, Section, Sentence, Tile, Verdict, joined
from mcnav.report.document.table import CODE, Cell, Column, Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.format import rounded
from mcnav.report.pages.run.first_screen import first_screen, stated_on
from mcnav.report.pages.run.page import figures, samples_and_confidence
from mcnav.report.pages.run.sections.remedies import ALL_REMEDIES, remedies_section
from mcnav.report.pages.run.tiles import NAMES, tiles
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.requirements import margin, worst_requirement
from mcnav.report.statements.verdicts import Statement
from mcnav.report.statements.words import WORST, listed

LISTED: Final = 3
"""Remedies on the sheet; the report has all."""

MULTIPLE: Final = "× {}".format
LINK: Final = Markup('<a href="{}">{}</a>').format


@dataclass(frozen=True)
class Links:
    """Places where the claims lead: the run folder for commands, and its report as seen from the sheet; empty: none."""

    run: str
    report: str

    def to(self, words: str, section: str = "") -> Markup:
        """Return words that lead to a section of the report."""
        return LINK(f"{self.report}{f'#{section}' if section else ''}", words) if self.report else Markup(words)


def page(content: RunAnalysis, links: Links) -> Page:
    """Return the brief of a run: one slide with the board's question first, and below it the sheet that it rests on.

    The board asks whether requirements are met; without requirements, whether what is worst can be trusted.
    """
    summary, drawn = content.summary, figures(content)
    stated = stated_on(content)
    stated.sort(key=lambda statement: ("means", "requirements").index(statement.subject)
                if statement.subject in ("means", "requirements") else 2)  # fmt: skip
    made = [replace(tile, details=(), further=(), link="") for tile in tiles(summary, stated, (), content.time_unit)]
    made.sort(key=lambda tile: [NAMES[statement.subject] for statement in stated].index(tile.subject))
    worst = worst_requirement(summary, content.time_unit)
    sections = [
        _requirements(content, links),
        _causes(content, drawn, worst, made[0].subject, links),
        _advice(content),
        _warnings(made),
        _sources(content, worst, links),
    ]
    said, tone = _both(stated)
    slide = first_screen(content, drawn, made, said)
    verdict, *beside = slide.parts
    if isinstance(verdict, Verdict) and tone != said[0].tone:
        verdict = replace(verdict, tone=tone)
    present = [section for section in sections if section is not None]
    return Page(
        f"{summary.campaign}, brief", samples_and_confidence("Brief", summary), summary.campaign,
        [verdict, *beside], present,
        status=_headline(stated), tone=tone, slide=True,
    )  # fmt: skip


def _worst(stated: Sequence[Statement]) -> Statement:
    """Return the verdict that is worse than the first one, the worst; the first one where none is."""
    return min(stated, key=lambda statement: WORST.index(statement.tone))


def _both(stated: Sequence[Statement]) -> tuple[list[Statement], str]:
    """Return the verdicts that the headline does not state already, and the worst tone of all."""
    worst = _worst(stated)
    first, *others = stated
    said = replace(first, sentence=_headline(stated))
    if worst is first:
        return [first, *others], worst.tone
    rest = [replace(other, sentence=f"{other.sentence.partition('. ')[0].rstrip('.')}.") for other in others
            if other is not worst]  # fmt: skip
    return [said, *rest], worst.tone


def _headline(stated: Sequence[Statement]) -> str:
    """Answer the board's question, and say what is worse, so that a sheet on which all is met does not hide it."""
    first, worst = stated[0], _worst(stated)
    return first.sentence if worst is first else f"{first.sentence} {worst.sentence}"


def _warnings(made: Sequence[Tile]) -> Section | None:
    """List the warnings; none without any."""
    warnings = [warning for tile in made for warning in tile.warnings]
    return Section(WARNINGS, "Warnings", [*map(Sentence, warnings)]) if warnings else None


def _requirements(content: RunAnalysis, links: Links) -> Section | None:
    """Tabulate the requirements with their margins; none without any."""
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    if not rows:
        return None

    def multiple(row: RequirementRow) -> str:
        known = margin(row)
        return "–" if known is None else MULTIPLE(rounded(known))

    def bounds(row: RequirementRow) -> str:
        low, high = row.entry.interval
        return f"{row.shown(low, '–')} to {row.shown(high)}"

    columns: list[Column[RequirementRow]] = [
        Column("Requirement", lambda row: row.words, kind="words"),
        Column("Finding", lambda row: Cell(row.entry.finding, tone=row.tone), kind="label"),
        Column("Monte Carlo", lambda row: Cell(row.shown(row.entry.estimate, "–"), below=bounds(row))),
        Column("Errors may be", multiple),
        Column("Linear", lambda row: row.linear),
        Column("Largest causes", lambda row: listed(row.causes), kind="words"),
    ]
    more = Note(Markup("All numbers: {}.").format(links.to("section Requirements of the report", "requirements")))
    return Section("requirements", "Requirements", [Table("", columns, rows), more])


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


def _advice(content: RunAnalysis) -> Section | None:
    """Tabulate what would help; none where nothing fails."""
    remedies = content.remedies
    if remedies is not None:
        remedies = remedies.completed({"listed": remedies.listed[:LISTED]})
    return remedies_section(remedies, content.manifest.model.outputs, ALL_REMEDIES)


def _sources(content: RunAnalysis, worst: RequirementRow | None, links: Links) -> Section:
    """Say where the numbers come from."""
    run, manifest = quote_word(links.run), content.manifest
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
    return Section("sources", "Sources", [*map(Sentence, entries)])


def _farthest(content: RunAnalysis) -> int | None:
    """Return the stored sample whose outputs, in units of their sigma, are the largest; none without dispersion."""
    known = np.isfinite(content.outputs).all(axis=1)
    outputs = content.outputs[known]
    spread = outputs.std(axis=0) if len(outputs) else np.zeros(0)
    if not content.dispersed or not spread.any():
        return None
    sizes = ((outputs - outputs.mean(axis=0))[:, spread > 0.0] / spread[spread > 0.0]) ** 2
    return int(content.index[known][sizes.sum(axis=1).argmax()])
