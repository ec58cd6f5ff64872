"""The content of ``summary.json``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from mcnav.analysis.budget import ErrorBudget
from mcnav.analysis.combinations import Combination
from mcnav.analysis.comparison import Comparison, Criterion, Model
from mcnav.analysis.ellipsoid import Ellipsoid
from mcnav.analysis.failed_samples import FailureBias
from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.analysis.linear_range import BeyondRange
from mcnav.analysis.multivariate import MultivariateTests
from mcnav.analysis.requirements import RequirementResult
from mcnav.analysis.tails import Quantile
from mcnav.analysis.variance_breakdown import VarianceBreakdown
from mcnav.report.filter_summary import filter_entries
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.store.manifest import Manifest, ModelRecord

TESTS: Final = ("covariance", "covariance_paired", "bias", "bias_paired", "nees")
"""Tests of the outputs together that `mcnav.analysis.multivariate.MultivariateTests` holds."""


def tally(findings: Iterable[str]) -> dict[str, int] | None:
    """Count requirements by their findings; none without requirements.

    >>> tally(["not met", "undecided"])
    {'met': 0, 'not_met': 1, 'undecided': 1, 'of': 2}
    """
    result = list(findings)
    counts = {finding.replace(" ", "_"): result.count(finding) for finding in ("met", "not met", "undecided")}
    return {**counts, "of": len(result)} if result else None


def summarise(
    manifest: Manifest,
    failures: Mapping[str, int],
    model: Model,
    criterion: Criterion,
    comparison: Comparison,
    causes: VarianceBreakdown | None,
    budget: ErrorBudget,
    requirements: Sequence[RequirementResult],
    tails: Sequence[Quantile],
    left_out: FailureBias | None = None,
    filtered: FilterConsistency | None = None,
    beyond: BeyondRange | None = None,
) -> dict[str, Any]:
    """Collect results in SI units, rows and columns in the order of outputs and sources.

    ``failures`` counts the samples that failed for each reason.
    """
    outputs, ellipsoid, record = comparison.outputs, comparison.ellipsoid, manifest.model
    variables = {"sources": record.sources, "outputs": record.outputs}
    named = {key: [{"name": each.name, "unit": each.unit} for each in entries] for key, entries in variables.items()}
    processes = [{"name": name, "covariance": covariance} for name, covariance in model.processes.items()]
    return {
        "campaign": manifest.campaign,
        "verdict": "undecided" if manifest.unsettled else comparison.verdict.value,
        "unsettled": manifest.unsettled.to_json() if manifest.unsettled else None,
        "samples": manifest.samples,
        "failed": comparison.failed,
        "failures": dict(failures),
        "excluded": asdict(left_out) if left_out else None,
        "engine": manifest.identity.engine,
        "seed": manifest.seed,
        "design": manifest.design,
        "store": manifest.store,
        "kept": manifest.stored_rows,
        "tolerance": criterion.tolerance,
        "confidence": criterion.confidence,
        "heavy_tailed": list(manifest.heavy_tailed),
        "stopping": manifest.stopping.to_json() if manifest.stopping else None,
        "long_tailed": list(manifest.long_tailed),
        "confidence_each": comparison.confidence_each,
        **named,
        "shown_in": {key: [each.shown_in for each in entries] for key, entries in variables.items()},
        "partials": model.partials,
        "start_mean": model.mean,
        "start_covariance": model.covariance,
        **({"processes": processes} if processes else {}),
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
        "verdict_matrix": ellipsoid.verdict.value if ellipsoid else None,
        "unscented": record.unscented,
        "detectable_ratio": [output.detectable_plain for output in outputs],
        "samples_to_see_tolerance": [output.samples_to_see for output in outputs],
        "nees_mean_expected": comparison.joint.nees_expected if comparison.joint else None,
        "detectable_ratio_paired": [output.detectable_paired for output in outputs],
        "principal_ratios": ellipsoid.direction_ratios if ellipsoid else [],
        "principal_directions": ellipsoid.directions if ellipsoid else [],
        "joint": _combinations(ellipsoid, named["outputs"]) if ellipsoid else None,
        **_joint(comparison.joint, len(model.partials)),
        "second_order": record.second_order,
        "higher_order": record.higher_order,
        "causes": asdict(causes) if causes else None,
        "tails": [
            _named(asdict(quantile), named["outputs"]) | {"verdict": quantile.verdict.value} for quantile in tails
        ],
        "requirements": [_requirement(judged, named["outputs"]) for judged in requirements],
        "requirements_met": tally(judged.finding.value for judged in requirements),
        **({} if beyond is None else {"beyond_range": _beyond(beyond, record)}),
        "budget": {**asdict(budget), "flown": record.budget},
        **({} if filtered is None else filter_entries(filtered)),
    }


def _beyond(beyond: BeyondRange, record: ModelRecord) -> dict[str, Any]:
    """Name the outputs that leave the range of linear analysis, and when; in the unit of the run's histories."""
    names = [record.outputs[output].name for output in beyond.outputs]
    return {"outputs": names, "begin": beyond.time, "time": record.development and record.development.label}


def _combinations(ellipsoid: Ellipsoid, outputs: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Describe mean and dispersion of all outputs together, and the combinations of outputs that differ."""
    dispersion = ellipsoid.dispersion
    differing, shifted = (each and _combination(each, outputs) for each in (ellipsoid.differing, ellipsoid.shifted))
    return {
        "cause": ellipsoid.cause.value if ellipsoid.cause else None,
        "nees_verdict": ellipsoid.judgement.verdict.value,
        "nees_about_mean": ellipsoid.nees_about_mean,
        "dispersion_verdict": dispersion.verdict.value if dispersion else None,
        "dispersion_ratio": dispersion.ratio if dispersion else None,
        "dispersion_ratio_interval": dispersion.interval if dispersion else None,
        "samples_needed": ellipsoid.judgement.samples_needed,
        "mean_error": ellipsoid.mean_error,
        "differing": differing,
        "shifted": shifted,
        "unpredicted": [_combination(each, outputs) for each in ellipsoid.unpredicted],
    }


def _combination(combination: Combination, outputs: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Describe a combination of outputs, in the unit of its lead output."""
    return {
        "lead": outputs[combination.lead]["name"],
        "weights": combination.weights,
        "shares": combination.shares,
        "sigma_linear": combination.sigma_linear,
        "sigma_paired": combination.sigma_paired,
        "mean_error": combination.offset,
        "verdict": combination.judgement.verdict.value if combination.judgement else None,
    }


def _named(entry: dict[str, Any], outputs: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    return entry | {"outputs": [outputs[number]["name"] for number in entry["outputs"]]}


def _requirement(judged: RequirementResult, outputs: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    entry = {
        **_named(asdict(judged.requirement), outputs),
        "finding": judged.finding.value,
        **{key: value for key, value in asdict(judged).items() if key not in ("requirement", "finding")},
    }
    at_the_end = () if judged.requirement.epochs else ("when", "epochs", "time", "samples")
    return {key: value for key, value in entry.items() if key not in at_the_end}


def _joint(joint: MultivariateTests | None, outputs: int) -> dict[str, Any]:
    """List the tests of all outputs together; each a table of its attributes, or null where it is not made."""
    tests: dict[str, HypothesisTest | None] = dict.fromkeys((*TESTS, "skewness", "kurtosis"))
    if joint is not None:
        tests |= {name: getattr(joint, name) for name in TESTS}
    if joint is not None and joint.normality is not None:
        tests["skewness"], tests["kurtosis"] = joint.normality.skewness_test, joint.normality.kurtosis_test
    correlations = joint.correlations if joint else ()
    differences = {"correlation_difference": np.full((outputs, outputs), np.nan)}
    differences["correlation_difference_standard_error"] = np.full((outputs, outputs), np.nan)
    for pair in correlations:
        for i, j in (pair.between, pair.between[::-1]):
            differences["correlation_difference"][i, j] = pair.difference.value
            differences["correlation_difference_standard_error"][i, j] = pair.difference.standard_error
    shapes: dict[str, list[float]] = {}
    for key in ("skewness", "excess_kurtosis"):
        estimates = getattr(joint, key) if joint else ()
        shapes[key] = [estimate.value for estimate in estimates]
        shapes[f"{key}_standard_error"] = [estimate.standard_error for estimate in estimates]
    return {
        "tests": {name: asdict(test) if test else None for name, test in tests.items()},
        "contained": [asdict(entry) for entry in joint.contained] if joint else [],
        **differences,
        **shapes,
    }
