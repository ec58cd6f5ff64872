"""Multivariate Student-t distribution of a group of sources, whose errors are large together.

With correlated standard normals z, and a chi-square W with nu degrees of freedom for the whole group,

    x_i = sigma_i z_i sqrt((nu - 2) / W)

has standard deviation sigma_i, and two members have exactly the correlation of their normals, since
``E (nu - 2) / W = 1``. The correlation of a member with an error ``g_j(z_j)`` outside the group is ``kappa a_j rho_z``,
with ``kappa = E sqrt((nu - 2) / W)`` and the first Hermite coefficient a_j of ``g_j`` (`mcnav.sampler.copula`);
members of two groups have ``kappa_1 kappa_2 rho_z``.

With three independent draws of a pair and S = 1 / W (1 for an error outside a group), the rank correlation is

    rho_S = (6 / pi) E arcsin( rho_z sqrt(S_1 S'_1 / ((S_1 + S_2) (S'_1 + S'_3))) ),

by the orthant probability of the normal; without groups it is (6 / pi) arcsin(rho_z / 2) (Kruskal, 1958).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.errors import NumericalError

_ABSCISSAE: Final = np.linspace(-7.0, 7.0, 29)
"""Abscissae of the trapezoidal rule over standard normals, with an error of at most 1e-9."""

REACHED: Final = 1e-9
"""Largest difference of a rank correlation that was solved for."""


@dataclass(frozen=True)
class MultivariateT:
    """Sources with one multivariate Student-t distribution; a finite variance needs more than 2 degrees of freedom."""

    sources: tuple[str, ...]
    degrees_of_freedom: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.degrees_of_freedom) and self.degrees_of_freedom > 2.0):
            raise ValueError("degrees_of_freedom must exceed 2 for a finite variance")

    def scale(self, normal: Array) -> Array:
        """Compute the factor ``sqrt((nu - 2) / W)`` from the group's standard normal variate, elementwise."""
        return np.asarray(np.sqrt((self.degrees_of_freedom - 2.0) / _chi_square(self.degrees_of_freedom, normal)))

    @property
    def coupling(self) -> float:
        """Mean of the factor, ``sqrt((nu - 2) / 2) Gamma((nu - 1) / 2) / Gamma(nu / 2)``."""
        half = 0.5 * self.degrees_of_freedom
        return math.sqrt(half - 1.0) * math.exp(math.lgamma(half - 0.5) - math.lgamma(half))


def _chi_square(degrees: float, normal: Array) -> Array:
    """Compute the chi-square quantile at the probability of a standard normal variate, from the nearer tail."""
    tail = special.ndtr(-np.abs(normal))
    half = 0.5 * degrees
    return np.asarray(2.0 * np.where(normal < 0.0, special.gammaincinv(half, tail), special.gammainccinv(half, tail)))


@lru_cache(maxsize=64)
def _sines(one: MultivariateT | None, other: MultivariateT | None) -> tuple[Array, Array]:
    """Compute the values of the root in the equation of rho_S and their probabilities, shape (m,)."""
    weights = np.exp(-0.5 * _ABSCISSAE**2)
    weights /= weights.sum()

    def inverse(group: MultivariateT | None) -> tuple[Array, Array]:
        """Return values of 1 / W, one where there is no group, and their probabilities."""
        if group is None:
            return np.ones(1), np.ones(1)
        return 1.0 / _chi_square(group.degrees_of_freedom, _ABSCISSAE), weights

    (s, p), (t, q) = inverse(one), inverse(other)
    left, right = s[:, None] / (s[:, None] + s), t[:, None] / (t[:, None] + t)  # first draw in rows, second in columns
    if one is not None and one == other:  # the first draw is shared
        sines = left[:, :, None] * right[:, None, :]
        probabilities = p[:, None, None] * p[None, :, None] * p
    else:
        sines = left[:, :, None, None] * right
        probabilities = p[:, None, None, None] * p[None, :, None, None] * q[:, None] * q
    relevant = probabilities > 1e-16
    return np.sqrt(sines[relevant]), probabilities[relevant]


def rank_correlation(normal: float, one: MultivariateT | None = None, other: MultivariateT | None = None) -> float:
    """Compute Spearman's rank correlation of two errors, each possibly in a group, from that of their normals.

    >>> round(rank_correlation(0.5), 4), round(rank_correlation(0.5, *[MultivariateT(("a", "b"), 3.0)] * 2), 4)
    (0.4826, 0.4643)
    """
    if one is None and other is None:
        return 6.0 / math.pi * math.asin(0.5 * normal)
    sines, probabilities = _sines(one, other)
    return float(6.0 / math.pi * np.sum(probabilities * np.arcsin(normal * sines)))


def normal_of_rank(wanted: float, one: MultivariateT | None = None, other: MultivariateT | None = None) -> float:
    """Find the correlation of the normals that gives a rank correlation; see `rank_correlation`.

    Raises `ValueError` when it cannot be reached; the message names the largest magnitude.
    """
    from scipy.optimize import brentq  # slow to import: a tenth of a second

    if one is None and other is None:
        return 2.0 * math.sin(math.pi * wanted / 6.0)
    largest = rank_correlation(1.0, one, other)
    if abs(abs(wanted) - largest) <= 1e-9:
        return math.copysign(1.0, wanted)
    if abs(wanted) > largest:
        raise ValueError(f"errors of these distributions can be rank-correlated up to {largest:.4f}; got {wanted:g}")
    root = float(brentq(lambda rho: rank_correlation(rho, one, other) - wanted, -1.0, 1.0, xtol=1e-15))
    if not abs(rank_correlation(root, one, other) - wanted) <= REACHED:
        raise NumericalError(f"normals correlated by {root:g} do not give two errors the correlation {wanted:g}")
    return root
