"""The measured covariance of a user's class's noise, and by how many simulations it is measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mcnav.arrays.types import Array

INDEPENDENT: Final = 1_000
"""Independent samples of noise from which sigmas have a standard error of 2.2 %; probes do no worse."""

EVERY: Final = 500
"""Variates up to which there is a probe for each, so that the covariance is exact but for the differences."""


def probe_count(variates: int) -> int:
    """Return the number of probes that do as well as `INDEPENDENT` samples of noise, or better.

    >>> probe_count(8), probe_count(1_200), probe_count(10**6)
    (8, 546, 1000)
    """
    equal = math.ceil(INDEPENDENT * variates / (variates + INDEPENDENT - 1))
    return min(variates, max(EVERY, equal))


@dataclass(frozen=True)
class MeasuredNoise:
    """Covariance of the noise, and from what it was measured.

    Attributes
    ----------
    covariance : ndarray, shape (m, outputs, outputs)
    first : ndarray, shape (m, outputs)
        Response to the first probe, by which another process can tell whether the class still does the same.
    variates : int or None
        Variates of a simulation; none where their number differs, so that the noise is independent.
    """

    covariance: Array
    first: Array
    variates: int | None

    @property
    def simulations(self) -> int:
        """Linear simulations."""
        return INDEPENDENT if self.variates is None else probe_count(self.variates)

    @property
    def sigma_error(self) -> float:
        """Standard error of sigmas, as a share; zero where there was a probe for each variate."""
        count, variates = self.simulations, self.variates
        if variates is None:
            return math.sqrt(0.5 / count)
        return math.sqrt(0.5 * (variates - count) / (count * (variates - 1))) if count < variates else 0.0

    def __str__(self) -> str:
        if self.variates is not None and self.simulations == self.variates:
            return f"computed from a linear simulation for each of its {self.variates:,} variates"
        return f"measured from {self.simulations:,} linear simulations, sigmas to {100.0 * self.sigma_error:.1f} %"
