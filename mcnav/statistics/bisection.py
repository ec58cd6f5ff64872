"""Bisection, for a few roots where the import of `scipy.optimize` would take longer: a tenth of a second."""

from __future__ import annotations

from collections.abc import Callable


def smallest_reaching(rising: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Find where a rising function reaches a value between low and high, to the last bit; high if it does not.

    >>> smallest_reaching(lambda x: x * x, 2.0, 0.0, 2.0)
    1.4142135623730951
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high
