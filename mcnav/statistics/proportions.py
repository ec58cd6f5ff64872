"""Exact bounds of a probability from counts (Clopper and Pearson, Biometrika 26, 1934, 404)."""

from __future__ import annotations

from scipy import special


def lower_probability(hits: int, count: int, confidence: float) -> float:
    """Bound a probability from below, one-sided, from hits among ``count`` independent trials.

    >>> round(lower_probability(59, 59, 0.95), 4)
    0.9505
    """
    _check(hits, count)
    return 0.0 if hits == 0 else float(special.betaincinv(hits, count - hits + 1, 1.0 - confidence))


def upper_probability(hits: int, count: int, confidence: float) -> float:
    """Bound a probability from above, as `lower_probability`."""
    _check(hits, count)
    return 1.0 if hits == count else float(special.betaincinv(hits + 1, count - hits, confidence))


def probability_interval(hits: int, count: int, confidence: float) -> tuple[float, float]:
    """Return the two-sided interval of a probability, with equal tails."""
    each = 0.5 + 0.5 * confidence
    return lower_probability(hits, count, each), upper_probability(hits, count, each)


def _check(hits: int, count: int) -> None:
    if not 0 <= hits <= count:
        raise ValueError(f"hits must lie between 0 and the number of trials; got {hits} of {count}")
