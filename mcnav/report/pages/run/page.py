"""The report of a run as a page: a first screen with the answers, and folds with the sections below it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from markupsafe import Markup

from mcnav.analysis.heading import heading_remark
from mcnav.report.columns import filter_tables
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Folded, Note, Page, Part, Section, Tile, Tiles, joined
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures import agreement, dispersion, matrices, normalized_errors, run_budget, sigma_ratios, truth
from mcnav.report.figures.captions import words_on
from mcnav.report.figures.combination import combination
from mcnav.report.figures.deck import deck
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.flight import flight
from mcnav.report.figures.requirements import requirements_over_time
from mcnav.report.figures.tail import tails
from mcnav.report.pages.run.first_screen import WHOLE, first_screen, stated_on
from mcnav.report.pages.run.folded import with_folded_parts, with_worst_first
from mcnav.report.pages.run.sections.answers import FILTERED, answers
from mcnav.report.pages.run.sections.budget import budget_section
from mcnav.report.pages.run.sections.causes import causes_section
from mcnav.report.pages.run.sections.filter import filter_sections
from mcnav.report.pages.run.sections.joint import combination_section, joint_section
from mcnav.report.pages.run.sections.outputs import dispersion_section, requirements_section, sigmas_section
from mcnav.report.pages.run.sections.provenance import provenance_section, simulated_per_second
from mcnav.report.pages.run.sections.remedies import ALL_REMEDIES, remedies_section
from mcnav.report.pages.run.sections.smoother import smoother_section
from mcnav.report.pages.run.sections.truth import truth_section
from mcnav.report.pages.run.sections.what_if import what_if_section, where_nonlinear
from mcnav.report.pages.run.tiles import NAMES, headline, tiles
from mcnav.report.pages.screen import folds_of, numbered_page
from mcnav.report.results.left_out import not_modelled
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import verdicts
from mcnav.report.statements.details import certain_but_small, explanation_of_filter, findings, room_to_grow, stopping
from mcnav.report.statements.verdicts import Statement, Subject

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

FIGURES: Final[dict[str, Callable[[RunAnalysis], Figure | None]]] = {
    "ratios": agreement.sigma_ratios, "nees": agreement.nees, "matrices": matrices.matrices,
    "budget": run_budget.budget, "development": run_budget.partials_history, "envelopes": envelopes,
    "scatter": dispersion.scatter, "histograms": dispersion.histograms, "quantiles": agreement.normal_quantiles,
    "convergence": agreement.running_ratios, "nees_history": normalized_errors.nees_over_time,
    "nis_history": normalized_errors.nis_over_time, "sigma_history": sigma_ratios.sigma_ratios_over_time,
    "within_history": sigma_ratios.shares_within, "estimation": estimation, "combination": combination,
    "requirements_over_time": requirements_over_time, "tails": tails,
    "deck": deck, "dispersion_over_time": truth.dispersion_over_time, "landing_ellipses": truth.ellipses_at_end,
}  # fmt: skip
"""Figures of the report besides the nominal flight: none where a run has nothing to show."""

FIRST: Final = (
    "Sigmas, ratios, biases, mean squared distance, correlations, skewness, kurtosis and their intervals are computed "
    "from all samples. Scatter plots, histograms, quantiles, CEP, the tests of distances and normality, and "
    "requirements on quantiles and probabilities use the first"
)
"""Results that a run with a stored summary computes from all samples, and from some."""


def figures(content: RunAnalysis) -> dict[str, Figure]:
    """Return the figures of the report by name, without those that have nothing to show."""
    drawn = {"flight": flight(content.history)}
    if content.dispersed:
        drawn |= {name: draw(content) for name, draw in FIGURES.items()}
    known = {name: drawing for name, drawing in drawn.items() if drawing is not None}
    return {
        name: with_worst_first(content, replace(drawing, shows=words_on(name, content) or drawing.shows))
        for name, drawing in known.items()
    }


def render(content: RunAnalysis) -> str:
    """Render the report as one HTML page."""
    return page_html(page(content))


def page(content: RunAnalysis) -> Page:
    """Return the report: one screen that answers, and everything else in folds."""
    name, drawn = content.summary.campaign, figures(content)
    stated = stated_on(content)
    sections = {section.name: section for section in _sections(content, drawn, stated[0].subject)}
    consistent = None if content.filter is None else filter_tables.interval_at_worst(content.filter)
    made = tiles(content.summary, _stated(content), sections, content.time_unit, consistent)
    first = first_screen(content, drawn, made, stated)
    moved = None
    if first.moved is not None:
        sections.pop(WHOLE, None)
        moved = replace(drawn[WHOLE], number=1)
        made = [replace(tile, link="linear") if tile.link == WHOLE else tile for tile in made]
    failing = content.summary.filter is not None and content.summary.filter.verdict == "optimistic"
    crowded = content.looped or failing  # with more to say than the number of samples
    kind, answer = "Run" if crowded else samples_and_confidence("Run", content.summary), made[0]
    above = _above(content, made, moved)
    if content.looped:
        above = {fold: with_folded_parts(parts) for fold, parts in above.items()}
    folds = folds_of([*sections.values()], above)
    whole = Page(
        name, kind, name, first.parts, status=headline(answer), tone=answer.tone, folds=folds, short=first.short
    )
    return numbered_page(whole)


def samples_and_confidence(kind: str, summary: Summary) -> str:
    """Say what the verdicts of a run rest on, above its heading."""
    return f"{kind}: {summary.samples:,} samples, {100.0 * summary.confidence:g} % confidence"


def _above(content: RunAnalysis, made: Sequence[Tile], moved: Figure | None) -> dict[str, Sequence[Part]]:
    """Return what stands above the sections of each fold: its verdicts first.

    A figure that has moved to the first screen leaves its words in the fold that it comes from.
    """
    by_subject = {tile.subject: tile for tile in made}
    table = answers(content)
    of_filter = table is not None and table.style == FILTERED
    return {
        "Filter": joined(_tiles(by_subject, "filter", "smoother"), table if of_filter else None),
        "Linear analysis": joined(
            _tiles(by_subject, "means", "linear"),
            None if of_filter else table,
            None if moved is None else _words(moved),
        ),
        "Requirements": joined(_tiles(by_subject, "requirements")),
        "Provenance": [*map(Note, _notes(content))],
    }


def _words(figure: Figure) -> Note:
    """Return what a figure shows and its caption."""
    return Note(Markup("Figure {}. {} {}").format(figure.number, figure.shows, figure.caption))


def _tiles(verdicts: Mapping[str, Tile], *subjects: Subject) -> Tiles | None:
    """Return the tiles on some subjects; none where there is no such verdict."""
    chosen = [verdicts[NAMES[subject]] for subject in subjects if NAMES[subject] in verdicts]
    return Tiles(chosen) if chosen else None


def _sections(content: RunAnalysis, drawn: Mapping[str, Figure], decided: Subject) -> list[Section]:
    """List the sections of the report; most are there where there is dispersion to show.

    ``decided``: what the foremost verdict is on. A combination of outputs has a section where that is linear analysis.
    """
    throughout, flown, dispersed = drawn.get("envelopes"), drawn.get("flight"), content.dispersed
    moved, decides = drawn.get("deck"), decided == "linear"
    differing = combination_section(content, drawn)
    folded_flight = Folded(flown.title, [flown]) if flown and moved and content.looped else None
    sections = [
        differing if decides else None,
        None if moved is None else Section("deck", moved.title, [moved, *joined(folded_flight)]),
        None if throughout is None else Section("throughout", throughout.title, [throughout]),
        truth_section(content, drawn) if dispersed else None,
        *filter_sections(content, drawn),
        smoother_section(content),
        None if flown is None or folded_flight else Section("flight", flown.title, [flown]),
        budget_section(content, drawn) if dispersed else None,
        remedies_section(content.remedies, content.manifest.model.outputs, ALL_REMEDIES),
        what_if_section(
            content.what_if, content.manifest.model.outputs, content.looped, where_nonlinear(content.summary)
        ),
        joint_section(content, drawn, None if decides else differing) if dispersed else None,
        dispersion_section(content, drawn) if dispersed else None,
        requirements_section(content, drawn),
        sigmas_section(content, drawn) if dispersed else None,
        causes_section(content),
        provenance_section(content),
    ]
    known = [section for section in sections if section is not None]
    if not content.looped:
        return known
    return [
        section if section.name == "requirements" else replace(section, parts=with_folded_parts(section.parts))
        for section in known
    ]


def _stated(content: RunAnalysis) -> list[Statement]:
    """State the verdicts, the worst first."""
    return [_on_page(content, statement) for statement in verdicts.statements(content.summary)]


def _on_page(content: RunAnalysis, statement: Statement) -> Statement:
    """Leave out of a verdict what the page has elsewhere, and add what only the whole run tells."""
    summary = content.summary
    if statement.subject == "linear":
        words = [*findings(summary, verdicts.tone(summary) == "partly")]
        further, growth, heading = _further(content), room_to_grow(summary), heading_remark(content.history)
        known = (*(sentence for sentence in words if sentence not in further), *([growth] if growth else []))
        if not heading:
            return replace(statement, details=known)
        others = [warning for warning in statement.warnings if not warning.startswith("Warning: the heading ")]
        return replace(statement, details=known, warnings=(*others, heading))  # which says more than the scenario's
    if statement.subject == "filter" and content.filter is not None:
        explained = explanation_of_filter(summary)  # with which the first section of the fold begins
        return replace(statement, details=tuple(words for words in statement.details if words != explained))
    return statement


def _further(content: RunAnalysis) -> list[str]:
    """Return the findings that are not beside the verdict: the second, where the joint distribution agrees."""
    failing = content.summary.verdict_matrix not in ("agrees", None)
    return [] if failing else findings(content.summary, verdicts.tone(content.summary) == "partly")[1:]


def _notes(content: RunAnalysis) -> list[str]:
    """Say what else there is to know of the answers, and how they were computed."""
    summary, execution, higher = content.summary, content.manifest.execution, content.summary.higher_order
    missing = f"No higher-order sigma: {higher.failed}." if content.dispersed and higher and higher.failed else ""
    some = f"Only a summary of the {summary.samples:,} samples is stored. {FIRST}"
    kept = f"{some} {summary.kept:,}." if summary.kept else ""
    took = f"; {execution.seconds} s" if execution and simulated_per_second(content) else ""
    flown = (
        f"{summary.samples:,} samples, {summary.failed:,} failed; engine {summary.engine}, design {summary.design}, "
        f"seed {summary.seed}{took}."
    )
    kind = str(content.manifest.identity.campaign.get("scenario", {}).get("type", ""))
    causes = [*(source.name for source in content.manifest.model.sources), *content.model.processes]
    left_out = not_modelled(kind, causes, bool(content.manifest.identity.campaign.get("faults")))
    remarks = (*_further(content), certain_but_small(summary), stopping(summary))
    return [*filter(None, (missing, *remarks, kept, flown, left_out))]
