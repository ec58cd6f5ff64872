"""Rows of the report's tables, in the units shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.variance_breakdown import TERMS, VarianceBreakdown
from mcnav.report import joint_words, sentences
from mcnav.report.figures.sources import SHOWN, contributors, flown_shares
from mcnav.report.format import number, share, signed, with_error
from mcnav.report.model import RunAnalysis
from mcnav.report.output_columns import output_rows
from mcnav.report.result_table import Row
from mcnav.statistics.estimates import Estimate
from mcnav.store.manifest import Manifest

TERM_NAMES: Final = {
    "sampled_sigmas": "sampling: sigmas of the errors",
    "sampled_correlations": "sampling: correlations of the errors",
    "sampled_noise": "sampling: noise",
    "partials": "partials: finite differences − variational",
    "second_order": "second order, ½ tr(HSHS)",
    "third_order": "third order",
    "rest": "remainder",
}

LARGEST: Final = 3
"""Sources named beside each output."""

LEAST: Final = 0.005
"""Smallest share of a source that is named there."""

FARTHEST: Final = 5
"""Samples with the largest NEES that are listed."""

NEGLIGIBLE: Final = 1e-3
"""Share by every method below which a source is left out of long tables of shares."""

INTERACTION: Final = 0.01
"""Excess of a total over a first-order Sobol index that counts as an interaction."""


def answers(content: RunAnalysis) -> list[Row]:
    """Add to the estimates of each output (`mcnav.report.output_columns`) its largest sources."""
    rows = []
    for i, row in enumerate(output_rows({"": content.summary})):
        shares = np.nan_to_num(content.budget.shares[i])
        largest = [
            (content.cause_names[j], f"{100.0 * shares[j]:.0f}")
            for j in np.argsort(-shares, kind="stable")[:LARGEST]
            if shares[j] >= LEAST
        ]
        tone = "" if row["verdict"] == sentences.NOT_DISTURBED else row["verdict"]
        rows.append(row | {"name": content.output_names[i], "tone": tone, "largest": largest})
    return rows


def contributions(content: RunAnalysis) -> list[dict[str, Any]]:
    """List the share of each contributor in the linear variance of each output, and its final error for one sigma."""
    scale, budget = content.output_scale, content.budget
    rows = []
    for each in contributors(content):
        shares = budget.shares[:, each.members].sum(axis=1)
        if len(each.members) == 1:
            final = budget.contributions[:, each.members[0]] * scale
        else:
            final = np.sqrt((budget.contributions[:, each.members] ** 2).sum(axis=1)) * scale
        rows.append({"name": each.label, "several": len(each.members) > 1,
                     "cells": list(zip(shares, final, strict=True))})  # fmt: skip
    return rows


def sources(content: RunAnalysis) -> list[dict[str, Any]]:
    """List sigma and mean of each source, its contribution to each output, and its share of the linear variance.

    The source with the largest mean share comes first.
    """
    noise = np.full(len(content.model.processes), np.nan)  # which has no sigma of one number
    scale = np.append(content.source_scale, noise)
    sigma = np.append(np.sqrt(np.diag(content.model.covariance)), noise)
    mean, units = np.append(content.model.mean, noise), [*content.source_units, *("" for _ in noise)]
    finals = content.budget.contributions * content.output_scale[:, None]
    order = np.argsort(-np.nan_to_num(content.budget.shares).mean(axis=0), kind="stable")
    return [
        {
            "name": content.cause_names[j],
            "unit": units[j],
            "sigma": sigma[j] * scale[j],
            "mean": mean[j] * scale[j],
            "cells": list(zip(content.budget.shares[:, j], finals[:, j], strict=True)),
        }
        for j in order
        if not sigma[j] <= 0.0 or mean[j] != 0.0
    ]


def input_files(manifest: Manifest) -> list[dict[str, Any]]:
    """List the files of a run besides its campaign: a user's code, and what that reads."""
    code, rows = manifest.identity.code, [
        {"name": each.name, "use": each.setting or "opened by the scenario", "bytes": each.bytes, "sha256": each.sha256,
         "copied": each.copied}
        for each in manifest.files
    ]  # fmt: skip
    if code is not None:
        rows.insert(0, {"name": code.file, "use": "the scenario", "bytes": None, "sha256": code.sha256, "copied": True})
    return rows


def ellipsoid(content: RunAnalysis) -> dict[str, str] | None:
    """Describe the NEES and the combination of outputs that differs most; none without a covariance matrix."""
    result, confidence = content.comparison.ellipsoid, content.comparison.confidence_each
    joint = content.summary.joint
    if result is None or joint is None or joint.differing is None:
        return None
    plain, paired = (with_error(each.value, each.reach(confidence)) for each in (result.nees, result.nees_paired))
    return {
        "dimension": f"{result.dimension}",
        "mean": number(result.nees_paired.value),
        "plain": plain,
        "paired": paired,
        "about_mean": number(result.nees_about_mean),
        "nees_verdict": result.judgement.verdict.value,
        "verdict": result.verdict.value,
        "remark": joint_words.shortly(content.summary, joint),
        "ratio": number(float(result.direction_ratios[result.farthest]), 5),
        "combination": joint_words.combination_words(joint.differing, content.summary),
    }


def farthest(content: RunAnalysis) -> list[dict[str, Any]]:
    """List the samples with the largest NEES."""
    result = content.comparison.ellipsoid
    if result is None:
        return []
    rows = np.argsort(-result.values, kind="stable")[:FARTHEST]
    numbers = content.index[np.isfinite(content.outputs).all(axis=1)]
    return [{"index": int(numbers[k]), "nees": result.values[k], "outputs": content.flown[k]} for k in rows]


def variance_terms(content: RunAnalysis) -> dict[str, Any] | None:
    """Split the difference of each variance that differs, in per cent of the linear one; none where none does."""
    causes = content.causes
    linear = np.diag(content.comparison.covariance_linear)
    shown = [i for i, each in enumerate(content.comparison.outputs) if linear[i] > 0.0 and each.paired.certain]
    if causes is None or not shown:
        return None
    per_cent = np.divide(100.0, linear, out=np.full_like(linear, np.nan), where=linear > 0.0)
    rows = {TERM_NAMES[name]: [signed(value) for value in (causes.terms[name] * per_cent)[shown]]
        for name in TERMS if name in causes.terms}  # fmt: skip
    remainder = zip((causes.terms["rest"] * per_cent)[shown], (causes.standard_error * per_cent)[shown], strict=True)
    rows[TERM_NAMES["rest"]] = [with_error(value, error, sign=True) for value, error in remainder]
    return {
        "names": [content.output_names[i] for i in shown],
        "rows": rows,
        "total": (causes.total * per_cent)[shown],
        "paired": (causes.paired * per_cent)[shown],
        "unscented": (causes.unscented * per_cent)[shown],
        "sentence": _largest_difference(content, causes, per_cent, shown),
        "normal_only": not content.manifest.normal,
    }


def _largest_difference(
    content: RunAnalysis, breakdown: VarianceBreakdown, per_cent: Array, shown: Sequence[int]
) -> str:
    """Explain the largest paired difference among some outputs."""
    paired = np.nan_to_num(breakdown.paired * per_cent)
    at = max(shown, key=lambda i: abs(paired[i]))
    error, remainder = breakdown.standard_error[at] * per_cent[at], breakdown.terms["rest"][at] * per_cent[at]
    predicted = (breakdown.terms["second_order"] + breakdown.terms["third_order"])[at] * per_cent[at]
    if not np.isfinite(error) or not np.isfinite(predicted):
        return ""
    difference = (
        f"After removing sampling error, the variance of {content.output_names[at]} differs by {signed(paired[at])} % "
        f"(± {signed(error, 2)[1:]} %)"
    )
    if abs(paired[at]) <= 2.0 * error:
        return f"{difference}, which is not significant."
    difference += f"; second- and third-order terms predict {signed(predicted)} %"
    if abs(remainder) <= 2.0 * error:
        return f"{difference}, which explains it."
    return f"{difference}. The remainder is significant and due to higher orders."


def simulated_budget(content: RunAnalysis) -> dict[str, Any] | None:
    """List linear and Monte Carlo shares of each source, a table per output; none when it was not simulated."""
    simulated = content.manifest.model.budget
    if not simulated or not content.dispersed:
        return None
    alone, sobol = simulated["alone"], simulated["sobol"]
    if "failed" in alone:
        return {"failed": alone["failed"]}
    variances = np.diag(content.comparison.covariance_linear)
    largest = _largest_shares(content, sobol)
    active = np.flatnonzero(np.diag(content.model.covariance) > 0.0)
    least = NEGLIGIBLE if len(active) > SHOWN else 0.0
    return {
        "failed": None,
        "least": f"{100.0 * least:g} %" if least else "",
        "samples": alone["samples"],
        "no_sobol": sobol.get("failed"),
        "interactions": "failed" not in sobol and _interacts(sobol),
        "tables": {
            content.output_names[i]: {
                content.source_names[j]: _shares(content, int(i), int(j), float(variances[i]), alone, sobol)
                for j in active[np.argsort(-content.budget.shares[i, active], kind="stable")]
                if largest[i, j] >= least
            }
            for i in np.flatnonzero(variances > 0.0)
        },
    }


def _largest_shares(content: RunAnalysis, sobol: dict[str, Any]) -> Array:
    """Return the largest share by any method, shape (outputs, sources)."""
    tables = [content.budget.shares, flown_shares(content), *([] if "failed" in sobol else [sobol["total"]])]
    return np.asarray(np.max([np.nan_to_num(np.array(each, dtype=float)) for each in tables], axis=0))


def _interacts(sobol: dict[str, Any]) -> bool:
    """Return whether some total index exceeds the first-order one significantly."""
    keys = ("total", "first_order", "total_standard_error", "first_order_standard_error")
    total, first, *errors = (np.array(sobol[key], dtype=float) for key in keys)
    return bool(np.any(total - first > INTERACTION + 4.0 * np.hypot(*errors)))


def _shares(
    content: RunAnalysis, i: int, j: int, variance: float, alone: dict[str, Any], sobol: dict[str, Any]
) -> list[str]:
    """Format the share of source j in the variance of output i: alone, without it, and Sobol indices."""

    def shown(estimate: Estimate) -> str:
        half_width = share(estimate.half_width(content.criterion.confidence))
        return f"{share(estimate.value)} ± {half_width}".replace(" ", "\N{NO-BREAK SPACE}")

    def simulated(key: str) -> str:
        error = alone[key]["standard_error"][i][j]
        value, error = alone[key]["variance"][i][j] / variance, math.inf if error is None else error / variance
        return shown(Estimate(value, error, alone["degrees_of_freedom"]))

    def index(key: str) -> str:
        if "failed" in sobol or sobol[key][i][j] is None:
            return "–"
        return shown(Estimate(sobol[key][i][j], sobol[f"{key}_standard_error"][i][j], sobol["replicates"] - 1.0))

    linear = share(float(content.budget.shares[i, j])), share(1.0 - float(content.budget.saved[i, j]))
    return [linear[0], simulated("alone"), linear[1], simulated("without"), index("first_order"), index("total")]
