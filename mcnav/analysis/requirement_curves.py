"""Curves of what a requirement limits: Monte Carlo estimate, its bounds, and linear analysis, at every epoch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.requirements import (
    Requirement,
    independent_samples,
    size_members,
    size_probability,
)
from mcnav.analysis.requirements_over_time import ErrorHistories
from mcnav.arrays.types import Array, IndexArray
from mcnav.statistics.normal_size import size_quantiles
from mcnav.statistics.order_statistics import RankedSizes

MOST: Final = 150
"""Epochs of a curve, at most, besides those at which the requirement holds."""


@dataclass(frozen=True)
class RequirementCurve:
    """Quantile of the size of errors at m epochs, SI.

    Attributes
    ----------
    times : ndarray, shape (m,)
    holds : ndarray of bool, shape (m,)
        Where the requirement holds.
    estimate : ndarray, shape (m,)
        Of the samples with histories.
    bounds : ndarray, shape (m, 2)
        Lower and upper bound, each at the confidence at its epoch; zero and infinity where there are too few samples,
        or none that are independent.
    linear : ndarray, shape (m,)
        By linear analysis for normal errors; NaN where it is not known.
    """

    times: Array
    holds: NDArray[np.bool_]
    estimate: Array
    bounds: Array
    linear: Array


def requirement_curve(requirement: Requirement, histories: ErrorHistories, confidence: float) -> RequirementCurve:
    """Compute the curve of a requirement on the size of errors at epochs."""
    probability = size_probability(requirement)
    epochs = drawn_epochs(requirement, len(histories.times))
    independent, remark = independent_samples(histories.blocks)
    sizes = [histories.counted_sizes(requirement, epoch) for epoch in epochs.tolist()]
    ranked = [RankedSizes.of(size[independent]) for size in sizes]
    bounds = [(0.0, math.inf) if remark else ranking.bounds(probability, confidence) for ranking in ranked]
    return RequirementCurve(
        times=histories.times[epochs],
        holds=np.isin(epochs, requirement.epochs),
        estimate=np.array([ranking.estimate(probability) for ranking in ranked]),
        bounds=np.array(bounds),
        linear=_linear(requirement, histories, epochs, probability),
    )


def drawn_epochs(requirement: Requirement, count: int) -> IndexArray:
    """Return the epochs of a curve: all of few, of many those of the requirement and some others, in order."""
    own = [epoch for epoch in requirement.epochs if epoch < count]
    every = np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(np.int64))
    return np.union1d(every, np.array(own[:: -(-len(own) // MOST) or 1], dtype=np.int64))


def _linear(requirement: Requirement, histories: ErrorHistories, epochs: IndexArray, probability: float) -> Array:
    mean = histories.counted_mean(requirement)
    if mean is None or histories.covariance is None:
        return np.full(len(epochs), np.nan)
    picked = np.array(size_members(requirement.outputs, histories.sizes) or requirement.outputs)
    means = mean[np.ix_(epochs, picked)]
    covariances = histories.covariance[np.ix_(epochs, picked, picked)]
    return size_quantiles(means, covariances, probability, instead=math.nan)
