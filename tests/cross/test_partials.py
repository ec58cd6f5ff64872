"""Partial derivatives three ways: variational, one error at a time, F S^-1 from independent error sets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.contract.engine import without_noise
from mcnav.contract.errors import ScenarioError
from mcnav.linear.partials import (
    partials_at_later_starts,
    partials_by_differences,
    partials_by_independent_sets,
    partials_from_runs,
)
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.linearized import LinearNavigator
from mcnav.systems.reentry.scenario import Reentry
from mcnav.systems.reentry.table_i import COLUMNS, ERRORS, among_all
from tests.conftest import SIZES, reentry

AGREEMENT = 1e-5
"""Share of each row's largest one-sigma contribution. The grid of the ensemble is good for 2e-6, the second-order term
cancels in both central schemes, and the third is of the step's square: 1e-6."""

SAME_EQUATIONS = 1e-7
"""One linear system, integrated to 1e-11 from each start and from the first one, and magnified up to a thousandfold by
a skip."""


def _differences(scenario: Reentry) -> dict[str, float]:
    probes = np.diag(SIZES)
    variational = scenario.linear().end.partials
    fast, slow = (without_noise(scenario.engine(engine, probes)) for engine in ("ensemble", "reference"))
    others = {
        "differences": partials_by_differences(fast, SIZES),
        "runs on the ensemble engine": partials_by_independent_sets(fast, SIZES),
        "runs on the reference engine": partials_by_independent_sets(slow, SIZES),
    }
    largest = np.abs(variational * SIZES).max(axis=1, keepdims=True)
    return {name: float((np.abs(other - variational) * SIZES / largest).max()) for name, other in others.items()}


def test_three_methods_agree(scenario: Reentry) -> None:
    found = _differences(scenario)
    assert max(found.values()) < AGREEMENT, found


@pytest.mark.parametrize(
    "options",
    [
        {"start": -214.8},
        {"start": -214.8, "axes": "trajectory"},
        {"start": 300.0},
        {"accelerometers_off_above": 121_920.0},
    ],
    ids=str,
)
def test_three_methods_agree_with_every_option(options: dict[str, Any]) -> None:
    found = _differences(reentry(4, **options))
    assert max(found.values()) < AGREEMENT, found


def test_partials_from_runs_is_exact_for_a_linear_system() -> None:
    """F S^-1 with F = P S gives P back, to rounding times the condition of S."""
    generator = np.random.default_rng(5)
    partials, sets = generator.standard_normal((4, 10)), generator.standard_normal((10, 10))
    tolerance = 1e-15 * np.linalg.cond(sets) * np.abs(partials).max() * 10
    np.testing.assert_allclose(partials_from_runs(sets, partials @ sets), partials, atol=tolerance)


def test_partials_from_runs_refuses_too_few_runs() -> None:
    with pytest.raises(ValueError, match="as many runs as sources"):
        partials_from_runs(np.ones((10, 9)), np.ones((4, 9)))


def test_axes_do_not_matter_without_accelerometer_errors() -> None:
    """Biases and scale factors live in the axes; everything else is the same physics in any axes."""
    here, there = (reentry(4, start=-214.8, axes=axes).linear().end.partials for axes in ("start", "trajectory"))
    np.testing.assert_allclose(
        (here * SIZES)[:, : Error.BIAS_X], (there * SIZES)[:, : Error.BIAS_X], rtol=1e-7, atol=1e-6
    )
    assert np.abs((here - there) * SIZES)[:, Error.BIAS_X :].max() > 100.0


def test_partials_over_time(scenario: Reentry) -> None:
    """From the start errors themselves to the final partials; in between against the histories of single runs."""
    trajectory, known = scenario.trajectory, scenario.linear_over_time()
    np.testing.assert_allclose(known.partials[-1], scenario.linear().end.partials, rtol=1e-8, atol=1e-6)
    at_start = np.diag([1.0, EARTH_RADIUS / trajectory.state(0.0)[0]] * 2)
    np.testing.assert_allclose(known.partials[0], np.hstack([at_start, np.zeros((4, len(SIZES) - 4))]), atol=1e-12)
    assert known.label == "time from reentry [min]"
    assert known.times[0] == pytest.approx(-trajectory.reentry_time / 60.0)
    assert np.abs(known.times).min() == pytest.approx(0.0, abs=1e-9)
    steps = np.vstack([np.diag(SIZES), -np.diag(SIZES)]) * 1e-3
    flown = scenario.error_histories(steps, known.times[1:] * 60.0)[2]
    found = (flown[:, : len(SIZES)] - flown[:, len(SIZES) :]).swapaxes(1, 2) / (2e-3 * SIZES)
    largest = np.abs(found * SIZES).max(axis=2, keepdims=True)
    assert (np.abs(found - known.partials[1:]) * SIZES / largest).max() < AGREEMENT


@pytest.mark.parametrize(("axes", "begin"), [("start", 0), ("trajectory", 2)])
def test_one_recursion_gives_every_start_time(scenario: Reentry, axes: str, begin: int) -> None:
    """Against the variational equations integrated afresh from every fourth of 50 start times, axes old and new."""
    trajectory = scenario.trajectory
    first, end = float(trajectory.state(0.0)[1]), np.array([trajectory.final_time])
    starts = np.linspace(0.0, 0.999 * trajectory.final_time, 50)[begin::4]
    from_all = scenario.partials_at(starts - trajectory.reentry_time, axes)
    for start, partials in zip(starts, from_all, strict=True):
        theta_axes = float(trajectory.state(start)[1]) if axes == "start" else first
        fresh = LinearNavigator(trajectory, start, theta_axes).read(end)[0][0]
        largest = np.abs(fresh * SIZES).max(axis=1, keepdims=True)
        assert (np.abs(partials - fresh) * SIZES / largest).max() < SAME_EQUATIONS


def test_start_times_and_the_histories_of_ten_runs_agree(scenario: Reentry) -> None:
    """NASA TN D-1772, eq. (16), at 50 start times: the report's own way, in the axes of the first start."""
    trajectory = scenario.trajectory
    times = np.linspace(0.0, 0.999 * trajectory.final_time, 50) - trajectory.reentry_time

    def histories(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sets, final = scenario.error_sets(among_all(errors), times)
        return sets[..., COLUMNS], final

    from_runs = partials_at_later_starts(histories, ERRORS)
    partials = scenario.partials_at(times, "trajectory")[..., COLUMNS]
    largest = np.abs(partials * ERRORS).max(axis=2, keepdims=True)
    assert (np.abs(from_runs - partials) * ERRORS / largest).max() < AGREEMENT


def test_a_start_at_the_end_is_the_identity(scenario: Reentry) -> None:
    """Nothing is left to happen: each final error is the start error, and equipment errors have no time."""
    trajectory = scenario.trajectory
    end = trajectory.final_time - trajectory.reentry_time
    partials = scenario.partials_at(np.array([end]), "trajectory")[0]
    share = EARTH_RADIUS / trajectory.state(trajectory.final_time)[0]
    np.testing.assert_allclose(partials[:, :4], np.diag([1.0, share, 1.0, share]), atol=1e-9)
    np.testing.assert_allclose((partials * SIZES)[:, 4:], 0.0, atol=1e-6)


def test_a_reentry_is_read_at_any_time(scenario: Reentry) -> None:
    """At an epoch as over time, whatever other times are asked for; outside of the flight it says so."""
    over_time = scenario.linear_over_time()
    asked = np.sort(np.append(over_time.times[3:5] * 60.0, 17.3))
    read = scenario.linear(asked)
    places = np.searchsorted(asked, over_time.times[3:5] * 60.0)
    np.testing.assert_allclose(read.partials[places], over_time.partials[3:5], rtol=1e-9, atol=1e-9)
    with pytest.raises(ScenarioError, match=r"^got 1000000 s from reentry; navigation is from -"):
        scenario.linear(np.array([1e6]))
