"""Error budget: contribution of each source to the variance of each output, by the linear model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array
from mcnav.lincov.covariance import propagated_variances


@dataclass(frozen=True)
class ErrorBudget:
    """Shares of each output's linear variance.

    Attributes
    ----------
    shares : ndarray, shape (outputs, sources)
        ``P_ij^2 S_jj / (P S P^T)_ii``; NaN in the row of an output without dispersion.
    cross_terms : ndarray, shape (outputs,)
        Contribution of correlations between sources; shares and cross-terms sum to one.
    contributions : ndarray, shape (outputs, sources)
        ``P_ij sqrt(S_jj)`` with its sign: the final error due to a one-sigma error of that source alone.
    saved : ndarray, shape (outputs, sources)
        Share of the variance that vanishes without the source: its own share and its cross-terms.
    """

    shares: Array
    cross_terms: Array
    contributions: Array
    saved: Array


def error_budget(partials: Array, start_covariance: Array) -> ErrorBudget:
    """Split the diagonal of P S P^T over the sources."""
    contributions = partials * np.sqrt(np.diag(start_covariance))
    variances = propagated_variances(partials, start_covariance)
    divisor = np.where(variances > 0.0, variances, np.nan)
    shares = contributions**2 / divisor[:, None]
    crossed = 2.0 * partials * (partials @ start_covariance) / divisor[:, None]
    return ErrorBudget(shares, 1.0 - shares.sum(axis=1), contributions, crossed - shares)
