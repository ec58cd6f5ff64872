"""Derivatives of maps by central differences, for one state of X or many at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.algebra import find_departures
from mcnav.systems.closed_loop.rotations import Space

Map = Callable[[Array, Array], Array]
"""X, shape (size, n), and inputs, shape (k, n), to shape (m, n)."""

TimedMap = Callable[[Array, Array, Array], Array]
"""The same, of times and the like of each state besides, shape (k, n)."""

SHARE: Final = 0.1
"""Step along the nominal, as a share of a quantity's size: the error of differences of fourth order is 1e-4 of a term
of fifth order at one sigma, and rounding is magnified by ten."""

OWN_SHARE: Final = 0.01
"""Step of differences about every sample's own estimate: a filter is linearized half of that beside it."""


STRAIGHT: Final = 1e-9
"""Departure of a map from its derivatives, as a share of what its terms add up to, up to which it is linear."""

ROUNDING: Final = 1e-12
"""The same as a share of the map's value."""

MIXED: Final = 3
"""Points at which all of X and of what enters is moved together, to see whether a map is linear."""

COLUMNS: Final = 6_144
"""States of X that are propagated together for derivatives: their arrays stay in a processor's cache."""


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
    straight : Straight, optional
        Where the map is linear, at all points at which it was evaluated.
    mixed : ndarray, shape (m, MIXED)
        Its values with all of X and of what enters moved together.
    """

    value: Array
    state: Array
    inputs: Array
    kinked: NDArray[np.bool_]
    straight: Straight | None = None
    mixed: Array = field(default_factory=lambda: np.zeros((0, MIXED)))


@dataclass(frozen=True)
class Straight:
    """A map that is linear: ``value + A (X - origin) + G w``.

    Attributes
    ----------
    origin, value : ndarray, shapes (size,) and (m,)
    state, inputs : ndarray, shapes (m, size) and (m, k)
    floor : ndarray, shape (m,)
        Departures that are rounding.
    """

    origin: Array
    value: Array
    state: Array
    inputs: Array
    floor: Array

    def departures(self, x: Array, entering: Array, outcome: Array) -> NDArray[np.bool_]:
        """Find the samples for which the map has turned out otherwise, shape (n,)."""
        about, given = (self.origin, self.value, self.floor), (x, entering, outcome)
        return find_departures(self.state, self.inputs, about, (STRAIGHT, ROUNDING), given)


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
    moved = _moves(np.concatenate([steps, input_steps]))
    size = len(x)
    values = function(space.plus(x[:, None], moved[:size]), moved[size:])
    return _derivatives(values, x, moved, steps, input_steps, space, result)


def differentiate_maps(
    function: TimedMap, x: Array, at: Array, steps: Array, input_steps: Array, space: Space,
    result: Space | None = None,
) -> tuple[list[Derivatives], Array]:  # fmt: skip
    """Differentiate a map about n states at once, each at its own time and the like; see `differentiate_map`.

    Parameters
    ----------
    x : ndarray, shape (n, size)
    at : ndarray, shape (n, k)

    Returns
    -------
    list of Derivatives
    ndarray, shape (m, n, columns)
        The map's values, from which they follow.
    """
    moved, count = _moves(np.concatenate([steps, input_steps])), len(x)
    values = values_about(function, x, at, moved, space)
    each = [
        _derivatives(np.ascontiguousarray(values[:, number]), x[number], moved, steps, input_steps, space, result)
        for number in range(count)
    ]
    return each, values


def values_about(function: TimedMap, x: Array, at: Array, moved: Array, space: Space) -> Array:
    """Compute the values of a map about n states, shape (m, n, columns).

    Parameters
    ----------
    x : ndarray, shape (n, size)
    at : ndarray, shape (n, k)
    moved : ndarray, shape (size + inputs, columns)
        Changes of X, and below it of the inputs.
    """
    count, size = x.shape
    columns = moved.shape[1]
    states = space.plus(x.T[:, :, None], moved[:size, None]).reshape(size, -1)
    values = function(states, np.tile(moved[size:], (1, count)), np.repeat(at.T, columns, axis=1))
    return values.reshape(-1, count, columns)


def columns_of(total: int) -> int:
    """Return how many states of X a derivative by so many numbers takes."""
    return 4 * total + 1 + MIXED


def _moves(sizes: Array) -> Array:
    """Return the changes of X, and below it of the inputs, at which a map is evaluated; the first is none."""
    total, all_steps = len(sizes), SHARE * sizes
    moved = np.zeros((total, columns_of(total)))
    for number, multiple in enumerate((1.0, -1.0, 2.0, -2.0)):
        moved[np.arange(total), 1 + number * total + np.arange(total)] = multiple * all_steps
    moved[:, 4 * total + 1 :] = sizes[:, None] * mixed(total)
    return moved


def _derivatives(
    values: Array, x: Array, moved: Array, steps: Array, input_steps: Array, space: Space, result: Space | None
) -> Derivatives:
    """Return the derivatives of a map from its values, shape (m, columns)."""
    size, total = len(x), len(moved)
    all_steps = SHARE * np.concatenate([steps, input_steps])
    value, moved_together = values[:, 0], values[:, 4 * total + 1 :].copy()
    middle = value
    bent = bool(space.attitudes) or (result is not None and bool(result.attitudes))
    if result is not None and result.attitudes:
        turns = result.minus(values, middle[:, None])
        values, middle = values.copy(), middle.copy()
        for place, _ in result.attitudes:
            values[place], middle[place] = turns[place], 0.0
    one, less, two, less_two = np.split(values[:, 1 : 4 * total + 1], 4, axis=1)
    slopes = (8.0 * (one - less) - (two - less_two)) / (12.0 * all_steps)
    near, far = np.abs(one + less - 2.0 * middle[:, None]), np.abs(two + less_two - 2.0 * middle[:, None])
    largest = np.abs(values[:, : 4 * total + 1]).max(axis=1, keepdims=True)
    rounding = 1e-9 * (largest + 1e-300)
    moves = np.maximum(np.abs(one - middle[:, None]), np.abs(less - middle[:, None]))
    kinked = (near > 0.05 * moves) & (far < 3.0 * near) & (moves > rounding)  # smooth: far = 4 near; a kink: 2 near
    state, entering = np.ascontiguousarray(slopes[:, :size]), np.ascontiguousarray(slopes[:, size:])
    straight = Straight(x, middle.copy(), state, entering, ROUNDING * largest[:, 0])
    if not bent:
        bent = bool(straight.departures(x[:, None] + moved[:size], moved[size:], values).any())
    return Derivatives(value, state, entering, kinked, None if bent else straight, moved_together)


@cache
def mixed(count: int) -> Array:
    """Return shares of sizes by which all is moved together, shape (count, MIXED)."""
    return np.random.default_rng(1966).standard_normal((count, MIXED))


def differentiate_own(
    function: Callable[..., Array], x: Array, directions: Array, inputs: Array, space: Space,
    result: Space | None = None, share: Array | None = None,
) -> Array:  # fmt: skip
    """Differentiate a map about every sample's state, forwards: with the derivatives half of a step beside it.

    Parameters
    ----------
    x : ndarray, shape (size, n)
    directions : ndarray, shape (size, d)
        Changes of X.
    inputs : ndarray, shape (k,)
        Changes of the inputs.
    space, result : Space
        As those of `differentiate_map`.
    share : ndarray, shape (..., n), optional
        Further argument of the map.

    Returns
    -------
    ndarray, shape (m, d + those of the inputs that change, n)
        Changes of the map's value.
    """
    size, count = x.shape
    d, entering = directions.shape[1], OWN_SHARE * np.diag(inputs)[:, inputs != 0.0]
    moved = np.zeros((size + len(inputs), d + entering.shape[1] + 1))
    moved[:size, :d], moved[size:, d:-1] = OWN_SHARE * directions, entering
    together = max(COLUMNS // moved.shape[1], 1)
    changes = np.empty((0, moved.shape[1] - 1, count))
    minus = (Space() if result is None else result).minus
    for begin in range(0, count, together):
        some = x[:, begin : begin + together]
        states = space.plus(some[:, None, :], moved[:size, :, None]).reshape(size, -1)
        more = () if share is None else (np.tile(share[..., begin : begin + together], moved.shape[1]),)
        values = function(states, np.repeat(moved[size:], some.shape[1], axis=1), *more)
        values = values.reshape(-1, moved.shape[1], some.shape[1])
        if not len(changes):
            changes = np.empty((len(values), moved.shape[1] - 1, count))
        changes[:, :, begin : begin + together] = minus(values[:, :-1], values[:, -1:])
    changes /= OWN_SHARE
    return changes
