"""Error quantiles by order statistics, compared with those of linear analysis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.analysis.comparison import Criterion, Model
from mcnav.analysis.requirements import absolute_normal_quantile, independent_samples
from mcnav.analysis.verdict import Verdict, judge
from mcnav.statistics.circular_error import normal_circular_error_probable
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
        Quantile of the normal distribution of linear analysis.
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
    mean, covariance = model.outcome_mean, model.outcome_covariance
    picked, remark = independent_samples(blocks)
    dispersed = [i for i in range(len(mean)) if covariance[i, i] > 0.0]

    pairs = [(i, j) for i, j in combinations(dispersed, 2) if units[i] == units[j]]
    family = max(len(PROBABILITIES) * len(dispersed) + len(pairs), 1)
    each = 1.0 - 0.5 * (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / family

    def found(outputs: tuple[int, ...], sizes: Array, linear: Mapping[float, float]) -> list[Quantile]:
        ranked = RankedSizes.of(sizes)
        apart = ranked if picked.all() else RankedSizes.of(sizes[picked])

        def bounds(probability: float, sure: float) -> tuple[float, float]:
            return (0.0, math.inf) if remark else (apart.lower(probability, sure), apart.upper(probability, sure))

        quantiles = []
        for probability, quoted in linear.items():
            estimate, together = ranked.estimate(probability), bounds(probability, each)
            low, high = (bound / quoted for bound in together)
            verdict = judge(estimate / quoted, (low, high), criterion.tolerance, len(sizes)).verdict
            lower, upper = bounds(probability, criterion.confidence)
            quantiles.append(Quantile(outputs, probability, estimate, lower, upper, quoted, together, verdict))
        return quantiles

    quantiles = []
    for i in dispersed:
        quoted = {p: absolute_normal_quantile(float(mean[i]), float(covariance[i, i]) ** 0.5, p) for p in PROBABILITIES}
        quantiles += found((i,), np.abs(outcomes[:, i]), quoted)
    for i, j in pairs:
        both = [i, j]
        circle = normal_circular_error_probable(mean[both], covariance[np.ix_(both, both)])
        quantiles += found((i, j), np.hypot(outcomes[:, i], outcomes[:, j]), {0.5: circle})
    return tuple(quantiles)
