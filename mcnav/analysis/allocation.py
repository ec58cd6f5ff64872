"""Inverse allocation: the largest sigma of one source with which an output meets a requirement."""

from __future__ import annotations

import numpy as np

from mcnav._types import Array


def largest_sigmas(row: Array, covariance: Array, limit: float) -> Array:
    """Compute the largest sigma of each source with which an output's linear sigma stays within a limit.

    The other sigmas and the correlation coefficients are kept. With the sigma of source j multiplied by k, the variance
    is ``k^2 A + k B + C``: A from the source alone, B its cross-terms, C the others.

    Parameters
    ----------
    row : ndarray, shape (sources,)
        Partial derivatives of the output.
    covariance : ndarray, shape (sources, sources)
        Start covariance S.
    limit : float
        Largest sigma of the output.

    Returns
    -------
    ndarray, shape (sources,)
        Infinite where the output does not depend on the source, NaN where the other sources exceed the limit.

    Examples
    --------
    >>> largest_sigmas(np.array([2.0, 1.0]), np.diag([1.0, 9.0]), 5.0)
    array([2.        , 4.58257569])
    """
    sigma = np.sqrt(np.diag(covariance))
    found = np.full(len(row), np.nan)
    for j in range(len(row)):
        others = np.arange(len(row)) != j
        rest = float(row[others] @ covariance[np.ix_(others, others)] @ row[others])
        if sigma[j] > 0.0:
            own = (float(row[j]) * float(sigma[j])) ** 2
            cross = 2.0 * float(row[j] * covariance[j, others] @ row[others])
            unit = float(sigma[j])
        else:  # absent now: it would be independent of the others
            own, cross, unit = float(row[j]) ** 2, 0.0, 1.0
        if own == 0.0:
            found[j] = np.inf if rest <= limit**2 else np.nan
            continue
        discriminant = cross**2 - 4.0 * own * (rest - limit**2)
        if discriminant >= 0.0:
            largest = (-cross + np.sqrt(discriminant)) / (2.0 * own)
            if largest >= 0.0:
                found[j] = largest * unit
    return found
