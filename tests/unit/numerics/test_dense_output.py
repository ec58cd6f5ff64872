"""States between steps are those of scipy's dense output, to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853, solve_ivp

from mcnav.arrays.types import Array
from mcnav.numerics.dense_output import DenseOutput


def rates(time: float, state: Array) -> Array:
    return np.array([state[1], -np.sin(state[0]), np.cos(time) * state[2]])


def solve(begin: float, end: float, **options: Any) -> Any:
    start = np.array([1.0, 0.3, 2.0])
    return solve_ivp(rates, (begin, end), start, method=DOP853, rtol=1e-9, atol=1e-9, dense_output=True, **options).sol


def passes_zero(time: float, state: Array) -> float:
    return float(state[0])


passes_zero.terminal = True  # type: ignore[attr-defined]

SOLUTIONS = {
    "forwards": solve(0.5, 9.0),
    "backwards": solve(9.0, 0.5),
    "until an event": solve(0.5, 9.0, events=passes_zero),
    "in one step": solve(0.5, 0.5 + 1e-6),
    "at one time": solve(0.5, 0.5),
}


@pytest.mark.parametrize("kind", SOLUTIONS)
def test_times_in_any_order_and_one_at_a_time(kind: str) -> None:
    """Among the times are the ends of all steps, and some outside of the solution."""
    expected = SOLUTIONS[kind]
    found = DenseOutput.of(expected)
    between = np.random.default_rng(853).uniform(-1.0, 11.0, 500)
    times = np.concatenate([between, expected.ts, np.nextafter(expected.ts, 20.0)])
    assert np.array_equal(found.ts, expected.ts)
    assert np.array_equal(found(times), expected(times))
    for time in times:
        assert np.array_equal(found(time), expected(time))


def test_kinds_are_what_they_say() -> None:
    assert len(SOLUTIONS["forwards"].ts) > 5
    assert SOLUTIONS["until an event"].interpolants[-1].t > SOLUTIONS["until an event"].ts[-1]
    assert len(SOLUTIONS["in one step"].interpolants) == 1
    assert not hasattr(SOLUTIONS["at one time"].interpolants[0], "F")
