"""The ensemble kernel: exact zeros, closed forms, convergence, lanes, validity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from mcnav.compiled.lanes import angle_of_half, gravity_remainder, half_turn
from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.ensemble.kernel import LANES, simulate_ensemble
from mcnav.systems.reentry.ensemble.refinement import TOLERANCE, refined_grid
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.scenario import Reentry
from tests.conftest import SIZES, reentry, response

Draw = Callable[[int, float], np.ndarray]


def test_no_errors_give_exactly_zero(scenario: Reentry) -> None:
    outcome, valid = simulate_ensemble(shared_grid(response(scenario), 24), np.zeros((3, len(SIZES))))
    assert np.all(outcome == 0.0)
    assert valid.all()


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.3, 1.0, 3.1, -3.2, 7.0, 1e3])
def test_half_turn(angle: float) -> None:
    """sin and 1 - cos of the whole angle, as the kernel uses it; a reduction of 1e3 rad costs 1e3 ulp."""
    sine, cosine = half_turn(angle)
    tolerance = 4e-16 * max(1.0, abs(angle))
    assert 2.0 * sine * cosine == pytest.approx(np.sin(angle), abs=tolerance)
    assert 2.0 * sine * sine == pytest.approx(1.0 - np.cos(angle), abs=tolerance)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-3, -0.4, 1.0, -1.57])
def test_angle_of_half(angle: float) -> None:
    assert angle_of_half(np.tan(0.5 * angle)) == pytest.approx(angle, rel=1e-15, abs=0.0)


def test_gravity_remainder_has_no_cancellation() -> None:
    """Against long double for a large deviation, and against the quadratic term for a tiny one."""
    big = np.array([0.05, -0.07], dtype=np.longdouble)
    moved = np.array([0.0, 1.0]) + big
    exact = -moved / (moved @ moved) ** 1.5 + [0.0, 1.0] - [-big[0], 2.0 * big[1]]
    np.testing.assert_allclose(gravity_remainder(*big.astype(float)), exact.astype(float), rtol=1e-14)
    east, up = 1e-9, 2e-9
    quadratic = [3.0 * up * east, 1.5 * east**2 - 3.0 * up**2]
    np.testing.assert_allclose(gravity_remainder(east, up), quadratic, rtol=1e-8)


def test_transition_matrix_is_symplectic(scenario: Reentry) -> None:
    """Gravity has a potential: M^T J M = J, on which the kernel's inverse of M rests. Rates count per 1,000 s."""
    transition = response(scenario).final[:, :4] * np.outer([1.0, 1.0, 1e3, 1e3], [1.0, 1.0, 1e-3, 1e-3])
    form = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    # the rates are along axes that turn with the reference, which a rotation of both pairs leaves symplectic
    np.testing.assert_allclose(transition.T @ form @ transition, form, atol=1e-9 * np.abs(transition).max() ** 2)


def test_small_errors_follow_the_partial_derivatives(scenario: Reentry, draws: Draw) -> None:
    """The odd part of the outcome, at a thousandth of the errors, and P of the adjoint, flown along the same truth.

    What is left is of third order: 1e-6 of its share of a sigma, which is below a hundredth.
    """
    errors = draws(20, 1e-3)
    grid = shared_grid(response(scenario), 48)
    odd = 0.5 * (simulate_ensemble(grid, errors)[0] - simulate_ensemble(grid, -errors)[0])
    linear = errors @ scenario.partials_at(scenario.start_times(2)[:1])[0].T
    assert (np.abs(odd - linear).max(axis=0) / linear.std(axis=0)).max() < 1e-8


@pytest.mark.parametrize("number", [4, 5, 7])
def test_fourth_order_at_least_despite_the_kinks(number: int, draws: Draw) -> None:
    """Four times the nodes divide the error by 4^4 and more: kinks lie in the factors that are integrated exactly."""
    errors = draws(40, 1.0)
    coarse, middle, fine = (
        simulate_ensemble(shared_grid(response(reentry(number)), nodes), errors)[0] for nodes in (36, 144, 384)
    )
    assert np.abs((coarse - fine) / fine.std(axis=0)).max() > 4**4 * np.abs((middle - fine) / fine.std(axis=0)).max()


def test_a_sample_does_not_depend_on_its_place(draws: Draw) -> None:
    """Bit for bit, whatever lane it has and whatever flies beside it."""
    errors = draws(2 * LANES + 7, 1.0)
    grid = shared_grid(response(reentry(4)), 24)
    whole, _ = simulate_ensemble(grid, errors)
    for cut in (1, 5, LANES - 1, LANES + 3):
        parts = np.concatenate([simulate_ensemble(grid, errors[:cut])[0], simulate_ensemble(grid, errors[cut:])[0]])
        assert np.array_equal(whole, parts)


def test_refinement_meets_its_tolerance(scenario: Reentry, draws: Draw) -> None:
    """What holds against twice the nodes holds against four times as many, but for what the former leave: 1/16."""
    probes = draws(64, 1.0)
    navigation = scenario.navigation
    refined = refined_grid(navigation.trajectory, navigation.start, navigation.theta_axes, probes)
    assert refined.error <= TOLERANCE
    values, _ = simulate_ensemble(refined.grid, probes)
    best, _ = simulate_ensemble(shared_grid(response(scenario), 4 * refined.nodes), probes)
    assert (np.abs(values - best).max(axis=0) / best.std(axis=0)).max() <= TOLERANCE * 17.0 / 16.0


def test_probes_that_are_mostly_invalid_ask_for_the_finest_grid(draws: Draw) -> None:
    """At a thousand times the errors few samples stay valid; those must not be flown on a grid that nobody tested."""
    scenario = reentry(7)
    navigation = scenario.navigation
    errors = draws(2000, 1000.0)
    refined = refined_grid(navigation.trajectory, navigation.start, navigation.theta_axes, errors[:64])
    values, valid = simulate_ensemble(refined.grid, errors)
    best, _ = simulate_ensemble(shared_grid(response(scenario), 2 * refined.nodes), errors)
    assert 0 < valid.sum() < 200
    assert (np.abs(values - best)[valid].max(axis=0) / best[valid].std(axis=0)).max() < 1e-5


def test_a_hopeless_sample_is_marked_not_flown_wrong() -> None:
    into_the_earth = np.eye(len(SIZES))[Error.ALTITUDE] * -2e7
    once_round = np.eye(len(SIZES))[Error.RANGE] * 2.0 * np.pi * reentry(4).trajectory.state(0.0)[0]
    errors = np.vstack([SIZES, into_the_earth, np.full(len(SIZES), np.nan), once_round, SIZES])
    outcome, valid = simulate_ensemble(shared_grid(response(reentry(4)), 24), errors)
    assert valid.tolist() == [True, False, False, False, True]
    assert np.array_equal(outcome[0], outcome[4])


def test_nothing_is_allocated_per_sample() -> None:
    """The compiled code allocates as often for one block as for a hundred."""
    grid = shared_grid(response(reentry(4)), 24)
    simulate_ensemble(grid, np.zeros((1, len(SIZES))))
    enabled = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    allocations = []
    for count in (LANES, 100 * LANES):
        before = rtsys.get_allocation_stats().alloc
        simulate_ensemble(grid, np.zeros((count, len(SIZES))))
        allocations.append(rtsys.get_allocation_stats().alloc - before)
    if not enabled:
        _nrt_python.memsys_disable_stats()
    assert allocations[0] == allocations[1] > 0
