"""Covariance of the final errors by linear analysis."""

from __future__ import annotations

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array


def propagated_covariance(partials: Array, start_covariance: Array) -> Array:
    """Compute P S P^T, symmetric to the last bit, with P of shape (outputs, sources) and S (sources, sources).

    >>> import numpy as np
    >>> propagated_covariance(np.array([[1.0, 2.0]]), np.diag([9.0, 4.0]))
    array([[25.]])
    """
    if partials.ndim != 2 or start_covariance.shape != (partials.shape[1],) * 2:
        raise ValueError(
            "partials and start covariance must list the same sources; got shapes "
            f"{partials.shape} and {start_covariance.shape}"
        )
    return transform(partials, start_covariance)
