"""The linear engine on systems of which textbooks, filterpy and scipy have the answers."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.linalg import solve_discrete_are

from mcnav.arrays.products import transform
from mcnav.contract.timeline import Start, StepNoise, Steps
from mcnav.linear.covariance import propagated_covariance
from mcnav.linear.engine.adjoint import adjoint
from mcnav.linear.engine.design import design
from mcnav.linear.engine.innovations import innovation_laws
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.rejections import WhitenedFilter, rejected_errors
from mcnav.linear.engine.smoother import smooth
from tests.timelines import constant_velocity, timeline_of

ROUNDING = 1e-12
"""Share of a covariance: some hundred products of numbers of about the same size."""


def test_position_fixes_have_the_gains_and_the_covariance_of_filterpy():
    start = np.diag([100.0, 4.0])
    fixes = constant_velocity(40, 0.5, 0.2, 3.0, start)
    designed = design(fixes, range(fixes.end + 1))
    theirs = KalmanFilter(dim_x=2, dim_z=1)
    steps = fixes.filter.steps(0, 1)
    theirs.F, theirs.Q = steps.transitions[0], steps.noise["all"].covariances[0]
    theirs.H, theirs.R = np.array([[1.0, 0.0]]), 9.0
    theirs.P, theirs.x = start.copy(), np.zeros((2, 1))
    for number in range(40):
        theirs.predict()
        np.testing.assert_allclose(designed.covariances[2 * number + 1], theirs.P, rtol=ROUNDING)
        theirs.update(0.0)
        np.testing.assert_allclose(designed.covariances[2 * number + 2], theirs.P, rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(designed.gains[number], theirs.K, rtol=ROUNDING)
        np.testing.assert_allclose(designed.roots[number] ** 2, theirs.S, rtol=ROUNDING)


def test_true_errors_of_a_filter_that_knows_the_truth_have_its_own_covariance():
    fixes = constant_velocity(300, 0.5, 0.2, 3.0, np.diag([100.0, 4.0]))
    positions = np.array([600, 0, 17, 256, 511, 512, 17])
    designed = design(fixes, positions)
    for by_cause in (True, False):
        true = propagate(fixes, designed.gains, positions, by_cause)
        np.testing.assert_allclose(true.covariances.sum(axis=1), designed.covariances, rtol=ROUNDING, atol=1e-14)


def test_a_long_filter_reaches_the_solution_of_riccatis_equation():
    fixes = constant_velocity(300, 0.5, 0.2, 3.0, np.diag([100.0, 4.0]))
    steps = fixes.filter.steps(0, 1)
    noise = steps.noise["all"].covariances[0]
    steady = solve_discrete_are(steps.transitions[0].T, np.array([[1.0], [0.0]]), noise, np.array([[9.0]]))
    np.testing.assert_allclose(design(fixes, [599]).covariances[0], steady, rtol=1e-9)


def test_a_gauss_markov_process_keeps_its_variance_and_drives_what_integrates_it():
    count, decay, sigma = 700, np.exp(-1.0 / 20.0), 2.0
    transition = np.array([[1.0, 1.0], [0.0, decay]])  # the sum of a sequence with the autocorrelation decay^k
    noise = {"markov": StepNoise(np.array([1]), np.full((count, 1, 1), sigma**2 * (1.0 - decay**2)))}
    sums = timeline_of(
        Steps(np.tile(transition, (count, 1, 1)), np.zeros((count, 2, 1)), noise),
        Start(np.zeros((2, 1)), {"markov": np.diag([0.0, sigma**2])}), ("markov",), np.eye(2),
        biases={"markov": np.array([1])},
    )  # fmt: skip
    read = propagate(sums, None, [1, 300, 700]).covariances[:, 0]
    for covariance, n in zip(read, (1, 300, 700), strict=True):
        lags = np.arange(1, n)
        expected = sigma**2 * (n + 2.0 * np.sum((n - lags) * decay**lags))
        np.testing.assert_allclose(covariance[0, 0], expected, rtol=ROUNDING)
        np.testing.assert_allclose(covariance[1, 1], sigma**2, rtol=ROUNDING)
        np.testing.assert_allclose(covariance[0, 1], sigma**2 * np.sum(decay ** np.arange(1, n + 1)), rtol=ROUNDING)


def test_correlated_sources_and_what_is_deterministic():
    """A body with an initial velocity v0 and a constant acceleration a, correlated, and 0.3 m of its own in a step."""
    count, transition = 10, np.array([[1.0, 1.0], [0.0, 1.0]])
    inputs = np.tile([[0.0, 0.5, 0.3], [0.0, 1.0, 0.0]], (count, 1, 1))
    body = timeline_of(
        Steps(np.tile(transition, (count, 1, 1)), inputs), Start(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])), (),
        np.array([[1.0, 0.0]]),
    )  # fmt: skip
    partials = propagate(body, None, [10]).partials[0]
    np.testing.assert_allclose(partials, [[10.0, 50.0, 3.0]], rtol=ROUNDING)
    sources = np.array([[4.0, -0.6], [-0.6, 0.09]])
    np.testing.assert_allclose(
        propagated_covariance(partials[:, :2], sources), [[100.0 * 4.0 - 1000.0 * 0.6 + 2500.0 * 0.09]], rtol=ROUNDING
    )
    np.testing.assert_allclose(adjoint(body, None, 10, np.array([[1.0, 0.0]]))[:, 0, 1], np.arange(10.0, -1.0, -1.0))


def test_a_smoother_is_the_least_squares_solution_of_the_whole_batch():
    """All states together minimize the weighted squares of the start, of the steps and of the fixes."""
    count, start = 30, np.diag([100.0, 4.0])
    fixes = constant_velocity(count, 0.5, 0.2, 3.0, start)
    steps = fixes.filter.steps(0, 1)
    information = np.zeros((2 * count + 2,) * 2)
    information[:2, :2] = np.linalg.inv(start)
    for number in range(count):
        both, new = slice(2 * number, 2 * number + 4), 2 * number + 2
        difference = np.concatenate([-steps.transitions[0], np.eye(2)], axis=1)
        information[both, both] += difference.T @ np.linalg.solve(steps.noise["all"].covariances[0], difference)
        information[new, new] += 1.0 / 9.0
    batch = np.linalg.inv(information)
    positions = np.concatenate([[0], 2 * np.arange(1, count + 1)])
    smoothed = smooth(fixes, design(fixes, positions), positions)
    expected = np.stack([batch[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(count + 1)])
    # the inverse loses digits by the condition number, 1e5
    np.testing.assert_allclose(smoothed.claimed, expected, rtol=1e-9)
    np.testing.assert_allclose(smoothed.covariances.sum(axis=1), expected, rtol=1e-9)


def test_the_innovations_of_a_filter_that_knows_the_truth_are_as_it_computes_them():
    fixes = constant_velocity(20, 0.5, 0.2, 3.0, np.diag([100.0, 4.0]))
    designed = design(fixes, range(41))
    for u, law in zip((19, 0, 4), innovation_laws(fixes, designed.gains, np.array([19, 0, 4])), strict=True):
        np.testing.assert_allclose(law.noise[:1, :1], designed.roots[u] ** 2, rtol=ROUNDING)
        np.testing.assert_allclose(law.noise[0, 1:], 0.0, atol=1e-12)  # what is known is used
        np.testing.assert_allclose(law.noise[1:, 1:], designed.covariances[2 * u + 2], rtol=ROUNDING)
        np.testing.assert_allclose(law.responses, designed.gains[u], rtol=ROUNDING)


@pytest.mark.parametrize(
    ("believed", "claimed", "true"),
    [(2.0, (0.562340084, 0.125744703), (0.562340084, 0.125744703)),
     (1.0, (0.334367155, 0.105741685), (0.602794028, 0.139872798))],
)  # fmt: skip
def test_held_values_of_a_smoothed_double_integrator(believed, claimed, true):
    """Position and velocity in the interior of a long record, matched and with a believed variance of 1 for 4.

    The nine printed digits were computed in two other ways; ends are further away than the filter remembers.
    """
    fixes, middle = constant_velocity(400, 1.0, 0.01, 2.0, np.eye(2), believed), [400]
    smoothed = smooth(fixes, design(fixes, middle), middle)
    np.testing.assert_allclose(np.sqrt(np.diag(smoothed.claimed[0])), claimed, rtol=1e-8)
    np.testing.assert_allclose(np.sqrt(np.diag(smoothed.covariances[0].sum(axis=0))), true, rtol=1e-8)


def test_a_first_rejection_long_before_the_end_keeps_its_digits():
    """Fixes with an unknown constant that is hardly observed: what is left of one rejection after two thousand fixes.

    The first fix left out of the information, which is a sum: its share is 1e-7 of the variance.
    """
    fixes = constant_velocity(2000, 1.0, 0.0, 3.0, np.diag([100.0, 4.0]))
    designed = design(fixes, [fixes.end])
    rejected = rejected_errors(WhitenedFilter.of(fixes, designed), np.array([fixes.end]), np.zeros(2000, dtype=bool))
    times = np.arange(1.0, 2001.0)
    rows = np.stack([np.ones(2000), times - 2000.0], axis=1)  # of position and velocity at the end
    start = np.linalg.inv(transform(np.array([[1.0, 2000.0], [0.0, 1.0]]), np.diag([100.0, 4.0])))
    for first in (0, 7, 1999):
        kept = np.delete(rows, first, axis=0)
        left_out, everything = (np.linalg.inv(start + each.T @ each / 9.0) for each in (kept, rows))
        expected = np.diag(left_out) - np.diag(everything)
        # the information has a condition number of 1e7, of which the difference takes 1e-3 to 1e-7
        np.testing.assert_allclose(rejected.excess[0, first], expected, rtol=1e-4)
