"""Integrals of many functions at once, each to a relative error: Gauss and Legendre's rule, halved where needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.errors import NumericalError

NODES: Final = 16
"""Nodes of the rule within an interval."""

RELATIVE: Final = 1e-10
"""Change of an integral by halving an interval, as a share of it, from which on the halves are halved: usual one."""

LEAST: Final = 1e-300
"""Change of an integral that does not matter."""

HALVINGS: Final = 40
"""Largest number of halvings."""


def integrals(function: Callable[[IndexArray, Array], Array], breaks: Array, relative: float = RELATIVE) -> Array:
    """Integrate m functions that are not negative, each over the intervals between its breaks; shape (m,).

    Parameters
    ----------
    function : callable
        Values at places of shape (p, q) of the functions whose numbers have the shape (p,).
    breaks : ndarray, shape (m, k)
        In rising order: ends, and places near which a function may change within a small share of its interval.
    relative : float
        Change by halving an interval, as a share of the integral, that is small.

    Raises
    ------
    NumericalError
        Where halving does not settle an integral.

    >>> integrals(lambda numbers, x: x ** (numbers[:, None] + 0.5), np.array([[0.0, 1.0], [0.0, 1.0]])).round(9)
    array([0.66666667, 0.4       ])
    """
    numbers = np.repeat(np.arange(len(breaks)), breaks.shape[1] - 1)
    low, high = breaks[:, :-1].ravel(), breaks[:, 1:].ravel()
    wide = high > low
    numbers, low, high = numbers[wide], low[wide], high[wide]
    values, settled = _rule(function, numbers, low, high), np.zeros(len(breaks))
    for _ in range(HALVINGS):
        if not len(numbers):
            return settled
        middle = 0.5 * (low + high)
        left, right = _rule(function, numbers, low, middle), _rule(function, numbers, middle, high)
        halved = left + right
        whole = settled + np.bincount(numbers, halved, len(breaks))
        done = np.abs(halved - values) <= np.maximum(relative * whole[numbers], LEAST)
        settled += np.bincount(numbers[done], halved[done], len(breaks))
        numbers, low, middle, high = numbers[~done], low[~done], middle[~done], high[~done]
        values = np.concatenate([left[~done], right[~done]])
        numbers, low, high = np.tile(numbers, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
    raise NumericalError(f"an integral does not settle between {low[0]:g} and {high[0]:g}")


def _rule(function: Callable[[IndexArray, Array], Array], numbers: IndexArray, low: Array, high: Array) -> Array:
    nodes, weights = _nodes()
    half = 0.5 * (high - low)
    places = 0.5 * (high + low)[:, None] + half[:, None] * nodes
    return np.asarray(half * (function(numbers, places) @ weights))


@cache
def _nodes() -> tuple[Array, Array]:
    nodes, weights = special.roots_legendre(NODES)
    return nodes, weights
