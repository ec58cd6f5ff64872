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
from mcnav.analysis.requirements import error_sizes, independent_samples, linear_quantile, size_members
from mcnav.analysis.verdict import Verdict, judge
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.interim_sizes import confidence_of_each
from mcnav.statistics.normal_size import size_quantiles
from mcnav.statistics.order_statistics import RankedSizes

PROBABILITIES: Final = (0.95, 0.99, 0.9973)
"""Probabilities of the quantiles of an output's absolute value."""

MOST_PAIRS: Final = 1_000
"""Pairs of outputs in one unit, those of 45 outputs, above which none has a CEP; a requirement asks for one.

So many outputs are no vectors of two. All pairs of 200 outputs took two thirds of the time of a run.
"""

Wanted = tuple[tuple[int, ...], float]
"""Outputs and the probability of a quantile."""


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
    pairs = pairs_in_one_unit(model, units)
    wanted = list[tuple[tuple[int, ...], tuple[float, ...]]]()
    wanted += [((i,), PROBABILITIES) for i in _dispersed_outputs(model)]
    wanted += [(pair, (0.5,)) for pair in pairs if len(pairs) <= MOST_PAIRS]
    linear = _linear_quantiles(model, [(outputs, each) for outputs, several in wanted for each in several])
    sure = 1.0 - 0.5 * (1.0 - confidence_of_each(criterion.confidence, criterion.looks)) / max(len(linear), 1)
    quantiles = []
    for outputs, probabilities in wanted:
        sizes = error_sizes(outcomes, outputs)
        ranked = RankedSizes.of(sizes)
        apart = ranked if picked.all() else RankedSizes.of(sizes[picked])
        for probability in probabilities:
            estimate, predicted = ranked.estimate(probability), linear[outputs, probability]
            bounds, together = (
                (0.0, math.inf) if remark else apart.bounds(probability, level)
                for level in (criterion.confidence, sure)
            )
            interval = together[0] / predicted, together[1] / predicted
            verdict = judge(estimate / predicted, interval, criterion.tolerance, len(sizes)).verdict
            quantiles.append(Quantile(outputs, probability, estimate, *bounds, predicted, together, verdict))
    return tuple(quantiles)


def pairs_in_one_unit(model: Model, units: Sequence[str]) -> list[tuple[int, int]]:
    """List the pairs of outputs that have a dispersion and a common unit."""
    dispersed = np.flatnonzero(np.diag(model.outcome_covariance) > 0.0).tolist()
    return [(i, j) for i, j in combinations(dispersed, 2) if units[i] == units[j]]


def _dispersed_outputs(model: Model) -> list[int]:
    """List the outputs with a dispersion, among them sizes that have no derivative."""
    variances = np.diag(model.outcome_covariance)
    varied = variances > 0.0
    for i, members in model.sizes.items():
        varied[i] |= variances[[*members]].any()
    return np.flatnonzero(varied).tolist()


def _linear_quantiles(model: Model, wanted: Sequence[Wanted]) -> dict[Wanted, float]:
    """Compute quantiles by the linear model, those of equally many outputs together; NaN where one is refused."""
    quantiles = dict[Wanted, float]()
    for number in (1, 2):
        alike = [entry for entry in wanted if len(entry[0]) == number and not size_members(entry[0], model.sizes)]
        picked = np.array([outputs for outputs, _ in alike], dtype=int).reshape(-1, number)
        covariances = model.outcome_covariance[picked[:, :, None], picked[:, None, :]]
        probabilities = np.array([probability for _, probability in alike])
        laws = size_quantiles(model.outcome_mean[picked], covariances, probabilities, instead=math.nan)
        quantiles |= dict(zip(alike, laws.tolist(), strict=True))
    return quantiles | {entry: linear_quantile(model, *entry) for entry in wanted if entry not in quantiles}
