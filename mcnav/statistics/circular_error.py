"""Circles and spheres about zero that hold a share of a normal distribution, such as half: CEP and SEP."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.statistics.bisection import root_between

_ANGLES: Final = 400
"""Nodes of the Gauss-Legendre rule: relative error below 1e-9 down to an axis ratio of 1:100."""

RADIUS: Final = 1e-12
"""Width of the last bracket of a radius, as a share of the root mean square distance."""

MARGIN: Final = 1e-9
"""Share by which the bounds of a radius are moved apart: the integral's own error."""

_SPHERE_NODES: Final = 120
"""Nodes of the rule along each of the two greater axes: relative error below 1e-6 down to axis ratios of 1:30."""


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


def normal_probability_within_sphere(radius: float, mean: Array, covariance: Array) -> float:
    """Compute the probability that a trivariate normal variable lies within a sphere about zero.

    In principal axes, as in a circle: the integrals over the two greater axes are done by Gauss-Legendre, each in the
    angle that makes the chord smooth. The covariance may be singular; with a mean outside its plane
    the error is 1e-3.
    """
    values, vectors = np.linalg.eigh(covariance)
    centre, sigma = vectors.T @ mean, np.sqrt(np.maximum(values, 0.0))
    if sigma[1] <= 0.0:  # a line, or a point
        rest = radius**2 - float(np.sum(centre[:2] ** 2))
        return 0.0 if rest < 0.0 else float(_chord(np.sqrt(rest), centre[2], sigma[2]))
    nodes, weights = _sphere_rule()
    half, by_greatest = _slices(np.array(radius), centre[2], sigma[2], nodes, weights)
    least, by_middle = _slices(half, centre[1], sigma[1], nodes, weights)
    return float(np.sum(by_greatest * np.sum(by_middle * _chord(least, centre[0], sigma[0]), axis=-1)))


def _slices(radius: Array, centre: float, sigma: float, nodes: Array, weights: Array) -> tuple[Array, Array]:
    """Return half chords along an axis within radii, and their weights times density; both have a last axis more."""
    some = np.where(radius > 0.0, radius, 1.0)
    low, high = (np.arcsin(np.clip((centre + reach * sigma) / some, -1.0, 1.0)) for reach in (-9.0, 9.0))
    angle = 0.5 * (low + high)[..., None] + 0.5 * (high - low)[..., None] * nodes
    x, half = radius[..., None] * np.sin(angle), radius[..., None] * np.cos(angle)
    density = np.exp(-0.5 * ((x - centre) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
    return half, 0.5 * (high - low)[..., None] * weights * density * half


def _chord(half: Array, centre: float, sigma: float) -> Array:
    """Return the probability that a normal variable lies within ``+-half``."""
    if sigma <= 0.0:
        return np.asarray((abs(centre) <= half).astype(float))
    return np.asarray(special.ndtr((half - centre) / sigma) - special.ndtr((-half - centre) / sigma))


@lru_cache(maxsize=1)
def _sphere_rule() -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(_SPHERE_NODES)


def normal_error_radius(mean: Array, covariance: Array, probability: float) -> float:
    """Compute the radius about zero that holds a share of a normal distribution in two or three axes.

    Radii are remembered: a report asks for the same ones in several places. Parameters as for
    `normal_probability_within` and `normal_probability_within_sphere`.

    >>> round(normal_error_radius(np.zeros(2), np.eye(2), 0.5), 6)  # CEP: sqrt(2 ln 2)
    1.17741
    >>> round(normal_error_radius(np.zeros(2), np.eye(2), 0.95), 6)  # R95: sqrt(2 ln 20)
    2.447747
    >>> round(normal_error_radius(np.zeros(3), np.eye(3), 0.5), 6)  # SEP: median of a chi variable
    1.538172
    """
    return _error_radius(tuple(mean.tolist()), tuple(covariance.ravel().tolist()), probability)


@lru_cache(maxsize=256)
def _error_radius(centre: tuple[float, ...], elements: tuple[float, ...], probability: float) -> float:
    mean, covariance = np.array(centre), np.array(elements).reshape(len(centre), -1)
    scale = float(np.sqrt(max(np.trace(covariance), 0.0)) + np.linalg.norm(mean))
    if scale == 0.0 or not np.isfinite(scale):
        return scale
    within = normal_probability_within if len(mean) == 2 else normal_probability_within_sphere

    def beyond(radius: float) -> float:
        return within(radius, mean, covariance) - probability

    # along the greatest axis alone less is outside; with all axes as great as that one, and beyond the mean, more
    greatest, axes = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])), len(mean)
    low = (1.0 - MARGIN) * greatest * float(special.ndtri(0.5 * (1.0 + probability)))
    around = greatest * float(np.sqrt(2.0 * special.gammaincinv(0.5 * axes, probability)))
    high = (1.0 + MARGIN) * (float(np.linalg.norm(mean)) + around)
    at_low, at_high = beyond(low), beyond(high)
    if at_low > 0.0 or at_high <= 0.0:
        return low if at_low > 0.0 else high
    return root_between(beyond, (low, at_low), (high, at_high), RADIUS * scale)[1]
