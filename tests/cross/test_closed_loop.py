"""Closed loops against closed forms, Riccati and Lyapunov equations, and nasa/condor's rendezvous."""

from __future__ import annotations

import runpy
from typing import Any

import numpy as np
import pytest
from scipy import linalg

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.studies.linear_covariance import linear_covariance
from tests.closed_loops import CAMPAIGNS, campaign

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def covariance(described: Campaign) -> tuple[list[str], Array]:
    """Names of the outputs, and their covariance at the end."""
    names = [output.name for output in described.scenario.outputs]
    return names, described.scenario.linear().covariance(described.errors.covariance)[0]


def sigmas(described: Campaign) -> dict[str, float]:
    names, matrix = covariance(described)
    return dict(zip(names, np.sqrt(np.diag(matrix)).tolist(), strict=True))


@pytest.mark.parametrize("guidance", [1.0, 0.5])
@pytest.mark.parametrize("believed", [1.0, 4.0])
def test_scalar_loop(guidance: float, believed: float) -> None:
    """x+ = x - L x_hat + w and a filter that believes another variance r of its measurements; closed forms."""
    k = linalg.solve_discrete_are(np.eye(1), np.eye(1), np.eye(1), believed * np.eye(1))[0, 0]
    k /= k + believed
    left, kept = 1.0 - k, 1.0 - guidance
    error = (left**2 + k**2) / (1.0 - left**2)
    across = -left * (guidance * error + 1.0) / (1.0 - left * kept)
    truth = (guidance**2 * error - 2.0 * guidance * kept * across + 1.0) / (1.0 - kept**2)
    sigma = f"{believed**0.5!r} m"
    described = campaign(
        "Scalar", settings={"gain": guidance}, filter={"believes": {"measurements": {"position": sigma}}}
    )
    names, matrix = covariance(described)
    assert names == ["x", "true_x", "navigated_x", "command"]
    expected = [[error, across, error + across], [across, truth, truth + across],
                [error + across, truth + across, truth + 2.0 * across + error]]  # fmt: skip
    np.testing.assert_allclose(matrix[:3, :3], expected, rtol=1e-8, atol=1e-12)
    if believed == 1.0:
        assert k == pytest.approx(GOLDEN)
        assert truth == pytest.approx(matrix[2, 2] + error, rel=1e-8)  # a matched filter is orthogonal
    else:
        assert abs(truth - matrix[2, 2] - error) > 0.1


MATCHED = (1.041357544, 0.241887060, 1.514418041, 0.401332998, 1.099561945, 0.320248069, 0.225742538)
MISMATCHED = (1.108109394, 0.270840537, 1.465866603, 0.525492674, 1.317560688, 0.423536551, 0.346122760)


@pytest.mark.parametrize(
    ("name", "sigma", "expected", "own"),
    [
        ("DoubleIntegrator", "2 m", MATCHED, (1.041357544, 0.241887060)),
        ("DoubleIntegrator", "1 m", MISMATCHED, (0.600492851, 0.200236878)),
        ("Nominal", "2 m", MATCHED, (1.041357544, 0.241887060)),
    ],
)
def test_double_integrator(name: str, sigma: str, expected: tuple[float, ...], own: tuple[float, ...]) -> None:
    """Steady state after the update: navigation error, true dispersion, navigation dispersion, command."""
    described = campaign(name, filter={"believes": {"measurements": {"ranging": sigma}}})
    np.testing.assert_allclose(list(sigmas(described).values()), expected, atol=6e-10)  # as printed
    of: Any = described.scenario
    stated = of.filter_prediction().covariance[-1]
    np.testing.assert_allclose(np.sqrt(np.diag(stated)[:2]), own, atol=6e-10)


def test_continuous_guidance() -> None:
    """The filter's F is that of the error: with that of the estimate alone sigma would be 72.6 m."""
    described = campaign("Fine")
    law, walked = np.array([[0.213023288, 0.652722433]]), 0.01 * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
    before = linalg.solve_discrete_are(np.array([[1.0, 0.0], [1.0, 1.0]]), np.eye(2)[:, :1], walked, [[4.0]])
    kalman = before[:, :1] / (before[0, 0] + 4.0)
    rate, control, h = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    both = np.block([[rate, -control @ law], [np.zeros((2, 2)), rate - control @ law]])
    spread = np.zeros((4, 4))
    spread[1, 1] = 0.01
    whole = linalg.expm(np.block([[-both, spread], [np.zeros((4, 4)), both.T]]))
    step = whole[4:, 4:].T
    noise = step @ whole[:4, 4:]
    update = np.block([[np.eye(2), np.zeros((2, 2))], [kalman @ h, np.eye(2) - kalman @ h]])
    added = np.zeros((4, 4))
    added[2:, 2:] = 4.0 * kalman @ kalman.T
    steady = linalg.solve_discrete_lyapunov(update @ step, update @ noise @ update.T + added)
    expected = np.sqrt(np.diag(steady))
    told = sigmas(described)
    assert told["true_position"] == pytest.approx(expected[0], rel=1e-8)  # Runge-Kutta's steps: 1e-9
    assert told["navigated_velocity"] == pytest.approx(expected[3], rel=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_correlation_of_position_and_velocity(seed: int) -> None:
    """E[dr dv] = -q T^2 / 24 in the steady state, for any stabilising guidance held over T and any filter."""
    random = np.random.default_rng(seed)
    poles = random.uniform(0.1, 0.75, 2)  # of r+ = r + v + u / 2, v+ = v + u, with u = -l1 r - l2 v
    of_position = (1.0 - poles[0]) * (1.0 - poles[1])
    of_velocity = 2.0 - poles.sum() - 0.5 * of_position
    described = campaign(
        "DoubleIntegrator",
        settings={"of_position": of_position, "of_velocity": of_velocity},
        filter={"believes": {"measurements": {"ranging": f"{random.uniform(0.5, 6.0)!r} m"}}},
    )
    names, matrix = covariance(described)
    across = matrix[names.index("true_position"), names.index("true_velocity")]
    assert across == pytest.approx(-0.01 / 24.0, rel=1e-8)


def test_rendezvous() -> None:
    """One targeted burn, by condor: dispersions, effort, budget of the final position."""
    described = campaign("Rendezvous")
    told, model = sigmas(described), described.scenario.linear().end
    expected = {
        "true_position_x": 7.86500699, "true_position_y": 3.27489711, "true_position_z": 7.02106633,
        "true_velocity_x": 0.04681371, "true_velocity_y": 0.04444446, "true_velocity_z": 0.03149102,
        "burn_x": 0.0336119, "burn_y": 0.04329116, "burn_z": 0.09082802,
    }  # fmt: skip
    for name, sigma in expected.items():
        assert told[name] == pytest.approx(sigma, abs=1e-8 + 5e-8 * (name == "burn_x")), name
    assert np.hypot.reduce([told[f"true_position_{axis}"] for axis in "xyz"]) == pytest.approx(11.0398668, rel=1e-8)
    assert np.hypot.reduce([told[f"burn_{axis}"] for axis in "xyz"]) == pytest.approx(0.106083055, rel=1e-8)
    assert all(told[f"navigated_position_{axis}"] < 1e-8 for axis in "xyz")
    names = [output.name for output in described.scenario.outputs]
    nominal = dict(zip(names, model.nominal.tolist(), strict=True))
    assert nominal["burn_x"] == pytest.approx(1.45222327, abs=1e-8)
    assert nominal["burn_z"] == pytest.approx(0.30311604, abs=1e-8)
    assert nominal["burn_size"] == pytest.approx(1.483520059, abs=1e-9)
    rows = [names.index(f"true_position_{axis}") for axis in "xyz"]
    navigation = np.array([not source.name.startswith("true_") for source in described.scenario.sources])
    partials, start = model.partials[rows], described.errors.covariance
    alone = partials[:, navigation] @ start[np.ix_(navigation, navigation)] @ partials[:, navigation].T
    assert np.trace(alone) == pytest.approx(120.6106315, rel=1e-8)
    traces = {name: np.trace(each[np.ix_(rows, rows)]) for name, each in model.processes.items()}
    assert traces == pytest.approx({"disturbance": 0.6068313, "burn": 0.6611957}, abs=6e-8)


def test_a_correction_by_trigger() -> None:
    """x = x0 + vx h / vz + k 400 / vz, with the kick k = (vx + e) / 2 + its own error where 400 m are left."""
    described = campaign("Kicked")
    told = sigmas(described)
    by_cause = np.array([30.0, 3.0 * 25.0, 60.0 * 0.5, 180.0 * 0.4, 10.0 * 1.0, 20.0 * 0.2])
    assert told["true_x"] == pytest.approx(np.linalg.norm(by_cause), rel=1e-10)
    assert told["kick"] == pytest.approx(np.linalg.norm([0.5 * 0.5, 0.5 * 1.0]), rel=1e-10)
    assert told["kick_time"] == pytest.approx(np.hypot(25.0, 0.4 * 30.0) / 20.0, rel=1e-9)
    assert told["final_time"] == pytest.approx(np.hypot(25.0, 0.4 * 50.0) / 20.0, rel=1e-9)
    model = described.scenario.linear().end
    rows = [output.name for output in described.scenario.outputs]
    assert np.sqrt(model.processes["kick"][rows.index("true_x"), rows.index("true_x")]) == pytest.approx(4.0, rel=1e-9)


def around(described: Campaign) -> list[tuple[float, str | None, dict[str, float]]]:
    """Sigmas of the outputs before and after updates and corrections."""
    history = linear_covariance(described).history
    assert history is not None
    names = [output.name for output in described.scenario.outputs]
    readings = history.readings
    rows = zip(readings.times.tolist(), readings.updates, history.sigma.tolist(), strict=True)
    return [(time, label, dict(zip(names, sigma, strict=True))) for time, label, sigma in rows]


def test_readings_before_and_after_updates() -> None:
    """In the steady state P- = F P F^T + W; what the filter states is the same."""
    history = linear_covariance(campaign("DoubleIntegrator")).history
    assert history is not None
    assert history.sigma_filter is not None
    assert history.readings.updates[-2:] == ("before", "after")
    step, after = np.array([[1.0, 1.0], [0.0, 1.0]]), history.covariance[-1, :2, :2]
    before = step @ after @ step.T + 0.01 * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(history.covariance[-2, :2, :2], before, rtol=1e-8)
    np.testing.assert_allclose(history.sigma_filter[-2, :2] ** 2, np.diag(before), rtol=1e-8)
    np.testing.assert_allclose(history.sigma[-2, 2:4], history.sigma[-1, 2:4], rtol=1e-12)  # of the truth: no jump


def test_readings_around_corrections() -> None:
    """The kick changes the velocity, and the position by what 30 m/s more have done at the nominal instant."""
    (_, first, before), (time, second, after) = [each for each in around(campaign("Kicked")) if each[0] == 30.0]
    assert (first, time, second) == ("before", 30.0, "after")
    assert before["true_vx"] == pytest.approx(0.5, rel=1e-9)
    assert after["true_vx"] == pytest.approx(np.linalg.norm([1.5 * 0.5, 0.5 * 1.0, 0.2]), rel=1e-9)
    assert before["true_x"] == pytest.approx(np.hypot(30.0, 15.0), rel=1e-9)
    moved = 30.0 * np.hypot(25.0, 0.4 * 30.0) / 20.0
    assert after["true_x"] == pytest.approx(np.linalg.norm([30.0, 15.0, moved]), rel=1e-9)
    assert before["kick"] == 0.0


def test_readings_around_a_burn() -> None:
    """What the burn does to the velocity of Clohessy and Wiltshire, from the covariance before it."""
    described = campaign("Rendezvous")
    rendezvous = runpy.run_path(str(CAMPAIGNS / "rendezvous.py"))
    answer = linear_covariance(described).history
    assert answer is not None
    at = answer.readings.updates.index("before")
    assert answer.readings.times[at] == answer.readings.times[at + 1] == rendezvous["BURN"]
    names = [output.name for output in described.scenario.outputs]
    of = {kind: [names.index(f"{kind}{part}_{axis}") for part in ("position", "velocity") for axis in "xyz"]
          for kind in ("true_", "navigated_")}  # fmt: skip
    whole = rendezvous["transition"](rendezvous["ARRIVAL"] - rendezvous["BURN"])
    targeting = np.hstack([-np.linalg.solve(whole[:3, 3:], whole[:3, :3]), -np.eye(3)])
    state = np.eye(12)
    state[3:6, 6:] += targeting
    state[9:, 6:] += targeting
    chosen = np.ix_(of["true_"] + of["navigated_"], of["true_"] + of["navigated_"])
    expected = state @ answer.covariance[at][chosen] @ state.T
    expected[3:6, 3:6] += 2.5e-7 * np.eye(3)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        answer.covariance[at + 1][chosen] / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-7
    )


def test_descent_to_a_trigger() -> None:
    """Events in closed form: 50 s before a trigger on the true altitude, and at a fixed time."""
    fixed, event = sigmas(campaign("FixedDescent")), sigmas(campaign("Descent"))
    assert fixed["true_x"] == pytest.approx(39.051248380, rel=1e-10)
    assert fixed["true_altitude"] == pytest.approx(32.015621187, rel=1e-10)
    assert event["final_time"] == pytest.approx(1.600781059, rel=1e-9)
    assert event["true_x"] == pytest.approx(103.682206767, rel=1e-10)
    assert event["true_altitude"] == pytest.approx(0.0, abs=1e-10)
    assert campaign("Descent").scenario.linear().end.nominal[-1] == pytest.approx(50.0, rel=1e-12)
