"""How far out errors reach: quantiles by order statistics beside those that linear analysis quotes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.comparison import Model
from mcnav.analysis.requirements import absolute_normal_quantile, independent_samples
from mcnav.statistics.order_statistics import lower_bound, upper_bound
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
    found = []
    for i in dispersed:
        for probability in PROBABILITIES:
            linear = absolute_normal_quantile(float(mean[i]), float(covariance[i, i]) ** 0.5, probability)
            sizes = np.abs(outcomes[:, i])
            found.append(_quantile((i,), probability, sizes, picked, not remark, confidence, linear))
    for i, j in combinations(dispersed, 2):
        if units[i] == units[j]:
            both = [i, j]
            linear = normal_circular_error_probable(mean[both], covariance[np.ix_(both, both)])
            sizes = np.hypot(outcomes[:, i], outcomes[:, j])
            found.append(_quantile((i, j), 0.5, sizes, picked, not remark, confidence, linear))
    return tuple(found)


def _quantile(
    outputs: tuple[int, ...],
    probability: float,
    sizes: Array,
    picked: NDArray[np.bool_],
    bounded: bool,
    confidence: float,
    linear: float,
) -> Quantile:
    failed = ~np.isfinite(sizes)
    estimate = float(np.quantile(sizes[~failed], probability)) if not failed.all() else float("nan")
    lower, upper = 0.0, float("inf")
    if bounded:
        lower = max(lower_bound(np.where(failed, 0.0, sizes)[picked], probability, confidence), 0.0)
        upper = upper_bound(np.where(failed, np.inf, sizes)[picked], probability, confidence)
    return Quantile(outputs, probability, estimate, lower, upper, linear)
