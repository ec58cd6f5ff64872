"""Error quantiles by order statistics, compared with those of linear analysis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import error_sizes, independent_samples, linear_quantile
from mcnav.analysis.verdict import Verdict, judge
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.interim_sizes import confidence_of_each
from mcnav.statistics.order_statistics import RankedSizes

PROBABILITIES: Final = (0.95, 0.99, 0.9973)
"""Probabilities of the quantiles of an output's absolute value."""


@dataclass(frozen=True)
class Quantile:
    """A quantile of an output's absolute value, or of the distance from zero in two outputs (CEP).

    Attributes
    ----------
    outputs : tuple of int
        One, or two.
    lower, upper : float
        One-sided distribution-free bounds; zero and infinite where the sample is too small or the design has too few
        independent replicates. Failed samples count as largest above, and as smallest below.
    linear : float
        Quantile of the normal distribution of linear analysis; of a vector's size by its exact law.
    together : (float, float)
        Two-sided interval, at a confidence such that those of all quantiles hold together (Bonferroni).
    verdict : Verdict
        Whether that interval lies within the tolerance about the linear value.
    """

    outputs: tuple[int, ...]
    probability: float
    estimate: float
    lower: float
    upper: float
    linear: float
    together: tuple[float, float]
    verdict: Verdict


def tails(
    model: Model, outcomes: Array, blocks: IndexArray, units: Sequence[str], criterion: Criterion
) -> tuple[Quantile, ...]:
    """Estimate quantiles of every output that has a dispersion, and the CEP of every pair in one unit.

    The criterion's confidence is that of each one-sided bound, and of all verdicts together; interim analyses widen the
    intervals of the verdicts. The units are those of the outputs; for the other parameters see `judge_requirement`.
    """
    picked, remark = independent_samples(blocks)
    variances = np.diag(model.outcome_covariance)
    dispersed = np.flatnonzero(variances > 0.0).tolist()
    pairs = [(i, j) for i, j in combinations(dispersed, 2) if units[i] == units[j]]
    without_derivative = [i for i, members in model.sizes.items() if i not in dispersed and variances[[*members]].any()]
    dispersed = sorted([*dispersed, *without_derivative])
    wanted = [*(((i,), PROBABILITIES) for i in dispersed), *((pair, (0.5,)) for pair in pairs)]
    family = max(sum(len(probabilities) for _, probabilities in wanted), 1)
    each = 1.0 - 0.5 * (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / family
    quantiles = []
    for outputs, probabilities in wanted:
        sizes = error_sizes(outcomes, outputs)
        ranked = RankedSizes.of(sizes)
        apart = ranked if picked.all() else RankedSizes.of(sizes[picked])
        for probability in probabilities:
            estimate, linear = ranked.estimate(probability), linear_quantile(model, outputs, probability)
            bounds, together = (
                (0.0, math.inf) if remark else apart.bounds(probability, sure) for sure in (criterion.confidence, each)
            )
            interval = together[0] / linear, together[1] / linear
            verdict = judge(estimate / linear, interval, criterion.tolerance, len(sizes)).verdict
            quantiles.append(Quantile(outputs, probability, estimate, *bounds, linear, together, verdict))
    return tuple(quantiles)
