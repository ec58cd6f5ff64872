"""Kinds of filters: errors on the group by logarithms of matrices, updates by what they minimise, small errors."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, logm

from mcnav.arrays.types import Array
from mcnav.config.overrides import override
from mcnav.config.read import parse_campaign
from mcnav.config.toml import load_mapping
from mcnav.errors import CampaignError
from mcnav.systems.ins.filter.model import EKF, KINDS, LEFT, RIGHT
from mcnav.systems.ins.recognition import is_ins
from mcnav.systems.ins.reference.error_definitions import carried_over, retracted
from mcnav.systems.ins.reference.nonlinear_updates import iterate, sigma_points, update_by_sigma_points
from tests.filter_kinds import CAMPAIGN


def _pose(rotation: Array, velocity: Array, position: Array) -> Array:
    pose = np.eye(5)
    pose[:3, :3], pose[:3, 3], pose[:3, 4] = rotation, velocity, position
    return pose


def _cross(vector: Array) -> Array:
    return np.asarray(np.cross(np.eye(3), vector))


def _logarithm(pose: Array) -> Array:
    algebra = np.real(logm(pose))
    return np.concatenate([[algebra[2, 1], algebra[0, 2], algebra[1, 0]], algebra[:3, 3], algebra[:3, 4]])


def _error(kind: str, indicated: Array, additive: Array, origin: Array) -> Array:
    """The invariant error of an indicated pose from the true one that has an additive error."""
    true = _pose(
        expm(_cross(additive[:3])).T @ indicated[:3, :3],
        indicated[:3, 3] - additive[3:6],
        indicated[:3, 4] - additive[6:9],
    )
    there = np.linalg.inv(origin)
    here, true = there @ indicated, there @ true
    return _logarithm(here @ np.linalg.inv(true) if kind == RIGHT else np.linalg.inv(true) @ here)


def _to_invariant(kind: str, indicated: Array, origin: Array) -> Array:
    """The derivative of the invariant error by the additive one, by central differences of logarithms."""
    steps = 1e-6 * np.eye(9)
    columns = [
        (_error(kind, indicated, step, origin) - _error(kind, indicated, -step, origin)) / 2e-6 for step in steps
    ]
    return np.array(columns).T


@pytest.mark.parametrize("kind", [LEFT, RIGHT])
@pytest.mark.parametrize("moved", [0.0, 1.0])
def test_the_covariance_of_an_invariant_error_stays_as_the_estimate_is_corrected(kind: str, moved: float) -> None:
    """In psi, dv, dr it is carried over by the derivatives at both estimates, wherever the group has its origin.

    The correction is the group's exponential; differences are second order in their step, 1e-12, over the step.
    """
    generator = np.random.default_rng(4)
    indicated = _pose(expm(_cross(np.array([0.4, -1.0, 0.7]))), np.array([15.0, -4.0, 1.0]), np.array([3.0, 8.0, -2.0]))
    origin = _pose(np.eye(3), moved * np.array([5.0, 1.0, -3.0]), moved * np.array([-7.0, 2.0, 30.0]))
    change = np.concatenate([[0.3, -0.2, 0.5], [1.0, -2.0, 0.5], [4.0, 3.0, -1.0], [0.1]])
    root = generator.standard_normal((10, 10))
    covariance = root @ root.T
    taken = retracted(kind, change)
    corrected = _pose(
        expm(-_cross(change[:3])) @ indicated[:3, :3], indicated[:3, 3] - taken[3:6], indicated[:3, 4] - taken[6:9]
    )
    # the same by the exponential of the group, about the estimate before
    there = _pose(np.eye(3), indicated[:3, 3], indicated[:3, 4])
    algebra = np.zeros((5, 5))
    algebra[:3, :3], algebra[:3, 3], algebra[:3, 4] = -_cross(change[:3]), -change[3:6], -change[6:9]
    np.testing.assert_allclose(corrected, there @ expm(algebra) @ np.linalg.inv(there) @ indicated, atol=1e-12)
    both = np.eye(10)
    both[:9, :9] = np.linalg.solve(_to_invariant(kind, corrected, origin), _to_invariant(kind, indicated, origin))
    np.testing.assert_allclose(carried_over(kind, covariance, taken), both @ covariance @ both.T, rtol=1e-5, atol=1e-4)


def test_the_error_state_filter_takes_it_as_it_is() -> None:
    change, covariance = np.arange(9.0), np.diag(np.arange(1.0, 10.0))
    assert retracted(EKF, change) is change
    assert carried_over(EKF, covariance, change) is covariance


def _double(covariance: Array) -> Any:
    """A navigator whose state is its correction, without axes that turn."""
    navigator = SimpleNamespace(filter=SimpleNamespace(P=covariance), state=np.zeros(3), estimates=np.zeros(0))
    navigator.from_inertial = lambda: np.eye(len(covariance))
    navigator.corrected = lambda change: (change, np.zeros(0))
    navigator.correct = lambda change: setattr(navigator, "state", change)
    return navigator


def _curved(state: Array, _: Array) -> tuple[Array, Array]:
    """Predicted less measured angle and distance of a point: the error is what the state lacks."""
    x, y = 3.0 - state[0], 1.0 - state[1]
    innovation = np.array([np.arctan2(y, x) - 0.6, np.hypot(x, y) - 2.5])
    response = np.array([[-y, x], [x * np.hypot(x, y), y * np.hypot(x, y)]]) / (x * x + y * y)
    return innovation, np.hstack([response, np.zeros((2, 1))])


def test_an_iterated_update_is_the_most_likely_state() -> None:
    """The gradient of the squared errors vanishes, to the change at which iteration ends; one update leaves more."""
    covariance = np.array([[1.0, 0.3, 0.2], [0.3, 0.8, 0.1], [0.2, 0.1, 0.5]])
    variances = np.array([0.01, 0.04])

    def slope(change: Array) -> float:
        innovation, response = _curved(change, change)
        pull = response.T @ (innovation / variances)
        return float(np.abs(np.linalg.solve(covariance, change) - pull).max() / np.abs(pull).max())

    navigator = _double(covariance.copy())
    iterate(navigator, _curved, variances, np.inf)
    innovation, response = _curved(np.zeros(3), np.zeros(0))
    once = (
        covariance @ response.T @ np.linalg.solve(response @ covariance @ response.T + np.diag(variances), innovation)
    )
    assert slope(navigator.state) < 0.02 < 0.2 < slope(once)
    rejected = iterate(_double(covariance.copy()), _curved, variances, 0.1)
    assert not rejected.accepted


def test_sigma_points_are_exact_for_lines_and_squares() -> None:
    """Of a singular covariance too: moments of a linear response with Kalman's update, and those of a square."""
    root = np.array([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 0.0]])
    covariance = root @ root.T
    points = sigma_points(covariance, np.eye(3))
    np.testing.assert_allclose(points.T @ points / 2.0, covariance, atol=1e-14)
    line, variances = np.array([[1.0, 2.0, 0.5]]), np.array([0.3])

    def straight(state: Array, _: Array) -> tuple[Array, Array]:
        return 1.5 - line @ state, line

    def square(state: Array, _: Array) -> tuple[Array, Array]:
        return np.array([(state[0] - 0.5) ** 2]), line

    navigator = _double(covariance.copy())
    update = update_by_sigma_points(navigator, straight, variances, np.inf)
    own = line @ covariance @ line.T + variances
    gain = covariance @ line.T / own
    np.testing.assert_allclose(update.gain, gain, atol=1e-14)
    np.testing.assert_allclose(navigator.state, (gain * 1.5)[:, 0], atol=1e-14)
    np.testing.assert_allclose(navigator.filter.P, covariance - gain @ own @ gain.T, atol=1e-14)
    # E (x - 1/2)^2 = 1 + 1/4, and var = 2 + 4/4
    whitened = update_by_sigma_points(_double(np.diag([1.0, 4.0, 0.0])), square, variances, np.inf)
    np.testing.assert_allclose(whitened.covariance, [[3.3]], atol=1e-12)
    np.testing.assert_allclose(whitened.whitened * np.sqrt(3.3), [1.25], atol=1e-12)


@cache
def _simulated(kind: str, factor: float) -> Array:
    """Final errors of one sample with errors and noise of so many times their sizes, and beliefs alike."""
    sized = {f"errors.{name}": _times(value, factor) for name, value in CAMPAIGN["errors"].items()}
    sized |= {f"imu.{name}.{key}": _times(value, factor) for name, keys in CAMPAIGN["imu"].items()
              for key, value in keys.items()}  # fmt: skip
    sized |= {f"aiding.gnss.{key}": _times(CAMPAIGN["aiding"][0][key], factor) for key in ("position", "velocity")}
    content = override(load_mapping(CAMPAIGN, "-"), {**sized, "filter.kind": kind})
    campaign = parse_campaign(content, "-", "-")
    scenario = campaign.scenario
    assert is_ins(scenario)
    assert scenario.engines[-1] == "reference"
    engine = scenario.engine("reference", np.zeros((1, len(scenario.sources))))
    errors = np.random.default_rng(8).standard_normal(len(scenario.sources)) * campaign.errors.standard_deviations
    mechanization = engine.mechanization  # type: ignore[attr-defined]
    values, _ = mechanization.simulate(errors, mechanization.draw(scenario.navigation.imu, 1, 0))
    return np.asarray(values[-1])


def _times(size: str, factor: float) -> str:
    value, _, unit = size.partition(" ")
    return f"{float(value) * factor!r} {unit}"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != EKF])
def test_kinds_agree_for_small_errors_and_differ_by_their_square(kind: str) -> None:
    """A tenth of the errors: a tenth of the difference, as a share of the largest error.

    Sigma points are integrated without the filter's steps of 0.2 s, which neglect 2e-4 here.
    """
    apart = []
    for factor in (1e-3, 1e-2):
        reference, own = _simulated(EKF, factor), _simulated(kind, factor)
        apart.append(np.abs(own - reference).max() / np.abs(reference).max())
    assert apart[0] < 1e-3
    assert kind == "ukf" or apart[0] < 0.3 * apart[1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"filter.smoother": "fixed-interval"}, "filter.smoother: is not there with kind = 'ukf'"),
        ({"filter.considers": ["gyro_scale_factor"]}, "filter.considers: is not there with kind = 'ukf'"),
        ({"filter.kind": "invariant"}, "filter.kind: got 'invariant'"),
    ],
)
def test_what_a_kind_has_not_is_refused(changes: dict[str, Any], message: str) -> None:
    content = load_mapping(CAMPAIGN, "-")
    content["filter"] = {
        **CAMPAIGN["filter"],
        "kind": "ukf",
        **{key.split(".")[1]: each for key, each in changes.items()},
    }
    content["imu"] = {**CAMPAIGN["imu"], "gyro": {**CAMPAIGN["imu"]["gyro"], "scale_factor": "100 ppm"}}
    with pytest.raises(CampaignError, match=message.replace("(", r"\(")):
        parse_campaign(content, "-", "-")
