"""How many floating-point operations a sample costs, counted by running the kernel's own functions on counting numbers.

Compiled functions keep the Python they were made of; given numbers that count what is done to them, it says exactly
what one lane takes. A fused multiply-add counts as two. `rates` measures how many of each kind one core does in loops
like the kernel's: lanes in a block that stays in the cache, compiled in the same way.
"""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from mcnav.compiled import lanes
from mcnav.compiled.jit import compiled
from mcnav.systems.reentry.ensemble import kernel
from mcnav.systems.reentry.ensemble.grid import Grid
from tests.benchmarks.timing import fastest

KINDS: Final = ("simple", "division", "root")
"""Additions, multiplications, comparisons and roundings; divisions; square roots."""

LANES: Final = kernel.LANES
TERMS: Final = 16
SWEEPS: Final = 20_000


class Counted:
    """A number that counts what is done to it."""

    __array_ufunc__ = None  # numpy's scalars leave the operation to us

    def __init__(self, value: Any, counts: Counter[str]) -> None:
        self.value, self.counts = float(value), counts

    def _with(self, other: Any, kind: str, value: float) -> Counted:
        self.counts[kind] += 1
        return Counted(value, self.counts)

    def __add__(self, other: Any) -> Counted:
        return self._with(other, "simple", self.value + _plain(other))

    def __sub__(self, other: Any) -> Counted:
        return self._with(other, "simple", self.value - _plain(other))

    def __rsub__(self, other: Any) -> Counted:
        return self._with(other, "simple", _plain(other) - self.value)

    def __mul__(self, other: Any) -> Counted:
        return self._with(other, "simple", self.value * _plain(other))

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: Any) -> Counted:
        return self._with(other, "division", self.value / _plain(other))

    def __rtruediv__(self, other: Any) -> Counted:
        return self._with(other, "division", _plain(other) / self.value)

    def __neg__(self) -> Counted:
        return Counted(-self.value, self.counts)  # the sign goes into the next operation

    def __lt__(self, other: Any) -> bool:
        self.counts["simple"] += 1
        return self.value < _plain(other)

    def __gt__(self, other: Any) -> bool:
        self.counts["simple"] += 1
        return self.value > _plain(other)

    def __float__(self) -> float:
        return self.value


def _plain(number: Any) -> float:
    return number.value if isinstance(number, Counted) else float(number)


class _Functions:
    """What the kernel takes from numpy, for counted numbers."""

    pi = np.pi

    def __getattr__(self, name: str) -> Any:
        kind = {"sqrt": "root", "abs": None, "rint": "simple"}.get(name, "other")
        function = getattr(np, name)

        def apply(number: Any) -> Any:
            if not isinstance(number, Counted):
                return function(number)
            if kind is not None:
                number.counts[kind] += 1
            return Counted(function(number.value), number.counts)

        return apply


def _counted(function: Any, rows: int, *arguments: Any) -> Counter[str]:
    """Operations of one lane in a compiled function whose first argument is a block of rows."""
    counts: Counter[str] = Counter()
    block = np.array([Counted(1e-3, counts) for _ in range(rows * LANES)], dtype=object)
    with ExitStack() as stack:
        for module in (kernel, lanes):
            stack.enter_context(patch.object(module, "np", _Functions()))
        for name in ("half_turn", "gravity_remainder", "angle_of_half"):
            stack.enter_context(patch.object(kernel, name, getattr(lanes, name).py_func))
        for name in ("_sine_and_cosine", "gravity_shares"):
            stack.enter_context(patch.object(lanes, name, getattr(lanes, name).py_func))
        function.py_func(block, *arguments)
    return Counter({kind: round(counts[kind] / LANES) for kind in KINDS})


def of_sample(grid: Grid) -> Counter[str]:
    """Operations that one sample costs on a grid: pushes by force and by gravity; start and end, once, are left out."""
    force = _counted(kernel.push_by_force, kernel.ROWS, 0.0, grid.moments[0])
    gravity = _counted(kernel.push_by_gravity, kernel.ROWS, grid.readout[0], grid.recent[0], grid.weights[0])
    end = _counted(kernel.convert, kernel.REPORT_ROWS, grid.last, grid.nominal)
    total: Counter[str] = Counter()
    for counted, times in ((force, int(grid.forced.sum())), (gravity, len(grid.readout)), (end, 1)):
        total.update({kind: number * times for kind, number in counted.items()})
    return total


@compiled
def _multiply_add(block: np.ndarray, terms: np.ndarray, sweeps: int) -> None:
    (a, b, c, d, e, f, g, h) = terms
    for _ in range(sweeps):
        for i in range(LANES):
            x, y = block[i], block[LANES + i]
            for _ in range(2):
                x, y = a + x * b, c + y * d
                x, y = e + x * f, g + y * h
            block[i], block[LANES + i] = x, y


@compiled
def _divide(block: np.ndarray, by: float, sweeps: int) -> None:
    for _ in range(sweeps):
        for i in range(LANES):
            block[i] = by / block[i]


@compiled
def _root(block: np.ndarray, sweeps: int) -> None:
    for _ in range(sweeps):
        for i in range(LANES):
            block[i] = np.sqrt(block[i])


def rates(seconds: float = 0.2) -> dict[str, float]:
    """Operations of each kind per second that one core does in such loops."""
    terms, block = np.array([0.1, 0.5, 0.2, 0.4, 0.3, 0.3, 0.2, 0.6]), np.full(2 * LANES, 0.7)
    work = {
        "simple": (lambda: _multiply_add(block, terms, SWEEPS), 16),
        "division": (lambda: _divide(block, 0.5, SWEEPS), 1),
        "root": (lambda: _root(block, SWEEPS), 1),
    }
    found = {}
    for kind, (run, each) in work.items():
        run()
        found[kind] = each * LANES * SWEEPS / fastest(run, seconds).processor
    return found


def shortest(operations: Counter[str], per_second: dict[str, float]) -> float:
    """Seconds that the operations would take one after the other at these rates.

    Divisions and roots share one unit, beside which additions and multiplications go on.
    """
    slow = sum(operations[kind] / per_second[kind] for kind in ("division", "root"))
    return max(operations["simple"] / per_second["simple"], slow)
