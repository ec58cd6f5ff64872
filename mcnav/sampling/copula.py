"""Correlation between errors of any distribution: a Gaussian copula that reaches the correlation asked for.

Two errors ``x_i = g_i(z_i)`` made from correlated normals have another correlation than the normals. With a_k and b_k
the coefficients of ``g_i`` and ``g_j`` in the orthonormal Hermite polynomials, scaled to unit variance,

    corr(x_i, x_j) = sum_k a_k b_k rho_z^k,

which rises with rho_z and is solved for it (Nataf's transformation; Liu and Der Kiureghian, 1986).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.optimize import brentq

from mcnav._types import Array
from mcnav.sampling.distributions import Distribution, Normal
from mcnav.sampling.scipy_and_tables import EmpiricalDistribution

_DEGREE: Final = 120
_ABSCISSAE: Final = np.linspace(-14.0, 14.0, 16_001)
"""Abscissae of the trapezoidal rule, whose weights fall to 1e-43 at the ends."""

ROUNDING: Final = 1e-10
"""A correlation matrix whose smallest eigenvalue lies above minus this is taken as semidefinite."""


@lru_cache(maxsize=128)
def hermite_coefficients(distribution: Distribution) -> Array:
    """Coefficients a_0 ... a_120 of a unit-variance transform in the orthonormal Hermite polynomials, shape (121,).

    What the finite sum leaves out (1e-7 for a triangle's kink) is made up by scaling. The steps of a table leave out
    more, of which only correlations near one would see anything: its coefficients stay as they are.

    Raises
    ------
    ValueError
        When the tails are so heavy that the sum does not hold 99.9 % of the variance.
    """
    z = _ABSCISSAE
    weights = np.exp(-0.5 * z * z) * ((z[1] - z[0]) / math.sqrt(2.0 * math.pi))
    values = (distribution.transform(z) - distribution.mean) / distribution.standard_deviation
    coefficients = np.empty(_DEGREE + 1)
    before, current = np.zeros_like(z), np.ones_like(z)
    for degree in range(_DEGREE + 1):
        coefficients[degree] = np.sum(weights * values * current)
        before, current = current, (z * current - math.sqrt(degree) * before) / math.sqrt(degree + 1)
    captured = float(np.sum(coefficients**2))
    if isinstance(distribution, EmpiricalDistribution) and 0.9 < captured < 0.999:
        return coefficients
    if captured < 0.999:
        raise ValueError(
            "an error has tails too heavy to be correlated (Student's t needs degrees_of_freedom of 2.2), or it has "
            "too few values"
        )
    return np.asarray(coefficients / math.sqrt(captured))


def normal_correlation(first: Distribution, second: Distribution, wanted: float) -> float:
    """Correlation of the normals that gives two errors the wanted correlation.

    Raises
    ------
    ValueError
        When no copula reaches it; the message names the largest magnitude that can be had.
    """
    if isinstance(first, Normal) and isinstance(second, Normal):
        return wanted
    products = np.asarray(hermite_coefficients(first)) * np.asarray(hermite_coefficients(second))

    def excess(rho: float) -> float:
        return float(np.polynomial.polynomial.polyval(rho, products)) - wanted

    lowest, highest = (excess(end) + wanted for end in (-1.0, 1.0))
    for end, reached in ((1.0, highest), (-1.0, lowest)):
        if abs(wanted - reached) <= 1e-9:
            return end
    if not lowest < wanted < highest:
        span = f"up to {highest:.4f}" if abs(lowest + highest) < 1e-9 else f"from {lowest:.4f} to {highest:.4f}"
        raise ValueError(f"errors of these distributions can be correlated {span}; got {wanted:g}")
    return float(brentq(excess, -1.0, 1.0, xtol=1e-15))


def error_correlation(first: Distribution, second: Distribution, normal: float) -> float:
    """Correlation of two errors whose normals have a given one."""
    if isinstance(first, Normal) and isinstance(second, Normal):
        return normal
    products = np.asarray(hermite_coefficients(first)) * np.asarray(hermite_coefficients(second))
    return float(np.polynomial.polynomial.polyval(normal, products))


def semidefinite_factor(matrix: Array) -> Array:
    """Lower triangular L with L L^T equal to a positive semidefinite matrix, shape (n, n).

    A pivot that vanishes to rounding gives a column of zeros, so that perfectly correlated errors can be drawn.

    Raises
    ------
    ValueError
        When the matrix has an eigenvalue below zero.
    """
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < -ROUNDING:
        raise ValueError(f"its smallest eigenvalue is {smallest:.3g}, and must not be negative")
    size = len(matrix)
    factor = np.zeros((size, size))
    for column in range(size):
        rest = matrix[column:, column] - factor[column:, :column] @ factor[column, :column]
        if rest[0] > ROUNDING:
            factor[column:, column] = rest / math.sqrt(rest[0])
    return factor
