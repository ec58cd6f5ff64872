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
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.analysis.budget import largest_sigmas
from mcnav.analysis.causes import Cause
from mcnav.analysis.comparison import Comparison
from mcnav.analysis.model import Model
from mcnav.analysis.samples_needed import Counting, samples_needed
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, Verdict, judge
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics import proportions
from mcnav.statistics.bisection import smallest_reaching
from mcnav.statistics.normal_box import normal_box_probability
from mcnav.statistics.normal_size import size_quantile
from mcnav.statistics.order_statistics import RankedSizes
from mcnav.statistics.refusals import or_withheld


class Finding(StrEnum):
    """Finding on a requirement.

    It is *met for the known ways* to fail where chosen flights show that it is met, but their search for a second way,
    as likely as what is allowed, would find it in fewer than nine of ten runs.
    """

    MET = "met"
    NOT_MET = "not met"
    UNDECIDED = "undecided"
    MET_AS_KNOWN = "met for the known ways"


@dataclass(frozen=True)
class Requirement:
    """Requirement on the final errors, or on those at each of several epochs; SI.

    Its kinds are ``sigma_ratio``: the paired sigma ratio of every output departs from one by no more than the limit;
    ``quantile``: the output's absolute value at a probability lies below the limit; ``cep``: half of all errors in two
    outputs lie within a circle of that radius about zero; ``r95``: 95 % of them do; ``sep``: half of all errors in
    three outputs lie within a sphere; ``box``: the absolute values of several outputs lie within their limits together,
    with a probability.

    ``epochs`` are those at each of which it holds, by number; ``when`` has them in words. Without any it is on the
    final errors. ``of`` is "smoother" where it is on the errors behind one. It limits a state of the truth itself, the
    nominal included, unless ``about`` is "nominal": then it limits the departure from the nominal (`counted`).
    """

    kind: str
    outputs: tuple[int, ...]
    limits: tuple[float, ...]
    probability: float | None
    when: str = ""
    epochs: tuple[int, ...] = ()
    of: str = ""
    about: str = ""


class StatedRequirement(Protocol):
    """A requirement as a campaign or a manifest states it: outputs by name, and nothing for what it leaves out."""

    kind: str
    outputs: tuple[str, ...]
    limits: tuple[float, ...]
    probability: float | None
    when: str | None
    epochs: tuple[int, ...] | None
    of: str | None
    about: str | None


def requirements_from(stated: Sequence[StatedRequirement], outputs: Sequence[str]) -> tuple[Requirement, ...]:
    """Build requirements on outputs of these names; `KeyError` where one is on another output."""
    number_of = {name: number for number, name in enumerate(outputs)}
    return tuple(
        Requirement(
            entry.kind, tuple(number_of[name] for name in entry.outputs), entry.limits, entry.probability,
            entry.when or "", entry.epochs or (), entry.of or "", entry.about or "",
        )
        for entry in stated
    )  # fmt: skip


def smallest_limits(requirements: Sequence[Requirement], outputs: int) -> Array:
    """Return the smallest limit that requirements set to the size of each output; infinite without one."""
    limits = np.full(outputs, np.inf)
    for requirement in requirements:
        if requirement.kind == "sigma_ratio":
            continue
        sides = requirement.limits if requirement.kind == "box" else requirement.limits * len(requirement.outputs)
        for output, limit in zip(requirement.outputs, sides, strict=True):
            limits[output] = min(limit, limits[output])
    return limits


def counted(requirement: Requirement, values: Array, origin: Array | None) -> Array:
    """Return outputs, or their means, as a requirement limits them: with what they are measured from.

    Parameters
    ----------
    values : ndarray, shape (..., outputs)
    origin : ndarray, shape (..., outputs), or None
        See `mcnav.contract.linear.LinearSystem`.
    """
    return values if origin is None or requirement.about else values + origin


def counted_model(requirement: Requirement, model: Model) -> Model:
    """Return the linear model of the outputs as a requirement limits them."""
    return replace(model, nominal=counted(requirement, model.nominal, model.origin), origin=None)


RARE: Final = 1e-3
"""Probability beyond its limits that a requirement allows, from which on linear analysis states it."""


def is_rare(probability: float) -> bool:
    """Return whether a requirement of a probability allows no more than `RARE` beyond its limits."""
    return 1.0 - probability <= RARE * (1.0 + 1e-9)


METHOD: Final = "lines along the linear model"
LEVELS: Final = "levels and widened errors"
"""Methods by which an exceedance is estimated (`mcnav.rare`): the second where it contradicts the first."""


@dataclass(frozen=True)
class Exceedance:
    """Probability beyond the limits of a requirement, by flights chosen with the linear model (`mcnav.rare`).

    Attributes
    ----------
    estimate, low, high : float
        Probability and its two-sided interval; NaN where it is refused.
    flights : int
    refusal : str
        Why nothing is stated; empty where it is.
    way : mapping of str to float
        Departures of the sources from their means in the most likely way to fail, in sigmas, the largest first.
    sides : int
        Separate ways to fail that carry at least a hundredth of the probability.
    power : float
        Probability with which the search finds a second way to fail, as likely as what is allowed; NaN where an earlier
        version estimated it, which did not know.
    method : str
        `METHOD` or `LEVELS`.
    """

    estimate: float
    low: float
    high: float
    flights: int
    refusal: str = ""
    way: Mapping[str, float] = field(default_factory=dict)
    sides: int = 0
    power: float = math.nan
    method: str = METHOD


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
        Samples that would decide an undecided case with a probability of 90 % if the truth is as estimated.
    largest_sigmas : ndarray, shape (sources,), or None
        For a quantile, the largest sigma of each source, the others unchanged: by linear analysis with errors as many
        times as large as the upper bound of the samples is over the linear value. None without an upper bound.
    remark : str
        Reason why nothing could be decided, other than too few samples; or why their number is rough.
    time : float or None
        Of several epochs, that of the largest estimate, in the unit of the run's histories.
    samples : int or None
        Samples with histories that it was judged by.
    causes : tuple of Cause
        Of the errors that it limits, by linear analysis, at ``time`` or at the end; empty where they are not known.
    exceedance : Exceedance or None
        Where counting could not be expected to decide.
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
    time: float | None = None
    samples: int | None = None
    causes: tuple[Cause, ...] = ()
    exceedance: Exceedance | None = None


def judge_requirement(
    requirement: Requirement, model: Model, outcomes: Array, blocks: IndexArray, comparison: Comparison,
    confidence: float, most: int | None = None,
) -> RequirementResult:  # fmt: skip
    """Judge one requirement by the outcomes of all samples, shape (n, outputs), and their blocks, shape (n,).

    The outcomes of a sample that failed are NaN. ``most`` is the number of samples whose outcomes are stored at most.
    """
    if requirement.kind == "sigma_ratio":
        return _judge_ratios(requirement, comparison)
    independent, remark = independent_samples(blocks)
    outcomes = counted(requirement, outcomes[independent], model.origin)
    model = counted_model(requirement, model)
    reason = f"a run that stores a summary has {most:,} samples to count, however many it simulates" if most else ""
    counting = Counting(len(blocks), len(outcomes), most, reason)
    if not np.isfinite(outcomes).any():
        remark = "every sample failed"
    judged = _judge_box if requirement.kind == "box" else _judge_size
    return judged(requirement, model, outcomes, confidence, remark, counting)


def independent_samples(blocks: IndexArray) -> tuple[NDArray[np.bool_], str]:
    """Select samples that are independent of one another: one of each block, if blocks are single samples or pairs."""
    first = np.diff(blocks, prepend=blocks[:1] - 1) > 0
    largest = int(np.max(np.diff(np.append(np.flatnonzero(first), len(blocks))), initial=0))
    if largest <= 2:
        return first, ""
    remark = "the design has too few independent replicates for a distribution-free bound: random or antithetic has not"
    return np.ones(len(blocks), dtype=bool), remark


def error_sizes(outcomes: Array, outputs: tuple[int, ...]) -> Array:
    """Return the absolute values of one output, or the distances from zero in two or three, shape (n,)."""
    if len(outputs) == 3:
        return np.asarray(np.sqrt(np.sum(outcomes[:, outputs] ** 2, axis=1)))
    return np.abs(outcomes[:, outputs[0]]) if len(outputs) == 1 else np.hypot(*(outcomes[:, i] for i in outputs))


def size_probability(requirement: Requirement) -> float:
    """Return the probability of a quantile or radius."""
    return 0.5 if requirement.probability is None else requirement.probability


def linear_quantile(model: Model, outputs: tuple[int, ...], probability: float) -> float:
    """Compute a quantile of the sizes of one to three outputs by the linear model; NaN where it is refused."""
    moments = _linear_moments(model, size_members(outputs, model.sizes) or outputs)
    return or_withheld(size_quantile, *moments, probability)


def size_members(outputs: tuple[int, ...], sizes: Mapping[int, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the outputs whose size one output is; none where it is no size."""
    return sizes.get(outputs[0], ()) if len(outputs) == 1 else ()


def _linear_moments(model: Model, outputs: tuple[int, ...]) -> tuple[Array, Array]:
    """Return the linear mean and covariance of some outputs."""
    picked = np.array(outputs)
    return model.outcome_mean[picked], model.outcome_covariance[np.ix_(picked, picked)]


def _judge_ratios(requirement: Requirement, comparison: Comparison) -> RequirementResult:
    paired = [output.paired for output in comparison.outputs]
    judgements = [
        judge(each.ratio, each.interval, requirement.limits[0], comparison.samples, comparison.confidence_each)
        for each in paired
        if each.ratio is not None and each.interval is not None and not each.negligible
    ]
    unforeseen = any(each.verdict == Verdict.DIFFERS and each.ratio is None for each in paired)
    if not judgements:
        finding = Finding.NOT_MET if unforeseen else Finding.UNDECIDED
        return RequirementResult(
            requirement, finding, math.nan, (0.0, math.inf), 1.0, True, remark="there is nothing to compare"
        )
    names = {Verdict.DIFFERS: Finding.NOT_MET, Verdict.UNDECIDED: Finding.UNDECIDED, Verdict.AGREES: Finding.MET}
    order = (Verdict.DIFFERS, Verdict.UNDECIDED, Verdict.AGREES)
    worst = min(
        judgements, key=lambda judgement: (order.index(judgement.verdict), -abs((judgement.ratio or 1.0) - 1.0))
    )
    finding = Finding.NOT_MET if unforeseen else names[worst.verdict]
    remark = ""
    if finding == Finding.MET and comparison.failed > LARGEST_FAILED_SHARE * (comparison.failed + comparison.samples):
        finding, remark = Finding.UNDECIDED, "too many samples failed"
    undecided = [judgement.samples_needed or 0 for judgement in judgements if finding == Finding.UNDECIDED]
    needed = max(undecided, default=0) or None
    ratio, interval = worst.ratio or 1.0, worst.interval or (0.0, math.inf)
    return RequirementResult(requirement, finding, ratio, interval, 1.0, True, needed, remark=remark)


def finding_on_size(interval: tuple[float, float], limit: float) -> Finding:
    """Judge a quantile of a size, by its one-sided bounds, against a limit below which it is to stay.

    ``below`` is strict: a size that equals the limit, as that of a saturated command, is not below it. With X_(k) the
    upper bound, ``X_(k) < limit`` says that at least k samples lie below the limit, so that a requirement that is not
    met is found met as rarely as the confidence says, also where sizes repeat.
    """
    low, high = interval
    return Finding.MET if high < limit else Finding.NOT_MET if low >= limit else Finding.UNDECIDED


def _judge_size(
    requirement: Requirement, model: Model, outcomes: Array, confidence: float, remark: str, counting: Counting
) -> RequirementResult:
    """Judge a quantile of an output's absolute value, or of the distance from zero in two or three outputs."""
    outputs, limit, probability = requirement.outputs, requirement.limits[0], size_probability(requirement)
    sizes = error_sizes(outcomes, outputs)
    ranked = RankedSizes.of(sizes)
    interval = (0.0, math.inf) if remark else ranked.bounds(probability, confidence)
    finding = finding_on_size(interval, limit)
    linear = linear_quantile(model, outputs, probability)
    needed = None
    if finding == Finding.UNDECIDED and not remark and len(sizes):
        shares = [float(np.mean(~(sizes < limit)))], [float(np.mean(sizes >= limit))]
        needed, remark = samples_needed(*shares, 1.0 - probability, (confidence, confidence), counting)
    largest = None
    measured = interval[1] / linear if linear > 0.0 else math.inf
    if requirement.kind == "quantile" and not size_members(outputs, model.sizes) and 0.0 < measured < math.inf:
        sigma = _largest_sigma(float(model.outcome_mean[outputs[0]]), limit / measured, probability)
        if sigma is not None:
            largest = largest_sigmas(model.partials[outputs[0]], model.covariance, sigma)
    estimate, meets = ranked.estimate(probability), linear < limit
    return RequirementResult(requirement, finding, estimate, interval, linear, meets, needed, largest, remark)


def _judge_box(
    requirement: Requirement, model: Model, outcomes: Array, confidence: float, remark: str, counting: Counting
) -> RequirementResult:
    """Judge the probability that several outputs lie within their limits together."""
    limits, probability = np.array(requirement.limits), requirement.probability or 0.5
    values = outcomes[:, requirement.outputs]
    inside = int(np.count_nonzero(np.all(np.abs(values) < limits, axis=1)))
    count, lost = len(values), int(np.count_nonzero(~np.isfinite(values).all(axis=1)))
    low, high = 0.0, 1.0
    if not remark:
        low = proportions.lower_probability(inside, count, confidence)
        high = proportions.upper_probability(inside + lost, count, confidence)
    finding = Finding.MET if low >= probability else Finding.NOT_MET if high < probability else Finding.UNDECIDED
    linear = or_withheld(normal_box_probability, *_linear_moments(model, requirement.outputs), limits)
    needed = None
    if finding == Finding.UNDECIDED and not remark and count:
        shares = [1.0 - inside / count], [1.0 - (inside + lost) / count]
        needed, remark = samples_needed(*shares, 1.0 - probability, (confidence, confidence), counting)
    estimate = inside / (count - lost) if count > lost else math.nan
    meets = linear >= probability
    return RequirementResult(requirement, finding, estimate, (low, high), linear, meets, needed, remark=remark)


def _largest_sigma(mean: float, limit: float, probability: float) -> float | None:
    """Compute the largest sigma at which a normal variable's absolute value stays below a limit at a probability."""
    if abs(mean) >= limit:
        return None
    if mean == 0.0:
        return limit / float(special.ndtri(0.5 + 0.5 * probability))
    largest = limit / float(special.ndtri(0.5 + 0.5 * probability)) * (1.0 + 1e-9)

    def quantile(sigma: float) -> float:
        return size_quantile(np.array([mean]), np.array([[sigma**2]]), probability)

    return smallest_reaching(quantile, limit, 0.0, largest)
