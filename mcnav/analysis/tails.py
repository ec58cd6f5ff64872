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
from mcnav.statistics.order_statistics import lower_rank, upper_rank

PROBABILITIES: Final = (0.95, 0.99, 0.9973)
"""Probabilities of the quantiles of an output's absolute value."""


@dataclass(frozen=True)
class Quantile:
    """A quantile of an output's absolute value, or of the distance from zero in two outputs (CEP).

    Attributes
    ----------
    outputs : tuple of int
        One, or two.
    estimate : float
        SI.
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

    Parameters
    ----------
    outcomes : ndarray, shape (n, outputs)
        Final errors of all samples; NaN in the row of one that failed.
    blocks : ndarray of int, shape (n,)
    units : sequence of str
        Units of the outputs.
    criterion : Criterion
        Its confidence is that of each one-sided bound, and of all verdicts together; interim analyses widen the
        intervals of the verdicts.
    """
    mean, covariance = model.outcome_mean, model.outcome_covariance
    picked, remark = independent_samples(blocks)
    dispersed = [i for i in range(len(mean)) if covariance[i, i] > 0.0]

    pairs = [(i, j) for i, j in combinations(dispersed, 2) if units[i] == units[j]]
    family = max(len(PROBABILITIES) * len(dispersed) + len(pairs), 1)
    each = 1.0 - 0.5 * (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / family

    def found(outputs: tuple[int, ...], sizes: Array, linear: Mapping[float, float]) -> list[Quantile]:
        ranked = _Ranked.of(sizes)
        apart = ranked if picked.all() else _Ranked.of(sizes[picked])

        def bounds(probability: float, sure: float) -> tuple[float, float]:
            return (0.0, math.inf) if remark else (apart.lower(probability, sure), apart.upper(probability, sure))

        quantiles = []
        for probability, quoted in linear.items():
            estimate, together = ranked.estimate(probability), bounds(probability, each)
            low, high = (bound / quoted for bound in together)
            verdict = judge(estimate / quoted, (low, high), criterion.tolerance, len(sizes)).verdict
            quantiles.append(
                Quantile(
                    outputs,
                    probability,
                    estimate,
                    *bounds(probability, criterion.confidence),
                    quoted,
                    together,
                    verdict,
                )
            )
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


@dataclass(frozen=True)
class _Ranked:
    """Sizes of the successful samples in rising order, and the number of failed ones."""

    values: Array
    failed: int

    @classmethod
    def of(cls, sizes: Array) -> _Ranked:
        """Rank sizes that are NaN where a sample failed."""
        ranked = np.sort(sizes)  # which puts them last
        successful = len(ranked) - int(np.count_nonzero(np.isnan(ranked)))
        return cls(ranked[:successful], len(ranked) - successful)

    def estimate(self, probability: float) -> float:
        """Interpolate between the two sizes next to the probability."""
        if not len(self.values):
            return math.nan
        place = (len(self.values) - 1) * probability
        below = int(place)
        return float(np.quantile(self.values[below : below + 2], place - below))

    def lower(self, probability: float, confidence: float) -> float:
        """Bound the quantile from below; failed samples count as smallest."""
        rank = lower_rank(len(self.values) + self.failed, probability, confidence)
        return 0.0 if rank is None or rank <= self.failed else float(self.values[rank - self.failed - 1])

    def upper(self, probability: float, confidence: float) -> float:
        """Bound the quantile from above; failed samples count as largest."""
        rank = upper_rank(len(self.values) + self.failed, probability, confidence)
        return math.inf if rank is None or rank > len(self.values) else float(self.values[rank - 1])
