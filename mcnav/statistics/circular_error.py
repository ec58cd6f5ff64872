"""Circular error probable of a normal distribution: the radius about zero that holds half of it."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.statistics.bisection import smallest_reaching

_ANGLES: Final = 400
"""Nodes of the Gauss-Legendre rule: relative error below 1e-9 down to an axis ratio of 1:100."""


@lru_cache(maxsize=1)
def _gauss_legendre() -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(_ANGLES)


def normal_probability_within(radius: float, mean: Array, covariance: Array) -> float:
    """Compute the probability that a bivariate normal variable lies within a circle about zero.

    In principal axes the integral over the lesser one is a difference of normal distributions; that over the greater is
    done by Gauss-Legendre in ``x = R sin(t)``. The covariance may be singular.
    """
    values, vectors = np.linalg.eigh(covariance)
    lesser, greater = np.sqrt(np.maximum(values, 0.0))
    centre_lesser, centre_greater = vectors.T @ mean
    if greater <= 0.0:
        return float(np.hypot(*mean) <= radius)
    nodes, weights = _gauss_legendre()
    # within 9 sigma: the nodes would miss a narrow peak in a wide circle
    low, high = np.clip((centre_greater + np.array([-9.0, 9.0]) * greater) / radius, -1.0, 1.0)
    angle_low, angle_high = np.arcsin(low), np.arcsin(high)
    angle = 0.5 * (angle_low + angle_high) + 0.5 * (angle_high - angle_low) * nodes
    x, half = radius * np.sin(angle), radius * np.cos(angle)
    density = np.exp(-0.5 * ((x - centre_greater) / greater) ** 2) / (greater * np.sqrt(2.0 * np.pi))
    if lesser > 0.0:
        inside = special.ndtr((half - centre_lesser) / lesser) - special.ndtr((-half - centre_lesser) / lesser)
    else:
        inside = (np.abs(centre_lesser) <= half).astype(float)
    return float(0.5 * (angle_high - angle_low) * np.sum(weights * density * inside * half))


def normal_circular_error_probable(mean: Array, covariance: Array) -> float:
    """Compute the CEP of a bivariate normal distribution; parameters as for `normal_probability_within`.

    >>> round(normal_circular_error_probable(np.zeros(2), np.eye(2)), 6)  # sqrt(2 ln 2)
    1.17741
    """
    scale = float(np.sqrt(max(np.trace(covariance), 0.0)) + np.hypot(*mean))
    if scale == 0.0 or not np.isfinite(scale):
        return scale
    return smallest_reaching(lambda r: normal_probability_within(r, mean, covariance), 0.5, 1e-9 * scale, 3.0 * scale)
