"""The report of a run as an HTML page: its figures, tables and sentences."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.heading import heading_remark
from mcnav.report import filter_tables, filter_verdict, sentences, tables
from mcnav.report.failures import failure_rows
from mcnav.report.figures import agreement, consistency, dispersion, matrices, sources
from mcnav.report.figures.combination import combination
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.figure import Figure
from mcnav.report.figures.flight import flight
from mcnav.report.html import filled
from mcnav.report.left_out import not_modelled
from mcnav.report.linear_causes import causes_at
from mcnav.report.model import RunAnalysis
from mcnav.report.requirements import detailed_rows

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
    manifest, summary = content.manifest, content.summary
    drawn = figures(content)
    contributions = tables.contributions(content) if content.dispersed else []
    simulated, seconds = (manifest.execution.samples, manifest.execution.seconds) if manifest.execution else (0, 0.0)
    requirements = detailed_rows(content)
    outputs = tables.outputs(content) if content.dispersed else []
    remarks = (sentences.certain_but_small, sentences.stopping)
    told = sentences.findings(summary)
    failing = summary["verdict_matrix"] not in ("agrees", None)
    return filled(
        "campaign.html",
        content=content,
        summary=summary,
        manifest=manifest,
        headline=sentences.headline(summary),
        tone=sentences.standing(summary),
        explanations=told if failing else told[:1],
        remarks=[*([] if failing else told[1:]), *(remark(summary) for remark in remarks)],
        warnings=[*(each(summary) for each in (sentences.caveat, sentences.failures)), heading_remark(content.history)],
        not_modelled=not_modelled(str(manifest.identity.campaign.get("scenario", {}).get("type", ""))),
        figures={key: drawn.get(key) for key in ("flight", *FIGURES)},
        outputs=outputs,
        **_of_filter(content, outputs),
        ellipsoid=tables.ellipsoid(content),
        tests=tables.multivariate(content),
        requirements=requirements,
        first=sorted(requirements, key=lambda row: FOREMOST.index(row["finding"]))[:REQUIREMENTS],
        terms=tables.variance_terms(content) if content.dispersed else None,
        simulated_budget=tables.simulated_budget(content),
        contributions=contributions,
        grouped=any(row["several"] for row in contributions),
        sources=tables.sources(content),
        no_higher_order=(summary["higher_order"] or {}).get("failed"),
        means=bool(np.any(content.model.mean)),
        correlated=bool(np.nanmax(np.abs(content.budget.cross_terms), initial=0.0) > 1e-12),
        farthest=tables.farthest(content) if content.dispersed else [],
        identity=manifest.identity.digest,
        together=f"{100.0 * content.criterion.confidence:g} %",
        confidence_each=f"{100.0 * content.comparison.confidence_each:.4g} %",
        tolerance=f"{100.0 * content.criterion.tolerance:g} %",
        speed=f"{simulated / max(seconds, 1e-3):,.0f}" if simulated == summary["samples"] else None,
        failed=failure_rows(content),
        inputs=tables.input_files(manifest),
        campaign=content.campaign,
        rerun=f"mcnav run campaign.toml --engine {shlex.quote(summary['engine'])}",
    )


def _of_filter(content: RunAnalysis, outputs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what the template shows of a filter; without one nothing."""
    result, summary = content.filter, content.summary
    if result is None:
        return {"filter_answers": [], "filter_first": False}
    explained = filter_tables.at_worst(result), filter_verdict.explanation(summary)
    answers = filter_tables.answers(content, outputs)
    return {
        "filter_answers": [
            row | {"largest_at_worst": causes_at(content, row["worst_time"], number) if row["worst"] else []}
            for number, row in enumerate(answers)
        ],
        "filter_first": filter_verdict.comes_first(summary, sentences.standing(summary)),
        "filter_headline": filter_verdict.headline(summary),
        "filter_explanation": " ".join(filter(None, explained)),
        "filter_tone": filter_verdict.TONES[result.verdict.value],
        "filter_findings": filter_tables.findings(result),
        "filter_neglected": filter_tables.neglected(content),
        "filter_neglected_at": "" if result.neglected_at is None else instant(result.neglected_at, result.label),
        "filter_sensors": filter_tables.sensors(result),
    }
