"""Bisection, for a few roots where the import of `scipy.optimize` would take longer: a tenth of a second."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from mcnav.errors import NumericalError

SPARE: Final = 1
"""Steps that a root may take more than halving does."""


def smallest_reaching(rising: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Find where a rising function reaches a value between low and high, to the last bit.

    Raises `NumericalError` where it does not reach the value up to high, or does not rise.

    >>> smallest_reaching(lambda x: x * x, 2.0, 0.0, 2.0)
    1.4142135623730951
    """
    ends = rising(low), rising(high)
    if not ends[0] <= ends[1] or not ends[1] >= wanted:
        raise NumericalError(f"{wanted:g} is not between {ends[0]:g} at {low:g} and {ends[1]:g} at {high:g}")
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high


def root_between(
    function: Callable[[float], float], low: tuple[float, float], high: tuple[float, float], width: float,
    order: float | None = None,
) -> tuple[float, float]:  # fmt: skip
    """Find the last bracket of a root, at most so wide, by false position kept near the middle of the bracket.

    A smooth function takes ten evaluations or so, and no function more than halving takes and `SPARE`.

    Parameters
    ----------
    low, high : (float, float)
        Places, and the values there: one above zero, the other not.
    order : float, optional
        Largest departure from order that is rounding, for a function that is known to rise or to fall throughout.

    Raises
    ------
    NumericalError
        Where the ends do not enclose a root, a value is not a number, or values are out of order.

    References
    ----------
    Oliveira and Takahashi, *An enhancement of the bisection method average performance preserving minmax optimality*
    (ACM TOMS 47, 2021): interpolate, truncate, project; with kappa_1 = 0.2 over the first bracket, kappa_2 = 2.

    Examples
    --------
    >>> low, high = root_between(lambda x: x * x - 2.0, (0.0, -2.0), (2.0, 2.0), 1e-9)
    >>> low <= 2.0**0.5 <= high, high - low <= 1e-9
    (True, True)
    """
    (a, at_a), (b, at_b) = low, high
    if math.isnan(at_a) or math.isnan(at_b) or not a <= b or (at_a <= 0.0) == (at_b <= 0.0):
        raise NumericalError(f"{a:g} and {b:g} do not enclose a root: the values there are {at_a:g} and {at_b:g}")
    halvings = math.ceil(math.log2(max((b - a) / width, 1.0)))
    for step in range(halvings + SPARE + 1):
        if b - a <= width:
            break
        middle, slope = 0.5 * (a + b), at_b - at_a
        near = a - at_a * (b - a) / slope if math.isfinite(slope) else middle
        # towards the middle by a little, so that the root is between it and the far end; never so far from the middle
        # that halving what is left takes more steps than there are
        inwards = min(0.2 * (b - a) ** 2 / (high[0] - low[0]), abs(middle - near))
        x = near + math.copysign(inwards, middle - near)
        reach = max(0.5 * width * 2.0 ** (halvings + SPARE - step) - 0.5 * (b - a), 0.0)
        x = min(max(x, middle - reach, a + 0.25 * width), middle + reach, b - 0.25 * width)
        x = min(max(x, math.nextafter(a, b)), math.nextafter(b, a))
        if not a < x < b:
            return a, b  # to the last bit
        at_x = function(x)
        least, most = min(at_a, at_b), max(at_a, at_b)
        if math.isnan(at_x) or (order is not None and not least - order <= at_x <= most + order):
            raise NumericalError(f"between {at_a:g} at {a:g} and {at_b:g} at {b:g} a root search met {at_x:g} at {x:g}")
        if (at_x <= 0.0) == (at_a <= 0.0):
            a, at_a = x, at_x
        else:
            b, at_b = x, at_x
    return a, b
