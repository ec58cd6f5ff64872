"""Compiled algebra of a loop's samples against matrices of numpy; a sample's bits whatever stands beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.systems.closed_loop.algebra import combine, factorize, find_departures, propagate, update, whiten
from mcnav.systems.closed_loop.records import normalized_squares
from tests.unit.systems.test_closed_loop import campaign

COUNT, STATES, INPUTS, SIZE = 21, 5, 3, 2


def drawn(*shape: int, seed: int = 1) -> Array:
    return np.random.default_rng([seed, *shape]).standard_normal(shape)


def positive(size: int, count: int) -> Array:
    """Covariances, shape (size, size, n)."""
    roots = drawn(count, size, size)
    return np.ascontiguousarray(np.moveaxis(roots @ roots.swapaxes(1, 2) + np.eye(size), 0, -1))


def first(matrices: Array) -> Array:
    """Samples first, as numpy multiplies matrices."""
    return np.moveaxis(matrices, -1, 0)


@pytest.mark.parametrize("shared", [False, True])
def test_propagation(shared: bool) -> None:
    p, f, g = positive(STATES, COUNT), drawn(STATES, STATES, COUNT), drawn(STATES, INPUTS, COUNT)
    if shared:
        f, g = f[:, :, :1], g[:, :, :1]
    expected = first(f) @ first(p) @ first(f).swapaxes(1, 2) + first(g) @ first(g).swapaxes(1, 2)
    np.testing.assert_allclose(first(propagate(p, f, g)), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("estimated", [STATES, STATES - 2])
def test_update(shared: bool, estimated: int) -> None:
    """Considered states keep their mean; the covariance is that of the gain, whatever it is."""
    p, h, sigma = positive(STATES, COUNT), drawn(SIZE, STATES, COUNT), np.array([0.5, 2.0])
    h = h[:, :, :1] if shared else h
    gain, factor, after = update(p, h, sigma, estimated)
    dense_p, dense_h = first(p), first(h)
    innovation = dense_h @ dense_p @ dense_h.swapaxes(1, 2) + np.diag(sigma**2)
    k = dense_p @ dense_h.swapaxes(1, 2) @ np.linalg.inv(innovation)
    k[:, estimated:] = 0.0
    left = np.eye(STATES) - k @ dense_h
    expected = left @ dense_p @ left.swapaxes(1, 2) + k @ np.diag(sigma**2) @ k.swapaxes(1, 2)
    np.testing.assert_allclose(first(gain), k, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(first(factor) @ first(factor).swapaxes(1, 2), innovation, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(first(after), expected, rtol=1e-11, atol=1e-12)
    np.testing.assert_array_equal(after, after.transpose(1, 0, 2))


def test_squares_of_whitened_values() -> None:
    p, y = positive(SIZE, COUNT), drawn(SIZE, COUNT)
    expected = np.einsum("in,nij,jn->n", y, np.linalg.inv(first(p)), y)
    np.testing.assert_allclose(np.sum(whiten(factorize(p), y) ** 2, axis=0), expected, rtol=1e-12)
    np.testing.assert_allclose(normalized_squares(y, p), expected, rtol=1e-12)
    p[:, :, 3], p[1, :, 5], p[:, 1, 5] = 1.0, 0.0, 0.0  # singular: fully correlated, and no variance
    squares = normalized_squares(y, p)
    assert np.flatnonzero(np.isnan(squares)).tolist() == [3, 5]
    assert np.isnan(factorize(-p)[0, 0]).all()


def test_products() -> None:
    a, x = drawn(4, STATES, COUNT), drawn(STATES, COUNT)
    np.testing.assert_allclose(combine(a, x), np.einsum("ijn,jn->in", a, x), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(combine(a[:, :, 0], x), a[:, :, 0] @ x, rtol=1e-12, atol=1e-13)


def test_departures_from_a_linear_map() -> None:
    """A departure of 1e-8 of one sample is found, NaN as well, and rounding is none."""
    a, g, x, w = drawn(4, STATES), drawn(4, INPUTS), drawn(STATES, COUNT), drawn(INPUTS, COUNT)
    origin, value = drawn(STATES, seed=2), drawn(4, seed=3)
    outcome = value[:, None] + a @ (x - origin[:, None]) + g @ w
    about, shares = (origin, value, 1e-12 * np.abs(value)), (1e-9, 1e-12)
    assert not find_departures(a, g, about, shares, (x, w, outcome)).any()
    outcome[2, 7] += 1e-7 * np.abs(outcome[2, 7])
    outcome[0, 13] = np.nan
    assert np.flatnonzero(find_departures(a, g, about, shares, (x, w, outcome))).tolist() == [7, 13]


def test_wrong_shapes_are_refused_at_the_door() -> None:
    p = positive(STATES, COUNT)
    with pytest.raises(ValueError, match="f: got an array of shape"):
        propagate(p, drawn(STATES, STATES, COUNT - 1), drawn(STATES, 0, 1))
    with pytest.raises(ValueError, match="h: got an array of shape"):
        update(p, drawn(SIZE, STATES + 1, 1), np.ones(SIZE), STATES)


@pytest.mark.parametrize("name", ["DoubleIntegrator", "Nominal", "Continuous", "Pendulum", "Landing"])
def test_a_sample_has_the_same_bits_beside_any_others(name: str) -> None:
    """Own gains, planned gains and bent maps; methods of these loops treat numbers one by one."""
    described = campaign(name)
    errors = described.errors.draw("random", 5, 19, 0, 19)
    engine = described.scenario.engine("vectorised", errors)
    whole = Batch(np.arange(19), errors, 5)
    together: Any = engine.simulate(whole)
    for chosen in ([6], [2, 3, 17], list(range(11))):
        alone: Any = engine.simulate(whole[np.array(chosen)])
        for part in ("values", "linear_values", "history", "filter_values"):
            if getattr(together, part) is not None:
                np.testing.assert_array_equal(getattr(alone, part), getattr(together, part)[chosen], err_msg=part)


def test_planned_derivatives_serve_where_a_map_is_linear_alone() -> None:
    """Steps of the double integrator are linear; of a pendulum none is, nor its measurement."""
    for name, expected in (("DoubleIntegrator", True), ("Pendulum", False)):
        scenario: Any = campaign(name).scenario
        transitions = [each for planned in scenario.plan.instants for each in (*planned.steps, *planned.updates)]
        straight = [each.straight is not None for each in transitions if each.kind in ("step", "measure")]
        assert set(straight) == {expected}
