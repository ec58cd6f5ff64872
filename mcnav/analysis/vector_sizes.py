"""The size of a vector of outputs, such as a velocity correction, by its exact law and by samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import independent_samples
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.normal_size import NormalSize
from mcnav.statistics.order_statistics import RankedSizes
from mcnav.statistics.refusals import or_withheld

MOST: Final = 0.9973
"""Probability of the quantile that mean plus three sigma would stand for."""

WRONG: Final = 0.01
"""Share of the exact quantile from which on nominal plus three sigma is said to be wrong."""


@dataclass(frozen=True)
class LinearSize:
    """The law of a size for normal components.

    Attributes
    ----------
    output : int
    nominal : float
        Size of the components' means.
    sigma : float
        Root sum of squares of the components' sigmas.
    median, mean, most : float
        Of the exact law; `most` is not exceeded with the probability `MOST`.
    three_sigma : float
        Nominal plus three sigma, and the probability of a size up to it.
    """

    output: int
    nominal: float
    sigma: float
    median: float
    mean: float
    most: float
    three_sigma: float
    three_sigma_probability: float

    @property
    def wrong(self) -> bool:
        """Departure of nominal plus three sigma from the exact quantile by `WRONG` or more."""
        return abs(self.three_sigma - self.most) > WRONG * self.most


def linear_sizes(sizes: Mapping[int, tuple[int, ...]], mean: Array, covariance: Array) -> tuple[LinearSize, ...]:
    """Compute the laws of sizes, by number with their components, of outputs with a mean and a covariance."""
    laws = []
    for number, members in sizes.items():
        chosen = np.array(members)
        part = covariance[np.ix_(chosen, chosen)]
        law, nominal = NormalSize.of(mean[chosen], part), float(np.linalg.norm(mean[chosen]))
        sigma = float(np.sqrt(max(np.trace(part), 0.0)))
        bound = nominal + 3.0 * sigma
        median, most = (or_withheld(law.quantile, probability) for probability in (0.5, MOST))
        within = or_withheld(law.probability, bound)
        laws.append(LinearSize(number, nominal, sigma, median, law.mean, most, bound, within))
    return tuple(laws)


@dataclass(frozen=True)
class SampledSize:
    """A size by its exact law, and by samples with two-sided intervals, each at the campaign's confidence.

    Intervals of the median and of the quantile are distribution-free; failed samples count on both sides. They are none
    where the design has too few independent replicates.
    """

    linear: LinearSize
    median: float
    mean: float
    most: float
    median_interval: tuple[float, float] | None
    mean_interval: tuple[float, float] | None
    most_interval: tuple[float, float] | None


def sampled_sizes(model: Model, outcomes: Array, blocks: IndexArray, criterion: Criterion) -> tuple[SampledSize, ...]:
    """Estimate sizes from the outcomes of all samples, shape (n, outputs); NaN in the rows of failed samples."""
    picked, remark = independent_samples(blocks)
    side = 0.5 + 0.5 * criterion.confidence
    results = []
    for law in linear_sizes(model.sizes, model.outcome_mean, model.outcome_covariance):
        values = outcomes[:, law.output]
        ranked, apart = RankedSizes.of(values), RankedSizes.of(values[picked])
        count, mean = len(ranked.values), float(np.mean(ranked.values)) if len(ranked.values) else math.nan
        independent = apart.values
        several = not remark and len(independent) > 1
        reach = float(special.stdtrit(len(independent) - 1, side)) if several else math.nan
        spread = reach * float(np.std(independent, ddof=1)) / math.sqrt(len(independent)) if several else math.nan
        results.append(
            SampledSize(
                law, ranked.estimate(0.5) if count else math.nan, mean, ranked.estimate(MOST) if count else math.nan,
                None if remark else apart.bounds(0.5, side),
                (mean - spread, mean + spread) if several else None,
                None if remark else apart.bounds(MOST, side),
            )
        )  # fmt: skip
    return tuple(results)
