"""The report of a run as a page: tiles with the verdicts, answers, and the sections of `mcnav.report.sections`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Final

from markupsafe import Markup

from mcnav.analysis.heading import heading_remark
from mcnav.report import filter_tables, sentences
from mcnav.report.document import Beside, Findings, Folded, Note, Page, Part, Section, Tiles, joined
from mcnav.report.figure_words import words_on
from mcnav.report.figures import agreement, dispersion, matrices, normalized_errors, run_budget, sigma_ratios, truth
from mcnav.report.figures.combination import combination
from mcnav.report.figures.deck import deck
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.figure import Figure
from mcnav.report.figures.flight import flight
from mcnav.report.figures.requirements import requirements_over_time
from mcnav.report.figures.tail import tails
from mcnav.report.html import page_html
from mcnav.report.left_out import not_modelled
from mcnav.report.model import RunAnalysis
from mcnav.report.requirements import requirement_rows
from mcnav.report.sections.answers import answers
from mcnav.report.sections.budget import budget_section
from mcnav.report.sections.causes import causes_section
from mcnav.report.sections.filter import filter_sections
from mcnav.report.sections.improvements import failing_in_run, improvements_section
from mcnav.report.sections.joint import combination_section, joint_section
from mcnav.report.sections.outputs import dispersion_section, requirements_section, sigmas_section
from mcnav.report.sections.provenance import provenance_section, simulated_per_second
from mcnav.report.sections.smoother import smoother_section
from mcnav.report.sections.truth import truth_section
from mcnav.report.sections.what_if import linear_fails, what_if_section
from mcnav.report.sentences import Statement
from mcnav.report.tiles import headline, tiles

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

FOREMOST: Final = ("not met", "undecided", "met for the known ways", "met")
"""Findings in the order in which requirements are listed above everything else."""

REQUIREMENTS: Final = 3
"""Requirements listed there where there are more than one more; the section on requirements has all."""

FIRST: Final = (
    "Sigmas, ratios, biases, mean NEES, correlations, skewness, kurtosis and their intervals are computed from all "
    "samples. Scatter plots, histograms, quantiles, CEP, the tests of NEES and normality, and requirements on "
    "quantiles and probabilities use the first"
)
"""Results that a run with a stored summary computes from all samples, and from some."""


def figures(content: RunAnalysis) -> dict[str, Figure]:
    """Return the figures of the report by name, without those that have nothing to show."""
    drawn = {"flight": flight(content.history)}
    if content.dispersed:
        drawn |= {name: draw(content) for name, draw in FIGURES.items()}
    known = {name: drawing for name, drawing in drawn.items() if drawing is not None}
    return {name: replace(drawing, shows=words_on(name, content) or drawing.shows) for name, drawing in known.items()}


def render(content: RunAnalysis) -> str:
    """Render the report as one HTML page."""
    return page_html(page(content))


def page(content: RunAnalysis) -> Page:
    """Return the report."""
    name, sections = content.summary.campaign, _numbered(_sections(content, figures(content)))
    consistent = None if content.filter is None else filter_tables.interval_at_worst(content.filter)
    made = tiles(content.summary, _stated(content), {each.name for each in sections}, content.time_unit, consistent)
    head = [Tiles(made), *joined(_requirements(content), answers(content)), *map(Note, _notes(content))]
    kind, foremost = "Linear covariance analysis and Monte Carlo", made[0]
    return Page(name, kind, name, head, sections, status=headline(foremost), tone=foremost.tone)


def _numbered(sections: Sequence[Section]) -> list[Section]:
    """Give the figures their numbers, in the order of the page."""
    numbers = count(1)

    def counted(figure: Figure) -> Figure:
        return replace(figure, number=next(numbers))

    def with_numbers(part: Part) -> Part:
        match part:
            case Figure():
                return counted(part)
            case Beside():
                return Beside([counted(figure) for figure in part.figures])
            case Folded():
                return replace(part, parts=[*map(with_numbers, part.parts)])
        return part

    return [replace(section, parts=[*map(with_numbers, section.parts)]) for section in sections]


def _sections(content: RunAnalysis, drawn: Mapping[str, Figure]) -> list[Section]:
    """List the sections of the report; most are there where there is dispersion to show."""
    throughout, flown, dispersed = drawn.get("envelopes"), drawn.get("flight"), content.dispersed
    moved = drawn.get("deck")
    sections = [
        combination_section(content, drawn),
        None if moved is None else Section("deck", moved.title, [moved]),
        None if throughout is None else Section("throughout", throughout.title, [throughout]),
        truth_section(content, drawn) if dispersed else None,
        *filter_sections(content, drawn),
        smoother_section(content),
        None if flown is None else Section("flight", flown.title, [flown]),
        budget_section(content, drawn) if dispersed else None,
        improvements_section(content.what_if, content.manifest.model.outputs, failing_in_run(content)),
        what_if_section(content.what_if, content.manifest.model.outputs, content.looped, linear_fails(content.summary)),
        joint_section(content, drawn) if dispersed else None,
        dispersion_section(content, drawn) if dispersed else None,
        requirements_section(content, drawn),
        sigmas_section(content, drawn) if dispersed else None,
        causes_section(content),
        provenance_section(content),
    ]
    return [section for section in sections if section is not None]


def _stated(content: RunAnalysis) -> list[Statement]:
    """State the verdicts, the worst first."""
    return [_on_page(content, statement) for statement in sentences.statements(content.summary)]


def _on_page(content: RunAnalysis, statement: Statement) -> Statement:
    """Leave out of a verdict what the page has elsewhere, and add what only the whole run tells."""
    details, warnings = statement.details, statement.warnings
    if statement.subject == "linear":
        findings, further = sentences.findings(content.summary), _further(content)
        heading = heading_remark(content.history)
        growth = sentences.room_to_grow(content.summary)
        details = (*(each for each in findings if each not in further), *([growth] if growth else []))
        if heading:  # which says more than what the scenario notices of it
            warnings = (*(each for each in warnings if not each.startswith("Noticed: the heading ")), heading)
    elif statement.subject == "filter" and content.filter is not None:
        where = filter_tables.at_worst(content.filter)
        details = (" ".join(filter(None, (where, *details))),)
    return replace(statement, details=details, warnings=warnings)


def _further(content: RunAnalysis) -> list[str]:
    """Return the findings that are not beside the verdict: the second, where the joint distribution agrees."""
    failing = content.summary.verdict_matrix not in ("agrees", None)
    return [] if failing else sentences.findings(content.summary)[1:]


def _requirements(content: RunAnalysis) -> Findings | None:
    """List the foremost requirements with their estimates; none where a tile has the only one, or none is asked."""
    rows = sorted(
        requirement_rows(content.summary, "shown", content.time_unit),
        key=lambda row: FOREMOST.index(row.entry.finding),
    )
    if len(rows) < 2:
        return None
    more = len(rows) - REQUIREMENTS if len(rows) > REQUIREMENTS + 1 else 0
    further = Markup('<a href="#requirements">and {} more</a>').format(more) if more > 0 else ""
    listed = rows[:REQUIREMENTS] if more else rows
    entries = [(row.entry.finding, row.tone, f"{row.words}: {row.estimate.text}") for row in listed]
    return Findings(entries, further)


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
    causes = [*(each.name for each in content.manifest.model.sources), *content.model.processes]
    left_out = not_modelled(kind, causes, bool(content.manifest.identity.campaign.get("faults")))
    remarks = (*_further(content), sentences.certain_but_small(summary), sentences.stopping(summary))
    return [*filter(None, (missing, *remarks, kept, flown, left_out))]
