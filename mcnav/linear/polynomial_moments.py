"""Moments of a polynomial of normal variables in closed form.

For independent standard normal u the expectation of a monomial ``prod u_j^e_j`` is ``prod (e_j - 1)!!`` when every e_j
is even, and zero otherwise. Powers of a polynomial are polynomials again, so that mean, covariance, skewness and
kurtosis are sums over pairs of monomials, of which only those with the same parity in every variable contribute.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.linear.polynomial import PolynomialMap, least_squares, monomials, products

HIGHEST_POWER: Final = 16
"""Four times the highest order of a polynomial map."""

NEGLIGIBLE: Final = 1e-12
"""Coefficients below this share of the largest are rounding."""

DOUBLE_FACTORIALS: Final = np.array(
    [float(np.prod(np.arange(e - 1, 0, -2, dtype=float))) if e % 2 == 0 else 0.0 for e in range(HIGHEST_POWER + 1)]
)
"""``(e - 1)!!`` for even e, the moments of a standard normal variable; zero for odd e."""


@dataclass(frozen=True)
class Moments:
    """Moments of the outputs for normal sources, shape (outputs,); covariance (outputs, outputs).

    The kurtosis of a normal distribution is 3; skewness and kurtosis are NaN for an output without dispersion.
    """

    mean: Array
    covariance: Array
    skewness: Array
    kurtosis: Array


def moments(polynomial: PolynomialMap, covariance: Array) -> Moments:
    """Compute mean, covariance, skewness and kurtosis of a polynomial's outputs for normal sources.

    The polynomial's centre is the mean of the sources, and the covariance is theirs, SI.

    The square of a standard normal variable has mean 1, variance 2, skewness sqrt(8) and kurtosis 15:

    >>> square = PolynomialMap(2, np.zeros(1), np.ones(1), np.array([[0], [1], [2]]), np.array([[0.0], [0.0], [1.0]]),
    ...                        0.0, 0, 0.0)
    >>> found = moments(square, np.eye(1))
    >>> [round(float(x), 6) for x in (found.mean[0], found.covariance[0, 0], found.skewness[0], found.kurtosis[0])]
    [1.0, 2.0, 2.828427, 15.0]
    """
    exponents, coefficients = _in_independent(polynomial, covariance)
    mean = np.array([_expected(exponents, column) for column in coefficients.T])
    centred = coefficients.copy()
    centred[0] -= mean
    count = centred.shape[1]
    result = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            result[i, j] = result[j, i] = _expected_product(exponents, centred[:, i], exponents, centred[:, j])
    skewness, kurtosis = np.full(count, np.nan), np.full(count, np.nan)
    for i in np.flatnonzero(np.diag(result) > 0.0).tolist():
        squared, values = _squared(exponents, centred[:, i])
        skewness[i] = _expected_product(squared, values, exponents, centred[:, i]) / result[i, i] ** 1.5
        kurtosis[i] = _expected_product(squared, values, squared, values) / result[i, i] ** 2
    return Moments(mean, result, skewness, kurtosis)


def _in_independent(polynomial: PolynomialMap, covariance: Array) -> tuple[IndexArray, Array]:
    """Transform the polynomial to independent standard normal variables.

    A polynomial stays one of its order under a linear change of variables: values at a few points determine the new
    coefficients to rounding.
    """
    sigma = np.sqrt(np.diag(covariance))
    active = np.flatnonzero(sigma > 0.0)
    scale = np.where(polynomial.scale > 0.0, polynomial.scale, 1.0)
    if np.array_equal(covariance, np.diag(np.diag(covariance))):
        stretched = polynomial.coefficients * ((sigma / scale) ** polynomial.exponents).prod(axis=1)[:, None]
        return polynomial.exponents, stretched
    values, vectors = np.linalg.eigh(covariance[np.ix_(active, active)] / np.outer(scale[active], scale[active]))
    factor = np.zeros((len(scale), len(active)))
    factor[active] = vectors * np.sqrt(np.maximum(values, 0.0))
    exponents = monomials(np.arange(len(active)), len(active), polynomial.order)
    points = np.random.Generator(np.random.Philox(1)).standard_normal((2 * len(exponents) + 8, len(active)))
    outcomes = products(points @ factor.T, polynomial.exponents) @ polynomial.coefficients
    coefficients = least_squares(products(points, exponents), outcomes)
    coefficients[np.abs(coefficients) <= NEGLIGIBLE * np.abs(coefficients).max(axis=0)] = 0.0
    needed = np.asarray(coefficients.any(axis=1))
    needed[0] = True
    return exponents[needed], coefficients[needed]


def _expected(exponents: IndexArray, coefficients: Array) -> float:
    return float((coefficients * DOUBLE_FACTORIALS[exponents].prod(axis=1)).sum())


def _squared(exponents: IndexArray, coefficients: Array) -> tuple[IndexArray, Array]:
    """Square a polynomial and collect equal monomials."""
    base = 2 * int(exponents.max(initial=0)) + 1
    if float(base) ** exponents.shape[1] < np.iinfo(np.int64).max:
        keys = exponents @ base ** np.arange(exponents.shape[1], dtype=np.int64)
        _, first, place = np.unique(np.add.outer(keys, keys), return_index=True, return_inverse=True)
        unique = exponents[first // len(exponents)] + exponents[first % len(exponents)]
    else:
        pairs = (exponents[:, None, :] + exponents[None, :, :]).reshape(-1, exponents.shape[1])
        unique, place = np.unique(pairs, axis=0, return_inverse=True)
    weights = np.outer(coefficients, coefficients).ravel()
    return unique, np.asarray(np.bincount(place.ravel(), weights=weights, minlength=len(unique)), dtype=float)


def _expected_product(exponents: IndexArray, coefficients: Array, others: IndexArray, their: Array) -> float:
    """Compute E[p q] of two polynomials given by their monomials."""
    weights = 1 << np.arange(exponents.shape[1], dtype=np.int64)
    parity, other_parity = (exponents % 2) @ weights, (others % 2) @ weights
    order, other_order = np.argsort(parity, kind="stable"), np.argsort(other_parity, kind="stable")
    keys = np.unique(parity)
    bounds = [
        np.searchsorted(ranked, keys, side)
        for ranked in (parity[order], other_parity[other_order])
        for side in ("left", "right")
    ]
    return _sum_over_pairs(
        exponents[order], coefficients[order], others[other_order], their[other_order], np.array(bounds).T,
        DOUBLE_FACTORIALS,
    )  # fmt: skip


@compiled
def _sum_over_pairs(
    exponents: IndexArray, coefficients: Array, others: IndexArray, their: Array, groups: IndexArray, table: Array
) -> float:
    """Add up the products of monomials in each group, [begin, end) of either polynomial."""
    total = 0.0
    for group in range(groups.shape[0]):
        begin, end, other_begin, other_end = groups[group]
        of_group = 0.0
        for i in range(begin, end):
            for j in range(other_begin, other_end):
                value = coefficients[i] * their[j]
                for variable in range(exponents.shape[1]):
                    value *= table[exponents[i, variable] + others[j, variable]]
                of_group += value
        total += of_group
    return total
