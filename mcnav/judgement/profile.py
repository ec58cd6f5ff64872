"""The log-likelihood of a record over the factors of one size: its highest value, and the interval of the factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray

DROP: Final = 1.920729410347062
"""Fall of the log-likelihood at the ends of a 95 % interval: half the 95 % point of chi-square of one degree."""


SMOOTH: Final = 1.0
"""Difference of log-likelihoods of neighbouring factors up to which a parabola, or a line, stands between them."""


@dataclass(frozen=True)
class Factor:
    """The factor of a size by maximum likelihood.

    Attributes
    ----------
    value : float
    low, high : float
        Ends of the 95 % interval; 0 or infinite where the likelihood does not fall that far.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Sums:
    """Sums of f sets of sizes: z.z + sum log det S, shape (f,), W^T z, (f, b), and W^T W, (f, b, b)."""

    totals: Array
    products: Array
    information: Array

    def values(self, free: IndexArray) -> Array:
        """Return the log-likelihoods with some errors free, shape (f,)."""
        if not len(free):
            return np.asarray(-0.5 * self.totals)
        gained = np.einsum("fa,fa->f", self.products[:, free], self.estimates(free))
        return np.asarray(-0.5 * (self.totals - gained))

    def covariances(self, free: IndexArray) -> Array:
        """Return the covariances of the estimates of some errors, shape (f, a, a)."""
        matrices = self.information[:, free[:, None], free]
        scale = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 1e-300))
        scales = scale[:, :, None] * scale[:, None, :]
        return np.asarray(np.linalg.pinv(matrices / scales, rcond=1e-9, hermitian=True) / scales)

    def estimates(self, free: IndexArray) -> Array:
        """Return the estimates of some errors, all free, shape (f, a)."""
        return np.asarray(np.einsum("fab,fb->fa", self.covariances(free), self.products[:, free]))

    def part(self, errors: IndexArray) -> Sums:
        """Return the sums of some errors."""
        return Sums(self.totals, self.products[:, errors], self.information[:, errors[:, None], errors])

    def chosen(self, sets: IndexArray) -> Sums:
        """Return some sets of sizes."""
        return Sums(self.totals[sets], self.products[sets], self.information[sets])


@dataclass(frozen=True)
class Profile:
    """Sums of a record with one size multiplied by rising factors."""

    factors: Array
    sums: Sums

    def highest(self, free: IndexArray) -> tuple[float, float]:
        """Return the factor of the highest log-likelihood, and it: of the parabola through its neighbours."""
        values = self.sums.values(free)
        best = int(np.argmax(values))
        if best in (0, len(values) - 1):
            return float(self.factors[best]), float(values[best])
        logs = np.log(self.factors[best - 1 : best + 2])
        left, right = logs[0] - logs[1], logs[2] - logs[1]
        low, here, high = values[best - 1 : best + 2]
        bend = ((high - here) / right - (low - here) / left) / (right - left)
        slope = (high - here) / right - bend * right
        step = -0.5 * slope / bend if bend < 0.0 else 0.0
        return float(np.exp(logs[1] + step)), float(here + slope * step + bend * step**2)

    def at_end(self, free: IndexArray) -> bool:
        """Return whether the highest value is at an end of the factors."""
        return int(np.argmax(self.sums.values(free))) in (0, len(self.factors) - 1)

    def between(self, free: IndexArray) -> Array:
        """Return factors between the highest value and its neighbours; none at an end, or where these are close."""
        values = self.sums.values(free)
        best = int(np.argmax(values))
        if best in (0, len(values) - 1) or values[best] - min(values[best - 1], values[best + 1]) < SMOOTH:
            return np.zeros(0)
        below = np.geomspace(self.factors[best - 1], self.factors[best], 4)[1:-1]
        return np.concatenate([below, np.geomspace(self.factors[best], self.factors[best + 1], 4)[1:-1]])

    def near_ends(self, free: IndexArray, drop: float) -> Array:
        """Return factors about the ends of an interval, of the sides that have one, but where these are close."""
        brackets = (self._bracket(free, drop, side) for side in (-1, 1))
        return np.concatenate([np.zeros(0), *(
            np.exp(np.linspace(bracket[0], bracket[1], 5)[1:-1])
            for bracket in brackets if bracket is not None and bracket[2] - bracket[3] > SMOOTH
        )])  # fmt: skip

    def factor(self, free: IndexArray, drop: float) -> Factor:
        """Return the factor with its interval."""
        ends = []
        for side, none in ((-1, 0.0), (1, np.inf)):
            bracket = self._bracket(free, drop, side)
            if bracket is None:
                ends.append(none)
                continue
            inner, outer, above, below = bracket
            ends.append(float(np.exp(inner + (outer - inner) * above / (above - below))))
        return Factor(self.highest(free)[0], ends[0], ends[1])

    def _bracket(self, free: IndexArray, drop: float, side: int) -> tuple[float, float, float, float] | None:
        """Return logarithms of factors about an end, and their log-likelihoods above that of the end; none without."""
        values = self.sums.values(free)
        best = int(np.argmax(values))
        level = values[best] - drop
        outwards = np.arange(best, len(values)) if side > 0 else np.arange(best, -1, -1)
        below = np.flatnonzero(values[outwards] < level)
        if not len(below):
            return None
        inner, outer = outwards[below[0] - 1], outwards[below[0]]
        logs = np.log(self.factors)
        return float(logs[inner]), float(logs[outer]), float(values[inner] - level), float(values[outer] - level)


def merged(profile: Profile, other: Profile | None) -> Profile:
    """Return a profile with the factors of another one besides."""
    if other is None:
        return profile
    factors = np.concatenate([profile.factors, other.factors])
    order = np.argsort(factors)
    pairs = zip(vars(profile.sums).values(), vars(other.sums).values(), strict=True)
    return Profile(factors[order], Sums(*(np.concatenate(pair)[order] for pair in pairs)))
