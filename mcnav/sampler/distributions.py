"""Distributions of an error source, each a function of a standard normal variate.

Every draw is ``F^-1(Phi(z))``, with a standard normal ``z`` and the distribution F. One variate per draw keeps samples
at fixed places of the random stream, and admits correlations (Gaussian copula) and any design. The distributions here
are symmetric about zero, except that `Normal` may have a mean and `Fixed` is a constant; others are in
`mcnav.sampler.scipy_and_tables`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from scipy import special

from mcnav.arrays.types import Array


class Distribution(Protocol):
    """Statistics of an error source, SI; equal distributions are interchangeable."""

    def __hash__(self) -> int:
        """Hash the parameters."""

    @property
    def mean(self) -> float:
        """Mean value."""

    @property
    def standard_deviation(self) -> float:
        """Standard deviation, as in the start covariance."""

    def transform(self, normal: Array) -> Array:
        """Convert standard normal variates to this distribution, elementwise: ``F^-1(Phi(z))``."""


_ABSCISSAE: Final = np.linspace(-14.0, 14.0, 2_001)


def tail_weight(distribution: Distribution) -> float:
    """Compute ``E z^8 / (E z^4)^2`` of the standardized values: the kurtosis of their squares.

    Squares of a quadratic function of the errors vary as their fourth powers, so this ratio decides whether the
    interval of a variance is reliable. The integral extends to probabilities of 1e-44, where a divergent one is very
    large. The standard deviation must not be zero.

    >>> round(tail_weight(Normal(2.0)), 3)
    11.667
    """
    density = np.exp(-0.5 * _ABSCISSAE**2) * ((_ABSCISSAE[1] - _ABSCISSAE[0]) / math.sqrt(2.0 * math.pi))
    squares = ((distribution.transform(_ABSCISSAE) - distribution.mean) / distribution.standard_deviation) ** 2
    return float(np.sum(density * squares**4) / np.sum(density * squares**2) ** 2)


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite; got {value:g}")


@dataclass(frozen=True)
class Normal:
    """Normal with standard deviation sigma about a mean; both zero mean no error."""

    sigma: float
    mean: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.sigma) and self.sigma >= 0.0):
            raise ValueError(f"a sigma must not be negative; got {self.sigma:g}")
        if not math.isfinite(self.mean):
            raise ValueError("mean must be finite")

    @property
    def standard_deviation(self) -> float:
        return self.sigma

    def transform(self, normal: Array) -> Array:
        return self.mean + self.sigma * normal


@dataclass(frozen=True)
class Uniform:
    """Uniform on [-half_width, half_width], with standard deviation half_width / sqrt(3)."""

    half_width: float
    mean: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        _positive("half_width", self.half_width)

    @property
    def standard_deviation(self) -> float:
        return self.half_width / math.sqrt(3.0)

    def transform(self, normal: Array) -> Array:
        return np.asarray(self.half_width * special.erf(normal / math.sqrt(2.0)))


@dataclass(frozen=True)
class TruncatedNormal:
    """Normal with parameter sigma, truncated at +-limit.

    With a = limit / sigma, its variance is ``sigma^2 [1 - 2 a phi(a) / (2 Phi(a) - 1)]``.
    """

    sigma: float
    limit: float
    mean: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        _positive("sigma", self.sigma)
        _positive("limit", self.limit)
        if not self.limit / self.sigma >= 1e-3:
            raise ValueError("limit must be at least 0.001 sigma")

    @property
    def _inside(self) -> float:
        """Probability that the untruncated normal lies within the limits."""
        return float(special.erf(self.limit / self.sigma / math.sqrt(2.0)))

    @property
    def standard_deviation(self) -> float:
        # variance / sigma^2 = P(3/2, a^2/2) / P(1/2, a^2/2), without cancellation at small a
        square = 0.5 * (self.limit / self.sigma) ** 2
        return self.sigma * math.sqrt(float(special.gammainc(1.5, square)) / self._inside)

    def transform(self, normal: Array) -> Array:
        below = special.ndtr(-np.abs(normal))  # probability of the nearer tail
        outside = 0.5 * (1.0 - self._inside)
        value = -self.sigma * special.ndtri(outside + self._inside * below)
        return np.asarray(np.copysign(np.clip(value, 0.0, self.limit), normal))


@dataclass(frozen=True)
class Triangular:
    """Symmetric triangular on [-half_width, half_width], with standard deviation half_width / sqrt(6)."""

    half_width: float
    mean: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        _positive("half_width", self.half_width)

    @property
    def standard_deviation(self) -> float:
        return self.half_width / math.sqrt(6.0)

    def transform(self, normal: Array) -> Array:
        nearer_tail = special.ndtr(-np.abs(normal))
        return np.asarray(np.copysign(self.half_width * (1.0 - np.sqrt(2.0 * nearer_tail)), normal))


@dataclass(frozen=True)
class StudentT:
    """Student's t scaled to standard deviation sigma, with more than 2 degrees of freedom."""

    sigma: float
    degrees_of_freedom: float
    mean: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        _positive("sigma", self.sigma)
        if not (math.isfinite(self.degrees_of_freedom) and self.degrees_of_freedom > 2.0):
            raise ValueError(f"degrees_of_freedom must exceed 2 for a finite variance; got {self.degrees_of_freedom:g}")

    @property
    def standard_deviation(self) -> float:
        return self.sigma

    def transform(self, normal: Array) -> Array:
        scale = self.sigma * math.sqrt((self.degrees_of_freedom - 2.0) / self.degrees_of_freedom)
        nearer_tail = special.ndtr(-np.abs(normal))
        return np.asarray(np.copysign(scale * special.stdtrit(self.degrees_of_freedom, nearer_tail), normal))


@dataclass(frozen=True)
class Fixed:
    """Known, constant error: a mean with zero standard deviation."""

    mean: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean):
            raise ValueError("value must be finite")

    @property
    def standard_deviation(self) -> float:
        return 0.0

    def transform(self, normal: Array) -> Array:
        return np.full_like(normal, self.mean)
