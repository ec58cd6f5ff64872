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

from mcnav.arrays.types import Array
from mcnav.errors import NumericalError
from mcnav.statistics.refusals import note_refusal
from mcnav.statistics.size_search import SizeSearch
from mcnav.statistics.size_tails import NONE, agree, principal_axes, refuse, size_tails

ROUGH: Final = 2
"""Path to search along."""

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
        ((_, variances, centres, fixed),) = principal_axes(mean[None], covariance[None])
        return cls(variances[0], centres[0], float(fixed[0]))

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
        search = SizeSearch(self.variances[None], self.centres[None], np.array([self.fixed]), np.array([probability]))
        (quantile,) = search.quantiles()
        if isinstance(quantile, NumericalError):
            raise quantile
        return quantile

    def _checked_tails(self, size: float) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond.

        Raises `NumericalError` where the two routes disagree.
        """
        tails = self._tails(size, 0)
        if math.isnan(self.fixed):
            return tails
        if not agree(np.array(tails), np.array(self._tails(size, 1))):
            raise refuse(f"probability of {size:g}", self.variances, self.centres)
        return tails

    def _tails(self, size: float, path: int) -> tuple[float, float]:
        """Return the probabilities of sizes up to this one, and beyond, along one of the paths."""
        if math.isnan(self.fixed):
            return math.nan, math.nan
        within, beyond = size_tails(self.variances, self.centres[None], np.array([self.fixed]), size, path)
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


def size_quantiles(
    means: Array, covariances: Array, probabilities: float | Array, instead: float | None = None
) -> Array:
    """Return the same of n normal variables, shape (n,), which are searched for together.

    Parameters
    ----------
    means, covariances : ndarray, shapes (n, k), (n, k, k)
    probabilities : float or ndarray, shape (n,)
    instead : float, optional
        What stands for a quantile that its check refuses, of which a note says why. Without it the first refusal is
        raised, a `NumericalError`.

    >>> size_quantiles(np.zeros((2, 2)), np.array([np.eye(2), np.diag([1.0, 0.0])]), 0.5).round(6)
    array([1.17741, 0.67449])
    """
    quantiles, wanted = np.zeros(len(means)), np.broadcast_to(probabilities, len(means))
    for rows, variances, centres, fixed in principal_axes(means, covariances):
        search = SizeSearch(variances, centres, fixed, wanted[rows])
        sizes = search.quantiles() if variances.shape[1] else fixed
        for row, size in zip(rows, sizes, strict=True):
            if not isinstance(size, NumericalError):
                quantiles[row] = size
            elif instead is None:
                raise size
            else:
                note_refusal(size)
                quantiles[row] = instead
    return quantiles


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
        return size_tails(variances, centres, fixed, size, ROUGH)[0]
    tails, others = (np.array(size_tails(variances, centres, fixed, size, path)) for path in (0, 1))
    if not (equal := agree(tails, others)).all():
        apart = int(np.argmin(equal))
        raise refuse(f"probability of {size:g}", variances, centres[apart])
    return np.asarray(tails[0])
