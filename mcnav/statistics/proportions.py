"""Exact bounds of a probability from counts (Clopper and Pearson, Biometrika 26, 1934, 404)."""

from __future__ import annotations

from typing import Final

from scipy import special

from mcnav.errors import NumericalError
from mcnav.statistics.refusals import or_withheld

BACK: Final = 1e-3
"""Largest difference of the probability of a quantile, computed back, as a share of the smaller tail.

Rounding of a quantile next to one leaves up to 1e-4.
"""


def lower_probability(hits: int, count: int, confidence: float) -> float:
    """Bound a probability from below, one-sided, from hits among ``count`` independent trials.

    A bound that does not compute back is withheld, by a note, and zero or one stands for it.

    >>> round(lower_probability(59, 59, 0.95), 4)
    0.9505
    """
    _check(hits, count)
    return 0.0 if hits == 0 else or_withheld(_beta_quantile, hits, count - hits + 1, 1.0 - confidence, instead=0.0)


def upper_probability(hits: int, count: int, confidence: float) -> float:
    """Bound a probability from above, as `lower_probability`."""
    _check(hits, count)
    return 1.0 if hits == count else or_withheld(_beta_quantile, hits + 1, count - hits, confidence, instead=1.0)


def probability_interval(hits: int, count: int, confidence: float) -> tuple[float, float]:
    """Return the two-sided interval of a probability, with equal tails."""
    each = 0.5 + 0.5 * confidence
    return lower_probability(hits, count, each), upper_probability(hits, count, each)


def _beta_quantile(first: int, second: int, probability: float) -> float:
    """Return a quantile of a beta variable, whose probability is computed back."""
    quantile = float(special.betaincinv(first, second, probability))
    back = float(special.betainc(first, second, quantile))
    if not abs(back - probability) <= BACK * min(probability, 1.0 - probability):
        raise NumericalError(
            f"the quantile {quantile:g} of a beta variable ({first}, {second}) is not at {probability:g}"
        )
    return quantile


def _check(hits: int, count: int) -> None:
    if not 0 <= hits <= count:
        raise ValueError(f"hits must lie between 0 and the number of trials; got {hits} of {count}")
