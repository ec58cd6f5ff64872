"""Result of a hypothesis test."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HypothesisTest:
    """Test statistic and its distribution under the hypothesis.

    Attributes
    ----------
    statistic : float
        Infinite when the sample contradicts the hypothesis with certainty.
    degrees_of_freedom : tuple of float
        Degrees of freedom of the statistic's chi-square or F distribution; empty for a standard normal one.
    p_value : float
        Probability of a statistic at least as extreme under the hypothesis.
    rank : int
        Dimension of the space of the test.
    """

    statistic: float
    degrees_of_freedom: tuple[float, ...]
    p_value: float
    rank: int
