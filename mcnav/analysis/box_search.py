"""Search of a unit cube for the largest values of several functions that are computed together.

First a grid of the whole cube, then parabolas through three neighbours along each axis about the largest value of each
function, until they gain nothing. What is found is at least the largest value of all points that were looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

Point = tuple[float, ...]
"""Place in the unit cube."""

GRID: Final = {1: 17, 2: 9, 3: 5, 4: 3}
"""Points along each axis of the first grid, by the number of axes."""

SCATTERED: Final = 64
"""Points of a net besides the corners, or as many of them, where there are more axes."""

SEED: Final = 59

ROUNDS: Final = 3
"""Times that all axes are gone through about a largest value."""

GAIN: Final = 1e-9
"""Relative gain below which a parabola is the last one."""

PARABOLAS: Final = 6
"""Parabolas along an axis in a round."""

STEP: Final = 1e-6
"""Shortest step along an axis; values are written with twelve digits."""


class Maxima:
    """Largest values of functions over the unit cube.

    Parameters
    ----------
    axes : int
    evaluate : callable
        Values of all functions at a point, shape (functions,).
    most : int
        Points that are looked at: refinement stops there.
    """

    def __init__(self, axes: int, evaluate: Callable[[Point], Array], most: int) -> None:
        self._axes, self._evaluate, self._most = axes, evaluate, most
        self.known: dict[Point, Array] = {}

    def search(self, functions: Sequence[int]) -> None:
        """Look at the grid, and then about the largest value of each of some functions, in this order."""
        for point in grid(self._axes):
            self.at(point)
        values = np.array(list(self.known.values()))
        for function in functions:
            column = values[:, function]
            if np.isfinite(column).all() and np.ptp(column) > GAIN * np.abs(column).max():  # it is no constant
                self._refine(function)

    def largest(self, function: int) -> tuple[Point, float]:
        """Return where a function is largest, of points that are equal the first, and its value there."""
        point = max(self.known, key=lambda known: self.known[known][function])
        return point, float(self.known[point][function])

    def at(self, point: Point) -> Array:
        """Look at a point, unless that was done already, and return the values of all functions there."""
        if point not in self.known:
            self.known[point] = self._evaluate(point)
        return self.known[point]

    def _refine(self, function: int) -> None:
        steps = [1.0 / (GRID.get(self._axes, 3) - 1)] * self._axes
        for _ in range(ROUNDS if self._axes else 0):
            before = self.largest(function)[1]
            for axis in range(self._axes):
                steps[axis] = self._peak(function, axis, steps[axis])
            if self.largest(function)[1] <= before + GAIN * abs(before) and max(steps) <= 1.0 / 16.0:
                return

    def _peak(self, function: int, axis: int, step: float) -> float:
        """Look along an axis about the largest value by parabolas; return the next step."""
        for _ in range(PARABOLAS):
            if len(self.known) >= self._most or step < STEP:
                break
            middle, top = self.largest(function)
            sides = [_moved(middle, axis, sign * step) for sign in (-1.0, 1.0)]
            values = [float(self.at(side)[function]) for side in sides]
            now, best = self.largest(function)
            if now == middle and middle not in sides:
                best = self._vertex(function, axis, (sides[0], middle, sides[1]), (values[0], top, values[1]))
            step /= 4.0 if now == middle else 1.0
            if now == middle and best <= top + GAIN * abs(top) and step <= 1.0 / 64.0:
                break
        return step

    def _vertex(self, function: int, axis: int, points: Sequence[Point], values: tuple[float, float, float]) -> float:
        """Look at the vertex of a parabola through three points; return the largest value then."""
        places = np.array([point[axis] for point in points])
        if np.isfinite(values).all():
            second, first, _ = np.polyfit(places - places[1], np.array(values), 2)
            if second < 0.0:
                vertex = float(np.clip(-first / (2.0 * second), places[0] - places[1], places[2] - places[1]))
                self.at(_moved(points[1], axis, vertex))
        return self.largest(function)[1]


def grid(axes: int) -> list[Point]:
    """Return the points of the first grid of a cube; the last, of all ones, comes first."""
    if axes in GRID or not axes:
        points = product(np.linspace(1.0, 0.0, GRID.get(axes, 1)).tolist(), repeat=axes)
        return [tuple(point) for point in points]
    random = np.random.default_rng(SEED)
    corners = [np.ones(axes), np.zeros(axes), *(1.0 - row for row in np.eye(axes)), *np.eye(axes)]
    corners += [random.integers(0, 2, axes) for _ in range(SCATTERED)]
    inner = [random.integers(0, 5, axes) / 4.0 for _ in range(SCATTERED)]
    return list(dict.fromkeys(tuple(float(value) for value in row) for row in (*corners, *inner)))


def _moved(point: Point, axis: int, step: float) -> Point:
    """Return a point moved along an axis, within the cube."""
    place = float(f"{min(max(point[axis] + step, 0.0), 1.0):.9g}")
    return (*point[:axis], place, *point[axis + 1 :])
