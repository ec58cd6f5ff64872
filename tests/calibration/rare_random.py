"""Rare events drawn at random, whose probabilities are known: no direction of theirs is an axis, and none is chosen.

With random unit vectors n and w, ``rho = n . w``, the output of the linear model is n . x, and

    y = n . x + f(w . x),      P(|y| > c) = integral over z of phi(z) [Phi((g(z) - c) / s) + Phi((-g(z) - c) / s)],

with ``g(z) = rho z + f(z)`` and ``s^2 = 1 - rho^2``: a sum over a grid, which is exact to rounding for functions so
smooth. A probability is drawn, uniform in its logarithm, and the limit follows from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy import integrate, optimize, special, stats

from mcnav.arrays.types import Array
from tests.calibration.rare_events import RareEvent, both, gauss_legendre, upper

PROBABILITIES: Final = (1e-7, 1e-4)
"""Range of the probabilities."""

GRID: Final = np.linspace(-14.0, 14.0, 2_801)
"""Values of w . x that are summed over."""

DENSITY: Final = stats.norm.pdf(GRID) * (GRID[1] - GRID[0])


def oblique_quadratic(dimensions: int, seed: int) -> RareEvent:
    """Draw ``|n . x + a ((w . x)^2 - 1)| > c`` with a between 0.05 and 0.25."""
    generator = np.random.default_rng((1, dimensions, seed))
    a = generator.uniform(0.05, 0.25)
    return _bent("oblique quadratic", lambda z: a * (z**2 - 1.0), dimensions, generator)


def oblique_cosh(dimensions: int, seed: int) -> RareEvent:
    """Draw ``|n . x + 0.2 cosh(w . x)| > c``."""
    generator = np.random.default_rng((2, dimensions, seed))
    return _bent("0.2 cosh(w x)", lambda z: 0.2 * np.cosh(z), dimensions, generator)


def second_half_space(dimensions: int, seed: int) -> RareEvent:
    """Draw ``n . x > c or m . x > b``, of which the linear model knows the first alone."""
    generator = np.random.default_rng((3, dimensions, seed))
    n, m = unit_vector(dimensions, generator), unit_vector(dimensions, generator)
    c, b = -special.ndtri(_draw_probability(generator)), -special.ndtri(_draw_probability(generator))
    rho = float(n @ m)
    s = math.sqrt(1.0 - rho**2)
    exact = float(special.ndtr(-b) + integrate.quad(
        lambda t: stats.norm.pdf(t) * special.ndtr((b - rho * t) / s), c, c + 12.0, epsabs=0.0, epsrel=1e-10, limit=400
    )[0])  # fmt: skip

    def outputs(x: Array) -> Array:
        return np.asarray(np.maximum(x @ n, x @ m - b + c)[:, None])

    return RareEvent(
        f"random second half-space, d = {dimensions}", outputs, lambda x: (x @ n)[:, None], upper(c), dimensions, exact
    )  # fmt: skip


def ball(dimensions: int, seed: int) -> RareEvent:
    """Draw ``n . x + max(0, q - r) > c``, with q the square of the distance across n from a centre off the nominal.

    Given q, noncentral chi-square, it is a normal beyond ``c - max(0, q - r)``.
    """
    generator = np.random.default_rng((4, dimensions, seed))
    n, centre = unit_vector(dimensions, generator), generator.standard_normal(dimensions)
    centre -= float(n @ centre) * n
    centre *= generator.uniform(0.2, 1.5) / np.linalg.norm(centre)
    c, others, moved = generator.uniform(4.5, 5.5), dimensions - 1, float(centre @ centre)
    r = float(stats.ncx2.isf(_draw_probability(generator), others, moved))
    nodes, weights = gauss_legendre(200)
    excess, weights = 0.5 * (c + 12.0) * (1.0 + nodes), 0.5 * (c + 12.0) * weights
    beyond = float(weights @ (special.ndtr(excess - c) * stats.ncx2.pdf(r + excess, others, moved)))
    exact = float(
        special.ndtr(-c) * stats.ncx2.cdf(r, others, moved) + beyond + stats.ncx2.sf(r + c + 12.0, others, moved)
    )

    def outputs(x: Array) -> Array:
        along = x @ n
        square = np.sum((x - centre) ** 2, axis=1) - along**2
        return np.asarray((along + np.maximum(0.0, square - r))[:, None])

    return RareEvent(
        f"random ball, d = {dimensions}", outputs, lambda x: (x @ n)[:, None], upper(c), dimensions, exact
    )  # fmt: skip


def unit_vector(dimensions: int, generator: np.random.Generator) -> Array:
    """Draw a direction."""
    direction = generator.standard_normal(dimensions)
    return np.asarray(direction / np.linalg.norm(direction))


def _draw_probability(generator: np.random.Generator) -> float:
    return float(np.exp(generator.uniform(*np.log(PROBABILITIES))))


def _bent(
    name: str, bend: Callable[[Array], Array], dimensions: int, generator: np.random.Generator
) -> RareEvent:  # fmt: skip
    """Draw the directions and the limit of an event that bends along w."""
    n, w = unit_vector(dimensions, generator), unit_vector(dimensions, generator)
    rho, exact = float(n @ w), _draw_probability(generator)
    at, s = rho * GRID + bend(GRID), math.sqrt(1.0 - rho**2)

    def beyond(c: float) -> float:
        return float(DENSITY @ (special.ndtr((at - c) / s) + special.ndtr((-at - c) / s)))

    c = optimize.brentq(lambda c: math.log(max(beyond(c), 1e-300) / exact), 1.0, 200.0, xtol=1e-12, rtol=1e-14)

    def outputs(x: Array) -> Array:
        return np.asarray((x @ n + bend(x @ w))[:, None])

    return RareEvent(
        f"random {name}, d = {dimensions}", outputs, lambda x: (x @ n)[:, None], both(c), dimensions, beyond(c)
    )  # fmt: skip


RANDOM: Final = (oblique_quadratic, oblique_cosh, second_half_space, ball)
DIMENSIONS: Final = (5, 10, 20, 40)
