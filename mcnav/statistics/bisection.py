"""Bisection, for a few roots where the import of `scipy.optimize` would take longer: a tenth of a second."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any, Final

from mcnav.errors import NumericalError

SPARE: Final = 1
"""Steps that a root may take more than halving does."""

Place = tuple[float, float]
"""Where a function is evaluated, and its value there."""

Bracket = tuple[float, float]


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
    function: Callable[[float], float], low: Place, high: Place, width: float, order: float | None = None
) -> Bracket:
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
    (bracket,) = _search([_narrow(low, high, width, order)], lambda _, places: [function(places[0])])
    if isinstance(bracket, NumericalError):
        raise bracket
    return bracket


def roots_between(
    functions: Callable[[list[int], list[float]], Sequence[float]], lows: Iterable[Place], highs: Iterable[Place],
    widths: Iterable[float], orders: Iterable[float],
) -> list[Bracket | NumericalError]:  # fmt: skip
    """Find the last brackets of roots of many functions, as `root_between` does, which are evaluated together.

    Where that raises an error, the error is the result.

    Parameters
    ----------
    functions : callable
        Values of the functions with these numbers at these places.

    >>> squares = [2.0, 9.0]
    >>> ends = roots_between(lambda numbers, places: [x * x - squares[i] for i, x in zip(numbers, places)],
    ...                      [(0.0, -2.0), (0.0, -9.0)], [(2.0, 2.0), (4.0, 7.0)], [1e-9, 1e-9], [0.0, 0.0])
    >>> [round(low, 8) for low, high in ends]
    [1.41421356, 3.0]
    """
    return _search([_narrow(*search) for search in zip(lows, highs, widths, orders, strict=True)], functions)


def _search(
    searches: Sequence[Generator[float, Any, Bracket]], functions: Callable[[list[int], list[float]], Sequence[float]]
) -> list[Bracket | NumericalError]:
    """Bring searches to their ends, side by side: each yields the next place of its function, and is sent the value."""
    ends: dict[int, Bracket | NumericalError] = {}
    values: dict[int, float | None] = dict.fromkeys(range(len(searches)))
    while values:
        places: dict[int, float] = {}
        for number, value in values.items():
            try:
                places[number] = searches[number].send(value)
            except StopIteration as end:
                ends[number] = end.value
            except NumericalError as refusal:
                ends[number] = refusal
        values = dict(zip(places, functions([*places], [*places.values()]), strict=True)) if places else {}
    return [ends[number] for number in range(len(searches))]


def _narrow(low: Place, high: Place, width: float, order: float | None) -> Generator[float, float, Bracket]:
    """Yield places of a function until its root is known well enough, and return its bracket; see `root_between`."""
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
        at_x = yield x
        least, most = min(at_a, at_b), max(at_a, at_b)
        if math.isnan(at_x) or (order is not None and not least - order <= at_x <= most + order):
            raise NumericalError(f"between {at_a:g} at {a:g} and {at_b:g} at {b:g} a root search met {at_x:g} at {x:g}")
        if (at_x <= 0.0) == (at_a <= 0.0):
            a, at_a = x, at_x
        else:
            b, at_b = x, at_x
    return a, b
