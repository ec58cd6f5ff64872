"""Continuous distributions of scipy.stats, and empirical distributions of tables."""

from __future__ import annotations

import hashlib
import math
import warnings
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.special import ndtr

from mcnav.arrays.types import Array


@lru_cache(maxsize=1)
def continuous_distributions() -> dict[str, Any]:
    """Return all continuous distributions of scipy.stats by name."""
    from scipy import stats  # the import takes half a second

    distributions = {name: getattr(stats, name) for name in dir(stats)}
    return {
        name: distribution
        for name, distribution in distributions.items()
        if isinstance(distribution, stats.rv_continuous)
    }


def shape_names(name: str) -> tuple[str, ...]:
    """Return the names of a scipy distribution's shape parameters.

    >>> shape_names("beta"), shape_names("laplace")
    (('a', 'b'), ())
    """
    shapes = continuous_distributions()[name].shapes
    return tuple(piece.strip() for piece in shapes.split(",")) if shapes else ()


@dataclass(frozen=True)
class ScipyDistribution:
    """Continuous distribution of scipy.stats, named by a key of `continuous_distributions`; nothing is evaluated.

    Raises `ValueError` when there is no such distribution, or it lacks a finite mean and a finite, positive variance.
    """

    name: str
    shapes: tuple[tuple[str, float], ...] = ()
    loc: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        if self.name not in continuous_distributions():
            raise ValueError(f"scipy.stats has no continuous distribution {self.name!r}")
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise ValueError("scale must be positive and finite")
        if not (math.isfinite(self.mean) and math.isfinite(self.standard_deviation) and self.standard_deviation > 0.0):
            raise ValueError(f"{self.name} has no finite mean and variance with these parameters")

    @cached_property
    def _moments(self) -> tuple[float, float]:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # integrals of moments that do not exist
            shapes = dict(self.shapes)
            mean, variance = continuous_distributions()[self.name].stats(**shapes, moments="mv")
        return self.loc + self.scale * float(mean), self.scale * math.sqrt(max(float(variance), 0.0))

    @property
    def mean(self) -> float:
        """Mean value."""
        return self._moments[0]

    @property
    def standard_deviation(self) -> float:
        """Standard deviation."""
        return self._moments[1]

    def transform(self, normal: Array) -> Array:
        """Compute the quantiles at the probabilities of standard normal variates, from the nearer tail."""
        family, shapes = continuous_distributions()[self.name], dict(self.shapes)
        tail = ndtr(-np.abs(normal))
        with np.errstate(all="ignore"):
            values = np.where(normal < 0.0, family.ppf(tail, **shapes), family.isf(tail, **shapes))
        return np.asarray(self.loc + self.scale * values)


@dataclass(frozen=True)
class EmpiricalDistribution:
    """Equally likely values, SI, in any order.

    Raises `ValueError` when fewer than two values differ, or one is not finite.
    """

    values: Array = field(compare=False, repr=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        if not np.isfinite(self.values).all():
            raise ValueError("a value is missing or not finite")
        if len(self.values) < 2 or np.ptp(self.values) == 0.0:
            raise ValueError("expected at least two different values")
        values = np.sort(np.asarray(self.values, dtype=float))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "digest", hashlib.sha256(values.astype("<f8").tobytes()).hexdigest())

    @property
    def mean(self) -> float:
        """Mean of the values."""
        return float(np.mean(self.values))

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of the values as a population."""
        return float(np.std(self.values))

    def transform(self, normal: Array) -> Array:
        """Return the values at the probabilities of standard normal variates."""
        count = len(self.values)
        return np.asarray(self.values[np.minimum((ndtr(normal) * count).astype(int), count - 1)])
