"""What every test of a hypothesis returns."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HypothesisTest:
    """A test statistic beside its distribution under the hypothesis.

    Attributes
    ----------
    statistic : float
        Infinite when the sample does what the hypothesis excludes.
    degrees_of_freedom : tuple of float
        Of the chi-square or F distribution that the statistic follows; empty for a standard normal one.
    p_value : float
        Probability of a statistic at least as far out, if the hypothesis holds.
    rank : int
        Dimension of the space in which was tested.
    """

    statistic: float
    degrees_of_freedom: tuple[float, ...]
    p_value: float
    rank: int
