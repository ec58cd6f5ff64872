"""The page: tables as text, figures as SVG, one template, one style sheet, nothing loaded from anywhere."""

from __future__ import annotations

import math
import shlex
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mcnav.report import figures, wording
from mcnav.report.content import Content


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits; a dash for one that does not exist.

    >>> number(36.3456789)
    '36.35'
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude >= digits + 2 or magnitude < -4:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10^{int(exponent)}".replace("-", "−")
    return f"{value:,.{max(0, digits - 1 - magnitude)}f}".replace("-", "−")


def share(value: float) -> str:
    """A share of a variance in per cent.

    >>> share(0.00001)
    '<0.01'
    """
    if not math.isfinite(value):
        return "–"
    return "<0.01" if 0.0 < abs(value) < 5e-5 else f"{100.0 * value:.2f}".replace("-", "−")


def _interval(interval: tuple[float, float] | None) -> str:
    return "–" if interval is None else f"{interval[0]:.4f} … {interval[1]:.4f}"


def _with_error(value: float, half_width: float) -> str:
    return f"{number(value, 4)} ± {number(half_width, 2)}"


def _output_rows(content: Content) -> list[dict[str, Any]]:
    scale, unscented = content.output_scale, content.summary["unscented"]
    rows = []
    for i, output in enumerate(content.comparison.outputs):
        second = math.sqrt(max(unscented["covariance"][i][i], 0.0)) * scale[i] if "covariance" in unscented else None
        sigma = output.sigma_linear
        rows.append(
            {
                "name": content.output_names[i],
                "unit": content.output_units[i],
                "linear": number(sigma * scale[i], 5),
                "sample": number(output.sigma_sample * scale[i], 5),
                "paired": number(output.sigma_paired * scale[i], 5),
                "unscented": number(second, 5),
                "plain_ratio": number(output.plain.ratio, 5),
                "plain_interval": _interval(output.plain.interval),
                "paired_ratio": number(output.paired.ratio, 5),
                "paired_interval": _interval(output.paired.interval),
                "bias": number(100.0 * output.bias.value / sigma if sigma > 0.0 else None, 3),
                "bias_error": number(100.0 * output.bias.standard_error / sigma if sigma > 0.0 else None, 2),
                "verdict": output.paired.verdict.value,
                "needed": output.paired.samples_needed,
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


def _matrices(content: Content) -> list[dict[str, Any]]:
    square = np.outer(content.output_scale, content.output_scale)
    comparison = content.comparison
    return [
        {"title": title, "rows": [[number(value, 5) for value in row] for row in matrix * square]}
        for title, matrix in (
            ("Linear, P·S·Pᵀ", comparison.covariance_linear),
            ("Monte Carlo, plain sample", comparison.covariance_sample),
            ("Monte Carlo, paired estimate", comparison.covariance_paired),
        )
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
        "nees": _with_error(ellipsoid.nees.value, ellipsoid.nees.half_width(confidence)),
        "paired": _with_error(ellipsoid.nees_paired.value, ellipsoid.nees_paired.half_width(confidence)),
        "verdict": ellipsoid.judgement.verdict.value,
        "ratio": number(float(ellipsoid.direction_ratios[ellipsoid.farthest]), 5),
        "combination": combination.removeprefix("+ "),
    }


def _figures(content: Content) -> dict[str, Markup]:
    drawn = {"flight": figures.flight(content)}
    if content.dispersed:
        drawn |= {
            "budget": figures.budget(content),
            "ratios": figures.sigma_ratios(content),
            "correlation": figures.correlation_maps(content),
            "scatter": figures.scatter(content),
            "histograms": figures.histograms(content),
            "nees": figures.nees(content),
        }
    return {key: Markup(svg) for key, svg in drawn.items()}


def filled(template: str, **values: Any) -> str:
    """A page of this package with values in it; text is escaped, only figures come as markup."""
    environment = Environment(
        loader=PackageLoader("mcnav.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    style = environment.loader.get_source(environment, "style.css")[0] if environment.loader else ""
    return environment.get_template(template).render(style=Markup(style), **values)


def render(content: Content) -> str:
    """The report as one HTML page."""
    manifest, summary = content.manifest, content.summary
    flown, seconds = manifest["flight"]["samples"], manifest["flight"]["seconds"]
    return filled(
        "campaign.html",
        summary=summary,
        manifest=manifest,
        headline=wording.headline(summary),
        explanation=wording.explanation(summary),
        joint=wording.joint_explanation(summary),
        tone=wording.tone(summary),
        certain=wording.certain_but_small(summary),
        caveat=wording.caveat(summary),
        failures=wording.failures(summary),
        figures=_figures(content),
        outputs=_output_rows(content) if content.dispersed else [],
        together=f"{100.0 * content.criterion.confidence:g} %",
        tolerance=f"{100.0 * content.criterion.tolerance:g} %",
        output_names=content.output_names,
        output_units=content.output_units,
        sources=_source_rows(content),
        means=bool(np.any(content.model.mean)),
        cross=[share(value) for value in content.budget.cross_terms],
        correlated=bool(np.nanmax(np.abs(content.budget.cross_terms), initial=0.0) > 1e-12),
        matrices=_matrices(content),
        ellipsoid=_ellipsoid(content),
        confidence_each=f"{100.0 * content.comparison.confidence_each:.4g} %",
        speed=f"{flown / max(seconds, 1e-3):,.0f}" if flown == summary["samples"] else None,
        failed=[(int(index), reason) for index, reason in zip(content.index, content.status, strict=True)
                if reason != "ok"][:20],
        campaign=content.campaign,
        rerun=f"mcnav run campaign.toml --engine {shlex.quote(summary['engine'])}",
    )  # fmt: skip
