"""The page: tables as text, figures as SVG, one template, one style sheet, nothing loaded from anywhere."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import shlex
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mcnav.report import sentences
from mcnav.report.budget import two_routes
from mcnav.report.causes import causes
from mcnav.report.failures import failure_rows
from mcnav.report.figures import agreement, dispersion, matrices, sources
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.figure import Figure
from mcnav.report.figures.flight import flight
from mcnav.report.format import number, share, with_error
from mcnav.report.joint import joint
from mcnav.report.model import Content
from mcnav.report.requirements import requirement_rows
from mcnav.report.tails import tail_rows

FIGURES: Final = (
    "flight", "ratios", "nees", "matrices", "budget", "development", "envelopes", "scatter", "histograms", "quantiles",
    "convergence",
)  # fmt: skip
"""Figures that the template knows."""

FARTHEST: Final = 5
"""Flights with the largest NEES that are listed."""

FAILED: Final = 20
"""Failed samples that are listed."""

CONTENTS: Final = "<!-- contents -->"
"""Where the base template has its contents."""


def _interval(interval: tuple[float, float] | None) -> str:
    return "–" if interval is None or not math.isfinite(interval[1]) else f"{interval[0]:.4f} to {interval[1]:.4f}"


def _range(interval: tuple[float, float] | None) -> str:
    """An interval of a ratio as differences from one; empty where there is none."""
    if interval is None or not math.isfinite(interval[1]):
        return ""
    low, high = (sentences.percent(end - 1.0) for end in interval)
    return f"{low.removesuffix(' %')} to {high}"


def _output_rows(content: Content) -> list[dict[str, Any]]:
    scale, unscented = content.output_scale, content.summary["unscented"]
    higher = content.higher_order
    rows = []
    for i, output in enumerate(content.comparison.outputs):
        second = math.sqrt(max(unscented["covariance"][i][i], 0.0)) * scale[i] if "covariance" in unscented else None
        sigma = output.sigma_linear
        needed = output.paired.samples_needed
        bias, error = (100.0 * each / (sigma or math.nan) for each in (output.bias.value, output.bias.standard_error))
        rows.append(
            {
                "name": content.output_names[i],
                "unit": content.output_units[i],
                "shown": number(output.sigma_paired * scale[i], 4),
                "change": "" if output.paired.ratio is None else sentences.percent(output.paired.ratio - 1.0),
                "range": _range(output.paired.interval),
                "linear": number(sigma * scale[i], 5),
                "sample": number(output.sigma_sample * scale[i], 5),
                "paired": number(output.sigma_paired * scale[i], 5),
                "unscented": number(second, 5),
                "higher_order": number(higher["sigma"][i] * scale[i] if higher else None, 5),
                "plain_ratio": number(output.plain.ratio, 5),
                "plain_interval": _interval(output.plain.interval),
                "paired_ratio": number(output.paired.ratio, 5),
                "paired_interval": _interval(output.paired.interval),
                "bias": with_error(bias, error).split(" ") if sigma > 0.0 else [],
                "verdict": (words := sentences.output_words(sigma, output.paired.verdict.value)),
                "tone": "" if words == sentences.NOT_DISTURBED else output.paired.verdict.value,
                "detectable": number(100.0 * output.detectable_paired, 2),
                "needed": needed and sentences.more_samples(needed, content.summary["samples"]),
            }
        )
    return rows


def _source_rows(content: Content) -> list[dict[str, Any]]:
    scale, sigma = content.source_scale, np.sqrt(np.diag(content.model.covariance))
    contributions = content.budget.contributions * content.output_scale[:, None]
    return [
        {
            "name": content.source_names[j],
            "unit": content.source_units[j],
            "sigma": number(sigma[j] * scale[j]),
            "mean": number(content.model.mean[j] * scale[j]),
            "contributions": [number(value, 4) for value in contributions[:, j]],
            "shares": [share(value) for value in content.budget.shares[:, j]],
        }
        for j in range(len(sigma))
        if sigma[j] > 0.0 or content.model.mean[j] != 0.0
    ]


def _ellipsoid(content: Content) -> dict[str, Any] | None:
    ellipsoid = content.comparison.ellipsoid
    if ellipsoid is None:
        return None
    weights = ellipsoid.directions[ellipsoid.farthest]
    combination = " ".join(
        f"{'+' if weight >= 0 else '−'} {abs(weight):.3f} {name}"
        for weight, name in zip(weights, content.output_names, strict=True)
    )
    confidence = content.comparison.confidence_each
    return {
        "dimension": ellipsoid.dimension,
        "mean": number(ellipsoid.nees_paired.value, 4),
        "nees": with_error(ellipsoid.nees.value, ellipsoid.nees.reach(confidence)),
        "paired": with_error(ellipsoid.nees_paired.value, ellipsoid.nees_paired.reach(confidence)),
        "verdict": ellipsoid.judgement.verdict.value,
        "ratio": number(float(ellipsoid.direction_ratios[ellipsoid.farthest]), 5),
        "combination": combination.removeprefix("+ "),
    }


def _farthest(content: Content) -> list[dict[str, Any]]:
    """The flights with the largest NEES, farthest first."""
    ellipsoid = content.comparison.ellipsoid
    if ellipsoid is None:
        return []
    numbers = content.index[np.isfinite(content.outputs).all(axis=1)]
    flown = content.flown
    rows = np.argsort(-ellipsoid.values, kind="stable")[:FARTHEST]
    return [
        {
            "index": int(numbers[k]),
            "nees": number(float(ellipsoid.values[k])),
            "outputs": [number(float(value), 5) for value in flown[k]],
            "replay": f"mcnav replay . {numbers[k]}",
        }
        for k in rows
    ]


def figures(content: Content) -> dict[str, Figure]:
    """Every figure of the report that there is something to show in, by name."""
    drawn: dict[str, Figure | None] = {"flight": flight(content.history)}
    if content.dispersed:
        drawn |= {
            "ratios": agreement.sigma_ratios(content),
            "nees": agreement.nees(content),
            "matrices": matrices.matrices(content),
            "budget": sources.budget(content),
            "development": sources.partials_history(content),
            "envelopes": envelopes(content),
            "scatter": dispersion.scatter(content),
            "histograms": dispersion.histograms(content),
            "quantiles": agreement.normal_quantiles(content),
            "convergence": agreement.running_ratios(content),
        }
    return {name: drawing for name, drawing in drawn.items() if drawing is not None}


def filled(template: str, **values: Any) -> str:
    """A page of this package with values in it; text is escaped, only figures come as markup.

    The page gets its contents from its sections that have an id and a heading, and one script of our own, which its
    content security policy names by its hash; whatever scrolls can be reached by keyboard.
    """
    environment = Environment(
        loader=PackageLoader("mcnav.report", "templates"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    style, script = (_source(environment, name) for name in ("style.css", "script.js"))
    script = re.sub(r"(?m)^\s*(//.*)?\n?", "", script)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    text = environment.get_template(template).render(
        style=Markup(style), script=Markup(script), script_hash=Markup(f"sha256-{digest}"), **values
    )
    return _reachable(_with_contents(text))


def _source(environment: Environment, name: str) -> str:
    return environment.loader.get_source(environment, name)[0] if environment.loader else ""


def _with_contents(text: str) -> str:
    """A page with a list of its sections at its side."""
    sections = re.findall(r'<section id="([^"]+)"[^>]*>\s*<h2[^>]*>(.*?)</h2>', text, flags=re.DOTALL)
    if len(sections) < 2:
        return text.replace(CONTENTS, "", 1)
    links = "\n".join(f'<li><a href="#{name}">{heading}</a></li>' for name, heading in sections)
    nav = f'<nav class="contents" aria-label="Contents"><p class="heading">On this page</p>\n<ul>\n{links}\n</ul></nav>'
    return text.replace(CONTENTS, nav, 1).replace('<div class="page">', '<div class="page with-contents">', 1)


def _reachable(text: str) -> str:
    """A page whose scrolling boxes take the keyboard's focus and have names, and whose captions stay in sight."""
    text = re.sub("<caption>(.*?)</caption>", r"<caption><span>\1</span></caption>", text, flags=re.DOTALL)
    number_of = iter(range(1, text.count('<div class="scroll">') + 1))
    return re.sub(
        '<div class="scroll">',
        lambda _: f'<div class="scroll" tabindex="0" role="group" aria-label="Table {next(number_of)}">',
        text,
    )


def render(content: Content) -> str:
    """The report as one HTML page."""
    manifest, summary = content.manifest, content.summary
    drawn = figures(content)
    flown, seconds = manifest["flight"]["samples"], manifest["flight"]["seconds"]
    return filled(
        "campaign.html",
        summary=summary,
        manifest={"commit": None, **manifest},
        headline=sentences.headline(summary),
        explanation=sentences.explanation(summary),
        joint_explanation=sentences.joint_explanation(summary),
        joint=joint(content),
        requirements=requirement_rows(content),
        tails=tail_rows(content),
        causes=causes(content),
        routes=two_routes(content),
        tone=sentences.standing(summary),
        certain=sentences.certain_but_small(summary),
        stopping=sentences.stopping(summary),
        caveat=sentences.caveat(summary),
        failures=sentences.failures(summary),
        figures={key: drawn.get(key) for key in FIGURES},
        outputs=_output_rows(content) if content.dispersed else [],
        together=f"{100.0 * content.criterion.confidence:g} %",
        tolerance=f"{100.0 * content.criterion.tolerance:g} %",
        output_names=content.output_names,
        output_units=content.output_units,
        sources=_source_rows(content),
        means=bool(np.any(content.model.mean)),
        cross=[share(value) for value in content.budget.cross_terms],
        correlated=bool(np.nanmax(np.abs(content.budget.cross_terms), initial=0.0) > 1e-12),
        farthest=_farthest(content) if content.dispersed else [],
        identity=hashlib.sha256(json.dumps(manifest["identity"], sort_keys=True).encode()).hexdigest(),
        ellipsoid=_ellipsoid(content),
        confidence_each=f"{100.0 * content.comparison.confidence_each:.4g} %",
        speed=f"{flown / max(seconds, 1e-3):,.0f}" if flown == summary["samples"] else None,
        failed=failure_rows(content),
        campaign=content.campaign,
        rerun=f"mcnav run campaign.toml --engine {shlex.quote(summary['engine'])}",
    )  # fmt: skip
