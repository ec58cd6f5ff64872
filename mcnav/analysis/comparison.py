"""Comparison of linear covariance analysis with Monte Carlo on the same draws.

With s the start errors of a sample, y its simulated final errors and ``z = y0 + P s`` the linear ones, the plain sample
covariance is cov(y). The *paired* estimate ``cov(y) - cov(z) + P S P^T`` has the same mean, but the sampling noise that
y and z share cancels (z is a control variate whose covariance is known). Its error is that of y's difference from z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcnav.analysis.block_moments import (
    BlockMoments,
    ErrorSums,
    ReducedSamples,
    SampleMoments,
    SummaryMoments,
)
from mcnav.analysis.combinations import Combination, FixedCombination, compare_fixed, fixed_combinations
from mcnav.analysis.decision_rule import DecisionRule
from mcnav.analysis.ellipsoid import Ellipsoid, compare_ellipsoid, name_combinations
from mcnav.analysis.model import Model
from mcnav.analysis.multivariate import MultivariateTests, compare_jointly
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, Judgement, Verdict, combine_verdicts
from mcnav.arrays.types import Array, IndexArray
from mcnav.execution.child_processes import side_threads
from mcnav.linear.block_sums import BlockSums, Normalization
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.chunked import STRETCH
from mcnav.statistics.estimates import Estimate, block_begins
from mcnav.statistics.interim_sizes import confidence_of_each
from mcnav.statistics.normal_size import NormalSize


@dataclass(frozen=True)
class Criterion:
    """Tolerance on sigma ratios, and confidence of all verdicts together.

    ``looks`` is the number of interim analyses (`mcnav.statistics.interim_sizes`).
    """

    tolerance: float = 0.05
    confidence: float = 0.95
    looks: int = 1


@dataclass(frozen=True)
class OutputComparison:
    """Comparison of one output's linear and Monte Carlo sigma, SI.

    Attributes
    ----------
    sigma_linear, sigma_sample, sigma_paired : float
        The last is NaN when the paired variance is negative.
    plain, paired : Judgement
        Judgements of the two Monte Carlo estimates over the linear sigma; the verdict is that of the paired one.
    bias : Estimate
        Mean of the simulated less the linear final errors.
    detectable_plain, detectable_paired : float
        Smallest departure of the sigma ratio from one that this sample finds with a probability of 90 %; NaN where
        there is no ratio.
    samples_to_see : float
        Samples with which the paired estimate finds a departure as large as the tolerance, as often.
    floor : float
        Sigma up to which a difference counts as agreement (`mcnav.analysis.floor`).
    """

    sigma_linear: float
    sigma_sample: float
    sigma_paired: float
    plain: Judgement
    paired: Judgement
    paired_variance: Estimate
    bias: Estimate
    detectable_plain: float
    detectable_paired: float
    samples_to_see: float
    floor: float = 0.0


@dataclass(frozen=True)
class Comparison:
    """Result of a campaign; arrays in the order of the scenario's outputs, SI.

    ``joint`` holds the tests of all outputs together, but those ``apart``; it is none when there is nothing to test.
    ``verdict`` is that on the outputs' sigmas. The whole matrix has a judgement of its own (`Ellipsoid`), which is
    stricter: nonlinearity appears first along the ellipsoid's narrowest axes.
    """

    samples: int
    failed: int
    confidence_each: float
    mean_sample: Array
    covariance_linear: Array
    covariance_sample: Array
    covariance_paired: Array
    outputs: tuple[OutputComparison, ...]
    ellipsoid: Ellipsoid | None
    joint: MultivariateTests | None
    verdict: Verdict
    apart: tuple[int, ...] = ()


def correlations(covariance: Array) -> Array:
    """Return the correlation matrix of a covariance; NaN in rows and columns without dispersion."""
    sigma = np.sqrt(np.where(np.diag(covariance) > 0.0, np.diag(covariance), np.nan))
    return np.asarray(covariance / np.outer(sigma, sigma))


def reduce_stored(
    model: Model, errors: Array, outcomes: Array, blocks: IndexArray, linear: Array | None = None
) -> ReducedSamples:
    """Reduce stored samples.

    Parameters
    ----------
    errors : ndarray, shape (n, sources)
    outcomes : ndarray, shape (n, outputs)
        Final errors; NaN in the row of a sample that failed.
    blocks : ndarray of int, shape (n,)
        Independent block of each sample.
    linear : ndarray, shape (n, outputs), optional
        Linear outcomes, which a sample with noise has besides; by default those of its errors alone.
    """
    drawn = successful = ErrorSums.of(errors)
    finite = np.isfinite(outcomes).all(axis=1)
    if not finite.all():
        errors, outcomes, blocks = errors[finite], outcomes[finite], blocks[finite]
        linear = None if linear is None else linear[finite]
        successful = ErrorSums.of(errors)
    y = np.asfortranarray(outcomes)
    if linear is None:
        z = (model.partials @ errors.T).T
        z += model.nominal
    else:
        z = np.asfortranarray(linear)
    moments = SampleMoments(y, z, block_begins(blocks), model.outcome_mean, model.whitened)
    return ReducedSamples(moments, moments, drawn, successful)


def reduce_summary(
    model: Model, frame: Normalization, sums: BlockSums, samples: int, stored: SampleMoments
) -> ReducedSamples:
    """Restore a campaign from its summary; of the samples drawn, those not in the sums failed."""
    moments = SummaryMoments.of(frame, sums, model.whitened)
    successful = ErrorSums(moments.samples, sums.errors, sums.squares)
    drawn = ErrorSums(samples, sums.errors + sums.lost, sums.squares + sums.lost_squares)
    return ReducedSamples(moments, stored, drawn, successful)


def compare(
    model: Model,
    errors: Array,
    outcomes: Array,
    criterion: Criterion,
    design: SamplingDesign | None = None,
    linear: Array | None = None,
) -> Comparison:
    """Compare the first samples of a campaign with the linear model; parameters as `reduce_stored`, `compare_reduced`.

    The design is that of independent draws from normal sources unless given.
    """
    design = design or SamplingDesign()
    reduced = reduce_stored(model, errors, outcomes, design.blocks(np.arange(len(errors))), linear)
    return compare_reduced(model, reduced, criterion, design)


def compare_reduced(model: Model, samples: ReducedSamples, criterion: Criterion, design: SamplingDesign) -> Comparison:
    """Compare a campaign with the linear model; the criterion's confidence is that of all verdicts (Bonferroni)."""
    moments, linear = samples.moments, model.outcome_covariance
    count, failed = moments.samples, samples.failed
    given = model.whitened
    each = 1.0 - (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / (len(linear) + 1)
    if min(count, samples.stored.samples) < 2:
        unknown = np.full_like(linear, np.nan)
        return Comparison(
            count, failed, each, np.full(len(linear), np.nan), linear, unknown, unknown, (), None,
            None, Verdict.UNDECIDED,
        )  # fmt: skip
    sample, predicted = moments.covariances
    paired = sample - predicted + linear
    rule = DecisionRule(count, criterion.tolerance, each, design.fewest_blocks)
    rules = [replace(rule, fewest_blocks=np.inf) if i in model.withheld else rule for i in range(len(linear))]
    if len(model.withheld) == len(linear):
        rule, design = rules[0], replace(design, fewest_blocks=np.inf)
    ellipsoid, joint = None, None
    of_sizes = model.laws_of_sizes
    with side_threads(2 if count > STRETCH else 0) as executor:
        judged = [
            executor.submit(_compare_size, i, of_sizes[i], float(model.outcome_mean[i]), moments, rules[i])
            if i in of_sizes
            else executor.submit(_compare_output, i, float(linear[i, i]), float(floor), moments, rules[i])
            for i, floor in enumerate(model.floor**2)
        ]
        if given.rank:
            whole = executor.submit(compare_ellipsoid, given, samples, paired, rule)
            joint = compare_jointly(samples, model, each, design)
            ellipsoid = whole.result()
    outputs = tuple(output.result() for output in judged)
    if ellipsoid is not None:
        bias = np.array([output.bias.value for output in outputs])
        fixed = _fixed_combinations(model, moments, given.rank)
        unpredicted = _unpredicted(fixed, np.sqrt(np.diag(linear)), moments, outputs, bias, rule)
        ellipsoid = name_combinations(ellipsoid, given, linear, paired, bias, unpredicted)
    verdict = _overall_verdict(outputs, failed, count + failed)
    apart = tuple(np.flatnonzero(~model.judged).tolist())
    return Comparison(
        count, failed, each, moments.mean, linear, sample, paired, outputs, ellipsoid, joint, verdict, apart
    )


def _fixed_combinations(model: Model, moments: BlockMoments, rank: int) -> tuple[FixedCombination, ...]:
    """List the combinations of outputs that the linear model holds fixed, of outputs that are judged together."""
    return fixed_combinations(
        model.partials, model.covariance, list(model.processes.values()), np.sqrt(np.diag(model.judged_covariance)),
        rank, model.floor, moments.rounding,
    )  # fmt: skip


def _unpredicted(
    fixed: Sequence[FixedCombination],
    sigma: Array,
    moments: BlockMoments,
    outputs: Sequence[OutputComparison],
    bias: Array,
    rule: DecisionRule,
) -> tuple[Combination, ...]:
    """List outputs, and combinations of outputs, that linear analysis holds fixed and that are dispersed otherwise."""
    own = np.eye(len(sigma))
    alone = [
        Combination(i, own[i], own[i], 0.0, output.sigma_sample, float(bias[i]), output.paired)
        for i, output in enumerate(outputs)
        if sigma[i] == 0.0 and output.paired.verdict == Verdict.DIFFERS
    ]
    together = [compare_fixed(combination, sigma, moments, bias, rule) for combination in fixed]
    judged = [(each.judgement.verdict, each) for each in together if each.judgement]
    certain, open_ = (
        sorted((each for own, each in judged if own == verdict), key=lambda each: -each.sigma_paired / sigma[each.lead])
        for verdict in (Verdict.DIFFERS, Verdict.UNDECIDED)
    )
    return (*alone, *certain, *open_)


def _overall_verdict(outputs: Sequence[OutputComparison], failed: int, samples: int) -> Verdict:
    """Combine the verdicts on all outputs' sigmas."""
    verdict = combine_verdicts([output.paired.verdict for output in outputs])
    nothing_to_compare = all(output.paired.ratio is None for output in outputs) and verdict == Verdict.AGREES
    if nothing_to_compare or (verdict == Verdict.AGREES and failed > LARGEST_FAILED_SHARE * samples):
        return Verdict.UNDECIDED
    return verdict


def _compare_size(
    i: int, law: NormalSize, nominal: float, moments: BlockMoments, rule: DecisionRule
) -> OutputComparison:
    """Compare a size that has no derivative with its exact law: no linear outcome, the nominal, is paired with it."""
    output = _compare_output(i, law.variance, 0.0, moments, rule)
    unbiased = moments.samples / (moments.samples - 1.0)
    plain = rule.mean(unbiased * moments.products(i, i)[0], moments.counts)
    bias = replace(output.bias, value=output.bias.value + nominal - law.mean)
    return replace(
        output, sigma_paired=output.sigma_sample, paired=output.plain, paired_variance=plain, bias=bias,
        detectable_paired=output.detectable_plain,
    )  # fmt: skip


def _compare_output(
    i: int, variance: float, floor: float, moments: BlockMoments, rule: DecisionRule
) -> OutputComparison:
    """Compare output i, of a linear variance; a difference of variances up to the floor counts as agreement."""
    unbiased = moments.samples / (moments.samples - 1.0)
    plain, difference = (rule.mean(unbiased * sums, moments.counts) for sums in moments.products(i, i))
    paired = replace(difference, value=variance + difference.value)
    detectable, samples_to_see = rule.power(paired, variance)
    return OutputComparison(
        sigma_linear=float(np.sqrt(variance)),
        sigma_sample=float(np.sqrt(plain.value)),
        sigma_paired=float(np.sqrt(paired.value)) if paired.value >= 0.0 else float("nan"),
        plain=rule.judge(plain, variance, floor),
        paired=rule.judge(paired, variance, floor),
        paired_variance=paired,
        bias=rule.mean(moments.differences(i), moments.counts),
        detectable_plain=rule.power(plain, variance)[0],
        detectable_paired=detectable,
        samples_to_see=samples_to_see,
        floor=float(np.sqrt(floor)),
    )
