"""A judged run in numbers: what ``summary.json`` holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcnav.analysis.comparison import Comparison, Criterion, Model


def summarise(
    manifest: Mapping[str, Any], status: Sequence[str], model: Model, criterion: Criterion, comparison: Comparison
) -> dict[str, Any]:
    """The content of ``summary.json``: SI units, rows and columns in the order of outputs and sources.

    Parameters
    ----------
    manifest : mapping
        What the run says of itself.
    status : sequence of str
        Of every sample.
    model, criterion, comparison
        As judged.
    """
    outputs, ellipsoid = comparison.outputs, comparison.ellipsoid
    named = {
        key: [{"name": e["name"], "unit": e["unit"]} for e in manifest["model"][key]] for key in ("sources", "outputs")
    }
    return {
        "campaign": manifest["campaign"],
        "verdict": comparison.verdict.value,
        "samples": manifest["samples"],
        "failed": comparison.failed,
        "failures": dict(Counter(reason for reason in status if reason != "ok")),
        "engine": manifest["identity"]["engine"],
        "seed": manifest["seed"],
        "design": manifest["design"],
        "tolerance": criterion.tolerance,
        "confidence": criterion.confidence,
        "heavy_tailed": manifest["heavy_tailed"],
        "confidence_each": comparison.confidence_each,
        **named,
        "partials": model.partials,
        "start_mean": model.mean,
        "start_covariance": model.covariance,
        "mean_linear": model.outcome_mean,
        "mean_sample": comparison.mean_sample,
        "bias": [output.bias.value for output in outputs],
        "bias_standard_error": [output.bias.standard_error for output in outputs],
        "covariance_linear": comparison.covariance_linear,
        "covariance_sample": comparison.covariance_sample,
        "covariance_paired": comparison.covariance_paired,
        "sigma_linear": np.sqrt(np.diag(comparison.covariance_linear)),
        "sigma_sample": [output.sigma_sample for output in outputs],
        "sigma_paired": [output.sigma_paired for output in outputs],
        "sigma_ratio": [output.plain.ratio for output in outputs],
        "sigma_ratio_interval": [output.plain.interval for output in outputs],
        "sigma_ratio_paired": [output.paired.ratio for output in outputs],
        "sigma_ratio_paired_interval": [output.paired.interval for output in outputs],
        "verdicts": [output.paired.verdict.value for output in outputs],
        "samples_needed": [output.paired.samples_needed for output in outputs],
        "nees_dimension": ellipsoid.dimension if ellipsoid else 0,
        "nees_mean": ellipsoid.nees.value if ellipsoid else None,
        "nees_standard_error": ellipsoid.nees.standard_error if ellipsoid else None,
        "nees_mean_paired": ellipsoid.nees_paired.value if ellipsoid else None,
        "nees_paired_standard_error": ellipsoid.nees_paired.standard_error if ellipsoid else None,
        "direction_ratio": float(ellipsoid.direction_ratios[ellipsoid.farthest]) if ellipsoid else None,
        "direction_weights": ellipsoid.directions[ellipsoid.farthest] if ellipsoid else None,
        "verdict_matrix": ellipsoid.judgement.verdict.value if ellipsoid else None,
        "unscented": manifest["model"]["unscented"],
    }
