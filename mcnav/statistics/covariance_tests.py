"""Test of a sample covariance: Wilks' likelihood ratio with Bartlett's correction."""

from __future__ import annotations

import numpy as np
from scipy import special

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.whitening import leaves_range, whitening


def covariance_likelihood_ratio(sample: Array, count: int, covariance: Array) -> HypothesisTest | None:
    """Test that independent normal samples, of unknown mean, have a given covariance.

    With W the sample covariance whitened by the given one, of rank p, and nu = n - 1,

        u = nu [tr W - ln det W - p],        rho = 1 - (2 p^2 + 3 p - 1) / (6 nu (p + 1)),

    and rho u is chi-square of p (p + 1) / 2 degrees of freedom to order n^-2 (Muirhead, *Aspects of Multivariate
    Statistical Theory*, 1982, theorem 8.4.8; Anderson, 2003, section 10.8). If the covariance is singular, the test is
    made in its range; a sample with dispersion outside the range has an infinite statistic. There is no test without
    dispersion, or with too few samples for a determinant.

    Parameters
    ----------
    sample : ndarray, shape (k, k)
        Unbiased sample covariance.
    covariance : ndarray, shape (k, k)
        Covariance of the hypothesis.
    """
    given = whitening(covariance)
    degrees, rank = count - 1, given.rank
    freedom = 0.5 * rank * (rank + 1)
    certain = HypothesisTest(float("inf"), (freedom,), 0.0, rank)
    if leaves_range(given, covariance, sample):
        return certain
    if rank == 0 or degrees < rank:
        return None
    values = np.linalg.eigvalsh(transform(given.matrix.T, sample))
    if values[0] <= 0.0:
        return certain
    ratio = degrees * float(np.sum(values - 1.0 - np.log(values)))
    correction = 1.0 - (2.0 * rank**2 + 3.0 * rank - 1.0) / (6.0 * degrees * (rank + 1.0))
    statistic = max(correction, 0.0) * ratio
    return HypothesisTest(statistic, (freedom,), float(special.chdtrc(freedom, statistic)), rank)
