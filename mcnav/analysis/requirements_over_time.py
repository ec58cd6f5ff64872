"""Requirements that hold at each of several epochs, judged by the histories of the campaign's first samples.

Such a requirement is on the largest of the quantiles at its epochs. Of these

- the largest upper bound is an upper bound at the confidence of each: it fails only if that of the epoch with the
  largest quantile does;
- the largest lower bound is a lower bound where the error rate is divided among the epochs (Bonferroni).

Histories are stored of the first samples only, so that a campaign of more does not make these bounds narrower.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mcnav.analysis.requirements import (
    Finding,
    Requirement,
    RequirementResult,
    counted,
    error_sizes,
    finding_on_size,
    independent_samples,
    size_members,
    size_probability,
)
from mcnav.analysis.samples_needed import Counting, samples_needed
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.interim_sizes import confidence_of_each
from mcnav.statistics.largest_quantiles import largest_quantiles
from mcnav.statistics.order_statistics import RankedSizes


@dataclass(frozen=True)
class ErrorHistories:
    """Errors of a campaign's first samples at m epochs, SI, and the linear moments.

    Attributes
    ----------
    times : ndarray, shape (m,)
    errors : ndarray, shape (n, m, outputs)
        NaN where a sample failed.
    blocks : ndarray of int, shape (n,)
        Independent block of each sample.
    mean, covariance : ndarray, shapes (m, outputs) and (m, outputs, outputs), or None
        By linear analysis.
    most : int
        Samples whose histories are stored at most.
    sizes : mapping of int to tuple of int
        Outputs that are the root sum of squares of others.
    origin : ndarray, shape (m, outputs), optional
        What the outputs are measured from; see `mcnav.contract.linear.LinearSystem`.
    """

    times: Array
    errors: Array
    blocks: IndexArray
    mean: Array | None
    covariance: Array | None
    most: int
    sizes: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    origin: Array | None = None

    def counted_sizes(self, requirement: Requirement, epoch: int) -> Array:
        """Return what a requirement limits at an epoch, for each sample, shape (n,)."""
        origin = None if self.origin is None else self.origin[epoch]
        return error_sizes(counted(requirement, self.errors[:, epoch], origin), requirement.outputs)

    def counted_mean(self, requirement: Requirement) -> Array | None:
        """Return the linear mean of the outputs as a requirement limits them, shape (m, outputs)."""
        return None if self.mean is None else counted(requirement, self.mean, self.origin)


def judge_over_time(requirement: Requirement, histories: ErrorHistories | None, confidence: float) -> RequirementResult:
    """Judge a requirement on the size of errors at its epochs."""
    limit, probability, epochs = requirement.limits[0], size_probability(requirement), requirement.epochs
    if histories is None or max(epochs) >= len(histories.times):
        return RequirementResult(
            requirement, Finding.UNDECIDED, math.nan, (0.0, math.inf), math.nan, False,
            remark="this run has no histories of errors",
        )  # fmt: skip
    independent, remark = independent_samples(histories.blocks)
    if not np.isfinite(histories.errors[independent]).any():
        remark = "every sample failed"
    sizes = [histories.counted_sizes(requirement, epoch)[independent] for epoch in epochs]
    ranked = [RankedSizes.of(size) for size in sizes]
    estimates = np.array([ranking.estimate(probability) for ranking in ranked])
    worst = int(np.argmax(np.nan_to_num(estimates, nan=-1.0)))
    shared = confidence_of_each(confidence, len(epochs))
    low = max(ranking.bounds(probability, shared)[0] for ranking in ranked)
    high = max(ranking.bounds(probability, confidence)[1] for ranking in ranked)
    interval = (0.0, math.inf) if remark else (low, high)
    finding = finding_on_size(interval, limit)
    needed = None
    count = int(np.count_nonzero(independent))
    if finding == Finding.UNDECIDED and not remark and count:
        shares = [float(np.mean(~(size < limit))) for size in sizes], [float(np.mean(size >= limit)) for size in sizes]
        reason = f"errors over time are stored of the first {histories.most:,} samples alone"
        counting = Counting(len(histories.errors), count, histories.most, reason)
        needed, remark = samples_needed(*shares, 1.0 - probability, (confidence, shared), counting)
    known = replace(histories, mean=histories.counted_mean(requirement))
    linear = largest_linear_quantile(known, requirement.outputs, epochs, probability)
    return RequirementResult(
        requirement,
        finding,
        float(estimates[worst]),
        interval,
        linear,
        linear < limit,
        needed,
        remark=remark,
        time=float(histories.times[epochs[worst]]),
        samples=count,
    )


def largest_linear_quantile(
    histories: ErrorHistories, outputs: tuple[int, ...], epochs: Sequence[int], probability: float
) -> float:
    """Compute the largest quantile of errors' sizes at some epochs by the linear model; NaN without one."""
    if histories.mean is None or histories.covariance is None:
        return math.nan
    at, picked = np.array(epochs), np.array(size_members(outputs, histories.sizes) or outputs)
    mean, covariance = histories.mean[np.ix_(at, picked)], histories.covariance[np.ix_(at, picked, picked)]
    return float(largest_quantiles(mean[None], covariance[None], probability, np.zeros(1), math.nan)[0][0])
