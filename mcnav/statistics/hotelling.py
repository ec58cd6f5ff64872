"""Hotelling's T-squared: test of a mean."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.whitening import RANK_TOLERANCE, whitening

ROUNDING: Final = 1e-12
"""A standard deviation below this share of the mean counts as zero."""


def hotelling(count: int, deviation: Array, covariance: Array) -> HypothesisTest | None:
    """Test that independent, nearly normal observations have a given mean.

    With m the sample mean less the given one and C the sample covariance, of dimension p,

        T^2 = n m^T C^-1 m,        T^2 (n - p) / (p (n - 1))  is  F(p, n - p)

    (Anderson, *An Introduction to Multivariate Statistical Analysis*, 2003, section 5.2). The test is made in the range
    of C; a mean outside it has an infinite statistic. There is no test with fewer observations than dimensions.

    Parameters
    ----------
    count : int
        Observations n.
    deviation, covariance : ndarray, shapes (k,) and (k, k)
        m and C.
    """
    if not 0 < len(deviation) < count:
        return None
    constant = np.diag(covariance) <= (ROUNDING * deviation) ** 2
    covariance = np.where(constant[:, None] | constant, 0.0, covariance)
    own = whitening(covariance)
    sigma = np.sqrt(np.diag(covariance))
    unscaled = np.divide(deviation, sigma, out=deviation.copy(), where=sigma > 0.0)
    outside = float(np.sum((own.complement.T @ unscaled) ** 2))
    rank = own.rank
    if outside > RANK_TOLERANCE * max(float(np.sum(unscaled**2)), 1.0 if rank else 0.0):
        return HypothesisTest(float("inf"), (float(max(rank, 1)), float(count - rank)), 0.0, rank)
    if rank == 0:
        return HypothesisTest(0.0, (1.0, float(count)), 1.0, 0)
    squared = count * float(np.sum((own.matrix.T @ deviation) ** 2))
    statistic = squared * (count - rank) / (rank * (count - 1.0))
    return HypothesisTest(
        statistic, (float(rank), float(count - rank)), float(special.fdtrc(rank, count - rank, statistic)), rank
    )
