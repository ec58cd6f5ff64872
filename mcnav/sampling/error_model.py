"""The one place where a campaign's errors become statistics and draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.sampling.copula import error_correlation, hermite_coefficients, normal_correlation, semidefinite_factor
from mcnav.sampling.designs import standard_normals
from mcnav.sampling.distributions import Distribution, Fixed, Normal, StudentT, tail_weight
from mcnav.sampling.multivariate_t import MultivariateT, normal_of_rank

HEAVY_TAILS: Final = {"random": 150.0, "antithetic": 18.0, "latin-hypercube": 150.0, "sobol": 18.0}
"""For each design the tail weight beyond which intervals of second moments cannot be promised.

Student's t of eight degrees of freedom has an infinite one; with five, intervals that should cover 95 % were measured
to cover half. With ten (weight 70) they cover 91 to 95 % for random draws and hypercubes, but only 80 to 90 % for
antithetic pairs and nets, which leave the tails alone and take away the rest (`mcnav calibrate`). The normal
distribution has 11.7.
"""

LONG_TAILS: Final = 18.0
"""Tail weight beyond which intervals are at best nearly right: Student's t of twenty-four degrees of freedom."""


class CorrelationError(ValueError):
    """Correlations that no errors can have; `entry` is the one at fault, or none when it is the whole matrix."""

    def __init__(self, message: str, entry: int | None = None) -> None:
        super().__init__(message)
        self.entry = entry


class JointError(ValueError):
    """Sources that cannot have one joint distribution; `entry` is the group at fault."""

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
        Every source of the scenario.
    distributions : mapping of str to Distribution
        Those that are present, SI units; a source left out is zero.
    correlations : sequence of Correlation
    joint : sequence of MultivariateT
        Groups of normal sources that have a multivariate Student-t distribution instead, with the same sigmas and
        correlations.
    later : sequence of str
        Sources that the scenario gained after others. They are drawn last, and only where they are present, so that
        they leave the draws of campaigns without them as they were.

    Raises
    ------
    CorrelationError
        When a correlation cannot be reached, or all of them together are impossible.
    JointError
        When a source of a group is not a normal one, or is in two groups.
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
                    raise CorrelationError(
                        f"{self.names[k]} has no dispersion, so that nothing can be correlated with it", entry
                    )
            try:
                found, copula = self._correlated(i, j, correlation)
            except ValueError as problem:
                raise CorrelationError(str(problem), entry) from None
            self._correlation[i, j] = self._correlation[j, i] = found
            normal[i, j] = normal[j, i] = copula
        try:
            semidefinite_factor(self._correlation)
            self._factor = semidefinite_factor(normal)
        except ValueError as problem:
            raise CorrelationError(f"together they are no correlation matrix: {problem}") from None

    def _groups(self) -> tuple[int | None, ...]:
        """The group of each source, by its number."""
        found: list[int | None] = [None] * len(self.names)
        for number, group in enumerate(self._joint):
            for name in group.sources:
                i = self.names.index(name)
                if found[i] is not None:
                    raise JointError(f"{name} is named twice", number)
                found[i] = number
        return tuple(found)

    def _member(self, name: str, stated: Distribution, number: int) -> Distribution:
        """Student's t with the sigma of a normal source."""
        if not isinstance(stated, Normal):
            raise JointError(f"{name} must be stated by its sigma alone, as a normal error", number)
        return StudentT(stated.sigma, self._joint[number].degrees_of_freedom) if stated.sigma > 0.0 else stated

    def _correlated(self, i: int, j: int, wanted: Correlation) -> tuple[float, float]:
        """Pearson's correlation of two errors, and that of their normals; see `mcnav.sampling.multivariate_t`."""
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
            raise ValueError(
                f"errors of these distributions can be correlated up to {largest:.4f}; got {wanted.coefficient:g}"
            )
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
        """The start covariance S of NASA TN D-1772's errors, shape (sources, sources)."""
        return np.asarray(self._correlation * np.outer(self.standard_deviations, self.standard_deviations))

    @property
    def independent(self) -> bool:
        """Whether no source tells anything about another."""
        return not self._joint and np.array_equal(self._correlation, np.eye(len(self.names)))

    @property
    def normal(self) -> bool:
        """Whether every source with dispersion is normal."""
        return all(isinstance(each, (Normal, Fixed)) for each in self.distributions)

    def heavy_tailed(self, design: str) -> tuple[str, ...]:
        """Sources with whose tails a design's intervals of second moments cannot be promised."""
        return self._tails(HEAVY_TAILS[design], math.inf)

    def long_tailed(self, design: str) -> tuple[str, ...]:
        """Sources with whose tails such intervals are only nearly right."""
        return self._tails(LONG_TAILS, HEAVY_TAILS[design])

    def _tails(self, above: float, to: float) -> tuple[str, ...]:
        weights = [tail_weight(each) if each.standard_deviation > 0.0 else 0.0 for each in self.distributions]
        return tuple(name for name, weight in zip(self.names, weights, strict=True) if above < weight <= to)

    def draw(self, design: str, seed: int, samples: int, begin: int, end: int) -> Array:
        """Errors of samples [begin, end) of a campaign of so many samples, shape (end - begin, sources), SI.

        A sample's errors depend on the campaign and its index alone. Sums run source by source and element by element,
        so that the same sample has the same bits in whatever stretch it is drawn.
        """
        first, groups = len(self._drawn), len(self._joint)
        variates = standard_normals(design, seed, samples, begin, end, first + groups + len(self._drawn_last))
        independent = np.zeros((end - begin, len(self.names)))
        independent[:, self._drawn], independent[:, self._drawn_last] = (
            variates[:, :first],
            variates[:, first + groups :],
        )
        of_groups = variates[:, first : first + groups]
        if design == "antithetic":  # a pair shares its scale: mirrored errors are the errors of mirrored normals
            of_groups[np.arange(begin, end) % 2 == 1] *= -1.0
        scales = [group.scale(of_groups[:, number]) for number, group in enumerate(self._joint)]
        errors = np.empty_like(independent)
        for i, (distribution, group) in enumerate(zip(self.distributions, self._group, strict=True)):
            normal = np.zeros(end - begin)
            for j in np.flatnonzero(self._factor[i]):
                normal = normal + self._factor[i, j] * independent[:, j]
            if group is None:
                errors[:, i] = distribution.transform(normal)
            else:
                errors[:, i] = distribution.standard_deviation * (scales[group] * normal)
        return errors
