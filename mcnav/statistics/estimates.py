"""Estimates with their errors, for samples that come in independent blocks.

A design of draws (`mcnav.sampling.designs`) guarantees independence between blocks, not within them. The mean of a
quantity therefore takes its standard error from the spread of its block means, and its interval from Student's t with
the blocks' degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """An estimated mean.

    Attributes
    ----------
    value : float
    standard_error : float
    degrees_of_freedom : float
        Independent blocks less one; with none the standard error is infinite.
    """

    value: float
    standard_error: float
    degrees_of_freedom: float

    def half_width(self, confidence: float) -> float:
        """Half the width of the two-sided interval ``value +- t s.e.`` of a confidence."""
        if self.degrees_of_freedom < 1.0:
            return float("inf")
        return float(special.stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * confidence)) * self.standard_error

    def interval(self, confidence: float) -> tuple[float, float]:
        """Two-sided interval of a confidence."""
        half = self.half_width(confidence)
        return self.value - half, self.value + half


def blocked_mean(values: Array, blocks: NDArray[np.int64], fewest: int = 2) -> Estimate:
    """Mean of one quantity over samples that belong to independent blocks.

    With m_b the mean and n_b the size of block b, ``s.e.^2 = B / (B - 1) sum_b n_b^2 (m_b - m)^2 / n^2``: the ratio
    estimator's error, which for blocks of one is the textbook s / sqrt(n).

    Parameters
    ----------
    values : ndarray, shape (n,)
    blocks : ndarray of int, shape (n,)
        The block of each sample, not decreasing.
    fewest : int
        With fewer blocks than this the standard error is infinite: nothing is claimed from so little.
    """
    count = len(values)
    if count == 0:
        return Estimate(float("nan"), float("inf"), 0.0)
    mean = float(np.mean(values))
    begins = np.flatnonzero(np.diff(blocks, prepend=blocks[0] - 1))
    deviations = np.add.reduceat(values - mean, begins)
    number = len(begins)
    if number < max(2, fewest):
        return Estimate(mean, float("inf"), 0.0)
    error = np.sqrt(number / (number - 1.0) * float(np.sum(deviations**2))) / count
    return Estimate(mean, float(error), number - 1.0)
