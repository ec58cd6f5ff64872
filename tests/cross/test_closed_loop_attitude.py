"""Attitudes of closed loops: gyroscopes with drift and a star tracker in closed form, at any angle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import linalg
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from mcnav.systems.closed_loop.rotations import from_matrix, to_matrix, turn_between, turned
from tests.closed_loops import campaign
from tests.cross.test_closed_loop import covariance, sigmas

WALK, DRIFT_WALK, TRACKER, INTERVAL, RATE = 1e-4, 5e-6, 5e-4, 5.0, 0.1


def test_gyroscopes_alone() -> None:
    """After 5.25 turns: in reference axes drift along the axis grows with time, that across it turns in a circle."""
    told, rate, time = sigmas(campaign("Gyroscopes")), np.pi / 50.0, 525.0
    noise = 1e-3**2 + 1e-4**2 * time
    across = 20e-6 * 2.0 / rate * np.sin(0.5 * rate * time)
    assert told["attitude_z"] == pytest.approx(np.sqrt(noise + (20e-6 * time) ** 2), rel=1e-9)
    assert told["attitude_x"] == pytest.approx(np.sqrt(noise + across**2), rel=1e-5)  # steps of an eighth of a radian
    assert told["true_attitude_x"] == pytest.approx(0.2, rel=1e-9)


def test_every_sample_of_gyroscopes_turns_by_its_own_rate() -> None:
    """C_hat = exp(e) exp(d) exp((w + drift) t) of the indicated, exp(d) exp(w t) of the truth, by scipy's rotations."""
    scenario = campaign("Gyroscopes").scenario
    errors = np.random.default_rng(3).standard_normal((20, 9)) * np.repeat([1.0, 0.3, 1e-3], 3)
    values = scenario.engine("vectorised", errors).simulate(Batch(np.arange(20), errors, 5), noise=False).values
    turns, (true, own, drift) = np.array([0.0, 0.0, np.pi / 50.0]), np.split(errors, 3, axis=1)
    start = Rotation.from_rotvec(true)
    truth = start * Rotation.from_rotvec(525.0 * turns)
    indicated = Rotation.from_rotvec(own) * start * Rotation.from_rotvec(525.0 * (turns + drift))
    nominal = Rotation.from_rotvec(525.0 * turns)
    expected = np.concatenate(
        [(each * of.inv()).as_rotvec() for each, of in ((indicated, truth), (truth, nominal), (indicated, nominal))], 1
    )
    np.testing.assert_allclose(values, expected, atol=1e-9)


def test_star_tracker_along_the_axis_of_rotation() -> None:
    """Farrenkopf's steady state after an update (Markley and Crassidis 2014, eq. (7.48))."""
    drift_share, share = DRIFT_WALK * INTERVAL**1.5 / TRACKER, WALK * INTERVAL**0.5 / TRACKER
    gamma = np.sqrt(1.0 + share**2 / 4.0 + drift_share**2 / 48.0)
    zeta = gamma + drift_share / 4.0 + 0.5 * np.sqrt(2.0 * gamma * drift_share + share**2 + drift_share**2 / 3.0)
    assert sigmas(campaign("Satellite"))["attitude_z"] == pytest.approx(TRACKER * np.sqrt(1.0 - zeta**-2), rel=1e-7)


def test_star_tracker_on_all_axes() -> None:
    """Riccati's equation of errors in body axes: error' = -w x error - error of the drift."""
    turning = RATE * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # w x
    rate = np.block([[-turning, -np.eye(3)], [np.zeros((3, 6))]])
    spread = np.diag(np.repeat([WALK**2, DRIFT_WALK**2], 3))
    whole = linalg.expm(INTERVAL * np.block([[-rate, spread], [np.zeros((6, 6)), rate.T]]))
    step = whole[6:, 6:].T
    noise, h = step @ whole[:6, 6:], np.eye(3, 6)
    before = linalg.solve_discrete_are(step.T, h.T, noise, TRACKER**2 * np.eye(3))
    gain = before @ h.T @ np.linalg.inv(h @ before @ h.T + TRACKER**2 * np.eye(3))
    expected = (np.eye(6) - gain @ h) @ before
    names, matrix = covariance(campaign("Satellite"))
    assert names[:6] == [f"{name}_{axis}" for name in ("attitude", "drift") for axis in "xyz"]
    np.testing.assert_allclose(matrix[:6, :6], expected, atol=2e-5 * TRACKER**2)  # steps of half a radian


def vectors(seed: int) -> Array:
    """Rotation vectors of all directions and sizes from nothing to half a turn."""
    random = np.random.default_rng(seed)
    direction = random.standard_normal((3, 8))
    direction /= np.linalg.norm(direction, axis=0)
    return np.asarray(direction * np.array([0.0, 1e-12, 1e-5, 1e-3, 1.0, 3.0, np.pi - 1e-9, np.pi]))


@pytest.mark.parametrize("side", ["reference", "body"])
def test_deviations_are_rotations(side: str) -> None:
    origin, other = vectors(1), vectors(2)[:, ::-1]
    between = turn_between(other, origin, side)  # type: ignore[arg-type]
    gap = to_matrix(turned(origin, between, side)) - to_matrix(other)  # type: ignore[arg-type]
    assert np.abs(gap).max() < 1e-14
    first, second = (Rotation.from_rotvec(each.T) for each in (origin, other))
    expected = (second * first.inv() if side == "reference" else first.inv() * second).as_rotvec()
    inside = np.linalg.norm(expected, axis=1) < np.pi - 1e-6  # of half a turn the vector's sign is free
    np.testing.assert_allclose(between.T[inside], expected[inside], atol=1e-13)


def test_matrices_and_rotation_vectors() -> None:
    matrices = to_matrix(vectors(1))
    np.testing.assert_allclose(matrices, Rotation.from_rotvec(vectors(1).T).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(to_matrix(from_matrix(matrices)), matrices, atol=1e-14)


def test_nees_of_attitude_and_drift() -> None:
    """Of 80 samples that turn by 8.6 turns from attitudes 0.2 rad apart; 3.9 standard errors."""
    described = campaign("Satellite")
    scenario: Any = described.scenario
    errors = described.errors.draw("random", 5, 80, 0, 80)
    result = scenario.engine("vectorised", errors).simulate(Batch(np.arange(80), errors, 5))
    assert not result.failures
    schema = scenario.filter_schema
    nees = result.filter_values[:, -1, schema.places["nees"]].mean(axis=0)
    sizes = np.array(list(schema.groups.values()))
    assert dict(schema.groups) == {"all": 6, "attitude": 3, "drift": 3}
    assert np.all(np.abs(nees - sizes) < 3.9 * np.sqrt(2.0 * sizes / 80.0))
