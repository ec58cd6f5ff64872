"""The law of the size ``|x|`` of a normal vector x ~ N(mean, covariance), as that of a velocity correction.

In principal axes ``|x|^2 = Q = sum lambda_j (z_j + b_j)^2``, a generalized chi-square variable. Its cumulants are known
(Imhof, *Biometrika* 48, 1961, 419)::

    K(s) = log E exp(s Q) = sum [lambda_j b_j^2 s / (1 - 2 lambda_j s) - 1/2 log(1 - 2 lambda_j s)]

and ``P(Q <= q) = -1 / (2 pi i) ∫ exp(K(s) - s q) / s ds`` along any path that crosses the real axis left of zero. A
parabola through the saddle point, along which the phase is constant to third order, makes the integrand as smooth as a
normal density, so that the trapezoidal rule converges geometrically. The mean is ``E sqrt(Q) = 1 / (2 sqrt(pi)) ∫ (1 -
exp K(-t)) t^(-3/2) dt``, by the trapezoidal rule in log t. Both are good to 1e-12.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import special

from mcnav._dataclasses import dataclass
from mcnav._types import Array
from mcnav.statistics.bisection import root_between

NONE: Final = 1e-14
"""Variance of a principal axis, as a share of the largest, below which there is none."""

PER_SCALE: Final = 8
"""Nodes of the trapezoidal rule in the distance of the path from the pole at zero: its error is exp(-2 pi 8)."""

MOST_NODES: Final = 200_000

NEGLIGIBLE: Final = 1e-17
"""Share of the largest value of an integrand below which it ends."""

RADIUS: Final = 1e-13
"""Width of the last bracket of a quantile, as a share of the root mean square size."""


@dataclass(frozen=True)
class NormalSize:
    """Distribution of the size of a normal vector.

    Attributes
    ----------
    variances, centres : ndarray, shape (k,)
        Along the principal axes in which it is dispersed: lambda_j, and means.
    fixed : float
        Square of what the other axes add.
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
        """
        values, vectors = np.linalg.eigh(covariance)
        along, moves = vectors.T @ mean, values > NONE * max(float(values[-1]), 0.0)
        return cls(values[moves], along[moves], float(np.sum(along[~moves] ** 2)))

    @property
    def mean_square(self) -> float:
        """The mean of the square."""
        return self.fixed + float(np.sum(self.variances + self.centres**2))

    @property
    def mean(self) -> float:
        """The mean."""
        if not len(self.variances):
            return float(np.sqrt(self.fixed))
        scale = self.mean_square
        t = np.exp(0.05 * np.arange(-1_600, 1_601)) / scale
        terms = -np.expm1(self._cumulant(-t) - t * self.fixed) / np.sqrt(t)
        return float(0.05 * np.sum(terms) / (2.0 * np.sqrt(np.pi)))

    @property
    def variance(self) -> float:
        """The variance.

        >>> round(NormalSize.of(np.zeros(2), np.eye(2)).variance, 9)  # Rayleigh: 2 - pi / 2
        0.429203673
        """
        return max(self.mean_square - self.mean**2, 0.0)

    def probability(self, size: float) -> float:
        """Return the probability of a size up to this one.

        >>> law = NormalSize.of(np.array([3.0, 0.0]), np.eye(2))
        >>> round(law.probability(4.0), 9)  # Rice, by scipy.stats.ncx2.cdf(16, 2, 9)
        0.803487811
        """
        square = size * size - self.fixed
        if size <= 0.0 or square < 0.0 or not len(self.variances):
            return float(size > 0.0 and square >= 0.0)
        if len(self.variances) == 1:
            sigma, half, centre = float(np.sqrt(self.variances[0])), float(np.sqrt(square)), float(self.centres[0])
            return float(special.ndtr((half - centre) / sigma) - special.ndtr((-half - centre) / sigma))
        return _inverted(self, square)

    def quantile(self, probability: float) -> float:
        """Return the size that is not exceeded with a probability."""
        scale = float(np.sqrt(self.mean_square))
        if not len(self.variances) or scale == 0.0:
            return scale

        def beyond(size: float) -> float:
            return self.probability(size) - probability

        high = 2.0 * scale
        while beyond(high) < 0.0:
            high *= 2.0
        low = float(np.sqrt(self.fixed))
        ends = root_between(beyond, (low, -probability), (high, beyond(high)), RADIUS * scale)
        return 0.5 * (ends[0] + ends[1])

    def _cumulant(self, s: Array) -> Array:
        """Compute K(s) of the dispersed part, shape of s."""
        less = -2.0 * np.multiply.outer(s, self.variances)
        terms = np.multiply.outer(s, self.centres**2) / (1.0 + less) - 0.5 * np.log1p(less)
        return np.asarray(np.sum(terms, axis=-1))

    def _slopes(self, s: float) -> tuple[float, float, float]:
        """Compute the first three derivatives of K."""
        left, doubled, square = 1.0 - 2.0 * s * self.variances, 2.0 * self.variances, self.centres**2
        first = np.sum(square / left**2 + self.variances / left)
        second = np.sum(2.0 * square * doubled / left**3 + self.variances * doubled / left**2)
        third = np.sum(6.0 * square * doubled**2 / left**4 + 2.0 * self.variances * doubled**2 / left**3)
        return float(first), float(second), float(third)


def _inverted(law: NormalSize, square: float) -> float:
    """Integrate ``-exp(K(s) - s q) / (2 pi i s)`` along ``s = c + i y + a y^2``."""

    def slope(logarithm: float) -> float:
        s = -float(np.exp(logarithm))
        return law._slopes(s)[0] - square - 1.0 / s

    low, high = -np.log(square), -np.log(square)
    while slope(low) < 0.0:  # -1 / s: it rises towards zero
        low -= 2.0
    while slope(high) > 0.0:
        high += 2.0
    ends = root_between(slope, (low, slope(low)), (high, slope(high)), 1e-12)
    c = -float(np.exp(0.5 * (ends[0] + ends[1])))
    _, second, third = law._slopes(c)
    second, third = second + 1.0 / c**2, third - 2.0 / c**3
    bend = min(third / (6.0 * second), float(law.variances[-1]))
    height, step = float(law._cumulant(np.array(c))) - c * square, min(-c, 1.0 / np.sqrt(second)) / PER_SCALE
    total, begin, largest = 0.0, 0, 0.0
    while begin < MOST_NODES:
        y = step * np.arange(begin, begin + 512)
        s = c + 1j * y + bend * y**2
        terms = np.exp(law._cumulant(s) - s * square - height) / s * (1j + 2.0 * bend * y)
        terms[0] *= 0.5 if begin == 0 else 1.0
        total += float(np.sum(terms.imag))
        largest, begin = max(largest, float(np.abs(terms).max())), begin + 512
        if float(np.abs(terms[-64:]).max()) < NEGLIGIBLE * largest:
            break
    return float(np.clip(-np.exp(height) * step * total / np.pi, 0.0, 1.0))
