"""The law of the size ``|x|`` of a normal vector x ~ N(mean, covariance), as that of a velocity correction or a radius.

In principal axes ``|x|^2 = sum lambda_j (z_j + b_j)^2``, a generalized chi-square variable, whose tails
`mcnav.statistics.generalized_chi_square` integrates along a hyperbola. A second hyperbola with other nodes must give
the same; a quantile is also checked for order.
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
from mcnav.statistics.bisection import root_between
from mcnav.statistics.generalized_chi_square import LEAST, tail

NONE: Final = 1e-14
"""Variance of a principal axis, as a share of the largest, below which there is none."""

ROUGH: Final = 2
"""Path to search along."""

AGREEMENT: Final = 1e-6
"""Largest difference of the two routes, as a share of the smaller tail: far above what rounding leaves."""

ROUNDING: Final = 1e-15
"""What rounding of squares leaves of a normal score, in the largest |b|."""

RADIUS: Final = 1e-13
"""Width of the last bracket of a quantile, as a share of the first one."""

WIDER: Final = 1e-9
"""Share by which the first bracket of a quantile is widened: what rounding of its ends may take."""

MEAN_STEP: Final = 0.05
"""Step of the trapezoidal rule for the mean, in log t."""


@dataclass(frozen=True)
class NormalSize:
    """Distribution of the size of a normal vector.

    Attributes
    ----------
    variances, centres : ndarray, shape (k,)
        Along the principal axes in which it varies, in rising order: lambda_j, and means.
    fixed : float
        Size of what the other axes add; NaN where mean or covariance is not finite.
    """

    variances: Array
    centres: Array
    fixed: float

    @classmethod
    def of(cls, mean: Array, covariance: Array) -> NormalSize:
        """Return that of a mean, shape (n,), and a covariance, shape (n, n), which may be singular.

        >>> law = NormalSize.of(np.zeros(3), np.eye(3))
        >>> round(law.mean, 9), round(law.quantile(0.5), 9)  # chi of three degrees of freedom: sqrt(8 / pi)
        (1.595769122, 1.538172254)
        >>> round(NormalSize.of(np.array([3.0, 4.0]), np.zeros((2, 2))).quantile(0.9973), 9)
        5.0
        >>> burn = NormalSize.of(np.array([0.0, 5.0]), np.diag([1.0001, 0.0101]))
        >>> round(burn.quantile(0.5), 4), round(burn.quantile(0.9973), 4)
        (5.0737, 5.8562)
        """
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            return cls(np.zeros(0), np.zeros(0), math.nan)
        values, vectors = np.linalg.eigh(covariance)
        along, moves = vectors.T @ mean, values > NONE * max(float(values[-1]), 0.0)
        return cls(values[moves], along[moves], float(np.linalg.norm(along[~moves])))

    @property
    def mean_square(self) -> float:
        """The mean of the square."""
        return self.fixed**2 + float(np.sum(self.variances + self.centres**2))

    @property
    def mean(self) -> float:
        """The mean."""
        return math.sqrt(self.mean_square) - self._shortfall

    @property
    def variance(self) -> float:
        """The variance.

        >>> round(NormalSize.of(np.zeros(2), np.eye(2)).variance, 9)  # Rayleigh: 2 - pi / 2
        0.429203673
        """
        return self._shortfall * (2.0 * math.sqrt(self.mean_square) - self._shortfall)

    @property
    def _shortfall(self) -> float:
        """Root mean square less mean: ``1 / (2 sqrt(pi)) ∫ (exp K(-t) - exp(-t E Q)) t^(-3/2) dt``."""
        if not len(self.variances):
            return 0.0
        t = np.exp(MEAN_STEP * np.arange(-1_600, 1_601)) / self.mean_square
        doubled, shifts = 2.0 * np.multiply.outer(t, self.variances), np.multiply.outer(t, self.centres**2)
        logarithms = np.log1p(doubled)
        cumulant = -t * self.fixed**2 - np.sum(shifts / (1.0 + doubled) + 0.5 * logarithms, axis=-1)
        above = np.sum(shifts * doubled / (1.0 + doubled) + 0.5 * (doubled - logarithms), axis=-1)
        terms = -np.exp(cumulant) * np.expm1(-above) / np.sqrt(t)
        return float(MEAN_STEP * np.sum(terms) / (2.0 * math.sqrt(math.pi)))

    def probability(self, size: float) -> float:
        """Return the probability of a size up to this one.

        >>> law = NormalSize.of(np.array([3.0, 0.0]), np.eye(2))
        >>> round(law.probability(4.0), 9)  # Rice, by scipy.stats.ncx2.cdf(16, 2, 9)
        0.803487811
        """
        return self._checked_tails(size)[0]

    def beyond(self, size: float) -> float:
        """Return the probability of a size beyond this one, however small.

        >>> round(NormalSize.of(np.zeros(2), np.eye(2)).beyond(5.0) * 1e6, 5)  # exp(-12.5)
        3.72665
        """
        return self._checked_tails(size)[1]

    def quantile(self, probability: float) -> float:
        """Return the size that is not exceeded with a probability; raises `NumericalError` where it cannot be trusted.

        The size is at most that of the mean and of what an isotropic vector of the largest variance adds with the
        probability, and at least the difference of such sizes.
        """
        if not len(self.variances):
            return self.fixed
        greatest, half = math.sqrt(float(self.variances[-1])), 0.5 * len(self.variances)
        offset = math.hypot(self.fixed, float(np.linalg.norm(self.centres)))
        reach, back = (greatest * _chi(half, *tails) for tails in (
            (probability, 1.0 - probability), (1.0 - probability, probability)
        ))  # fmt: skip
        wanted = _score(probability, 1.0 - probability)

        def score(size: float, path: int = 0) -> float:
            return _score(*self._tails(size, path)) - wanted

        low, high = max(self.fixed, offset - back) * (1.0 - WIDER), (offset + reach) * (1.0 + WIDER)
        rounding = AGREEMENT + ROUNDING * float(np.max(np.abs(self.centres) / np.sqrt(self.variances)))
        ends = root_between(score, (low, score(low)), (high, score(high)), RADIUS * (high - low), rounding)
        if score(ends[0], 1) > rounding or score(ends[1], 1) < -rounding:
            raise _refusal(f"size at the probability {probability:g}", self.variances, self.centres)
        return 0.5 * (ends[0] + ends[1])

    def _checked_tails(self, size: float) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond.

        Raises `NumericalError` where the two routes disagree.
        """
        tails = self._tails(size, 0)
        if math.isnan(self.fixed):
            return tails
        if not _agree(np.array(tails), np.array(self._tails(size, 1))):
            raise _refusal(f"probability of {size:g}", self.variances, self.centres)
        return tails

    def _tails(self, size: float, path: int) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond, along one of the paths."""
        if math.isnan(self.fixed):
            return math.nan, math.nan
        within, beyond = _tails(self.variances, self.centres[None], np.array([self.fixed]), size, path)
        return float(within[0]), float(beyond[0])


@lru_cache(maxsize=1024)
def _remembered_quantile(mean: tuple[float, ...], elements: tuple[float, ...], probability: float) -> float:
    covariance = np.array(elements).reshape(len(mean), -1)
    return NormalSize.of(np.array(mean), covariance).quantile(probability)


def size_quantile(mean: Array, covariance: Array, probability: float) -> float:
    """Return the distance from zero that a normal variable of any number of dimensions does not exceed: CEP, R95, SEP.

    Quantiles are remembered: a report asks for the same ones in several places.

    >>> round(size_quantile(np.zeros(2), np.eye(2), 0.5), 6)  # CEP: sqrt(2 ln 2)
    1.17741
    >>> round(size_quantile(np.zeros(1), np.eye(1), 0.9973), 3)
    3.0
    """
    return _remembered_quantile(tuple(mean.tolist()), tuple(covariance.ravel().tolist()), probability)


def _chi(half: float, within: float, beyond: float) -> float:
    """Return the quantile of a chi variable of ``2 half`` degrees of freedom with these probabilities on its sides."""
    if within < beyond:
        return math.sqrt(2.0 * float(special.gammaincinv(half, within)))
    return math.sqrt(2.0 * float(special.gammainccinv(half, beyond)))


def _score(within: float, beyond: float) -> float:
    """Return the standard normal variable with these probabilities below and above, by the smaller of them."""
    smaller = float(special.ndtri(max(min(within, beyond), LEAST)))
    return smaller if within < beyond else -smaller


def probabilities_within(size: float, means: Array, covariance: Array, rough: bool = False) -> Array:
    """Return the probabilities of sizes up to this one of n vectors with one covariance, shape (n,).

    Raises `NumericalError` where the two routes disagree.

    Parameters
    ----------
    means, covariance : ndarray, shapes (n, k), (k, k)
    rough : bool
        To 1e-6, unchecked and in a sixth of the time: to search with.

    >>> probabilities_within(4.0, np.array([[3.0, 0.0], [0.0, 3.0], [0.0, 0.0]]), np.eye(2)).round(9)
    array([0.80348781, 0.80348781, 0.99966454])
    """
    values, vectors = np.linalg.eigh(covariance)
    along, moves = means @ vectors, values > NONE * max(float(values[-1]), 0.0)
    variances, centres, fixed = values[moves], along[:, moves], np.linalg.norm(along[:, ~moves], axis=1)
    if rough:
        return _tails(variances, centres, fixed, size, ROUGH)[0]
    tails, others = (np.array(_tails(variances, centres, fixed, size, path)) for path in (0, 1))
    if not _agree(tails, others):
        apart = int(np.argmax(np.abs(tails - others).max(axis=0)))
        raise _refusal(f"probability of {size:g}", variances, centres[apart])
    return np.asarray(tails[0])


def _agree(tails: Array, others: Array) -> bool:
    """Return whether two routes give the same tails, shape (2, ...), and these are probabilities."""
    smaller = tails.min(axis=0)
    agree = np.abs(smaller - others.min(axis=0)) <= AGREEMENT * smaller
    return bool(np.all(agree & (smaller >= 0.0) & (tails.max(axis=0) <= 1.0)))


def _refusal(what: str, variances: Array, centres: Array) -> NumericalError:
    sigmas = ", ".join(f"{sigma:g}" for sigma in np.sqrt(variances))
    means = ", ".join(f"{centre:g}" for centre in centres)
    return NumericalError(
        f"two ways to compute the {what} of a vector with means {means} and sigmas {sigmas} along its principal "
        "axes disagree"
    )


def _tails(variances: Array, centres: Array, fixed: Array, size: float, path: int) -> tuple[Array, Array]:
    """Return the probabilities of sizes up to this one, and beyond, along one of the paths; shapes (n,).

    Parameters
    ----------
    variances, centres, fixed : ndarray, shapes (k,), (n, k), (n,)
        As in `NormalSize`, of n vectors.
    """
    squares = (size - fixed) * (size + fixed)
    possible = (size > 0.0) & (squares > 0.0)
    if not len(variances):
        within = (squares > 0.0).astype(float)
        return within, 1.0 - within
    if len(variances) == 1:
        halves = np.sqrt(np.maximum(squares, 0.0))
        within, beyond = _interval(halves, np.abs(centres[:, 0]), math.sqrt(float(variances[0])))
        return np.where(possible, within, 0.0), np.where(possible, beyond, 1.0)
    within, beyond = np.zeros(len(squares)), np.ones(len(squares))
    low = squares < variances.sum() + (centres**2).sum(axis=1)
    for below, smaller, larger in ((True, within, beyond), (False, beyond, within)):
        rows = np.flatnonzero(possible & (low == below))
        smaller[rows] = tail(variances, centres[rows], squares[rows], below, path)
        larger[rows] = 1.0 - smaller[rows]
    return within, beyond


def _interval(halves: Array, centres: Array, sigma: float) -> tuple[Array, Array]:
    """Return the probabilities that normal variables lie within ``+-half``, and beyond."""
    near, far = (halves - centres) / sigma, (halves + centres) / sigma
    beyond = special.ndtr(-near) + special.ndtr(-far)
    outside = special.ndtr(near) - special.ndtr(-far)
    inside = 0.5 * (special.erf(near / math.sqrt(2.0)) + special.erf(far / math.sqrt(2.0)))
    return np.where(near < 0.0, outside, inside), np.asarray(beyond)
