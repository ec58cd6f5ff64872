"""Derivatives of maps by central differences, for one state of X or many at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.systems.closed_loop.rotations import Space

Map = Callable[[Array, Array], Array]
"""X, shape (size, n), and inputs, shape (k, n), to shape (m, n)."""

SHARE: Final = 0.1
"""Step along the nominal, as a share of a quantity's size: the error of differences of fourth order is 1e-4 of a term
of fifth order at one sigma, and rounding is magnified by ten."""

OWN_SHARE: Final = 0.01
"""Step of differences about every sample's own estimate."""


@dataclass(frozen=True)
class Derivatives:
    """A map's value at a state, and its derivatives.

    Attributes
    ----------
    value : ndarray, shape (m,)
    state : ndarray, shape (m, size)
    inputs : ndarray, shape (m, k)
    kinked : ndarray of bool, shape (m, size + k)
        Where forward and backward differences differ by as much at half of the step.
    """

    value: Array
    state: Array
    inputs: Array
    kinked: NDArray[np.bool_]


def differentiate_map(
    function: Map, x: Array, steps: Array, input_steps: Array, space: Space, result: Space | None = None
) -> Derivatives:
    """Differentiate a map about one state, shape (size,), to fourth order: (8 (f1 - f-1) - (f2 - f-2)) / (12 step).

    Parameters
    ----------
    space : Space
        Sums of X.
    result : Space, optional
        Differences of the map's values; ordinary ones unless given.
    """
    size, inputs = len(x), len(input_steps)
    total, all_steps = size + inputs, SHARE * np.concatenate([steps, input_steps])
    moved = np.zeros((total, 4 * total + 1))
    for number, multiple in enumerate((1.0, -1.0, 2.0, -2.0)):
        moved[np.arange(total), 1 + number * total + np.arange(total)] = multiple * all_steps
    values = function(space.plus(x[:, None], moved[:size]), moved[size:])
    value = middle = values[:, 0]
    if result is not None and result.attitudes:
        turns = result.minus(values, middle[:, None])
        values, middle = values.copy(), middle.copy()
        for place, _ in result.attitudes:
            values[place], middle[place] = turns[place], 0.0
    one, less, two, less_two = np.split(values[:, 1:], 4, axis=1)
    slopes = (8.0 * (one - less) - (two - less_two)) / (12.0 * all_steps)
    near, far = np.abs(one + less - 2.0 * middle[:, None]), np.abs(two + less_two - 2.0 * middle[:, None])
    rounding = 1e-9 * (np.abs(values).max(axis=1, keepdims=True) + 1e-300)
    moves = np.maximum(np.abs(one - middle[:, None]), np.abs(less - middle[:, None]))
    kinked = (near > 0.05 * moves) & (far < 3.0 * near) & (moves > rounding)  # smooth: far = 4 near; a kink: 2 near
    return Derivatives(value, slopes[:, :size], slopes[:, size:], kinked)


def differentiate_own(
    function: Map, x: Array, directions: Array, inputs: Array, space: Space, result: Space | None = None
) -> Array:
    """Differentiate a map about every sample's state, to second order by X, to first order by what enters.

    Parameters
    ----------
    x : ndarray, shape (size, n)
    directions : ndarray, shape (size, d)
        Changes of X.
    inputs : ndarray, shape (k,)
        Changes of the inputs.
    space, result : Space
        As those of `differentiate_map`.

    Returns
    -------
    ndarray, shape (n, m, d + those of the inputs that change)
        Changes of the map's value.
    """
    size, count = x.shape
    d, entering = directions.shape[1], OWN_SHARE * np.diag(inputs)[:, inputs != 0.0]
    k = entering.shape[1]
    moved = np.zeros((size + len(inputs), 2 * d + (k + 1 if k else 0)))
    moved[:size, :d], moved[:size, d : 2 * d] = OWN_SHARE * directions, -OWN_SHARE * directions
    moved[size:, 2 * d : 2 * d + k] = entering
    states = space.plus(x[:, None, :], moved[:size, :, None]).reshape(size, -1)
    values = function(states, np.repeat(moved[size:], count, axis=1)).reshape(-1, moved.shape[1], count)
    minus = (Space() if result is None else result).minus
    changes = np.empty((count, len(values), d + k))
    changes[:, :, :d] = minus(values[:, :d], values[:, d : 2 * d]).transpose(2, 0, 1) / (2.0 * OWN_SHARE)
    if k:
        changes[:, :, d:] = minus(values[:, 2 * d : 2 * d + k], values[:, -1:]).transpose(2, 0, 1) / OWN_SHARE
    return changes
