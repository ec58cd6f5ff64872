"""Squared distances of samples, normalised by a covariance, against the chi-square distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.proportions import probability_interval

LEVELS: Final = (0.5, 0.9, 0.95, 0.99, 0.9973)


def mean_interval(count: int, dimension: int, confidence: float) -> tuple[float, float]:
    """Return the interval of the mean of n squared distances that are chi-square of a dimension.

    Their sum is chi-square of n times the dimension (Bar-Shalom, Li and Kirubarajan, 2001, section 5.4.2).

    >>> [round(bound, 3) for bound in mean_interval(1000, 4, 0.95)]
    [3.827, 4.177]
    """
    freedom = count * dimension
    tail = 0.5 - 0.5 * confidence
    return float(special.chdtri(freedom, 1.0 - tail)) / count, float(special.chdtri(freedom, tail)) / count


def distribution_test(values: Array, dimension: int) -> HypothesisTest | None:
    """Test independent squared distances, shape (n,), against chi-square of a dimension (Kolmogorov-Smirnov)."""
    if len(values) == 0 or dimension < 1:
        return None
    count = len(values)
    expected = special.chdtr(dimension, np.sort(values))
    above = np.max(np.arange(1, count + 1) / count - expected)
    below = np.max(expected - np.arange(count) / count)
    distance = float(max(above, below))
    return HypothesisTest(distance, (float(count),), kolmogorov_p_value(distance, count), dimension)


def kolmogorov_p_value(distance: float, count: int) -> float:
    """Compute the probability of a Kolmogorov-Smirnov distance larger than D.

    With ``x = sqrt(n) D`` it is the limiting distribution's at ``x + 1 / (6 sqrt(n)) + (x - 1) / (4 n)`` (Vrbik,
    *Pioneer Journal of Theoretical and Applied Statistics* 15, 2018), with a relative error below 1 / n down to 0.01.
    """
    x, root = np.sqrt(count) * distance, np.sqrt(count)
    return float(special.kolmogorov(x + 1.0 / (6.0 * root) + (x - 1.0) / (4.0 * count)))


@dataclass(frozen=True)
class Containment:
    """Share of samples inside an ellipsoid whose probability is ``level`` if they are normal with a given covariance.

    The interval is that of the probability (Clopper and Pearson).
    """

    level: float
    share: float
    interval: tuple[float, float]


def containment(hits: Array, count: int, confidence: float) -> tuple[Containment, ...]:
    """Return the shares of independent samples inside the ellipsoids of `LEVELS`, from the numbers inside each."""
    return tuple(
        Containment(level, int(hit) / count, probability_interval(int(hit), count, confidence))
        for level, hit in zip(LEVELS, hits, strict=False)
    )
