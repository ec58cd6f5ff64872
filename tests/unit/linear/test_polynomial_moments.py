"""Moments of polynomials of normal variables: closed forms that are known, and sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from mcnav.linear.polynomial import PolynomialMap, monomials
from mcnav.linear.polynomial_moments import moments


def _polynomial(coefficients: dict[tuple[int, ...], tuple[float, ...]], scale: list[float]) -> PolynomialMap:
    exponents = np.array(list(coefficients), dtype=np.int64)
    order = int(exponents.sum(axis=1).max())
    values = np.array(list(coefficients.values()))
    return PolynomialMap(order, np.zeros(len(scale)), np.array(scale), exponents, values, 0.0, 0, np.inf)


@pytest.mark.parametrize("degrees", [1, 3, 6])
def test_chi_square(degrees: int) -> None:
    """A sum of squares of standard normals: the textbook's mean, variance, skewness and kurtosis."""
    squares = {tuple(2 * row): (1.0,) for row in np.eye(degrees, dtype=int).tolist() for row in [np.array(row)]}
    zero = tuple([0] * degrees)
    polynomial = _polynomial({zero: (0.0,), **squares}, [1.0] * degrees)
    found = moments(polynomial, np.eye(degrees))
    mean, variance, skewness, excess = (float(value) for value in chi2.stats(degrees, moments="mvsk"))
    assert found.mean[0] == pytest.approx(mean, rel=1e-14)
    assert found.covariance[0, 0] == pytest.approx(variance, rel=1e-13)
    assert found.skewness[0] == pytest.approx(skewness, rel=1e-13)
    assert found.kurtosis[0] == pytest.approx(3.0 + excess, rel=1e-13)


@pytest.mark.parametrize("correlation", [-0.6, 0.0, 0.9, 1.0])
def test_product_of_correlated_normals(correlation: float) -> None:
    """x y with variances 4 and 9: mean rho a b, variance (1 + rho^2) a^2 b^2, third cumulant (6 rho + 2 rho^3) a^3 b^3.

    Kurtosis from the fourth cumulant, 6 (1 + 6 rho^2 + rho^4) a^4 b^4.
    """
    polynomial = _polynomial(
        {(0, 0): (0.0,), (1, 0): (0.0,), (0, 1): (0.0,), (1, 1): (6.0,)}, [2.0, 3.0]
    )  # in standard deviations
    r = correlation
    found = moments(polynomial, np.array([[4.0, 6.0 * r], [6.0 * r, 9.0]]))
    assert found.mean[0] == pytest.approx(6.0 * r, abs=1e-11)
    assert found.covariance[0, 0] == pytest.approx(36.0 * (1.0 + r**2), rel=1e-11)
    assert found.skewness[0] == pytest.approx((6.0 * r + 2.0 * r**3) / (1.0 + r**2) ** 1.5, abs=1e-10)
    assert found.kurtosis[0] == pytest.approx(3.0 + 6.0 * (1.0 + 6.0 * r**2 + r**4) / (1.0 + r**2) ** 2, rel=1e-10)


def test_a_linear_polynomial_is_normal() -> None:
    """P S P^T, no skewness, kurtosis 3; an output without dispersion has neither."""
    polynomial = _polynomial({(0, 0): (1.0, 5.0), (1, 0): (2.0, 0.0), (0, 1): (-1.0, 0.0)}, [0.5, 2.0])
    covariance = np.array([[0.25, 0.3], [0.3, 4.0]])
    found = moments(polynomial, covariance)
    partials = np.array([4.0, -0.5])
    assert found.mean == pytest.approx([1.0, 5.0], rel=1e-12)
    assert found.covariance[0, 0] == pytest.approx(partials @ covariance @ partials, rel=1e-12)
    assert (found.skewness[0], found.kurtosis[0]) == pytest.approx((0.0, 3.0), abs=1e-10)
    assert np.isnan(found.skewness[1])


def test_against_sampling() -> None:
    """A random cubic of three correlated sources: within 4.5 standard errors in each of eleven moments.

    The errors are those of blocks of the sample itself; 4.5 of them, 11 times, give a false alarm once in 13,000.
    """
    generator = np.random.default_rng(1963)
    exponents = monomials(np.arange(3), 3, 3)
    weights = generator.standard_normal((len(exponents), 2)) * 0.3 ** np.maximum(exponents.sum(axis=1) - 1, 0)[:, None]
    covariance = np.array([[1.0, 0.4, 0.0], [0.4, 2.0, -0.5], [0.0, -0.5, 0.5]])
    scale = np.sqrt(np.diag(covariance))
    polynomial = PolynomialMap(3, np.array([1.0, 0.0, -2.0]), scale, exponents, weights, 0.0, 0, np.inf)
    found = moments(polynomial, covariance)
    drawn = polynomial.centre + generator.standard_normal((400_000, 3)) @ np.linalg.cholesky(covariance).T
    values, _ = polynomial(drawn)
    y = (values - found.mean) / np.sqrt(np.diag(found.covariance))
    correlation = found.covariance[0, 1] / np.sqrt(np.prod(np.diag(found.covariance)))
    expected = [(y[:, i] ** power, moment) for i in range(2) for power, moment in (
        (1, 0.0), (2, 1.0), (3, found.skewness[i]), (4, found.kurtosis[i]))]  # fmt: skip
    expected.append((y[:, 0] * y[:, 1], correlation))
    for sample, moment in expected:
        error = sample.std() / np.sqrt(len(sample))
        assert abs(sample.mean() - moment) < 4.5 * error
