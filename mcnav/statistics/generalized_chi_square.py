"""Tails of a generalized chi-square variable ``Q = sum lambda_j (z_j + b_j)^2``, for many of them at once.

Its cumulants are known (Imhof, *Biometrika* 48, 1961, 419)::

    K(s) = log E exp(s Q) = sum [lambda_j b_j^2 s / (1 - 2 lambda_j s) - 1/2 log(1 - 2 lambda_j s)]

and ``1 / (2 pi i) ∫ exp(K(s) - s q) / s ds`` is ``P(Q > q)`` along a path that crosses the real axis between zero and
the first pole, ``-P(Q <= q)`` along one that crosses it left of zero. The tail on q's side of the mean is integrated,
along a hyperbola through the saddle point c::

    s = c + w (i sinh v + t (cosh v - 1))        w^-2 = K''(c) + c^-2

With tilted variances and centres ``lambda' = lambda / (1 - 2 lambda c)``, ``m' = m / (1 - 2 lambda c)`` an axis adds
``2 lambda' m'^2 (s - c)^2 / (1 - 2 lambda' (s - c))`` to the exponent, whose real part is negative on every ray from c
that is at most 45 degrees from the upright: with slopes t below one the integrand is largest at c, whatever the shape
and the offset. So nothing cancels, and the trapezoidal rule in v, which takes scales of any ratio in equal steps,
converges geometrically. Rounding of q leaves ``1e-16 |b|`` of a probability.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

PATHS: Final = ((2.0**0.5 - 1.0, 16), (0.3, 20), (2.0**0.5 - 1.0, 6))
"""Slope t of a hyperbola and nodes of the trapezoidal rule in a unit of v: first, second and rough route.

Hyperbolas between 45 and 90 degrees from the real axis will do. The first one is amid them, so that the integrand is
analytic and bounded within a strip of half width pi / 8 in v: the rule's error is exp(-2 pi 16 pi / 8) = 7e-18, and
with six nodes 4e-7, which is enough to search with.
"""

UNITS: Final = 5
"""Units of v in a block of nodes."""

BLOCKS: Final = 12
"""Largest number of blocks: their hyperbola reaches exp(60) times its width."""

NEGLIGIBLE: Final = 6e-19
"""Integrand below which it ends, as a share of its largest value."""

COARSE: Final = np.arange(-2.0, 9.0, 2.0)
FINE: Final = np.linspace(0.0, 2.0, 17)
"""Grids in the logarithm of a saddle point, on which it is bracketed: the path need not be exactly there."""

LEAST: Final = 1e-300
"""Smallest probability that is told from zero."""

AT_ONCE: Final = 256
"""Variables that are integrated at once, so that their nodes stay in the cache."""


def tail(variances: Array, centres: Array, squares: Array, below: bool, path: int) -> Array:
    """Compute ``P(Q <= q)``, for q below the means, or ``P(Q > q)``, by one of the `PATHS`; shape (n,).

    Parameters
    ----------
    variances : ndarray, shape (k,) or (n, k)
        lambda_j, in rising order, of all or of each of n variables.
    centres : ndarray, shape (n, k)
        ``m_j = sqrt(lambda_j) b_j``.
    squares : ndarray, shape (n,)
        q, above zero.

    >>> two = tail(np.ones(2), np.zeros((2, 2)), np.array([9.0, 25.0]), False, 0)
    >>> (two / np.exp([-4.5, -12.5])).round(12)
    array([1., 1.])
    """
    variances = np.broadcast_to(variances, centres.shape)
    rows = [slice(first, first + AT_ONCE) for first in range(0, len(squares), AT_ONCE)]
    tails = [_tail(variances[some], centres[some], squares[some], below, path) for some in rows]
    return np.concatenate([np.zeros(0), *tails])


def _tail(variances: Array, centres: Array, squares: Array, below: bool, path: int) -> Array:
    saddle, left = _saddles(variances, centres, squares, below)
    tilted, weights = variances / left, (centres / left) ** 2
    offset, result = squares - weights.sum(axis=1), np.zeros(len(squares))
    width = 1.0 / np.sqrt(np.sum(2.0 * tilted * (tilted + 2.0 * weights), axis=1) + saddle**-2)
    height = -saddle * offset - 2.0 * saddle**2 * (weights * variances).sum(axis=1) - 0.5 * np.log(left).sum(axis=1)
    rows = np.flatnonzero(height >= math.log(LEAST))  # Chernoff's bound
    nodes = PATHS[path][1]
    for block in range(BLOCKS):
        if not len(rows):
            break
        factor, moved, moving = _integrand(tilted[rows], weights[rows], offset[rows], width[rows], path, block)
        terms = (factor * moving / (saddle[rows, None] + moved)).imag
        result[rows] += terms.sum(axis=1) - (0.5 * terms[:, 0] if block == 0 else 0.0)
        rows = rows[~(np.abs(factor[:, -nodes:]).max(axis=1) < NEGLIGIBLE)]
    return np.asarray(np.exp(height) * (-result if below else result) / (math.pi * nodes))


def _integrand(
    tilted: Array, weights: Array, offset: Array, width: Array, path: int, block: int
) -> tuple[Array, Array, Array]:
    """Return ``exp(K(s) - s q)`` over its value at the saddle point, ``s - c`` and ``ds / dv``, shape (n, nodes).

    Roots are multiplied, and no logarithms added: each of them has one value.
    """
    along, slope = _hyperbola(path, block)
    moved = width[:, None] * along
    exponents, roots = np.zeros_like(moved), np.ones_like(moved)
    for axis in range(tilted.shape[1]):
        turned = 2.0 * tilted[:, axis, None] * moved
        left = 1.0 - turned
        exponents += weights[:, axis, None] * turned / left
        roots *= np.sqrt(left)
    return np.exp((exponents - offset[:, None]) * moved) / roots, moved, width[:, None] * slope


@cache
def _hyperbola(path: int, block: int) -> tuple[Array, Array]:
    """Return ``i sinh v + t (cosh v - 1)`` and its derivative in a block of one of the `PATHS`, shape (n,), complex."""
    slope, nodes = PATHS[path]
    v = np.arange(block * UNITS * nodes, (block + 1) * UNITS * nodes) / nodes
    return 1j * np.sinh(v) + slope * (np.cosh(v) - 1.0), 1j * np.cosh(v) + slope * np.sinh(v)


def _saddles(variances: Array, centres: Array, squares: Array, below: bool) -> tuple[Array, Array]:
    """Find the saddle points c of ``K(s) - s q - log|s|``, shape (n,), and return them with ``1 - 2 lambda c``.

    They are looked for as ``c = -x``, or as ``c = x / (1 + 2 lambda x)`` with the largest variance, in log x: on a
    coarse grid around that of a normal variable with the mean and variance of Q, on a fine one, and by interpolation.
    """
    largest, means = variances[:, -1:], centres**2
    doubled = 2.0 * (variances if below else largest - variances)

    def at(logarithms: Array) -> tuple[Array, Array]:
        x = np.exp(logarithms)
        left = 1.0 + x[..., None] * doubled[:, None]
        if below:
            return -x, left
        stretched = 1.0 + 2.0 * largest * x
        return x / stretched, left / stretched[..., None]

    def slope(logarithms: Array) -> Array:
        """Return the derivative there, shape (n, g), which rises with x: its sign is turned left of zero."""
        saddle, left = at(logarithms)
        values = ((means[:, None] / left + variances[:, None]) / left).sum(axis=2) - squares[:, None] - 1.0 / saddle
        return np.asarray(-values if below else values)

    begin, rows = -0.5 * np.log(2.0 * ((variances + 2.0 * means) * variances).sum(axis=1)), np.arange(len(squares))
    while True:
        values = slope(begin[:, None] + COARSE)
        aside = np.where(values[:, 0] > 0.0, COARSE[0], np.where(values[:, -1] <= 0.0, COARSE[-1], 0.0))
        if not aside.any():
            break
        begin = begin + aside
    begin = begin + COARSE[np.maximum(np.sum(values <= 0.0, axis=1) - 1, 0)]
    values = slope(begin[:, None] + FINE)
    last = np.clip(np.sum(values <= 0.0, axis=1) - 1, 0, len(FINE) - 2)
    low, high = values[rows, last], values[rows, last + 1]
    saddle, left = at((begin + FINE[last] - FINE[1] * low / (high - low))[:, None])
    return saddle[:, 0], left[:, 0]
