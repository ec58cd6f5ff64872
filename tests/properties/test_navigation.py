"""Symmetries of the navigator, for any errors (hypothesis)."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcnav.linear.covariance import propagated_covariance
from mcnav.physics.units import quantity
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.navigator import simulate_indicated
from mcnav.systems.reentry.outputs import DEVIATIONS
from mcnav.systems.reentry.scenario import SOURCES
from tests.conftest import SIZES, reentry, response

MULTIPLES = st.lists(st.floats(-3.0, 3.0), min_size=len(SIZES), max_size=len(SIZES)).map(np.array)


@settings(max_examples=30)
@given(MULTIPLES)
def test_engines_agree_for_any_errors(multiples: np.ndarray) -> None:
    """1e-7 of the one-sigma dispersion on 96 nodes, whose own error is a tenth of that, as is the reference path's."""
    navigation = reentry(1).navigation
    errors = multiples * SIZES
    grid = shared_grid(response(reentry(1)), 96)
    fast, _ = simulate_ensemble(grid, errors[None, :])
    slow = simulate_indicated(navigation.trajectory, errors, navigation.start, navigation.theta_axes)
    sigma = np.sqrt(np.diag(propagated_covariance(reentry(1).linear().end.partials, np.diag(SIZES**2))))
    np.testing.assert_array_less(np.abs(fast[0] - slow), 1e-7 * sigma)


@settings(max_examples=30)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_an_initial_range_error_turns_the_axes(drift: float, turn: float) -> None:
    """Turning the indicated start and the platform together only shifts the range: the physics has no preferred angle.

    With range error R and misalignment -R / r_o the navigator flies the true flight, rotated; every other final error
    stays as it was, to the accuracy of the grid's coefficients.
    """
    scenario = reentry(4)
    navigation = scenario.navigation
    grid = shared_grid(response(scenario), 96)
    radius = navigation.trajectory.state(0.0)[0]
    plain = np.zeros(len(SIZES))
    plain[Error.GYRO_DRIFT] = drift * SIZES[Error.GYRO_DRIFT]
    turned = plain.copy()
    turned[Error.RANGE] = turn * SIZES[Error.RANGE]
    turned[Error.MISALIGNMENT] = -turned[Error.RANGE] / radius
    outcome, _ = simulate_ensemble(grid, np.stack([plain, turned]))
    shift = 6378140.0 * turned[Error.RANGE] / radius
    np.testing.assert_allclose(outcome[1] - outcome[0], [0.0, shift, 0.0, 0.0], rtol=1e-9, atol=1e-4)


@settings(max_examples=50)
@given(MULTIPLES, st.floats(1e-3, 1e3))
def test_linear_covariance_scales_and_stays_symmetric(multiples: np.ndarray, factor: float) -> None:
    partials = reentry(4).linear().end.partials
    start = np.diag((multiples * SIZES) ** 2)
    covariance = propagated_covariance(partials, start)
    assert np.array_equal(covariance, covariance.T)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale))[0] > -1e-12
    scaled = propagated_covariance(partials, factor**2 * start)
    sigma = np.sqrt(np.diag(scaled))
    np.testing.assert_array_less(np.abs(scaled - factor**2 * covariance), 1e-13 * np.outer(sigma, sigma) + 1e-300)


@settings(max_examples=50)
@given(st.integers(0, 2**63 - 1), st.integers(0, 10_000), st.integers(1, 50))
def test_draws_depend_on_seed_and_index_alone(seed: int, begin: int, count: int) -> None:
    from mcnav.sampler.distributions import Normal

    model = ErrorModel([s.name for s in SOURCES], {"gyro_drift": Normal(1.0)})
    drawn = model.draw("random", seed, 20_000, begin, begin + count)
    assert np.array_equal(drawn[-1:], model.draw("random", seed, 20_000, begin + count - 1, begin + count))


@settings(max_examples=200)
@given(st.floats(-1e6, 1e6, allow_subnormal=False), st.sampled_from([*SOURCES, *DEVIATIONS]))
def test_quantities_survive_writing(value: float, channel: object) -> None:
    """What a resolved campaign prints is read back to the same bits."""
    unit = channel.unit  # type: ignore[attr-defined]
    assert quantity(f"{value!r} {unit}" if unit != "1" else value, unit) == value
