"""Bisection, for a few roots where the import of `scipy.optimize` would take longer: a tenth of a second."""

from __future__ import annotations

import math
from collections.abc import Callable


def smallest_reaching(rising: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Find where a rising function reaches a value between low and high, to the last bit; high if it does not.

    >>> smallest_reaching(lambda x: x * x, 2.0, 0.0, 2.0)
    1.4142135623730951
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high


def root_between(
    function: Callable[[float], float], low: tuple[float, float], high: tuple[float, float], width: float
) -> tuple[float, float]:
    """Find the last bracket of a root, at most so wide, by false position and, where that is longer, bisection.

    Parameters
    ----------
    low, high : (float, float)
        Places, and the values there: one above zero, the other not.

    References
    ----------
    Dowell and Jarratt, *A modified regula falsi method for computing the root of an equation* (BIT 11, 1971): the
    Illinois method.

    Examples
    --------
    >>> low, high = root_between(lambda x: x * x - 2.0, (0.0, -2.0), (2.0, 2.0), 1e-9)
    >>> low <= 2.0**0.5 <= high, high - low <= 1e-9
    (True, True)
    """
    (a, at_a), (b, at_b) = low, high
    moved = ""
    while b - a > width:
        before = b - a
        for bisect in (False, True):
            slope = at_b - at_a
            x = 0.5 * (a + b) if bisect or not math.isfinite(slope) else a - at_a * (b - a) / slope
            x = min(max(x, a + 0.25 * width), b - 0.25 * width)
            if not a < x < b:
                return a, b  # to the last bit
            at_x = function(x)
            if (at_x <= 0.0) == (at_a <= 0.0):
                at_b *= 0.5 if moved == "a" else 1.0
                a, at_a, moved = x, at_x, "a"
            else:
                at_a *= 0.5 if moved == "b" else 1.0
                b, at_b, moved = x, at_x, "b"
            if b - a <= max(width, 0.5 * before):
                break
    return a, b
