"""Requirements judged by Monte Carlo: met, not met, or undecided, each at a stated confidence.

A requirement is *met* when its one-sided confidence bound lies on the right side of the limit, *not met* when the bound
on the other side lies beyond it. The statement that all of several requirements are met holds at the confidence of
each: it is wrong only if a requirement that is not met was found to be (an intersection-union test; Berger, 1982).

Bounds of quantiles and probabilities are distribution-free and exact for independent draws. Antithetic campaigns
contribute one draw of each pair; Latin hypercubes and nets have too few independent replicates and stay undecided.
Failed samples count against the requirement when it is to be met, and for it when it is to be rejected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.analysis.allocation import largest_sigmas
from mcnav.analysis.comparison import LARGEST_FAILED_SHARE, Comparison, Model
from mcnav.analysis.verdict import Verdict, judge
from mcnav.statistics import order_statistics, proportions
from mcnav.statistics.bisection import smallest_reaching
from mcnav.statistics.circular_error import normal_circular_error_probable


class Finding(StrEnum):
    """Finding on a requirement."""

    MET = "met"
    NOT_MET = "not met"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Requirement:
    """Requirement on the final errors, SI.

    Attributes
    ----------
    kind : str
        ``sigma_ratio``: the paired sigma ratio of every output departs from one by no more than the limit.
        ``quantile``: the output's absolute value at a probability lies below the limit. ``cep``: half of all errors in
        two outputs lie within a circle of that radius about zero. ``box``: the absolute values of several outputs lie
        within their limits together, with a probability.
    outputs : tuple of int
        Their numbers.
    """

    kind: str
    outputs: tuple[int, ...]
    limits: tuple[float, ...]
    probability: float | None


def requirements_from(
    entries: Sequence[Mapping[str, Any]], outputs: Sequence[Mapping[str, Any]]
) -> tuple[Requirement, ...]:
    """Build requirements from a manifest's entries, which refer to outputs by name."""
    at = {entry["name"]: number for number, entry in enumerate(outputs)}
    return tuple(
        Requirement(
            kind=entry["kind"],
            outputs=tuple(at[name] for name in entry["outputs"]),
            limits=tuple(float(limit) for limit in entry["limits"]),
            probability=entry["probability"],
        )
        for entry in entries
    )


@dataclass(frozen=True)
class RequirementResult:
    """Requirement and the finding on it.

    Attributes
    ----------
    estimate : float
        Quantile, CEP, probability, or the sigma ratio farthest from one.
    interval : (float, float)
        One-sided bounds, each at the stated confidence; for a sigma ratio its two-sided interval.
    linear : float
        Value by linear analysis, assuming normal errors; one for a sigma ratio.
    samples_needed : int or None
        Approximate number of samples that would decide an undecided case.
    largest_sigmas : ndarray, shape (sources,), or None
        For a quantile, the largest sigma of each source by linear analysis, the others unchanged.
    remark : str
        Reason why nothing could be decided, other than too few samples.
    """

    requirement: Requirement
    finding: Finding
    estimate: float
    interval: tuple[float, float]
    linear: float
    linear_meets: bool
    samples_needed: int | None = None
    largest_sigmas: Array | None = None
    remark: str = ""


def judge_requirement(
    requirement: Requirement,
    model: Model,
    outcomes: Array,
    blocks: IndexArray,
    comparison: Comparison,
    confidence: float,
) -> RequirementResult:
    """Judge one requirement.

    Parameters
    ----------
    outcomes : ndarray, shape (n, outputs)
        Of all samples; NaN in the row of one that failed.
    blocks : ndarray of int, shape (n,)
    """
    if requirement.kind == "sigma_ratio":
        return _judge_ratios(requirement, comparison)
    independent, remark = independent_samples(blocks)
    values = outcomes[independent][:, np.array(requirement.outputs)]
    if not np.isfinite(values).any():
        remark = "every sample failed"
    if requirement.kind == "box":
        return _judge_box(requirement, model, values, confidence, remark)
    return _judge_size(requirement, model, values, confidence, remark)


def independent_samples(blocks: IndexArray) -> tuple[NDArray[np.bool_], str]:
    """Select samples that are independent of one another: one of each block, if blocks are single samples or pairs."""
    first = np.diff(blocks, prepend=blocks[:1] - 1) > 0
    largest = int(np.max(np.diff(np.append(np.flatnonzero(first), len(blocks))), initial=0))
    if largest <= 2:
        return first, ""
    remark = "the design has too few independent replicates for a distribution-free bound: random or antithetic has not"
    return np.ones(len(blocks), dtype=bool), remark


def _linear_moments(requirement: Requirement, model: Model) -> tuple[Array, Array]:
    """Return the linear mean and covariance of a requirement's outputs."""
    picked = np.array(requirement.outputs)
    return model.outcome_mean[picked], model.outcome_covariance[np.ix_(picked, picked)]


def _judge_ratios(requirement: Requirement, comparison: Comparison) -> RequirementResult:
    found = [
        judge(output.paired.ratio, output.paired.interval, requirement.limits[0], comparison.samples)
        for output in comparison.outputs
        if output.paired.ratio is not None and output.paired.interval is not None
    ]
    failed = comparison.failed > LARGEST_FAILED_SHARE * (comparison.failed + comparison.samples)
    unforeseen = any(output.paired.verdict == Verdict.DIFFERS and output.paired.ratio is None
                     for output in comparison.outputs)  # fmt: skip
    if not found:
        finding = Finding.NOT_MET if unforeseen else Finding.UNDECIDED
        return RequirementResult(
            requirement, finding, math.nan, (0.0, math.inf), 1.0, True, remark="there is nothing to compare"
        )
    names = {Verdict.DIFFERS: Finding.NOT_MET, Verdict.UNDECIDED: Finding.UNDECIDED, Verdict.AGREES: Finding.MET}
    order = (Verdict.DIFFERS, Verdict.UNDECIDED, Verdict.AGREES)
    worst = min(found, key=lambda each: (order.index(each.verdict), -abs((each.ratio or 1.0) - 1.0)))
    finding = Finding.NOT_MET if unforeseen else names[worst.verdict]
    remark = ""
    if finding == Finding.MET and failed:
        finding, remark = Finding.UNDECIDED, "too many samples failed"
    needed = max((each.samples_needed or 0 for each in found), default=0) or None
    return RequirementResult(requirement, finding, worst.ratio or 1.0, worst.interval or (0.0, math.inf), 1.0, True,
                  needed if finding == Finding.UNDECIDED else None, remark=remark)  # fmt: skip


def _judge_size(
    requirement: Requirement, model: Model, values: Array, confidence: float, remark: str
) -> RequirementResult:
    """Judge a quantile of an output's absolute value, or of the distance from zero in two outputs."""
    mean, covariance = _linear_moments(requirement, model)
    limit, probability = requirement.limits[0], requirement.probability or 0.5
    size = np.hypot(*values.T) if requirement.kind == "cep" else np.abs(values[:, 0])
    failed = ~np.isfinite(size)
    against, favouring = np.where(failed, np.inf, size), np.where(failed, 0.0, size)
    successful = size[~failed]
    estimate = float(np.quantile(successful, probability)) if len(successful) else math.nan
    interval = (0.0, math.inf)
    if not remark:
        interval = (
            max(order_statistics.lower_bound(favouring, probability, confidence), 0.0),
            order_statistics.upper_bound(against, probability, confidence),
        )
    finding = Finding.MET if interval[1] <= limit else Finding.NOT_MET if interval[0] > limit else Finding.UNDECIDED
    linear = (
        normal_circular_error_probable(mean, covariance)
        if requirement.kind == "cep"
        else absolute_normal_quantile(float(mean[0]), float(covariance[0, 0]) ** 0.5, probability)
    )
    needed = None
    if finding == Finding.UNDECIDED and not remark and len(size):
        beyond = float(np.mean(against > limit))
        needed = _needed(beyond, 1.0 - probability, confidence, len(size))
    largest = None
    if requirement.kind == "quantile":
        sigma = _largest_sigma(float(mean[0]), limit, probability)
        if sigma is not None:
            largest = largest_sigmas(model.partials[requirement.outputs[0]], model.covariance, sigma)
    return RequirementResult(requirement, finding, estimate, interval, linear, linear <= limit, needed, largest, remark)


def _judge_box(
    requirement: Requirement, model: Model, values: Array, confidence: float, remark: str
) -> RequirementResult:
    """Judge the probability that several outputs lie within their limits together."""
    limits, probability = np.array(requirement.limits), requirement.probability or 0.5
    failed = ~np.isfinite(values).all(axis=1)
    inside = int(np.count_nonzero(np.all(np.abs(values[~failed]) <= limits, axis=1)))
    count, lost = len(values), int(failed.sum())
    interval = (0.0, 1.0)
    if not remark:
        interval = (
            proportions.lower_probability(inside, count, confidence),
            proportions.upper_probability(inside + lost, count, confidence),
        )
    met = interval[0] >= probability
    finding = Finding.MET if met else Finding.NOT_MET if interval[1] < probability else Finding.UNDECIDED
    linear = normal_box_probability(*_linear_moments(requirement, model), limits)
    needed = None
    if finding == Finding.UNDECIDED and not remark and count:
        needed = _needed(1.0 - inside / count, 1.0 - probability, confidence, count)
    estimate = inside / (count - lost) if count > lost else math.nan
    return RequirementResult(
        requirement, finding, estimate, interval, linear, linear >= probability, needed, remark=remark
    )


def _needed(share: float, allowed: float, confidence: float, count: int) -> int | None:
    """Estimate the samples that would decide, if the share of samples beyond the limit stays the same."""
    if share == 0.0:
        return max(count + 1, order_statistics.samples_for_upper_bound(1.0 - allowed, confidence))
    if share == allowed:
        return None
    reach = float(special.ndtri(confidence)) * math.sqrt(allowed * (1.0 - allowed)) / abs(allowed - share)
    return max(count + 1, math.ceil(reach**2)) if reach < 1e5 else None


def absolute_normal_quantile(mean: float, sigma: float, probability: float) -> float:
    """Compute a quantile of the absolute value of a normal variable.

    >>> round(absolute_normal_quantile(0.0, 1.0, 0.9973), 3)
    3.0
    """
    if sigma <= 0.0:
        return abs(mean)

    def within(size: float) -> float:
        return float(special.ndtr((size - mean) / sigma) - special.ndtr((-size - mean) / sigma))

    return smallest_reaching(within, probability, 0.0, abs(mean) + 40.0 * sigma)


def _largest_sigma(mean: float, limit: float, probability: float) -> float | None:
    """Compute the largest sigma at which a normal variable's absolute value stays below a limit at a probability."""
    if abs(mean) >= limit:
        return None
    if mean == 0.0:
        return limit / float(special.ndtri(0.5 + 0.5 * probability))
    largest = limit / float(special.ndtri(0.5 + 0.5 * probability)) * (1.0 + 1e-9)
    return smallest_reaching(lambda sigma: absolute_normal_quantile(mean, sigma, probability), limit, 0.0, largest)


def normal_box_probability(mean: Array, covariance: Array, limits: Array) -> float:
    """Compute the probability that a normal vector lies within ``+-limits``; its covariance may be singular.

    >>> round(normal_box_probability(np.zeros(2), np.diag([1.0, 0.0]), np.array([1.0, 1.0])), 4)
    0.6827
    """
    sigma = np.sqrt(np.diag(covariance))
    spread = sigma > 0.0
    if np.any(np.abs(mean[~spread]) > limits[~spread]):
        return 0.0
    if not spread.any():
        return 1.0
    correlation = covariance[np.ix_(spread, spread)] / np.outer(sigma[spread], sigma[spread])
    centre, half = mean[spread] / sigma[spread], limits[spread] / sigma[spread]
    if len(centre) == 1:
        return float((special.ndtr(half - centre) - special.ndtr(-half - centre))[0])
    from scipy.stats import multivariate_normal  # slow to import: half a second

    normal = multivariate_normal(centre, correlation, allow_singular=True, seed=1, abseps=1e-7, releps=1e-7)
    return float(normal.cdf(half, lower_limit=-half))
