"""Gaussian copula: correlated errors of any distribution.

Two errors ``x_i = g_i(z_i)`` of correlated normals have a different correlation than the normals. With a_k and b_k the
coefficients of ``g_i`` and ``g_j`` in orthonormal Hermite polynomials, scaled to unit variance,

    corr(x_i, x_j) = sum_k a_k b_k rho_z^k,

which increases with rho_z and is solved for it (Nataf's transformation; Liu and Der Kiureghian, 1986).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.errors import NumericalError
from mcnav.sampler.distributions import Distribution, Normal
from mcnav.sampler.scipy_and_tables import EmpiricalDistribution

_DEGREE: Final = 120
_ABSCISSAE: Final = np.linspace(-14.0, 14.0, 16_001)
"""Abscissae of the trapezoidal rule; the weights at the ends are 1e-43."""

REACHED: Final = 1e-9
"""Largest difference of a correlation that was solved for."""

ROUNDING: Final = 1e-10
"""Magnitude of a negative eigenvalue that counts as rounding error."""


@lru_cache(maxsize=128)
def hermite_coefficients(distribution: Distribution) -> Array:
    """Compute the coefficients a_0 ... a_120 of a unit-variance transform in orthonormal Hermite polynomials.

    Scaling replaces the variance that the finite sum omits (1e-7 for a triangle's kink). The steps of a table omit
    more, which only matters for correlations near one: its coefficients are not scaled.

    Raises `ValueError` when the tails are so heavy that the sum contains less than 99.9 % of the variance.
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
    """Find the correlation of the normals that gives two errors the wanted correlation.

    Raises `ValueError` when no copula reaches it; the message names the range that can be reached.
    """
    from scipy.optimize import brentq  # slow to import: a tenth of a second

    if isinstance(first, Normal) and isinstance(second, Normal):
        return wanted
    lowest, highest = (error_correlation(first, second, end) for end in (-1.0, 1.0))
    for end, reached in ((1.0, highest), (-1.0, lowest)):
        if abs(wanted - reached) <= 1e-9:
            return end
    if not lowest < wanted < highest:
        span = f"up to {highest:.4f}" if abs(lowest + highest) < 1e-9 else f"from {lowest:.4f} to {highest:.4f}"
        raise ValueError(f"errors of these distributions can be correlated {span}; got {wanted:g}")
    root = float(brentq(lambda rho: error_correlation(first, second, rho) - wanted, -1.0, 1.0, xtol=1e-15))
    if not abs(error_correlation(first, second, root) - wanted) <= REACHED:
        raise NumericalError(f"normals correlated by {root:g} do not give two errors the correlation {wanted:g}")
    return root


def error_correlation(first: Distribution, second: Distribution, normal: float) -> float:
    """Compute the correlation of two errors from that of their normals."""
    if isinstance(first, Normal) and isinstance(second, Normal):
        return normal
    products = np.asarray(hermite_coefficients(first)) * np.asarray(hermite_coefficients(second))
    return float(np.polynomial.polynomial.polyval(normal, products))


def semidefinite_factor(matrix: Array) -> Array:
    """Compute the lower triangular L with L L^T equal to a positive semidefinite matrix, shape (n, n).

    A pivot of zero, to rounding, gives a column of zeros; perfectly correlated errors can be drawn.

    Raises `ValueError` when the matrix has a negative eigenvalue.
    """
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < -ROUNDING:
        raise ValueError(f"its smallest eigenvalue is {smallest:.3g}; expected none below zero")
    size = len(matrix)
    factor = np.zeros((size, size))
    for column in range(size):
        rest = matrix[column:, column] - factor[column:, :column] @ factor[column, :column]
        if rest[0] > ROUNDING:
            factor[column:, column] = rest / math.sqrt(rest[0])
    return factor
