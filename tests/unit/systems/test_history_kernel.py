"""Errors against time: ends that are known, the reference path in between, and moments from power sums."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.ensemble.grid import shared_grid
from mcnav.systems.reentry.ensemble.history_kernel import history_grid, history_sums, simulate_histories
from mcnav.systems.reentry.ensemble.kernel import LANES, simulate_ensemble
from mcnav.systems.reentry.navigator import simulate_indicated
from mcnav.systems.reentry.scenario import Reentry
from mcnav.systems.reentry.truth import Trajectory
from tests.conftest import SIZES, reentry, response

Draw = Callable[[int, float], np.ndarray]
NODES = 150


def _epochs(scenario: Reentry, count: int = 50) -> np.ndarray:
    return np.linspace(response(scenario).start, response(scenario).end, count)


def test_a_history_begins_and_ends_where_it_must(scenario: Reentry, all_draws: Draw) -> None:
    """At the start errors themselves, ranges at the earth's radius; at the final errors of the ensemble."""
    errors = all_draws(100, 1.0)
    histories, component = simulate_histories(history_grid(response(scenario), NODES, _epochs(scenario)), errors)
    scale = np.array([1.0, EARTH_RADIUS / response(scenario).first[0]] * 2)
    np.testing.assert_allclose(histories[:, 0], errors[:, :4] * scale, rtol=1e-9, atol=1e-10)
    final, _ = simulate_ensemble(shared_grid(response(scenario), NODES), errors)
    assert (np.abs(histories[:, -1] - final).max(axis=0) / final.std(axis=0)).max() < 1e-7
    assert np.all(component > 0.9)


def test_no_errors_give_exactly_zero_at_every_epoch() -> None:
    grid = history_grid(response(reentry(4)), 40, _epochs(reentry(4)))
    assert np.all(simulate_histories(grid, np.zeros((2, len(SIZES))))[0] == 0.0)


@pytest.mark.parametrize("number", [1, 4, 7])
def test_against_the_reference_path_at_kinks_of_the_truth(number: int, all_draws: Draw) -> None:
    """The reference path ends where a cut truth ends. A remainder that stands in costs up to 1e-4 of sigma."""
    navigation = reentry(number).navigation
    phases = navigation.trajectory.phases
    ends = (len(phases) // 3, len(phases) // 2, len(phases) - 2)
    epochs = np.array([phases[end].end for end in ends])
    errors = all_draws(100, 1.0)
    histories, _ = simulate_histories(history_grid(response(reentry(number)), NODES, epochs), errors)
    for place, end in enumerate(ends):
        cut = Trajectory(phases[: end + 1], navigation.trajectory.reentry_time)
        flown = np.array([simulate_indicated(cut, row, navigation.start, navigation.theta_axes) for row in errors[:10]])
        share = np.abs(histories[:10, place] - flown) / histories[:, place].std(axis=0)
        assert share.max() < 1e-4


def test_a_perfect_system_misses_the_forces_it_does_not_see() -> None:
    """Accelerometers off above an altitude: the last epoch holds the nominal final errors of the variational path."""
    scenario = reentry(1, accelerometers_off_above=60_000.0)
    histories, _ = simulate_histories(
        history_grid(response(scenario), NODES, _epochs(scenario)), np.zeros((1, len(SIZES)))
    )
    np.testing.assert_allclose(histories[0, -1], scenario.linear().end.nominal, rtol=1e-7)


@pytest.mark.parametrize("multiple", [1.0, 100.0])
def test_power_sums_give_the_moments_of_stored_histories(multiple: float, all_draws: Draw) -> None:
    """Within 1e-12 of the moment: sums of some thousand terms, about a pivot at most a sigma or so off."""
    errors = all_draws(3 * LANES + 5, multiple)
    grid = history_grid(response(reentry(4)), NODES, _epochs(reentry(4)))
    errors = errors[simulate_ensemble(shared_grid(response(reentry(4)), NODES), errors)[1]]
    stored, _ = simulate_histories(grid, errors)
    sums = history_sums(grid, errors)
    central = stored - stored.mean(axis=0)
    sigma = stored.std(axis=0)
    assert sums.count == len(errors)
    assert (np.abs(sums.mean - stored.mean(axis=0)) / sigma).max() < 1e-12
    covariance = np.einsum("nma,nmb->mab", central, central) / (len(errors) - 1)
    assert (np.abs(sums.covariance - covariance) / (sigma[:, :, None] * sigma[:, None, :])).max() < 1e-12
    assert (np.abs(sums.third - (central**3).mean(axis=0)) / sigma**3).max() < 1e-11
    assert (np.abs(sums.fourth - (central**4).mean(axis=0)) / sigma**4).max() < 1e-11


def test_sums_of_chunks_add_up_to_the_same_bits_in_the_same_order(all_draws: Draw) -> None:
    errors = all_draws(5 * LANES, 1.0)
    grid = history_grid(response(reentry(4)), 40, _epochs(reentry(4)))
    chunks = np.split(errors, [LANES + 3, 3 * LANES])
    forwards = [history_sums(grid, chunk) for chunk in chunks]
    backwards = [history_sums(grid, chunk) for chunk in reversed(chunks)][::-1]
    first, second = (parts[0] + parts[1] + parts[2] for parts in (forwards, backwards))
    assert np.array_equal(first.sums, second.sums)
    whole = history_sums(grid, errors)
    assert first.count == whole.count
    np.testing.assert_allclose(first.covariance, whole.covariance, rtol=1e-11)


def test_epochs_outside_the_flight_are_refused() -> None:
    with pytest.raises(ValueError, match="epochs must rise from 0 s"):
        history_grid(response(reentry(4)), 40, np.array([-1.0, 10.0]))
