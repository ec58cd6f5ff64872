"""States along splines by compiled code against scipy's splines and rotations."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.truth.spline_states import SMALL, states_of_splines
from mcnav.systems.ins.truth.trajectory import Truth, TruthStates
from tests.flights import flight

ROUNDING = 2.0**-52


def tumbling() -> Truth:
    """Return a vehicle that turns by up to two radians between rows."""
    rng = np.random.default_rng(11)
    times = np.cumsum(rng.uniform(5.0, 20.0, 12))
    places = np.array([0.7, -0.4, 3e3]) + np.cumsum(rng.normal(0.0, [1e-4, 1e-4, 50.0], (12, 3)), axis=0)
    return Truth.through(WGS84, times, *places.T, np.cumsum(rng.uniform(-0.6, 0.6, (12, 3)), axis=0))


def by_scipy(truth: Truth, times: Array) -> TruthStates:
    """Compute the same states from scipy's splines, operation by operation."""
    earth, spin = truth.earth, np.array([0.0, 0.0, truth.earth.rotation_rate])
    to_inertial = earth.turned(times - truth.times[0])
    place, speed, change = (np.asarray(truth.position(times, order)) for order in range(3))
    carried = speed + np.cross(spin, place)
    felt = change + np.cross(spin, speed + carried) - earth.gravitation(place)
    body = truth.attitude(times).as_matrix()
    rate = truth.attitude(times, 1) + np.einsum("nji,j->ni", body, spin)
    force = np.einsum("nji,nj->ni", body, felt)
    inertial = np.einsum("nij,nj->ni", to_inertial, place)
    return TruthStates(times, inertial, np.einsum("nij,nj->ni", to_inertial, carried), to_inertial @ body, force, rate)


@pytest.mark.parametrize("truth", [flight(1.0), tumbling()], ids=["flight", "tumbling"])
def test_states_are_those_of_scipy(truth: Truth) -> None:
    """To some ten roundings of the largest number that goes in; scipy's rate loses more in small rotation vectors."""
    inside = np.random.default_rng(5).uniform(truth.times[0], truth.times[-1], 500)
    times = np.concatenate([inside, truth.times[[0, 1, -2, -1]], [truth.times[0] - 0.1, truth.times[-1] + 0.1]])
    found, expected = truth.states(times, "strapdown", float(truth.times[0])), by_scipy(truth, times)
    for name in ("position", "velocity", "axes", "force"):
        value, other = getattr(found, name), getattr(expected, name)
        largest = np.abs(other).max()
        np.testing.assert_allclose(value, other, rtol=0.0, atol=20.0 * ROUNDING * largest, err_msg=name)
    # with an angle a between rows scipy divides differences of cosines by a^2: not below 1e-4
    size = np.abs(expected.rate).max()
    np.testing.assert_allclose(found.rate, expected.rate, rtol=0.0, atol=size * (20.0 * ROUNDING + ROUNDING / 1e-4))


def test_no_index_is_beyond_its_array(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python, which checks every index, computes the same states to some roundings."""
    truth = tumbling()
    times = np.linspace(truth.times[0], truth.times[-1], 7)
    found = truth.states(times, "strapdown", float(truth.times[0]))
    monkeypatch.setattr("mcnav.systems.ins.truth.trajectory.states_of_splines", states_of_splines.py_func)
    expected = truth.states(times, "strapdown", float(truth.times[0]))
    for name in ("position", "velocity", "axes", "force", "rate"):
        value, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(value, other, rtol=0.0, atol=20.0 * ROUNDING * np.abs(other).max(), err_msg=name)


def test_both_ways_of_large_and_small_rotations_are_tried() -> None:
    large = tumbling().attitude.rotations
    assert (large[:-1].inv() * large[1:]).magnitude().max() > SMALL
    small = flight(1.0).attitude.rotations
    assert (small[:-1].inv() * small[1:]).magnitude().max() < SMALL
