"""The results of an analysed run as its summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from mcnav.analysis.budget import ErrorBudget
from mcnav.analysis.combinations import Combination
from mcnav.analysis.comparison import Comparison, Criterion
from mcnav.analysis.ellipsoid import Ellipsoid
from mcnav.analysis.failed_samples import FailureBias
from mcnav.analysis.filter_consistency import FilterConsistency
from mcnav.analysis.linear_range import BeyondRange
from mcnav.analysis.mean_errors import mean_errors, nominal_values
from mcnav.analysis.model import Model
from mcnav.analysis.multivariate import MultivariateTests
from mcnav.analysis.requirements import RequirementResult
from mcnav.analysis.summary import Beyond, CombinationEntry, Joint, Summary, tally
from mcnav.analysis.tails import MOST_PAIRS, Quantile, pairs_in_one_unit
from mcnav.analysis.variance_breakdown import VarianceBreakdown
from mcnav.analysis.vector_sizes import SampledSize
from mcnav.report.results.filter_summary import fault_entries, filter_entries, smoother_entries
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.store.manifest import Manifest, ModelRecord, Variable

Keys = Mapping[str, Any]
"""Some keys of a summary, which `Summary` checks."""

TESTS: Final = ("covariance", "covariance_paired", "bias", "bias_paired", "nees")
"""Tests of the outputs together that `mcnav.analysis.multivariate.MultivariateTests` holds."""


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
    sizes: Sequence[SampledSize] = (),
    smoothed: FilterConsistency | None = None,
) -> Summary:
    """Collect the results of a run.

    ``failures`` counts the samples that failed for each reason.
    """
    record = manifest.model
    names = [output.name for output in record.outputs]
    return Summary.of({
        **_run(manifest),
        "verdict": "undecided" if manifest.unsettled else comparison.verdict.value,
        "failed": comparison.failed,
        "failures": dict(failures),
        "excluded": asdict(left_out) if left_out else None,
        "tolerance": criterion.tolerance,
        "confidence": criterion.confidence,
        "confidence_each": comparison.confidence_each,
        **_linear(record, model),
        **_sigmas(comparison),
        **_apart(comparison, model, names),
        **_means(record, model, comparison),
        **_ellipsoid(comparison.ellipsoid, names),
        "nees_mean_expected": comparison.joint.nees_expected if comparison.joint else None,
        **_joint(comparison.joint, len(names)),
        "causes": asdict(causes) if causes else None,
        **_quantiles(tails, model, record),
        **({"sizes": [_size(size, names) for size in sizes]} if sizes else {}),
        "requirements": [_requirement(judged, names) for judged in requirements],
        "requirements_met": tally(judged.finding.value for judged in requirements),
        **({} if beyond is None else {"beyond_range": named_range(beyond, record)}),
        "budget": {**asdict(budget), "flown": record.budget},
        **({} if filtered is None else filter_entries(filtered)),
        **({} if smoothed is None else smoother_entries(smoothed)),
        **({"faults": fault_entries(record.faults, filtered)} if record.faults else {}),
    })  # fmt: skip


def _quantiles(tails: Sequence[Quantile], model: Model, record: ModelRecord) -> Keys:
    """Return the quantiles, and the number of pairs that are too many to have a CEP each."""
    names, pairs = (
        [output.name for output in record.outputs],
        pairs_in_one_unit(model, [o.unit for o in record.outputs]),
    )
    return {
        "tails": [_named(vars(quantile), names) | {"verdict": quantile.verdict.value} for quantile in tails],
        **({"pairs_without_cep": len(pairs)} if len(pairs) > MOST_PAIRS else {}),
    }


def _size(size: SampledSize, names: Sequence[str]) -> Keys:
    """Return a size by its exact law and by samples."""
    law = size.linear
    return {
        "output": names[law.output], "nominal": law.nominal, "sigma": law.sigma,
        "median": law.median, "mean": law.mean, "most": law.most,
        "three_sigma": law.three_sigma, "three_sigma_probability": law.three_sigma_probability, "wrong": law.wrong,
        "median_sample": size.median, "mean_sample": size.mean, "most_sample": size.most,
        "median_interval": size.median_interval, "mean_interval": size.mean_interval,
        "most_interval": size.most_interval,
    }  # fmt: skip


def _repeated(manifest: Manifest) -> tuple[str, ...]:
    """Say how many samples of a user's class were simulated one by one because a call with several failed."""
    repeated = sum(chunk.fallback_count for chunk in manifest.chunks)
    if manifest.identity.code is None or not repeated:
        return ()
    return (
        f"propagate failed in calls with several samples, so {repeated:,} of {manifest.samples:,} samples were "
        "simulated one by one, which is slower",
    )


def _run(manifest: Manifest) -> Keys:
    """Return what was asked for and what was simulated."""
    return {
        "campaign": manifest.campaign,
        "unsettled": manifest.unsettled.to_json() if manifest.unsettled else None,
        **({"remarks": remarks} if (remarks := [*manifest.remarks, *_repeated(manifest)]) else {}),
        "samples": manifest.samples,
        "engine": manifest.identity.engine,
        "seed": manifest.seed,
        "design": manifest.design,
        "store": manifest.store,
        "kept": manifest.stored_rows,
        "heavy_tailed": list(manifest.heavy_tailed),
        "stopping": manifest.stopping.to_json() if manifest.stopping else None,
        "long_tailed": list(manifest.long_tailed),
    }


def _linear(record: ModelRecord, model: Model) -> Keys:
    """Return the linear model, and what further simulations add to it."""
    processes = [{"name": name, "covariance": covariance} for name, covariance in model.processes.items()]
    return {
        "sources": [{"name": source.name, "unit": source.unit} for source in record.sources],
        "outputs": [_output(output) for output in record.outputs],
        "shown_in": {
            "sources": [source.shown_in for source in record.sources],
            "outputs": [output.shown_in for output in record.outputs],
        },
        "partials": model.partials,
        "start_mean": model.mean,
        "start_covariance": model.covariance,
        **({"processes": processes} if processes else {}),
        "mean_linear": model.outcome_mean,
        "unscented": record.unscented,
        "second_order": _without_axes(record.second_order),
        "higher_order": record.higher_order,
    }


def _without_axes(second_order: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Leave out what only tails are computed from (`mcnav.analysis.tail_curves`)."""
    axes = {"centre", "slopes", "curvatures"}
    return None if second_order is None else {key: each for key, each in second_order.items() if key not in axes}


def _output(output: Variable) -> Keys:
    """Name an output, and say what it is of unless it is a navigation error."""
    return {"name": output.name, "unit": output.unit, **({} if output.of == "navigation" else {"of": output.of})}


def _sigmas(comparison: Comparison) -> Keys:
    """Return the moments of each output; lists are empty where nothing was compared."""
    outputs = comparison.outputs
    return {
        "mean_sample": comparison.mean_sample,
        "bias": [output.bias.value for output in outputs],
        "bias_standard_error": [output.bias.standard_error for output in outputs],
        "covariance_linear": comparison.covariance_linear,
        "covariance_sample": comparison.covariance_sample,
        "covariance_paired": comparison.covariance_paired,
        "sigma_linear": np.array([output.sigma_linear for output in outputs])
        if outputs
        else np.sqrt(np.diag(comparison.covariance_linear)),
        "sigma_sample": [output.sigma_sample for output in outputs],
        "sigma_paired": [output.sigma_paired for output in outputs],
        "sigma_ratio": [output.plain.ratio for output in outputs],
        "sigma_ratio_interval": [output.plain.interval for output in outputs],
        "sigma_ratio_paired": [output.paired.ratio for output in outputs],
        "sigma_ratio_paired_interval": [output.paired.interval for output in outputs],
        "verdicts": [output.paired.verdict.value for output in outputs],
        "samples_needed": [output.paired.samples_needed for output in outputs],
        "detectable_ratio": [output.detectable_plain for output in outputs],
        "detectable_ratio_paired": [output.detectable_paired for output in outputs],
        "samples_to_see_tolerance": [output.samples_to_see for output in outputs],
    }


def _apart(comparison: Comparison, model: Model, names: Sequence[str]) -> Keys:
    """Return which outputs agree within their floor, have no verdict, or are not judged together."""
    negligible = [output.floor if output.paired.negligible else None for output in comparison.outputs]
    return {
        **({"floors": negligible} if any(negligible) else {}),
        "withheld": [names[i] for i in model.withheld],
        **({"not_joint": [names[i] for i in comparison.apart]} if comparison.apart else {}),
    }


def _means(record: ModelRecord, model: Model, comparison: Comparison) -> Keys:
    """Return the nominal values of the outputs, and the paired estimates of their mean errors.

    Null is the nominal value of a navigation error, and the mean error of a command, a size or a time.
    """
    outputs, linear_sigma = record.outputs, np.sqrt(np.diag(model.outcome_covariance))
    entries: dict[str, Any] = {}
    if record.origin is not None:
        entries["nominal"] = nominal_values(outputs, model.nominal, record.origin, linear_sigma).tolist()
    if record.mean_rounding is None or not comparison.outputs:
        return entries
    linear = mean_errors(outputs, model.outcome_mean, model.nominal)
    biases = [output.bias for output in comparison.outputs]
    ends = np.array([bias.interval(comparison.confidence_each) for bias in biases])
    return {
        **entries,
        "mean_error": (linear + [bias.value for bias in biases]).tolist(),
        "mean_error_interval": (linear[:, None] + ends).tolist(),
        "mean_rounding": record.mean_rounding.tolist(),
    }


def _ellipsoid(ellipsoid: Ellipsoid | None, names: Sequence[str]) -> Keys:
    """Return NEES and principal directions of all outputs together; null or empty where there is no dispersion."""
    if ellipsoid is None:
        unknown = ("nees_mean", "nees_standard_error", "nees_mean_paired", "nees_paired_standard_error")
        others = ("direction_ratio", "direction_weights", "verdict_matrix", "joint")
        empty = {"nees_dimension": 0, "principal_ratios": [], "principal_directions": []}
        return dict.fromkeys((*unknown, *others)) | empty
    return {
        "nees_dimension": ellipsoid.dimension,
        "nees_mean": ellipsoid.nees.value,
        "nees_standard_error": ellipsoid.nees.standard_error,
        "nees_mean_paired": ellipsoid.nees_paired.value,
        "nees_paired_standard_error": ellipsoid.nees_paired.standard_error,
        "direction_ratio": float(ellipsoid.direction_ratios[ellipsoid.farthest]),
        "direction_weights": ellipsoid.directions[ellipsoid.farthest],
        "verdict_matrix": ellipsoid.verdict.value,
        "principal_ratios": ellipsoid.direction_ratios,
        "principal_directions": ellipsoid.directions,
        "joint": _combinations(ellipsoid, names),
    }


def named_range(beyond: BeyondRange, record: ModelRecord) -> Beyond:
    """Name the outputs that leave the range of linear analysis, and when; in the unit of the run's histories."""
    names = [record.outputs[output].name for output in beyond.outputs]
    return Beyond(
        outputs=names, begin=beyond.time, time=None if record.development is None else record.development.label
    )


def _combinations(ellipsoid: Ellipsoid, names: Sequence[str]) -> Joint:
    """Describe mean and dispersion of all outputs together, and the combinations of outputs that differ."""
    dispersion = ellipsoid.dispersion
    differing, shifted = (
        None if each is None else _combination(each, names) for each in (ellipsoid.differing, ellipsoid.shifted)
    )
    return Joint(
        cause=ellipsoid.cause.value if ellipsoid.cause else None,
        nees_verdict=ellipsoid.judgement.verdict.value,
        nees_about_mean=ellipsoid.nees_about_mean,
        dispersion_verdict=dispersion.verdict.value if dispersion else None,
        dispersion_ratio=dispersion.ratio if dispersion else None,
        dispersion_ratio_interval=dispersion.interval if dispersion else None,
        samples_needed=ellipsoid.judgement.samples_needed,
        mean_error=ellipsoid.mean_error,
        differing=differing,
        shifted=shifted,
        unpredicted=[_combination(combination, names) for combination in ellipsoid.unpredicted],
    )


def _combination(combination: Combination, names: Sequence[str]) -> CombinationEntry:
    """Describe a combination of outputs, in the unit of its lead output."""
    return CombinationEntry(
        lead=names[combination.lead],
        weights=combination.weights,
        shares=combination.shares,
        sigma_linear=combination.sigma_linear,
        sigma_paired=combination.sigma_paired,
        mean_error=combination.offset,
        verdict=combination.judgement.verdict.value if combination.judgement else None,
    )


def _named(entry: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    return {**entry, "outputs": [names[number] for number in entry["outputs"]]}


def _requirement(judged: RequirementResult, names: Sequence[str]) -> Keys:
    """Describe a requirement and the result on it; one on the final errors has no epochs."""
    result = asdict(judged)
    exceedance = result.pop("exceedance")
    entry = {**_named(result.pop("requirement"), names), **result, "finding": judged.finding.value}
    if exceedance is not None:
        exceedance["from"], exceedance["to"] = exceedance.pop("low"), exceedance.pop("high")
        entry["exceedance"] = exceedance
    at_the_end = () if judged.requirement.epochs else ("epochs", "time", "samples")
    unsaid = [key for key in ("when", "about") if not getattr(judged.requirement, key)]
    return {key: value for key, value in entry.items() if key not in (*at_the_end, *unsaid)}


def _joint(joint: MultivariateTests | None, outputs: int) -> Keys:
    """List the tests of all outputs together; each a table of its attributes, or null where it is not made."""
    tests: dict[str, HypothesisTest | None] = dict.fromkeys((*TESTS, "skewness", "kurtosis"))
    if joint is not None:
        tests |= {name: getattr(joint, name) for name in TESTS}
    if joint is not None and joint.normality is not None:
        tests["skewness"], tests["kurtosis"] = joint.normality.skewness_test, joint.normality.kurtosis_test
    differences = np.full((2, outputs, outputs), np.nan)
    for pair in joint.correlations if joint else ():
        for i, j in (pair.between, pair.between[::-1]):
            differences[:, i, j] = pair.difference.value, pair.difference.standard_error
    shapes: dict[str, list[float]] = {}
    for key in ("skewness", "excess_kurtosis"):
        estimates = getattr(joint, key) if joint else ()
        shapes[key] = [estimate.value for estimate in estimates]
        shapes[f"{key}_standard_error"] = [estimate.standard_error for estimate in estimates]
    return {
        "tests": {name: asdict(test) if test else None for name, test in tests.items()},
        "contained": [asdict(entry) for entry in joint.contained] if joint else [],
        "correlation_difference": differences[0],
        "correlation_difference_standard_error": differences[1],
        **shapes,
    }
