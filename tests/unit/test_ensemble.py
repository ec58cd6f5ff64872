"""The ensemble kernel: exact zeros, order, lanes, validity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.physics.ensemble import LANES, fly_ensemble, gravity_difference, half_turn
from mcnav.physics.grid import Grid, shared_grid
from mcnav.physics.refinement import refined_grid
from mcnav.scenarios.reentry import Reentry
from mcnav.scenarios.tn_d1772 import ERRORS
from tests.conftest import reentry

Draw = Callable[[int, float], np.ndarray]


def _grid(scenario: Reentry, parts: int) -> Grid:
    navigation = scenario.navigation
    return shared_grid(navigation.trajectory, navigation.start, navigation.theta_axes, parts)


def test_no_errors_give_exactly_zero(scenario: Reentry) -> None:
    outcome, valid = fly_ensemble(_grid(scenario, 1), np.zeros((3, 10)))
    assert np.all(outcome == 0.0)
    assert valid.all()


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.3, 1.0, 3.1, -3.2, 7.0, 1e3])
def test_half_turn(angle: float) -> None:
    """sin and 1 - cos of the whole angle, as the kernel uses it; a reduction of 1e3 rad costs 1e3 ulp."""
    sine, cosine = half_turn(angle)
    tolerance = 4e-16 * max(1.0, abs(angle))
    assert 2.0 * sine * cosine == pytest.approx(np.sin(angle), abs=tolerance)
    assert 2.0 * sine * sine == pytest.approx(1.0 - np.cos(angle), abs=tolerance)


def test_gravity_difference_has_no_cancellation() -> None:
    """Against long double for a large deviation, and against the tidal term for a tiny one."""
    mu, position = 3.986135e14, np.array([1.2e6, 6.4e6])
    square = float(position @ position)
    arguments = (*position, 1.0 / square, mu * square**-1.5)
    big = np.array([3e5, -4e5])
    moved = (position + big).astype(np.longdouble)
    expected = -mu * moved / (moved @ moved) ** 1.5 + mu * position / np.longdouble(square) ** 1.5
    np.testing.assert_allclose(gravity_difference(*big, *arguments), expected.astype(float), rtol=1e-13)
    tiny = np.array([1e-9, 2e-9])
    tidal = mu * square**-1.5 * (3.0 * position * (position @ tiny) / square - tiny)
    np.testing.assert_allclose(gravity_difference(*tiny, *arguments), tidal, rtol=1e-12)


def test_fourth_order_despite_the_kinks(draws: Draw) -> None:
    """Halving the steps divides the error by 2^4; nodes on the kinks are what makes that true."""
    errors = draws(20, 1.0)
    for number in (1, 4, 7):
        scenario = reentry(number)
        coarse, middle, fine = (fly_ensemble(_grid(scenario, parts), errors)[0] for parts in (4, 8, 16))
        ratios = np.abs(coarse - middle).max(axis=0) / np.abs(middle - fine).max(axis=0)
        assert np.all((ratios > 2**3.5) & (ratios < 2**4.5)), ratios


def test_a_sample_does_not_depend_on_its_place(draws: Draw) -> None:
    """Bit for bit, whatever lane it has and whatever flies beside it."""
    errors = draws(2 * LANES + 7, 1.0)
    grid = _grid(reentry(4), 1)
    whole, _ = fly_ensemble(grid, errors)
    for cut in (1, 5, LANES - 1, LANES + 3):
        parts = np.concatenate([fly_ensemble(grid, errors[:cut])[0], fly_ensemble(grid, errors[cut:])[0]])
        assert np.array_equal(whole, parts)


def test_refinement_meets_its_tolerance(scenario: Reentry, draws: Draw) -> None:
    """What Richardson's rule promises holds against a grid eight times as fine, within its own error of a quarter."""
    probes = draws(64, 1.0)
    navigation = scenario.navigation
    refined = refined_grid(navigation.trajectory, navigation.start, navigation.theta_axes, probes, 1e-6)
    assert refined.error <= 1e-6
    values, _ = fly_ensemble(refined.grid, probes)
    best, _ = fly_ensemble(_grid(scenario, 8 * refined.parts), probes)
    error = (np.abs(values - best).max(axis=0) / np.sqrt(np.mean(best**2, axis=0))).max()
    assert error <= 1.25e-6


def test_a_hopeless_sample_is_marked_not_flown_wrong() -> None:
    into_the_earth = np.eye(10)[0] * -2e7
    once_round = np.eye(10)[1] * 2.0 * np.pi * reentry(4).trajectory.state(0.0)[0]
    errors = np.vstack([ERRORS, into_the_earth, np.full(10, np.nan), once_round, ERRORS])
    outcome, valid = fly_ensemble(_grid(reentry(4), 2), errors)
    assert valid.tolist() == [True, False, False, False, True]
    assert np.array_equal(outcome[0], outcome[4])


def test_nothing_is_allocated_per_sample() -> None:
    """The kernel's own memory is one block, whatever the number of samples."""
    import tracemalloc

    grid = _grid(reentry(4), 1)
    peaks = []
    for count in (LANES, 64 * LANES):
        errors = np.zeros((count, 10))
        fly_ensemble(grid, errors)
        tracemalloc.start()
        outcome, valid = fly_ensemble(grid, errors)
        peaks.append(tracemalloc.get_traced_memory()[1] - outcome.nbytes - valid.nbytes)
        tracemalloc.stop()
    per_sample = (peaks[1] - peaks[0]) / (63 * LANES)
    assert per_sample <= 8 + 4 + 4 + 1  # one float for the smallest component, and numpy's masks
