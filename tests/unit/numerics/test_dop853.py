"""Compiled steps against those of scipy, on an ellipse of eccentricity 0.9: steps grow, shrink and are rejected."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.compiled.jit import uncontracted
from mcnav.numerics.dop853 import LEFT, REACHED, ROOM, TOO_SMALL, advance, integrate_compiled
from mcnav.numerics.integration import integrate

ECCENTRICITY = 0.9
START = np.array([1.0 - ECCENTRICITY, 0.0, 0.0, np.sqrt((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY))])
PERIOD = 2.0 * np.pi
FREE = np.array([[-np.inf] * 4, [np.inf] * 4])
TOLERANCES = (1e-9, np.full(4, 1e-9))


@uncontracted
def rates(time: float, state: Array, calls: Array) -> Array:
    calls[0] += 1.0
    x, y, x_rate, y_rate = state
    pull = -1.0 / (x * x + y * y) ** 1.5
    return np.array([x_rate, y_rate, pull * x, pull * y])


@uncontracted
def _advance(
    args: Any, bound: float, relative: float, absolute: Array, limits: Array, step: float, times: Array, states: Array
) -> tuple[int, int, float]:
    return advance(rates, args, bound, relative, absolute, limits, step, times, states)


def test_steps_are_those_of_scipy() -> None:
    """Rejected ones as well, in which the equations are called.

    Each step leaves an error of some 1e-9, of which rounding is 1e-6, and the step is its eighth root.
    """
    calls = np.zeros(1)
    scipy = integrate(rates, (0.5, 0.5 + PERIOD), START, TOLERANCES, (np.zeros(1),))
    ours = integrate_compiled(_advance, (0.5, 0.5 + PERIOD), START, TOLERANCES, FREE, (calls,))
    assert ours.status == REACHED
    assert calls[0] == scipy.nfev > 12 * (len(ours.times) - 1) + 2
    assert ours.times[-1] == scipy.t[-1]
    np.testing.assert_allclose(ours.times, scipy.t, rtol=1e-6)
    np.testing.assert_allclose(ours.states[:3], scipy.y.T[:3], atol=1e-9)
    np.testing.assert_allclose(ours.states[-1], scipy.y[:, -1], atol=0.1 * np.abs(scipy.y[:, -1] - START).max())


def test_more_steps_than_compiled_code_takes_at_once() -> None:
    """The ellipse is closed: twenty turns are one turn's steps twenty times, as exact as scipy's."""
    span = (0.0, 20.0 * PERIOD)
    scipy = integrate(rates, span, START, TOLERANCES, (np.zeros(1),))
    ours = integrate_compiled(_advance, span, START, TOLERANCES, FREE, (np.zeros(1),))
    assert ours.status == REACHED
    assert len(ours.times) > 2 * ROOM
    assert (np.diff(ours.times) > 0.0).all()
    assert len(ours.times) == pytest.approx(len(scipy.t), rel=0.01)
    assert np.abs(ours.states[-1] - START).max() < 2.0 * np.abs(scipy.y[:, -1] - START).max()


@pytest.mark.parametrize(("component", "side", "limit"), [(0, 0, -1.0), (1, 1, 0.3), (3, 0, 0.0)])
def test_steps_end_where_the_state_meets_a_limit(component: int, side: int, limit: float) -> None:
    """At the root that scipy finds in its dense output, whose error is that of its steps."""
    limits = FREE.copy()
    limits[side, component] = limit

    def meets(time: float, state: Array, calls: Array) -> float:
        return float(state[component]) - limit

    meets.terminal = True  # type: ignore[attr-defined]
    scipy = integrate(rates, (0.0, PERIOD), START, TOLERANCES, (np.zeros(1),), events=meets)
    found = integrate_compiled(_advance, (0.0, PERIOD), START, TOLERANCES, limits, (np.zeros(1),))
    assert (found.status, scipy.status) == (LEFT, 1)
    inside = found.states[:-1, component] - limit
    assert ((inside >= 0.0) if side == 0 else (inside <= 0.0)).all()
    assert found.states[-1, component] == pytest.approx(limit, abs=1e-9)
    assert found.times[-1] == pytest.approx(scipy.t[-1], abs=1e-6)


def test_a_fall_into_the_centre_ends() -> None:
    """From rest at unit distance, after pi / sqrt(8)."""
    begin = np.array([1.0, 0.0, 0.0, 0.0])
    found = integrate_compiled(_advance, (0.0, PERIOD), begin, TOLERANCES, FREE, (np.zeros(1),))
    assert found.status == TOO_SMALL
    assert found.times[-1] == pytest.approx(np.pi / np.sqrt(8.0), rel=1e-6)
