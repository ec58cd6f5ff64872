"""Small probabilities that a quadratic function of normal variables lies beyond a limit.

Of ``y = m + sum_k (g_k u_k + 1/2 q_k u_k^2) + sigma w`` with independent standard normals u and w the cumulants are
known (Imhof, *Biometrika* 48, 1961, 419)::

    K(s) = m s + 1/2 sigma^2 s^2 + sum_k [1/2 g_k^2 s^2 / (1 - q_k s) - 1/2 log(1 - q_k s)]

and ``P(y > c) = 1 / (2 pi i) ∫ exp(K(s) - s c) / s ds`` along any path that crosses the real axis between zero and the
first of 1 / q_k: an upright line through the saddle point, or, where what curves downwards cannot reach c, a hyperbola
60 degrees from the real axis far out, on which the integrand falls fast. The trapezoidal rule is good to 1e-10 of the
probability, however small. Second-order reliability (Breitung,
*Journal of Engineering Mechanics* 110, 1984, 357) is what it approaches far out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.statistics.bisection import root_between

PER_SCALE: Final = 8
"""Nodes of the rule in the distance of the path from the nearest pole."""

LEANING: Final = 3.0**-0.5
"""Slope of the hyperbola from the upright, far out: beyond one, noise would make the integrand grow."""

MOST_NODES: Final = 100_000
SECOND: Final = 0.95
"""Share of the saddle point through which a second path leads, with `PER_SCALE` - 2 nodes: both must agree."""

AGREEMENT: Final = 1e-6
"""Largest difference of the two, as a share of the probability."""

NEGLIGIBLE: Final = 1e-13
"""Share of the largest value of the integrand below which it ends."""

FARTHEST: Final = 1e4
"""Saddle point, times the standard deviation, beyond which there is no probability left."""


@dataclass(frozen=True)
class QuadraticForm:
    """Quadratic function of normal variables: m, g and q, shape (r,), and sigma."""

    mean: float
    slopes: Array
    curvatures: Array
    sigma: float = 0.0

    def beyond(self, limit: float) -> float:
        """Return the probability of ``|y| > limit``, each side by itself; NaN where the integral does not converge.

        >>> form = QuadraticForm(0.0, np.array([1.0]), np.array([0.0]))
        >>> f"{form.beyond(5.0):.6e}"
        '5.733031e-07'
        """
        return self.above(limit) + self._mirrored.above(limit)

    @property
    def _mirrored(self) -> QuadraticForm:
        return QuadraticForm(-self.mean, self.slopes, -self.curvatures, self.sigma)

    @property
    def scale(self) -> float:
        """The standard deviation."""
        return math.sqrt(float(np.sum(self.slopes**2 + 0.5 * self.curvatures**2)) + self.sigma**2)

    def above(self, limit: float) -> float:
        """Return the probability of ``y > limit``; NaN where the integral does not converge.

        NaN also where a second path gives another probability.
        """
        scale, expected = self.scale, self.mean + 0.5 * float(np.sum(self.curvatures))
        if scale == 0.0:
            return float(expected > limit)
        if expected > limit:
            return 1.0 - self._mirrored.above(-limit)  # on the other side of the mean terms cancel
        largest = float(np.max(self.curvatures, initial=0.0))
        # lengths in standard deviations
        form = QuadraticForm((self.mean - limit) / scale, self.slopes / scale, self.curvatures / scale,
                             self.sigma / scale)  # fmt: skip
        end = min(FARTHEST, scale / largest * (1.0 - 1e-9)) if largest > 0.0 else FARTHEST

        def slope(s: float) -> float:
            return form._derivatives(s)[0] - 1.0 / s

        low = 1e-6 * min(1.0, end)
        if slope(end) < 0.0:
            return 0.0
        ends = root_between(slope, (low, slope(low)), (end, slope(end)), 1e-12 * end)
        saddle = 0.5 * (ends[0] + ends[1])
        value, again = form._integral(saddle, PER_SCALE), form._integral(SECOND * saddle, PER_SCALE - 2)
        return value if 0.0 <= value <= 1.0 and abs(value - again) <= AGREEMENT * value else math.nan

    def _cumulant(self, s: Array) -> Array:
        left = 1.0 - np.multiply.outer(s, self.curvatures)
        terms = 0.5 * np.multiply.outer(s**2, self.slopes**2) / left - 0.5 * np.log(left)
        return np.asarray(self.mean * s + 0.5 * (self.sigma * s) ** 2 + np.sum(terms, axis=-1))

    def _derivatives(self, s: float) -> tuple[float, float]:
        """Return the first two derivatives of K."""
        left, g, q = 1.0 - s * self.curvatures, self.slopes**2, self.curvatures
        first = self.mean + self.sigma**2 * s + np.sum(g * s * (2.0 - s * q) / (2.0 * left**2) + 0.5 * q / left)
        second = self.sigma**2 + np.sum(g / left**3 + 0.5 * q**2 / left**2)
        return float(first), float(second)

    def _integral(self, saddle: float, per_scale: int) -> float:
        """Return ``1 / pi ∫ Im exp(K(s)) / s ds`` over ``s = saddle + i t + leaning (sqrt(t^2 + w^2) - w)``, t > 0."""
        height = float(self._cumulant(np.array(saddle)))
        width = 1.0 / math.sqrt(self._derivatives(saddle)[1] + saddle**-2)
        largest = float(np.max(self.curvatures, initial=0.0))
        room = 1.0 / largest - saddle if largest > 0.0 else math.inf
        step = min(saddle, width, room) / per_scale
        down = self.curvatures < 0.0
        reached = float(np.sum(0.5 * self.slopes[down] ** 2 / -self.curvatures[down]))
        leaning = LEANING if self.mean + reached < 0.0 else 0.0
        total, most = 0.0, 0.0
        for begin in range(0, MOST_NODES, 512):
            t = step * np.arange(begin, begin + 512)
            root = np.sqrt(t**2 + width**2)
            s = saddle + 1j * t + leaning * (root - width)
            with np.errstate(over="ignore", invalid="ignore"):
                terms = np.exp(self._cumulant(s) - height) / s * (1j + leaning * t / root)
            if not np.isfinite(terms).all():
                break
            terms[0] *= 0.5 if begin == 0 else 1.0
            total += float(np.sum(terms.imag))
            most = max(most, float(np.abs(terms).max()))
            if float(np.abs(terms[-64:]).max()) < NEGLIGIBLE * most:
                return math.exp(height) * step * total / math.pi
        return math.nan
