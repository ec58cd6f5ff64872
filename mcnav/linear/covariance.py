"""Covariance of the final errors by linear analysis."""

from __future__ import annotations

import numpy as np

from mcnav._types import Array


def propagated_covariance(partials: Array, start_covariance: Array) -> Array:
    """Compute P S P^T, symmetric to the last bit, with P of shape (outputs, sources) and S (sources, sources).

    >>> propagated_covariance(np.array([[1.0, 2.0]]), np.diag([9.0, 4.0]))
    array([[25.]])
    """
    if partials.ndim != 2 or start_covariance.shape != (partials.shape[1],) * 2:
        raise ValueError(
            "partials and start covariance must list the same sources; got shapes "
            f"{partials.shape} and {start_covariance.shape}"
        )
    covariance = partials @ start_covariance @ partials.T
    return np.asarray(0.5 * (covariance + covariance.T))


def propagated_variances(partials: Array, start_covariance: Array) -> Array:
    """Compute the diagonal of P S P^T, shape (outputs,)."""
    return np.asarray(np.einsum("ij,jk,ik->i", partials, start_covariance, partials))
