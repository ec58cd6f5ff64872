"""Estimates and their standard errors, for samples in independent blocks.

A design of draws (`mcnav.sampler.designs`) guarantees independence between blocks, not within them. The mean of a
quantity therefore takes its standard error from the spread of its block means, and its interval from Student's t with
the blocks' degrees of freedom.

Where few blocks are skewed that interval misses on one side. With T the studentised mean of B blocks of skewness gamma
and ``a = gamma / sqrt(B)``, the quantity

    g(T) = T + a T^2 / 3 + a^2 T^3 / 27 + a / 6

is free of the first effect of skewness, and rises with T (Hall, 1992). The interval here extends on
each side to the farther of Student's and Hall's: sample skewness is mostly too small, and is used only where it widens
the interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray


@dataclass(frozen=True)
class Estimate:
    """An estimated mean with as many degrees of freedom as independent blocks less one.

    With none the standard error is infinite. The asymmetry ``a`` is the skewness of the blocks over the root of their
    number.
    """

    value: float
    standard_error: float
    degrees_of_freedom: float
    asymmetry: float = 0.0

    def half_width(self, confidence: float) -> float:
        """Return half the width of Student's two-sided interval ``value +- t s.e.``."""
        return self._quantile(confidence) * self.standard_error if self.degrees_of_freedom >= 1.0 else float("inf")

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return the two-sided interval of a confidence."""
        half = self.half_width(confidence)
        low, high = self.reach_of_skewness(confidence)
        return self.value - max(half, low), self.value + max(half, high)

    def reach(self, confidence: float) -> float:
        """Return the larger distance of the interval's ends from the value."""
        return max(self.half_width(confidence), *self.reach_of_skewness(confidence))

    def reach_of_skewness(self, confidence: float) -> tuple[float, float]:
        """Return the distances of the lower and upper end of Hall's interval from the value."""
        if self.degrees_of_freedom < 1.0:
            return float("inf"), float("inf")
        quantile = self._quantile(confidence)
        low, high = (_unskewed(end, self.asymmetry) * self.standard_error for end in (quantile, -quantile))
        return low, -high

    def _quantile(self, confidence: float) -> float:
        return float(special.stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * confidence))


NEARLY_SYMMETRIC: Final = 1e-6


def _unskewed(quantile: float, asymmetry: float) -> float:
    """Invert g(T)."""
    if abs(asymmetry) < NEARLY_SYMMETRIC:
        return quantile
    root = np.cbrt(1.0 + asymmetry * (quantile - asymmetry / 6.0))
    return float(3.0 * (root - 1.0) / asymmetry)


def blocked_mean(values: Array, blocks: IndexArray, fewest: float = 2) -> Estimate:
    """Estimate the mean of one quantity over samples in independent blocks.

    With m_b the mean and n_b the size of block b, ``s.e.^2 = B / (B - 1) sum_b n_b^2 (m_b - m)^2 / n^2``: the ratio
    estimator's error, which for blocks of one is the textbook s / sqrt(n). With fewer than ``fewest`` blocks it is
    infinite. The block of each sample, shape (n,), does not decrease.
    """
    count = len(values)
    if count == 0:
        return Estimate(float("nan"), float("inf"), 0.0)
    mean = float(np.mean(values))
    deviations, begins = values - mean, block_begins(blocks)
    if len(begins) < count:
        deviations = np.add.reduceat(deviations, begins)
    return _estimate(mean, deviations, count, fewest)


@dataclass(frozen=True)
class MeanColumns:
    """Means of several quantities over the same samples, and their standard errors, shape (quantities,) each."""

    values: Array
    standard_errors: Array
    degrees_of_freedom: float


def blocked_means(values: Array, blocks: IndexArray, fewest: float = 2) -> MeanColumns:
    """Estimate the means of columns, shape (n, quantities), as `blocked_mean` does for one.

    At least one sample is required.
    """
    means, begins = values.mean(axis=0), block_begins(blocks)
    deviations = values - means
    if len(begins) < len(values):
        deviations = np.add.reduceat(deviations, begins, axis=0)
    number = len(deviations)
    if number < max(2, fewest):
        return MeanColumns(means, np.full(len(means), np.inf), 0.0)
    squares = np.einsum("ij,ij->j", deviations, deviations)
    return MeanColumns(means, np.sqrt(number / (number - 1.0) * squares) / len(values), number - 1.0)


def _estimate(mean: float, deviations: Array, count: float, fewest: float) -> Estimate:
    """Form an estimate from the block sums of deviations from the mean."""
    number = len(deviations)
    if number < max(2, fewest):
        return Estimate(mean, float("inf"), 0.0)
    square = float(np.sum(deviations**2))
    error = np.sqrt(number / (number - 1.0) * square) / count
    shares = deviations / (np.sqrt(square) or 1.0)
    return Estimate(mean, float(error), number - 1.0, float(np.sum(shares * shares * shares)))


def summed_mean(totals: Array, counts: Array, fewest: float = 2) -> Estimate:
    """Estimate the mean as `blocked_mean`, from the sums and sample counts of blocks, shape (blocks,)."""
    return summed_means(totals[None], counts, fewest)[0]


def summed_means(totals: Array, counts: Array, fewest: float = 2) -> list[Estimate]:
    """Estimate the means of several quantities, shape (quantities, blocks), as `summed_mean` does for one."""
    count, number = float(np.sum(counts)), totals.shape[1]
    if count == 0.0:
        return [Estimate(float("nan"), float("inf"), 0.0)] * len(totals)
    means = np.sum(totals, axis=1) / count
    if number < max(2, fewest):
        return [Estimate(mean, float("inf"), 0.0) for mean in means.tolist()]
    deviations = totals - means[:, None] * counts
    squares = np.sum(deviations * deviations, axis=1)
    errors = np.sqrt(number / (number - 1.0) * squares) / count
    deviations /= np.where(squares > 0.0, np.sqrt(squares), 1.0)[:, None]
    skewed = np.sum(deviations * deviations * deviations, axis=1)
    columns = zip(means.tolist(), errors.tolist(), skewed.tolist(), strict=True)
    return [Estimate(mean, error, number - 1.0, asymmetry) for mean, error, asymmetry in columns]


def paired_squares(simulated: Array, linear: Array) -> Array:
    """Return the squares of simulated less those of linear errors, each about their mean, shape (n,) or (n, outputs).

    Their mean is the difference of the unbiased sample variances.
    """
    unbiased = len(simulated) / max(len(simulated) - 1.0, 1.0)
    return np.asarray(unbiased * ((simulated - simulated.mean(axis=0)) ** 2 - (linear - linear.mean(axis=0)) ** 2))


def block_begins(blocks: IndexArray) -> IndexArray:
    """Return the first sample of each block, shape (blocks,)."""
    return np.flatnonzero(np.diff(blocks, prepend=blocks[:1] - 1))
