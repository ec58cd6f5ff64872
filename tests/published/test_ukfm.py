"""The benchmark of ukfm: filters against identities, few runs against many, printed numbers as the page has them."""

from __future__ import annotations

from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from mcnav.arrays.types import Array
from mcnav.numerics.extended_poses import exponential
from mcnav.validation.reproduce.ukfm import flight, page
from mcnav.validation.reproduce.ukfm.kernel import FLOOR, LEFT, RIGHT, STANDARD, simulate
from mcnav.validation.reproduce.ukfm.printed import MEANT, PRINTED, Filter
from mcnav.validation.reproduce.ukfm.simulation import ALL
from tests.commands import invoke
from tests.conftest import ROOT

RUNS = 60
COMMITTED = ROOT / "mcnav" / "validation" / "reproduce" / "ukfm" / "UKFM.md"


def _wedge(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _pose(error: Array) -> Array:
    """The exponential of SE_2(3) by that of a matrix of five rows."""
    algebra = np.zeros((5, 5))
    algebra[:3, :3], algebra[:3, 3], algebra[:3, 4] = _wedge(error[:3]), error[3:6], error[6:]
    return np.asarray(expm(algebra))


def _retracted(definition: int, pose: Array, error: Array) -> Array:
    if definition == LEFT:
        return np.asarray(pose @ _pose(error))
    if definition == RIGHT:
        return np.asarray(_pose(error) @ pose)
    result = pose.copy()
    result[:3, :3] = expm(_wedge(error[:3])) @ pose[:3, :3]
    result[:3, 3] += error[3:6]
    result[:3, 4] += error[6:]
    return result


def _difference(definition: int, pose: Array, other: Array) -> Array:
    """The error that makes another pose of this one, by the logarithm of matrices near the identity."""
    apart = np.linalg.solve(pose, other) if definition == LEFT else other @ np.linalg.inv(pose)
    if definition == STANDARD:
        apart[:3, 3], apart[:3, 4] = other[:3, 3] - pose[:3, 3], other[:3, 4] - pose[:3, 4]
    term, series = apart - np.eye(5), np.zeros((5, 5))
    power = np.eye(5)
    for order in range(1, 12):
        power = power @ term
        series -= (-1.0) ** order / order * power
    shift = series if definition != STANDARD else apart
    return np.array([series[2, 1], series[0, 2], series[1, 0], *shift[:3, 3], *shift[:3, 4]])


def _stepped(pose: Array, rate: Array, force: Array) -> Array:
    result = pose.copy()
    acceleration = pose[:3, :3] @ force + flight.GRAVITY
    result[:3, :3] = pose[:3, :3] @ expm(_wedge(rate) * flight.STEP)
    result[:3, 4] += flight.STEP * pose[:3, 3] + 0.5 * flight.STEP**2 * acceleration
    result[:3, 3] += flight.STEP * acceleration
    return result


def _spread(size: int) -> tuple[float, float, float]:
    """Distance, weight and the weight of the central point of sigma points with a spread of 1e-3."""
    excess = (1e-6 - 1.0) * size
    return np.sqrt(size + excess), 0.5 / (size + excess), excess / (size + excess)


def _advanced(definition: int, pose: Array, covariance: Array, reading: Array) -> tuple[Array, Array]:
    """Propagate by sigma points of the state and of the readings' noise, as the paper has them."""
    after = _stepped(pose, reading[:3], reading[3:])
    total = np.zeros((9, 9))
    state = np.linalg.cholesky(covariance + FLOOR * np.eye(9)).T
    noise = np.diag([flight.GYRO] * 3 + [flight.ACCELEROMETER] * 3)
    for factor, size in ((state, 9), (noise, 6)):
        distance, weight, central = _spread(size)
        moved = []
        for sign in (distance, -distance):
            for row in factor:
                start = _retracted(definition, pose, sign * row) if size == 9 else pose
                read = reading + (sign * row if size == 6 else 0.0)
                moved.append(_difference(definition, after, _stepped(start, read[:3], read[3:])))
        mean = weight * np.sum(moved, axis=0)
        total += weight * (np.array(moved) - mean).T @ (np.array(moved) - mean)
        total += (central + 3.0 - 1e-6) * np.outer(mean, mean)
    return after, total


def _updated(definition: int, pose: Array, covariance: Array, measured: Array) -> tuple[Array, Array]:
    """Update by sigma points."""
    distance, weight, central = _spread(9)
    covariance = covariance + FLOOR * np.eye(9)
    factor = np.linalg.cholesky(covariance).T

    def seen(at: Array) -> Array:
        return np.asarray(((flight.LANDMARKS - at[:3, 4]) @ at[:3, :3]).ravel())

    errors = distance * np.concatenate([factor, -factor])
    points = np.array([seen(_retracted(definition, pose, each)) for each in errors])
    mean = central * seen(pose) + weight * points.sum(axis=0)
    own = np.outer(seen(pose) - mean, seen(pose) - mean) * (central + 3.0 - 1e-6)
    own += weight * (points - mean).T @ (points - mean) + flight.RANGING**2 * np.eye(9)
    gain = np.linalg.solve(own, weight * (points - mean).T @ errors).T
    return _retracted(definition, pose, gain @ (measured - mean)), covariance - gain @ own @ gain.T


@pytest.mark.parametrize("filter_", [each for each in MEANT if each.sigma_points], ids=lambda each: each.name)
def test_a_sigma_point_filter_is_that_of_the_paper(filter_: Filter) -> None:
    """The kernel moves covariances by matrices; here all of it is sigma points, over six steps and two updates.

    Differences are those of the spread, 1e-6, and of rounding, 1e-16 over the square of the spread.
    """
    truth, draws = flight.truth(), flight.draw(7, 0, 1)
    pose = np.eye(5)
    pose[:3, :3] = expm(_wedge(draws.start[0, :3]))
    pose[:3, 4] = truth.position[0] + draws.start[0, 3:]
    turned = np.eye(9)
    turned[6:, :3] = filter_.turned * _wedge(pose[:3, 4])
    sizes = np.repeat([flight.START_ATTITUDE, 0.0, flight.START_POSITION], 3)
    covariance = turned @ np.diag(sizes**2) @ turned.T
    squares = []
    for instant in range(1, 7):
        reading = draws.readings[0, instant - 1] + np.concatenate([np.zeros(3), truth.forces[instant - 1]])
        pose, covariance = _advanced(filter_.definition, pose, covariance, reading)
        if instant % 3 == 0:
            measured = (flight.LANDMARKS - truth.position[instant]).ravel() + draws.landmarks[0, instant // 3 - 1]
            pose, covariance = _updated(filter_.definition, pose, covariance, measured)
        squares.append(np.sum((pose[:3, 4] - truth.position[instant]) ** 2))
    by_run, by_time = np.empty((1, 5)), np.zeros((7, 5))
    sigmas = np.array([flight.GYRO, flight.ACCELEROMETER, flight.RANGING, flight.START_ATTITUDE, flight.START_POSITION])
    simulate(
        filter_.definition, True, truth.forces[:6], truth.position[:7], flight.GRAVITY, flight.LANDMARKS, flight.STEP,
        3, sigmas, filter_.turned, draws.start, draws.readings, draws.landmarks, by_run, by_time,
    )  # fmt: skip
    np.testing.assert_allclose(by_time[1:, 1], squares, rtol=1e-5)
    body = covariance[6:, 6:]
    if filter_.definition == RIGHT:
        arm = np.hstack([-_wedge(pose[:3, 4]), np.eye(3)])
        places = np.r_[0:3, 6:9]
        body = arm @ covariance[np.ix_(places, places)] @ arm.T
    elif filter_.definition == LEFT:
        body = pose[:3, :3] @ body @ pose[:3, :3].T
    off = pose[:3, 4] - truth.position[6]
    assert by_time[6, 4] == pytest.approx(off @ np.linalg.solve(body, off) / 3.0, rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-5, 0.0099, 0.0101, 2.0])
def test_the_exponential_is_that_of_matrices(angle: float) -> None:
    vector, b = angle * np.array([2.0, -1.0, 2.0]) / 3.0, np.array([0.3, -0.2, 0.5])
    rotation, jacobian = np.empty((3, 3)), np.empty((3, 3))
    exponential(vector, rotation, jacobian)
    exact = _pose(np.concatenate([vector, b, np.zeros(3)]))
    np.testing.assert_allclose(rotation, exact[:3, :3], atol=1e-15)
    np.testing.assert_allclose(jacobian @ b, exact[:3, 3], atol=1e-15)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ukfm")
    finished = invoke("reproduce", "ukfm", "--samples", RUNS, "--out", folder, cwd=folder)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert finished.stdout.splitlines()[0] == "40 printed numbers"
    return folder


def test_few_runs_agree_with_the_committed_numbers(folder: Path) -> None:
    """A range of means of 100 runs has its half width in 1.96 sigma; means of 60 runs are within four of their own."""
    few = pd.read_csv(folder / "numbers.csv")
    rows = [line.split(" | ") for line in COMMITTED.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    rows = [row for row in rows if len(row) == 6 and " to " in row[4] and "%" in row[5]]
    assert len(rows) == len(few) == 40
    for row, (_, computed) in zip(rows, few.iterrows(), strict=True):
        assert row[2].removesuffix(" ≠") == f"{computed['printed']:.2f}"
        low, high = (float(each) for each in row[4].split(" to "))
        sigma = (high - low) / (2.0 * 1.96) * np.sqrt(100.0 / RUNS)
        assert abs(computed["ours"] - float(row[3])) < 4.0 * sigma + 0.005 * float(row[3]), row


def test_the_page_and_the_documentation_tell_the_same(folder: Path) -> None:
    text = unescape((folder / page.PAGE).read_text(encoding="utf-8"))
    assert text.count('class="digits"') + text.count('class="tolerance"') == 40
    assert "left UKF" in text
    assert len(ALL) == 9
    document = COMMITTED.read_text(encoding="utf-8")
    inside = 40 - document.count(" ≠ |")
    assert f"{inside} of the 40" in document
    assert f"{inside} of the 40" in (ROOT / "mcnav" / "docs" / "COMMANDS.md").read_text(encoding="utf-8")
    printed = [number for filters in PRINTED.values() for numbers in filters.values() for number in numbers]
    assert all(f"| {each} " in document for each in printed)


def test_samples_are_for_ukfm_alone(tmp_path: Path) -> None:
    finished = invoke("reproduce", "textbook", "--samples", 5, cwd=tmp_path)
    assert finished.returncode != 0
    assert finished.stderr.strip() == "error: --samples: belongs to ukfm; leave it out for textbook"
