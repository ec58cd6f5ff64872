"""Rare events whose shape is no half-space, in a random frame: they showed faults of the search, or tempt it.

Each is a function of a seed, which draws the frame; exact values are integrals over one normal, or sums.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
from scipy import integrate, special, stats

from mcnav.arrays.types import Array
from mcnav.sampler.scipy_and_tables import EmpiricalDistribution
from tests.calibration.rare_events import RareEvent, upper

ENDS: Final = np.linspace(-14.0, 14.0, 57)
"""Ends of the pieces of integrals over a normal."""

TABLE: Final = EmpiricalDistribution(np.concatenate([np.zeros(9_950), np.full(45, 3.0), np.full(5, 8.0)]))


def saturating(seed: int) -> RareEvent:
    """Draw ``n . x + 2 tanh(1.5 w . x) > 6.5``: the linear model has a way at 2.1 that does not exist."""
    n, w = frame(6, 2, seed)
    return RareEvent(
        "a term that saturates", lambda x: (x @ n + 2.0 * np.tanh(1.5 * (x @ w)))[:, None],
        lambda x: (x @ n + 3.0 * (x @ w))[:, None], upper(6.5), 6,
        over_a_normal(lambda z: special.ndtr(2.0 * np.tanh(1.5 * z) - 6.5)),
    )  # fmt: skip


def sloping_square(seed: int) -> RareEvent:
    """Draw ``(w . x)^2 - n . x / 2 > 24``: the linear model has a way at 48, the two that matter are at 4.9."""
    n, w = frame(10, 2, seed)
    return RareEvent(
        "a square beside a slope", lambda x: ((x @ w) ** 2 - 0.5 * (x @ n))[:, None],
        lambda x: (-0.5 * (x @ n))[:, None], upper(24.0), 10,
        over_a_normal(lambda z: special.ndtr((z**2 - 24.0) / 0.5)),
    )  # fmt: skip


def table_of_three(seed: int) -> RareEvent:
    """Return a table of 0, 3 and 8, of 99.5, 0.45 and 0.05 %, plus a normal, beyond 9."""

    def outputs(x: Array) -> Array:
        return np.asarray((TABLE.transform(x[:, 0]) + x[:, 1])[:, None])

    exact = float(np.array([0.995, 0.0045, 0.0005]) @ special.ndtr(np.array([0.0, 3.0, 8.0]) - 9.0))
    return RareEvent("a table of three values", outputs, outputs, upper(9.0), 3, exact)


def hidden_corner(seed: int) -> RareEvent:
    """Draw ``n . x > 5``, or both of m . x and k . x above 3.2, of which the linear model knows nothing."""
    n, m, k = frame(6, 3, seed)
    exact = float(special.ndtr(-5.0) + special.ndtr(5.0) * special.ndtr(-3.2) ** 2)
    return RareEvent(
        "a hidden corner", lambda x: np.maximum(x @ n, 1.8 + np.minimum(x @ m, x @ k))[:, None],
        lambda x: (x @ n)[:, None], upper(5.0), 6, exact,
    )  # fmt: skip


def ring(seed: int) -> RareEvent:
    """Draw ``n . x > 5``, or a jump where the distance across n is between 5.4 and 5.7."""
    axes = frame(5, 5, seed)
    share = float(stats.chi.cdf(5.7, 4) - stats.chi.cdf(5.4, 4))

    def outputs(x: Array) -> Array:
        across = np.linalg.norm(x @ axes[1:].T, axis=1)
        return np.asarray((x @ axes[0] + 20.0 * ((across > 5.4) & (across < 5.7)))[:, None])

    exact = share + (1.0 - share) * float(special.ndtr(-5.0))
    return RareEvent("a ring", outputs, lambda x: (x @ axes[0])[:, None], upper(5.0), 5, exact)


def frame(dimensions: int, count: int, seed: int) -> Array:
    """Draw orthonormal directions, shape (count, dimensions)."""
    normals = np.random.default_rng((9, dimensions, seed)).standard_normal((dimensions, dimensions))
    return np.asarray(np.linalg.qr(normals)[0][:count])


def over_a_normal(beyond: Callable[[float], float]) -> float:
    """Integrate a probability given a standard normal."""
    return sum(
        float(integrate.quad(lambda z: beyond(z) * stats.norm.pdf(z), *ends, epsabs=0.0, epsrel=1e-9, limit=400)[0])
        for ends in pairwise(ENDS)
    )  # fmt: skip


SHAPES: Final = (saturating, sloping_square, table_of_three, hidden_corner, ring)
