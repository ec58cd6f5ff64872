"""HTML pages: one template each, tables as text, figures as SVG, one style sheet and script, nothing loaded."""

from __future__ import annotations

import base64
import hashlib
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mcnav.analysis.filter_remarks import instant
from mcnav.errors import shortened
from mcnav.report import filter_tables, filter_verdict, sentences, tables
from mcnav.report import format as formats
from mcnav.report.failures import failure_rows
from mcnav.report.figures import agreement, consistency, dispersion, matrices, sources
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.estimation import estimation
from mcnav.report.figures.figure import Figure
from mcnav.report.figures.flight import flight
from mcnav.report.model import RunAnalysis
from mcnav.report.requirements import detailed_rows
from mcnav.report.template_cache import TemplateCache

FIGURES: Final[dict[str, Callable[[RunAnalysis], Figure | None]]] = {
    "ratios": agreement.sigma_ratios, "nees": agreement.nees, "matrices": matrices.matrices, "budget": sources.budget,
    "development": sources.partials_history, "envelopes": envelopes, "scatter": dispersion.scatter,
    "histograms": dispersion.histograms, "quantiles": agreement.normal_quantiles,
    "convergence": agreement.running_ratios, "nees_history": consistency.nees_over_time,
    "nis_history": consistency.nis_over_time, "sigma_history": consistency.sigma_ratios_over_time,
    "within_history": consistency.shares_within, "estimation": estimation,
}  # fmt: skip
"""Figures of the report besides the nominal flight: none where a run has nothing to show."""

FILTERS: Final = ("number", "signed", "fixed", "with_error", "interval", "share", "percent", "probability")
"""Functions of `mcnav.report.format` that templates use."""

FOREMOST: Final = ("not met", "undecided", "met")
"""Findings in the order in which requirements are listed above everything else."""

REQUIREMENTS: Final = 4
"""Requirements listed there; the section on requirements has all."""

CONTENTS: Final = "<!-- contents -->"
"""Placeholder of the table of contents in the base template."""


def figures(content: RunAnalysis) -> dict[str, Figure]:
    """Return the figures of the report by name, without those that have nothing to show."""
    drawn = {"flight": flight(content.history)}
    if content.dispersed:
        drawn |= {name: draw(content) for name, draw in FIGURES.items()}
    return {name: drawing for name, drawing in drawn.items() if drawing is not None}


def filled(template: str, **values: Any) -> str:
    """Fill a template of this package; text is escaped, only figures are markup.

    The table of contents lists the sections that have an id and a heading. The content security policy allows the one
    script by its hash. Scrolling boxes can be focused by keyboard.
    """
    environment = _environment()
    style, script = (_source(environment, name) for name in ("style.css", "script.js"))
    script = re.sub(r"(?m)^\s*(//.*)?\n?", "", script)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = environment.get_template(template).render(
        style=Markup(style), script=Markup(script), script_hash=Markup(f"sha256-{digest}"), **values
    )
    return _focusable(_with_contents(text))


@cache
def _environment() -> Environment:
    """Return the one environment of this process, which keeps the templates that it has loaded."""
    environment = Environment(
        loader=PackageLoader("mcnav.report", "templates"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, bytecode_cache=TemplateCache(__file__),
    )  # fmt: skip
    environment.filters |= {name: getattr(formats, name) for name in FILTERS} | {"shortened": shortened}
    return environment


def _source(environment: Environment, name: str) -> str:
    return environment.loader.get_source(environment, name)[0] if environment.loader else ""


def _with_contents(text: str) -> str:
    """Add the list of sections."""
    sections = re.findall(r'<section id="([^"]+)"[^>]*>\s*<h2[^>]*>(.*?)</h2>', text, flags=re.DOTALL)
    if len(sections) < 2:
        return text.replace(CONTENTS, "", 1)
    links = "\n".join(f'<li><a href="#{name}">{heading}</a></li>' for name, heading in sections)
    nav = f'<nav class="contents" aria-label="Contents"><p class="heading">On this page</p>\n<ul>\n{links}\n</ul></nav>'
    return text.replace(CONTENTS, nav, 1).replace('<div class="page">', '<div class="page with-contents">', 1)


def _focusable(text: str) -> str:
    """Let scrolling boxes take the keyboard's focus, name them, and wrap captions so that they do not scroll."""
    text = re.sub("<caption>(.*?)</caption>", r"<caption><span>\1</span></caption>", text, flags=re.DOTALL)
    number_of = iter(range(1, text.count('<div class="scroll">') + 1))
    return re.sub(
        '<div class="scroll">',
        lambda _: f'<div class="scroll" tabindex="0" role="group" aria-label="Table {next(number_of)}">',
        text,
    )


def render(content: RunAnalysis) -> str:
    """Render the report as one HTML page."""
    manifest, summary = content.manifest, content.summary
    drawn = figures(content)
    contributions = tables.contributions(content) if content.dispersed else []
    simulated, seconds = (manifest.execution.samples, manifest.execution.seconds) if manifest.execution else (0, 0.0)
    requirements = detailed_rows(content)
    outputs = tables.outputs(content) if content.dispersed else []
    remarks = (sentences.joint_explanation, sentences.certain_but_small, sentences.stopping)
    return filled(
        "campaign.html",
        content=content,
        summary=summary,
        manifest=manifest,
        headline=sentences.headline(summary),
        tone=sentences.standing(summary),
        explanation=sentences.explanation(summary),
        remarks=[remark(summary) for remark in remarks],
        warnings=[warning(summary) for warning in (sentences.caveat, sentences.failures)],
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
    found, summary = content.filter, content.summary
    if found is None:
        return {"filter_answers": []}
    explained = filter_tables.at_worst(found), filter_verdict.explanation(summary)
    return {
        "filter_answers": filter_tables.answers(content, outputs),
        "filter_headline": filter_verdict.headline(summary),
        "filter_explanation": " ".join(filter(None, explained)),
        "filter_tone": filter_verdict.TONES[found.verdict.value],
        "filter_findings": filter_tables.findings(found),
        "filter_neglected": filter_tables.neglected(content),
        "filter_neglected_at": "" if found.neglected_at is None else instant(found.neglected_at, found.label),
        "filter_sensors": filter_tables.sensors(found),
    }
