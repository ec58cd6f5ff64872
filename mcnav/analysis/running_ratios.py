"""Convergence of the sigma ratios as samples are added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.analysis.block_moments import BlockMoments
from mcnav.analysis.comparison import Comparison
from mcnav.analysis.decision_rule import ratio_interval
from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.estimates import Estimate

POINTS: Final = 40
"""Sample sizes, evenly spaced on a logarithmic scale."""


@dataclass(frozen=True)
class RunningRatio:
    """Sigma ratios from growing parts of a campaign, shape (sizes, outputs); NaN without linear dispersion."""

    ratio: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Convergence:
    """Sigma ratios against the number of samples, in whole blocks.

    Each interval holds by itself at the confidence of the final one; all sizes together hold at less.
    """

    sizes: IndexArray
    plain: RunningRatio
    paired: RunningRatio


def convergence(
    moments: BlockMoments, comparison: Comparison, design: SamplingDesign, withheld: Sequence[int] = ()
) -> Convergence | None:
    """Compute the sigma ratios of growing parts of a campaign; none with too few blocks.

    Products are about the mean of all samples, which takes nothing from the intervals and makes the curves end at the
    comparison's ratios. Outputs without a verdict, by number, have none.
    """
    if len(withheld) == len(comparison.outputs) or len(moments.counts) < 2 * design.fewest_blocks:
        return None
    unbiased = moments.samples / (moments.samples - 1.0)
    ends = np.unique(np.geomspace(design.fewest_blocks, len(moments.counts), POINTS).round().astype(int))
    sizes = np.cumsum(moments.counts).astype(np.int64)[ends - 1]
    variances = np.diag(comparison.covariance_linear).copy()
    running = np.full((2, 3, len(sizes), len(variances)), np.nan)
    variances[list(withheld)] = 0.0
    for i in np.flatnonzero(variances > 0.0).tolist():
        variance = float(variances[i])
        for kind, (sums, known) in enumerate(zip(moments.products(i, i), (0.0, variance), strict=True)):
            for row, estimate in enumerate(_running_means(unbiased * sums, moments.counts, ends)):
                estimate = replace(estimate, value=known + estimate.value)
                ratio, interval = ratio_interval(estimate, variance, comparison.confidence_each)
                running[kind, :, row, i] = ratio, *interval
    return Convergence(sizes, *(RunningRatio(*each) for each in running))


def _running_means(totals: Array, counts: Array, ends: IndexArray) -> list[Estimate]:
    """Estimate the means over the first blocks, up to each of some ends.

    With T a block's sum and n its size, the ratio estimator's error is ``B / (B - 1) sum_b (T_b - m n_b)^2 / n^2``, and
    the asymmetry follows from the third powers (`mcnav.statistics.estimates`); both need the cumulative sums of T, n,
    T^2, T n, n^2, T^3, T^2 n, T n^2 and n^3 only.
    """
    rows = []
    for begin, end in pairwise([0, *ends]):
        total, count = totals[begin:end], counts[begin:end]
        square, crossed, squared = total * total, total * count, count * count
        rows.append([total.sum(), count.sum(), square.sum(), crossed.sum(), squared.sum(), square @ total,
                     square @ count, crossed @ count, squared @ count])  # fmt: skip
    total, size, square, crossed, squared, *third = np.cumsum(rows, axis=0).T
    mean = total / size
    spread = np.maximum(square - 2.0 * mean * crossed + mean**2 * squared, 0.0)
    cubes = third[0] - 3.0 * mean * third[1] + 3.0 * mean**2 * third[2] - mean**3 * third[3]
    asymmetry = np.divide(cubes, spread**1.5, out=np.zeros_like(cubes), where=spread > 0.0)
    error = np.sqrt(spread * ends / (ends - 1.0)) / size
    return [Estimate(*each) for each in np.stack([mean, error, ends - 1.0, asymmetry], axis=1).tolist()]
