"""Error model of a campaign: statistics and samples of all sources."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.sampler.copula import error_correlation, hermite_coefficients, normal_correlation, semidefinite_factor
from mcnav.sampler.designs import standard_normals
from mcnav.sampler.distributions import Distribution, Fixed, Normal, StudentT, tail_weight
from mcnav.sampler.multivariate_t import MultivariateT, normal_of_rank

HEAVY_TAILS: Final = {"random": 150.0, "antithetic": 18.0, "latin-hypercube": 150.0, "sobol": 18.0}
"""Tail weight by design above which intervals of second moments are not reliable.

Student's t with eight degrees of freedom has an infinite tail weight; with five, 95 % intervals were measured to cover
half. With ten (weight 70) they cover 91 to 95 % for random draws and hypercubes, but only 80 to 90 % for antithetic
pairs and nets, which reduce the variance of everything but the tails (``make calibrate``). The normal distribution
has 11.7.
"""

LONG_TAILS: Final = 18.0
"""Tail weight above which intervals are at best approximate: Student's t with twenty-four degrees of freedom."""


class CorrelationError(ValueError):
    """Impossible correlations; ``entry`` is the index of the wrong one, or None for the matrix as a whole."""

    def __init__(self, message: str, entry: int | None = None) -> None:
        super().__init__(message)
        self.entry = entry


class JointError(ValueError):
    """Sources that cannot have a joint distribution; ``entry`` is the index of the group."""

    def __init__(self, message: str, entry: int) -> None:
        super().__init__(message)
        self.entry = entry


@dataclass(frozen=True)
class Correlation:
    """Correlation coefficient between two named errors: Pearson's, or Spearman's of ranks."""

    between: tuple[str, str]
    coefficient: float
    of_ranks: bool = False


class ErrorModel:
    """Statistics of all error sources of a scenario, in its order.

    Parameters
    ----------
    names : sequence of str
        All sources of the scenario.
    distributions : mapping of str to Distribution
        Distributions by source, SI; an omitted source is zero.
    joint : sequence of MultivariateT
        Groups of normal sources that get a multivariate Student-t distribution with the same sigmas and correlations.
    later : sequence of str
        Sources that the scenario gained after others. They are drawn last, and only where they are present, so that
        they leave the draws of campaigns without them as they were.

    Raises
    ------
    CorrelationError
        When a correlation cannot be reached, or the matrix is not positive semidefinite.
    JointError
        When a source of a group is not normal, or is in two groups.
    """

    def __init__(
        self,
        names: Sequence[str],
        distributions: Mapping[str, Distribution],
        correlations: Sequence[Correlation] = (),
        joint: Sequence[MultivariateT] = (),
        later: Sequence[str] = (),
    ) -> None:
        self.names = tuple(names)
        self._drawn = [i for i, name in enumerate(self.names) if name not in later]
        self._drawn_last = [i for i, name in enumerate(self.names) if name in later and name in distributions]
        self._joint = tuple(joint)
        self._group = self._groups()
        stated = [distributions.get(name, Fixed(0.0)) for name in names]
        self.distributions: tuple[Distribution, ...] = tuple(
            each if group is None else self._member(name, each, group)
            for name, each, group in zip(self.names, stated, self._group, strict=True)
        )
        self._correlation = np.eye(len(self.names))
        normal = np.eye(len(self.names))
        for entry, correlation in enumerate(correlations):
            i, j = (self.names.index(name) for name in correlation.between)
            for k in (i, j):
                if self.distributions[k].standard_deviation == 0.0:
                    message = f"{self.names[k]} has no dispersion, so that nothing can be correlated with it"
                    raise CorrelationError(message, entry)
            try:
                result, copula = self._correlated(i, j, correlation)
            except ValueError as problem:
                raise CorrelationError(str(problem), entry) from None
            self._correlation[i, j] = self._correlation[j, i] = result
            normal[i, j] = normal[j, i] = copula
        try:
            semidefinite_factor(self._correlation)
            self._factor = semidefinite_factor(normal)
        except ValueError as problem:
            raise CorrelationError(f"together they are not a correlation matrix: {problem}") from None

    def _groups(self) -> tuple[int | None, ...]:
        """Find the index of each source's group."""
        groups: list[int | None] = [None] * len(self.names)
        for number, group in enumerate(self._joint):
            for name in group.sources:
                i = self.names.index(name)
                if groups[i] is not None:
                    raise JointError(f"{name} is named twice", number)
                groups[i] = number
        return tuple(groups)

    def _member(self, name: str, stated: Distribution, number: int) -> Distribution:
        """Return Student's t with the sigma of a normal source."""
        if not isinstance(stated, Normal) or stated.mean != 0.0:
            raise JointError(f"{name} must be stated by its sigma alone, as a normal error", number)
        return StudentT(stated.sigma, self._joint[number].degrees_of_freedom) if stated.sigma > 0.0 else stated

    def _correlated(self, i: int, j: int, wanted: Correlation) -> tuple[float, float]:
        """Compute Pearson's correlation of two errors and of their normals; see `mcnav.sampler.multivariate_t`."""
        one, other = self.distributions[i], self.distributions[j]
        groups = [None if (group := self._group[k]) is None else self._joint[group] for k in (i, j)]
        if groups == [None, None]:
            if wanted.of_ranks:
                copula = normal_of_rank(wanted.coefficient)
                return error_correlation(one, other, copula), copula
            return wanted.coefficient, normal_correlation(one, other, wanted.coefficient)
        largest = 1.0
        if self._group[i] != self._group[j]:
            largest = math.prod(
                float(hermite_coefficients(each)[1]) if group is None else group.coupling
                for each, group in zip((one, other), groups, strict=True)
            )
        if wanted.of_ranks:
            copula = normal_of_rank(wanted.coefficient, *groups)
            return largest * copula, copula
        if abs(wanted.coefficient) > largest:
            came = f"got {wanted.coefficient:g}"
            raise ValueError(f"errors of these distributions can be correlated up to {largest:.4f}; {came}")
        return wanted.coefficient, wanted.coefficient / largest

    @cached_property
    def mean(self) -> Array:
        """Mean of each source, shape (sources,)."""
        return np.array([distribution.mean for distribution in self.distributions])

    @cached_property
    def standard_deviations(self) -> Array:
        """Standard deviation of each source, shape (sources,)."""
        return np.array([distribution.standard_deviation for distribution in self.distributions])

    @cached_property
    def covariance(self) -> Array:
        """Start covariance S of NASA TN D-1772, shape (sources, sources)."""
        return np.asarray(self._correlation * np.outer(self.standard_deviations, self.standard_deviations))

    @property
    def independent(self) -> bool:
        """Return whether all sources are independent."""
        return not self._joint and np.array_equal(self._correlation, np.eye(len(self.names)))

    @property
    def normal(self) -> bool:
        """Return whether every source with dispersion is normal."""
        return all(isinstance(distribution, (Normal, Fixed)) for distribution in self.distributions)

    def heavy_tailed(self, design: str) -> tuple[str, ...]:
        """Return the sources whose tails make a design's intervals of second moments unreliable."""
        return self._tails(HEAVY_TAILS[design], math.inf)

    def long_tailed(self, design: str) -> tuple[str, ...]:
        """Return the sources whose tails make such intervals approximate."""
        return self._tails(LONG_TAILS, HEAVY_TAILS[design])

    def _tails(self, above: float, to: float) -> tuple[str, ...]:
        weights = [
            tail_weight(distribution) if distribution.standard_deviation > 0.0 else 0.0
            for distribution in self.distributions
        ]
        return tuple(name for name, weight in zip(self.names, weights, strict=True) if above < weight <= to)

    def draw(self, design: str, seed: int, samples: int, begin: int, end: int) -> Array:
        """Draw samples [begin, end) of a campaign with the given total, shape (end - begin, sources), SI.

        A sample depends on the campaign and its index alone. Sums are elementwise, one source after another, so that a
        sample has the same bits in any range.
        """
        variates = standard_normals(design, seed, samples, begin, end, self.variates)
        if design == "antithetic":  # a pair shares its scale: mirrored errors are the errors of mirrored normals
            first = len(self._drawn)
            variates[np.arange(begin, end) % 2 == 1, first : first + len(self._joint)] *= -1.0
        return self.errors_of(variates)

    @property
    def variates(self) -> int:
        """Return the number of standard normals that a sample takes."""
        return len(self._drawn) + len(self._joint) + len(self._drawn_last)

    @cached_property
    def dispersing(self) -> IndexArray:
        """Variates on which an error depends, by number: those of sources with dispersion, and of groups."""
        spread = self.standard_deviations > 0.0
        of_source = np.any((self._factor != 0.0) & spread[:, None], axis=0)
        groups = [any(spread[self.names.index(name)] for name in group.sources) for group in self._joint]
        return np.flatnonzero(np.concatenate([of_source[self._drawn], groups, of_source[self._drawn_last]]))

    @cached_property
    def _terms(self) -> tuple[IndexArray, ...]:
        """Independent normals of which each source's normal is a sum, by number."""
        return tuple(np.flatnonzero(row) for row in self._factor)

    def errors_of(self, variates: Array) -> Array:
        """Return the errors of standard normals, shape (n, variates), as shape (n, sources), SI.

        Normals come one for each source, then one for the scale of each group, then those of later sources.
        """
        first, groups = len(self._drawn), len(self._joint)
        drawn, of_groups, drawn_last = np.split(variates, [first, first + groups], axis=1)
        independent = np.zeros((len(variates), len(self.names)))
        independent[:, self._drawn], independent[:, self._drawn_last] = drawn, drawn_last
        scales = [group.scale(of_groups[:, number]) for number, group in enumerate(self._joint)]
        errors = np.empty_like(independent)
        for i, (distribution, group) in enumerate(zip(self.distributions, self._group, strict=True)):
            normal = np.zeros(len(variates))
            for j in self._terms[i]:
                normal = normal + self._factor[i, j] * independent[:, j]
            if group is None:
                errors[:, i] = distribution.transform(normal)
            else:
                errors[:, i] = distribution.standard_deviation * (scales[group] * normal)
        return errors
