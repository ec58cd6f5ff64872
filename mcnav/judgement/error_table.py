"""Consistency of somebody else's filter, from a table of its errors, sigmas and innovations alone.

Neighbouring values of one record are correlated, so that a mean square of n of them is as uncertain as one of fewer.
Of a normal process of mean zero with autocorrelations rho_k, the mean of n squares has the variance of a mean of nu
independent ones (Priestley 1981, *Spectral Analysis and Time Series*, section 5.3)::

    nu = n / (1 + 2 sum rho_k^2)

rho is that of an autoregression fitted by Burg's method with the order that Akaike's criterion chooses. The mean square
of normalized errors times nu is compared with chi-square of nu degrees of freedom. What is assumed: normal errors of
mean zero, normalized by their sigmas stationary, and a record of several correlation times. The rates of false alarms
are measured: see the documentation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import stats

from mcnav.arrays.types import Array

MOST_ORDER: Final = 12
"""Largest order of the autoregression; at most an eighth of the number of values."""

FREQUENCIES: Final = 8192
"""Points of the grid on which spectral densities are summed."""

TINY: Final = 1e-300
"""Least variance whose logarithm is taken."""

FEWEST: Final = 20
"""Values below which nothing is said."""

FEWEST_INDEPENDENT: Final = 10.0
"""Effective number of values of each component below which nothing is said."""


@dataclass(frozen=True)
class RatioTest:
    """Test of the ratio of true to stated variance.

    Attributes
    ----------
    ratio : float
        Mean normalized square, over the number of components.
    low, high : float
        95 % interval of it.
    p_value : float
        Two-sided, that the ratio is one.
    values : int
    effective : float
        Number of independent values with the same uncertainty.
    """

    ratio: float
    low: float
    high: float
    p_value: float
    values: int
    effective: float

    @property
    def factor(self) -> tuple[float, float, float]:
        """Factor of the stated sigma, and its interval."""
        return float(np.sqrt(self.ratio)), float(np.sqrt(max(self.low, 0.0))), float(np.sqrt(self.high))


@dataclass(frozen=True)
class Whiteness:
    """Test of the whiteness of normalized innovations: the first autocorrelation, and Ljung and Box's p-value."""

    autocorrelation: float
    p_value: float
    lags: int


def autoregression(values: Array) -> tuple[Array, float]:
    """Fit an autoregression of mean zero by Burg's method; return its coefficients and the variance of its noise.

    The order is the one with the least ``n log variance + 2 order``.

    >>> coefficients, variance = autoregression(np.random.default_rng(1).standard_normal(1000))
    >>> len(coefficients), round(variance, 1)
    (0, 1.0)
    """
    forward, backward = values.copy(), values.copy()
    variance = float(np.mean(values**2))
    coefficients = np.zeros(0)
    best, least = (coefficients, variance), len(values) * np.log(max(variance, TINY))
    for order in range(1, min(MOST_ORDER, len(values) // 8) + 1):
        ahead, behind = forward[1:], backward[:-1]
        power = float(ahead @ ahead + behind @ behind)
        if power <= 0.0 or variance <= 0.0:
            break
        reflection = 2.0 * float(ahead @ behind) / power
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
        variance *= 1.0 - reflection**2
        forward, backward = ahead - reflection * behind, behind - reflection * ahead
        criterion = len(values) * np.log(max(variance, TINY)) + 2.0 * order
        if criterion < least:
            best, least = (coefficients, variance), criterion
    return best


def effective_number(values: Array) -> float:
    """Return the number of independent values whose mean square is as uncertain; at most the number of values.

    ``1 + 2 sum rho_k^2`` is the mean square of the spectral density over the square of its mean.
    """
    coefficients, _ = autoregression(values)
    grid = np.fft.rfft(np.concatenate([[1.0], -coefficients]), FREQUENCIES)
    weights = np.full(len(grid), 2.0)
    weights[[0, -1]] = 1.0
    density = 1.0 / np.maximum(np.abs(grid) ** 2, 1e-12)
    share = float(np.sum(weights * density**2)) * float(np.sum(weights)) / float(np.sum(weights * density)) ** 2
    return float(len(values) / max(share, 1.0))


def judge_size(normalized: Array) -> RatioTest | None:
    """Test that normalized values, shape (n, k), have the mean square one; the k are independent of each other.

    None where there are too few independent values. The interval is that of the ratio of variances.
    """
    known = normalized[np.all(np.isfinite(normalized), axis=1)]
    if len(known) < FEWEST:
        return None
    effective = float(sum(effective_number(column) for column in known.T))
    if effective < FEWEST_INDEPENDENT * known.shape[1]:
        return None
    ratio = float(np.mean(known**2))
    below, above = (float(part(ratio * effective, effective)) for part in (stats.chi2.cdf, stats.chi2.sf))
    low, high = (ratio * effective / float(stats.chi2.ppf(share, effective)) for share in (0.975, 0.025))
    return RatioTest(ratio, low, high, min(1.0, 2.0 * min(below, above)), len(known), effective)


def whiteness(normalized: Array) -> Whiteness | None:
    """Test normalized innovations, shape (n,), for whiteness."""
    known = normalized[np.isfinite(normalized)]
    count = len(known)
    if count < FEWEST:
        return None
    lags = int(min(10, count // 5))
    power = float(known @ known)
    correlations = np.array([float(known[lag:] @ known[:-lag]) / power for lag in range(1, lags + 1)])
    box = count * (count + 2.0) * float(np.sum(correlations**2 / (count - np.arange(1, lags + 1))))
    return Whiteness(float(correlations[0]), float(stats.chi2.sf(box, lags)), lags)


@dataclass(frozen=True)
class ErrorTable:
    """Errors and innovations of a filter over time, in any unit.

    Attributes
    ----------
    times : ndarray, shape (n,)
    errors : mapping of str to (ndarray, ndarray)
        Values and stated sigmas, shape (n,) each.
    groups : mapping of str to (tuple of str, ndarray)
        Names of errors with a stated covariance, and it, shape (n, k, k).
    innovations : mapping of str to (ndarray, ndarray)
        Values and stated sigmas, shape (n,) each.
    """

    times: Array
    errors: Mapping[str, tuple[Array, Array]]
    groups: Mapping[str, tuple[tuple[str, ...], Array]]
    innovations: Mapping[str, tuple[Array, Array]]


@dataclass(frozen=True)
class ErrorVerdict:
    """Tests of a quantity: of its size, and, of an innovation, of its whiteness. ``kind``: NEES or NIS."""

    name: str
    kind: str
    size: RatioTest | None
    whiteness: Whiteness | None


def judge_errors(table: ErrorTable) -> tuple[ErrorVerdict, ...]:
    """Test each error, each group of errors with a covariance, and each innovation."""
    verdicts = []
    for name, (values, sigmas) in table.errors.items():
        verdicts.append(ErrorVerdict(name, "NEES", judge_size((values / sigmas)[:, None]), None))
    for name, (members, covariances) in table.groups.items():
        values = np.stack([table.errors[member][0] for member in members], axis=1)
        whitened = np.linalg.solve(np.linalg.cholesky(covariances), values[:, :, None])[:, :, 0]
        verdicts.append(ErrorVerdict(name, "NEES", judge_size(whitened), None))
    for name, (values, sigmas) in table.innovations.items():
        normalized = values / sigmas
        verdicts.append(ErrorVerdict(name, "NIS", judge_size(normalized[:, None]), whiteness(normalized)))
    return tuple(verdicts)
