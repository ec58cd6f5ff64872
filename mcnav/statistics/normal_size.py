"""The law of the size ``|x|`` of a normal vector x ~ N(mean, covariance), as that of a velocity correction or a radius.

In principal axes ``|x|^2 = Q = sum lambda_j (z_j + b_j)^2``, a generalized chi-square variable. Its cumulants are known
(Imhof, *Biometrika* 48, 1961, 419)::

    K(s) = log E exp(s Q) = sum [lambda_j b_j^2 s / (1 - 2 lambda_j s) - 1/2 log(1 - 2 lambda_j s)]

and ``1 / (2 pi i) ∫ exp(K(s) - s q) / s ds`` is ``P(Q > q)`` along a path that crosses the real axis between zero and
the first pole, ``-P(Q <= q)`` along one that crosses it left of zero. The tail on q's side of the mean is integrated,
along a hyperbola through the saddle point c::

    s = c + w (i sinh v + t (cosh v - 1))        w^-2 = K''(c) + c^-2

With tilted variances and centres ``lambda' = lambda / (1 - 2 lambda c)``, ``m' = m / (1 - 2 lambda c)`` an axis adds
``2 lambda' m'^2 (s - c)^2 / (1 - 2 lambda' (s - c))`` to the exponent, whose real part is negative on every ray from c
that is at most 45 degrees from the upright: with slopes t below one the integrand is largest at c, whatever the shape
and the offset. So nothing cancels, and the trapezoidal rule in v, which takes scales of any ratio in equal steps,
converges geometrically. Rounding of q leaves ``1e-16 |b|`` of a probability.

A second hyperbola with other nodes must give the same; a quantile is also checked for order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.errors import NumericalError
from mcnav.statistics.bisection import root_between

NONE: Final = 1e-14
"""Variance of a principal axis, as a share of the largest, below which there is none."""

PATHS: Final = ((2.0**0.5 - 1.0, 16), (0.3, 20))
"""Slope t of a hyperbola and nodes of the trapezoidal rule in a unit of v: first route and second route.

Hyperbolas between 45 and 90 degrees from the real axis will do. The first one is amid them, so that the integrand is
analytic and bounded within a strip of half width pi / 8 in v: the rule's error is exp(-2 pi 16 pi / 8) = 7e-18.
"""

UNITS: Final = 5
"""Units of v in a block of nodes."""

BLOCKS: Final = 12
"""Largest number of blocks: their hyperbola reaches exp(60) times its width."""

NEGLIGIBLE: Final = -42.0
"""Exponent of the integrand below which it ends: 6e-19 of its largest value."""

AGREEMENT: Final = 1e-6
"""Largest difference of the two routes, as a share of the smaller tail: far above what rounding leaves."""

ROUNDING: Final = 1e-15
"""What rounding of squares leaves of a normal score, in the largest |b|."""

RADIUS: Final = 1e-13
"""Width of the last bracket of a quantile, as a share of the first one."""

WIDER: Final = 1e-9
"""Share by which the first bracket of a quantile is widened: what rounding of its ends may take."""

NEAR: Final = 0.01
"""Width of the last bracket of a saddle point, in its logarithm: the path need not be exactly there."""

LEAST: Final = 1e-300
"""Smallest probability that is told from zero."""

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
            raise self._refusal(f"size at the probability {probability:g}")
        return 0.5 * (ends[0] + ends[1])

    def _checked_tails(self, size: float) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond.

        Raises `NumericalError` where the two routes disagree.
        """
        tails = self._tails(size, 0)
        if math.isnan(self.fixed):
            return tails
        smaller = min(tails)
        difference = abs(smaller - min(self._tails(size, 1)))
        if not 0.0 <= smaller <= max(tails) <= 1.0 or not difference <= AGREEMENT * smaller:
            raise self._refusal(f"probability of {size:g}")
        return tails

    def _refusal(self, what: str) -> NumericalError:
        sigmas = ", ".join(f"{sigma:g}" for sigma in np.sqrt(self.variances))
        means = ", ".join(f"{centre:g}" for centre in self.centres)
        return NumericalError(
            f"two ways to compute the {what} of a vector with means {means} and sigmas {sigmas} along its principal "
            "axes disagree"
        )

    def _tails(self, size: float, path: int) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond, by one of the `PATHS`."""
        if math.isnan(self.fixed):
            return math.nan, math.nan
        square = (size - self.fixed) * (size + self.fixed)
        if not len(self.variances):
            return float(square > 0.0), float(square <= 0.0)
        if size <= 0.0 or square <= 0.0:
            return 0.0, 1.0
        if len(self.variances) == 1:
            return _interval(math.sqrt(square), abs(float(self.centres[0])), math.sqrt(float(self.variances[0])))
        below = square < float(np.sum(self.variances + self.centres**2))
        tail = _inverted(self.variances, self.centres, square, below, path)
        return (tail, 1.0 - tail) if below else (1.0 - tail, tail)


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


def _interval(half: float, centre: float, sigma: float) -> tuple[float, float]:
    """Return the probabilities that a normal variable lies within ``+-half``, and beyond."""
    near, far = (half - centre) / sigma, (half + centre) / sigma
    beyond = float(special.ndtr(-near) + special.ndtr(-far))
    if near < 0.0:
        return float(special.ndtr(near) - special.ndtr(-far)), beyond
    return 0.5 * float(special.erf(near / math.sqrt(2.0)) + special.erf(far / math.sqrt(2.0))), beyond


def _inverted(variances: Array, centres: Array, square: float, below: bool, path: int) -> float:
    """Return ``P(Q <= square)``, for one below the mean, or ``P(Q > square)``, by one of the `PATHS`."""
    saddle, left = _saddle(variances, centres, square, below)
    tilted, squares = variances / left, (centres / left) ** 2
    residual = square - float(np.sum(squares + tilted))
    width = 1.0 / math.sqrt(float(np.sum(2.0 * tilted * (tilted + 2.0 * squares))) + saddle**-2)
    height = -saddle * (square - float(np.sum(squares)))
    height -= float(np.sum(2.0 * variances * squares) * saddle**2 + 0.5 * np.sum(np.log(left)))
    if height < math.log(LEAST):
        return 0.0  # Chernoff's bound
    nodes, total = PATHS[path][1], 0.0
    for block in range(BLOCKS):
        along, moving = _hyperbola(path, block)
        moved = width * along
        u = 2.0 * np.multiply.outer(tilted, moved)
        exponent = (squares @ (u / (1.0 - u)) - residual) * moved - 0.5 * (np.log1p(-u) + u).sum(axis=0)
        terms = (np.exp(exponent) * width * moving / (saddle + moved)).imag
        total += float(terms.sum()) - (0.5 * float(terms[0]) if block == 0 else 0.0)
        if exponent.real[-nodes:].max() < NEGLIGIBLE:
            break
    return math.exp(height) * (-total if below else total) / (math.pi * nodes)


@cache
def _hyperbola(path: int, block: int) -> tuple[Array, Array]:
    """Return ``i sinh v + t (cosh v - 1)`` and its derivative in a block of one of the `PATHS`, shape (n,), complex."""
    slope, nodes = PATHS[path]
    v = np.arange(block * UNITS * nodes, (block + 1) * UNITS * nodes) / nodes
    return 1j * np.sinh(v) + slope * (np.cosh(v) - 1.0), 1j * np.cosh(v) + slope * np.sinh(v)


def _saddle(variances: Array, centres: Array, square: float, below: bool) -> tuple[float, Array]:
    """Find the saddle point c of ``K(s) - s q - log|s|``, and return it with ``1 - 2 lambda c``.

    It is looked for as ``c = -x``, or as ``c = x / (1 + 2 lambda x)`` with the largest variance, in log x.
    """
    greatest = float(variances[-1])
    doubled, weights = 2.0 * (variances if below else greatest - variances), centres**2

    def at(logarithm: float) -> tuple[float, Array]:
        x = math.exp(logarithm)
        if below:
            return -x, 1.0 + doubled * x
        stretched = 1.0 + 2.0 * greatest * x
        return x / stretched, (1.0 + doubled * x) / stretched

    def slope(logarithm: float) -> float:
        """Return the derivative there, which rises with x: its sign is turned left of zero."""
        saddle, left = at(logarithm)
        value = float((weights / left + variances) @ (1.0 / left)) - square - 1.0 / saddle
        return -value if below else value

    # by the law of a normal variable with the mean and variance of Q, and from there on both sides
    begin = -0.5 * math.log(float(2.0 * variances @ (variances + 2.0 * weights)))
    low, at_low = begin, slope(begin)
    while at_low > 0.0:
        low, at_low = low - 2.0, slope(low - 2.0)
    high, at_high = low, at_low
    while at_high <= 0.0:
        low, at_low, high, at_high = high, at_high, high + 2.0, slope(high + 2.0)
    ends = root_between(slope, (low, at_low), (high, at_high), NEAR)
    return at(0.5 * (ends[0] + ends[1]))
