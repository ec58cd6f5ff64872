"""Error budget: contribution of each source to the variance of each output, by the linear model, and its inverse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array

ROUNDING: Final = 1e-9
"""Cross-term up to which correlations contribute nothing."""


@dataclass(frozen=True)
class ErrorBudget:
    """Shares of each output's linear variance.

    Causes are the sources and, after them, the processes of noise.

    Attributes
    ----------
    shares : ndarray, shape (outputs, causes)
        ``P_ij^2 S_jj / C_ii`` of a source, ``(Q_j)_ii / C_ii`` of a process, with ``C = P S P^T + sum Q_j``; NaN in the
        row of an output without dispersion.
    cross_terms : ndarray, shape (outputs,)
        Contribution of correlations between sources; shares and cross-terms sum to one.
    contributions : ndarray, shape (outputs, causes)
        ``P_ij sqrt(S_jj)`` with its sign: the final error due to a one-sigma error of that source alone, or sigma due
        to a process.
    saved : ndarray, shape (outputs, causes)
        Share of the variance that vanishes without the cause: its own share and its cross-terms.
    """

    shares: Array
    cross_terms: Array
    contributions: Array
    saved: Array

    @property
    def attributed(self) -> Array:
        """Shares that add up to one: each with half of its cross-terms, ``P_ij (P S)_ij / C_ii`` of a source.

        Where sources are correlated, a share may be negative: its source takes away some of what others add.
        """
        return np.asarray(0.5 * (self.shares + self.saved))

    @property
    def crossed(self) -> bool:
        """Return whether correlations between sources contribute to a variance."""
        return bool(np.nanmax(np.abs(self.cross_terms), initial=0.0) > ROUNDING)


def error_budget(partials: Array, start_covariance: Array, processes: Sequence[Array] = ()) -> ErrorBudget:
    """Split the diagonal of P S P^T, and of the covariance that each process adds, over their causes."""
    noise = np.stack([np.diag(process) for process in processes], axis=1) if processes else np.zeros((len(partials), 0))
    contributions = partials * np.sqrt(np.diag(start_covariance))
    variances = transformed_variances(partials, start_covariance) + noise.sum(axis=1)
    divisor = np.where(variances > 0.0, variances, np.nan)[:, None]
    shares = contributions**2 / divisor
    crossed = 2.0 * partials * (partials @ start_covariance) / divisor
    whole = np.hstack([shares, noise / divisor])
    sizes = np.hstack([contributions, np.sqrt(np.maximum(noise, 0.0))])  # rounding of variances that vanish
    return ErrorBudget(whole, 1.0 - whole.sum(axis=1), sizes, np.hstack([crossed - shares, noise / divisor]))


def largest_sigmas(row: Array, covariance: Array, limit: float) -> Array:
    """Compute the largest sigma of each source with which an output's linear sigma stays within a limit.

    The other sigmas and the correlation coefficients stay. With the sigma of source j multiplied by k, the variance is
    ``k^2 A + k B + C``: A from the source alone, B its cross-terms, C the others. The result, shape (sources,), is
    infinite where the output does not depend on the source, and NaN where the other sources exceed the limit.

    Parameters
    ----------
    row : ndarray, shape (sources,)
        Partial derivatives of the output.
    covariance : ndarray, shape (sources, sources)
        Start covariance S.

    Examples
    --------
    >>> largest_sigmas(np.array([2.0, 1.0]), np.diag([1.0, 9.0]), 5.0)
    array([2.        , 4.58257569])
    """
    sigma = np.sqrt(np.diag(covariance))
    unit = np.where(sigma > 0.0, sigma, 1.0)  # a source that is absent now would be independent of the others
    own = (row * unit) ** 2
    others = row * ~np.eye(len(row), dtype=bool)
    rest = transformed_variances(others, covariance)
    cross = 2.0 * row * np.einsum("ij,ij->i", covariance, others)
    with np.errstate(invalid="ignore", divide="ignore"):
        largest = (-cross + np.sqrt(cross**2 - 4.0 * own * (rest - limit**2))) / (2.0 * own)
    irrelevant = np.where(rest <= limit**2, np.inf, np.nan)
    return np.where(own == 0.0, irrelevant, np.where(largest >= 0.0, largest * unit, np.nan))
