"""The report of a run as an HTML page: its figures, tables and sentences."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from mcnav.analysis.heading import heading_remark
from mcnav.report import filter_tables, filter_verdict, sentences, tables
from mcnav.report.failures import failure_rows
from mcnav.report.figures import agreement, consistency, dispersion, matrices, sources
from mcnav.report.figures.combination import combination
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.figure import Figure
from mcnav.report.figures.flight import flight
from mcnav.report.filter_columns import foremost_neglected, groups_table, sensors_table, sigmas_of
from mcnav.report.html import filled
from mcnav.report.joint_columns import directions_table, ellipsoids_table, tests_table
from mcnav.report.left_out import not_modelled
from mcnav.report.linear_causes import causes_at
from mcnav.report.model import RunAnalysis
from mcnav.report.output_columns import outputs_table
from mcnav.report.percentiles import percentiles_table
from mcnav.report.requirements import allowed_by_requirement, requirement_rows, requirements_table
from mcnav.report.result_table import Row
from mcnav.report.sentences import Statement
from mcnav.report.vector_sizes import sizes_table

Values = Mapping[str, Any]
"""Values of a template."""

FIGURES: Final[dict[str, Callable[[RunAnalysis], Figure | None]]] = {
    "ratios": agreement.sigma_ratios, "nees": agreement.nees, "matrices": matrices.matrices, "budget": sources.budget,
    "development": sources.partials_history, "envelopes": envelopes, "scatter": dispersion.scatter,
    "histograms": dispersion.histograms, "quantiles": agreement.normal_quantiles,
    "convergence": agreement.running_ratios, "nees_history": consistency.nees_over_time,
    "nis_history": consistency.nis_over_time, "sigma_history": consistency.sigma_ratios_over_time,
    "within_history": consistency.shares_within, "estimation": estimation,
    "combination": combination,
}  # fmt: skip
"""Figures of the report besides the nominal flight: none where a run has nothing to show."""

FOREMOST: Final = ("not met", "undecided", "met")
"""Findings in the order in which requirements are listed above everything else."""

REQUIREMENTS: Final = 4
"""Requirements listed there; the section on requirements has all."""


def figures(content: RunAnalysis) -> dict[str, Figure]:
    """Return the figures of the report by name, without those that have nothing to show."""
    drawn = {"flight": flight(content.history)}
    if content.dispersed:
        drawn |= {name: draw(content) for name, draw in FIGURES.items()}
    return {name: drawing for name, drawing in drawn.items() if drawing is not None}


def render(content: RunAnalysis) -> str:
    """Render the report as one HTML page."""
    return filled("campaign.html", **_verdicts(content), **_numbers(content), **_provenance(content))


def _verdicts(content: RunAnalysis) -> Values:
    """Return the verdicts, the worst first, and what is read beside them."""
    summary = content.summary
    remarks = (sentences.certain_but_small(summary), sentences.stopping(summary))
    requirements = sorted(
        requirement_rows(summary, "shown", _time_unit(content)),
        key=lambda row: FOREMOST.index(row.entry.finding),
    )
    return {
        "statements": [_on_page(content, statement) for statement in sentences.statements(summary)],
        "remarks": [*_further(content), *filter(None, remarks)],
        "not_modelled": not_modelled(str(content.manifest.identity.campaign.get("scenario", {}).get("type", ""))),
        "first": requirements[:REQUIREMENTS],
        "no_higher_order": summary.higher_order and summary.higher_order.failed,
    }


def _further(content: RunAnalysis) -> list[str]:
    """Return the findings that are not beside the verdict: the second, where the joint distribution agrees."""
    failing = content.summary.verdict_matrix not in ("agrees", None)
    return [] if failing else sentences.findings(content.summary)[1:]


def _on_page(content: RunAnalysis, statement: Statement) -> Statement:
    """Leave out of a verdict what the page has elsewhere, and add what only the whole run tells."""
    if statement.subject == "linear":
        findings, further = sentences.findings(content.summary), _further(content)
        heading = heading_remark(content.history)
        return replace(
            statement,
            details=tuple(each for each in findings if each not in further),
            warnings=(*statement.warnings, *([heading] if heading else [])),
        )
    if statement.subject == "filter" and content.filter is not None:
        where = filter_tables.at_worst(content.filter)
        return replace(statement, details=(" ".join(filter(None, (where, *statement.details))),))
    return statement


def _time_unit(content: RunAnalysis) -> str:
    """Return the unit of the run's histories; empty without any."""
    return "" if content.development is None else content.development.label.partition(" [")[2].removesuffix("]")


def _numbers(content: RunAnalysis) -> Values:
    """Return figures and tables."""
    summary, drawn = content.summary, figures(content)
    together, tolerance = f"{100.0 * summary.confidence:g} %", f"{100.0 * summary.tolerance:g} %"
    each = f"{100.0 * content.comparison.confidence_each:.4g} %"
    answers = tables.answers(content) if content.dispersed else []
    contributions = tables.contributions(content) if content.dispersed else []
    caption = (
        "Final navigation errors, one sigma: linear and Monte Carlo (paired and plain estimates). Intervals hold at "
        f"{each} each and {together} jointly."
    )
    return {
        "together": together,
        "confidence_each": each,
        "tolerance": tolerance,
        "figures": {key: drawn.get(key) for key in ("flight", *FIGURES)},
        "outputs": answers,
        "outputs_table": outputs_table(summary, caption=caption).read,
        **_of_filter(content, answers, together),
        "ellipsoid": tables.ellipsoid(content),
        "tests_table": tests_table(summary).read,
        "directions_table": directions_table(summary).read,
        "ellipsoids_table": ellipsoids_table(summary).read,
        "requirements": summary.requirements,
        "requirements_table": requirements_table(summary, "shown", _time_unit(content), together).read,
        "allowed": allowed_by_requirement(summary),
        "sizes": sizes_table(summary, "shown", together).read if summary.sizes else None,
        "percentiles": percentiles_table(summary, "shown", together, tolerance).read,
        "terms": tables.variance_terms(content) if content.dispersed else None,
        "simulated_budget": tables.simulated_budget(content),
        "contributions": contributions,
        "grouped": any(row["several"] for row in contributions),
        "sources": tables.sources(content),
        "means": bool(np.any(content.model.mean)),
        "correlated": bool(np.nanmax(np.abs(content.budget.cross_terms), initial=0.0) > 1e-12),
        "farthest": tables.farthest(content) if content.dispersed else [],
    }


def _provenance(content: RunAnalysis) -> Values:
    """Return what the run consists of."""
    manifest, summary = content.manifest, content.summary
    simulated, seconds = (manifest.execution.samples, manifest.execution.seconds) if manifest.execution else (0, 0.0)
    return {
        "content": content,
        "summary": summary,
        "manifest": manifest,
        "identity": manifest.identity.digest,
        "speed": f"{simulated / max(seconds, 1e-3):,.0f}" if simulated == summary.samples else None,
        "failed": failure_rows(content),
        "inputs": tables.input_files(manifest),
        "campaign": content.campaign,
        "rerun": f"mcnav run campaign.toml --engine {shlex.quote(summary.engine)}",
    }


def _of_filter(content: RunAnalysis, outputs: Sequence[Row], together: str) -> Values:
    """Return what the template shows of a filter; without one nothing."""
    result, summary = content.filter, content.summary
    if result is None:
        return {"filter_answers": []}
    record = content.manifest.model.filter
    explained = filter_tables.at_worst(result), filter_verdict.explanation(summary)
    return {
        "filter_answers": [
            row | {"largest_at_worst": causes_at(content, row["worst_time"], number) if row["worst"] else []}
            for number, row in enumerate(filter_tables.answers(content, outputs))
        ],
        "filter_explanation": " ".join(filter(None, explained)),
        "filter_tone": filter_verdict.TONES[result.verdict.value],
        "filter_groups": groups_table(summary).read,
        "filter_outputs": sigmas_of(summary, "output"),
        "filter_states": sigmas_of(summary, "state"),
        "filter_neglected": foremost_neglected(summary),
        "filter_sensors": sensors_table(summary, bool(record and record.considered), together).read,
    }
