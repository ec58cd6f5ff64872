"""The one place where a campaign's errors become statistics and draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.sampling.copula import normal_correlation, semidefinite_factor
from mcnav.sampling.designs import standard_normals
from mcnav.sampling.distributions import Distribution, Fixed, StudentT

Array = NDArray[np.float64]


LIGHT_TAILS: Final = 8.0
"""Degrees of freedom of Student's t up to which squares of nonlinear terms have no variance."""


class CorrelationError(ValueError):
    """Correlations that no errors can have; `entry` is the one at fault, or none when it is the whole matrix."""

    def __init__(self, message: str, entry: int | None = None) -> None:
        super().__init__(message)
        self.entry = entry


@dataclass(frozen=True)
class Correlation:
    """Pearson's correlation coefficient between two named errors."""

    between: tuple[str, str]
    coefficient: float


class ErrorModel:
    """Statistics of all error sources of a scenario, in its order.

    Parameters
    ----------
    names : sequence of str
        Every source of the scenario.
    distributions : mapping of str to Distribution
        Those that are present, SI units; a source left out is zero.
    correlations : sequence of Correlation

    Raises
    ------
    CorrelationError
        When a correlation cannot be reached, or all of them together are impossible.
    """

    def __init__(
        self,
        names: Sequence[str],
        distributions: Mapping[str, Distribution],
        correlations: Sequence[Correlation] = (),
    ) -> None:
        self.names = tuple(names)
        self.distributions: tuple[Distribution, ...] = tuple(distributions.get(name, Fixed(0.0)) for name in names)
        self._correlation = np.eye(len(self.names))
        normal = np.eye(len(self.names))
        for entry, correlation in enumerate(correlations):
            i, j = (self.names.index(name) for name in correlation.between)
            one, other = self.distributions[i], self.distributions[j]
            for name, distribution in zip(correlation.between, (one, other), strict=True):
                if distribution.standard_deviation == 0.0:
                    raise CorrelationError(
                        f"{name} has no dispersion, so that nothing can be correlated with it", entry
                    )
            try:
                copula = normal_correlation(one, other, correlation.coefficient)
            except ValueError as problem:
                raise CorrelationError(str(problem), entry) from None
            self._correlation[i, j] = self._correlation[j, i] = correlation.coefficient
            normal[i, j] = normal[j, i] = copula
        try:
            semidefinite_factor(self._correlation)
            self._factor = semidefinite_factor(normal)
        except ValueError as problem:
            raise CorrelationError(f"together they are no correlation matrix: {problem}") from None

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
    def heavy_tailed(self) -> tuple[str, ...]:
        """Sources whose eighth moment does not exist: intervals of second moments are only nominal with them."""
        return tuple(
            name
            for name, distribution in zip(self.names, self.distributions, strict=True)
            if isinstance(distribution, StudentT) and distribution.degrees_of_freedom <= LIGHT_TAILS
        )

    def draw(self, design: str, seed: int, samples: int, begin: int, end: int) -> Array:
        """Errors of samples [begin, end) of a campaign of so many samples, shape (end - begin, sources), SI.

        A sample's errors depend on the campaign and its index alone. Sums run source by source and element by element,
        so that the same sample has the same bits in whatever stretch it is drawn.
        """
        independent = standard_normals(design, seed, samples, begin, end, len(self.names))
        errors = np.empty_like(independent)
        for i, distribution in enumerate(self.distributions):
            normal = np.zeros(end - begin)
            for j in np.flatnonzero(self._factor[i]):
                normal = normal + self._factor[i, j] * independent[:, j]
            errors[:, i] = distribution.transform(normal)
        return errors
