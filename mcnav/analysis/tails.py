"""How far out errors reach: quantiles by order statistics beside those that linear analysis quotes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.comparison import Model
from mcnav.analysis.requirements import absolute_normal_quantile, independent_samples
from mcnav.statistics.order_statistics import lower_rank, upper_rank
from mcnav.statistics.radial import normal_circular_error_probable

Array = NDArray[np.float64]

PROBABILITIES: Final = (0.95, 0.99, 0.9973)
"""At which an output's absolute value is told."""


@dataclass(frozen=True)
class Quantile:
    """A quantile of an output's absolute value, or of the distance from zero in two outputs (CEP).

    Attributes
    ----------
    outputs : tuple of int
        One, or two.
    probability : float
    estimate : float
        Of the flights, SI.
    lower, upper : float
        One-sided bounds, free of any distribution; zero and infinite where the sample is too small or the design has
        too few independent replicates. Samples that failed count as largest above, and as smallest below.
    linear : float
        Of the normal distribution of linear analysis.
    """

    outputs: tuple[int, ...]
    probability: float
    estimate: float
    lower: float
    upper: float
    linear: float


def tails(
    model: Model, outcomes: Array, blocks: NDArray[np.int64], units: Sequence[str], confidence: float
) -> tuple[Quantile, ...]:
    """Quantiles of every output that has a dispersion, and the CEP of every pair in one unit.

    Parameters
    ----------
    model : Model
    outcomes : ndarray, shape (n, outputs)
        Of all samples; NaN in the row of one that failed.
    blocks : ndarray of int, shape (n,)
    units : sequence of str
        Of the outputs.
    confidence : float
        Of each one-sided bound.
    """
    mean, covariance = model.outcome_mean, model.outcome_covariance
    picked, remark = independent_samples(blocks)
    dispersed = [i for i in range(len(mean)) if covariance[i, i] > 0.0]

    def found(outputs: tuple[int, ...], sizes: Array, linear: Mapping[float, float]) -> list[Quantile]:
        ranked = _Ranked.of(sizes)
        apart = ranked if picked.all() else _Ranked.of(sizes[picked])
        return [
            Quantile(
                outputs,
                probability,
                ranked.estimate(probability),
                0.0 if remark else apart.lower(probability, confidence),
                math.inf if remark else apart.upper(probability, confidence),
                quoted,
            )
            for probability, quoted in linear.items()
        ]

    quantiles = []
    for i in dispersed:
        quoted = {p: absolute_normal_quantile(float(mean[i]), float(covariance[i, i]) ** 0.5, p) for p in PROBABILITIES}
        quantiles += found((i,), np.abs(outcomes[:, i]), quoted)
    for i, j in combinations(dispersed, 2):
        if units[i] == units[j]:
            both = [i, j]
            circle = normal_circular_error_probable(mean[both], covariance[np.ix_(both, both)])
            quantiles += found((i, j), np.hypot(outcomes[:, i], outcomes[:, j]), {0.5: circle})
    return tuple(quantiles)


@dataclass(frozen=True)
class _Ranked:
    """Sizes of the samples that were flown in rising order, and how many failed."""

    values: Array
    failed: int

    @classmethod
    def of(cls, sizes: Array) -> _Ranked:
        """From sizes that are NaN where a sample failed."""
        ranked = np.sort(sizes)  # which puts them last
        flown = len(ranked) - int(np.count_nonzero(np.isnan(ranked)))
        return cls(ranked[:flown], len(ranked) - flown)

    def estimate(self, probability: float) -> float:
        """Between the two sizes that the probability falls between."""
        if not len(self.values):
            return math.nan
        place = (len(self.values) - 1) * probability
        below = int(place)
        return float(np.quantile(self.values[below : below + 2], place - below))

    def lower(self, probability: float, confidence: float) -> float:
        """Bound from below, where samples that failed count as smallest."""
        rank = lower_rank(len(self.values) + self.failed, probability, confidence)
        return 0.0 if rank is None or rank <= self.failed else float(self.values[rank - self.failed - 1])

    def upper(self, probability: float, confidence: float) -> float:
        """Bound from above, where samples that failed count as largest."""
        rank = upper_rank(len(self.values) + self.failed, probability, confidence)
        return math.inf if rank is None or rank > len(self.values) else float(self.values[rank - 1])
