"""Test of joint normality: Mardia's multivariate skewness and kurtosis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.statistics.chunked import scatter, stretches
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.whitening import whitening


@dataclass(frozen=True)
class Mardia:
    """Multivariate skewness b_1, zero for a normal distribution, and kurtosis b_2, p (p + 2) for a normal distribution.

    The tests are against normality: chi-square and standard normal (two-sided).
    """

    skewness: float
    kurtosis: float
    skewness_test: HypothesisTest
    kurtosis_test: HypothesisTest


def mardia(values: Array) -> Mardia | None:
    """Compute Mardia's measures and their tests for independent samples, shape (n, k).

    With z the samples whitened by their own covariance (divisor n), in its range of dimension p,

        b_1 = sum_abc mean(z_a z_b z_c)^2,        b_2 = mean((z^T z)^2);

    n k b_1 / 6 with ``k = (p+1)(n+1)(n+3) / (n [(n+1)(p+1) - 6])`` is chi-square of p (p+1) (p+2) / 6 degrees of
    freedom, and b_2 is normal with mean p (p+2) (n-1) / (n+1) and its exact variance (Mardia, Biometrika 57, 1970, 519;
    Sankhya B 36, 1974, 115). There is none without dispersion, or with too few samples.
    """
    count = len(values)
    if count < 2:
        return None
    mean = values.mean(axis=0)
    own = whitening(scatter(values) / count)
    rank = own.rank
    if rank == 0 or count <= rank + 3:
        return None
    thirds = [np.zeros((rank - a, rank - a)) for a in range(rank)]  # those of a <= b, c: they do not depend on order
    fourths = 0.0
    for stretch in stretches(count):
        white = own.matrix.T @ (values[stretch] - mean).T
        for a, of_first in enumerate(thirds):
            of_first += (white[a:] * white[a]) @ white[a:].T
        fourths += float(np.sum(np.sum(white**2, axis=0) ** 2))
    # of six orders of a < b < c two are kept, of three of a < b = c one, of three of a = b < c two, and a = b = c
    squares = [3.0 * np.sum(of_first**2) - 3.0 * np.sum(of_first[0] ** 2) + of_first[0, 0] ** 2 for of_first in thirds]
    skewness, kurtosis = float(sum(squares)) / count**2, fourths / count
    n, p = float(count), float(rank)
    small = (p + 1) * (n + 1) * (n + 3) / (n * ((n + 1) * (p + 1) - 6))
    freedom = p * (p + 1) * (p + 2) / 6
    chi = small * n * skewness / 6
    mean = p * (p + 2) * (n - 1) / (n + 1)
    variance = 8 * p * (p + 2) * (n - 3) / ((n + 1) ** 2 * (n + 3)) * (n - p - 1) * (n - p + 1) / (n + 5)
    normal = (kurtosis - mean) / np.sqrt(variance)
    return Mardia(
        skewness,
        kurtosis,
        HypothesisTest(float(chi), (freedom,), float(special.chdtrc(freedom, chi)), rank),
        HypothesisTest(float(normal), (), float(2.0 * special.ndtr(-abs(normal))), rank),
    )
