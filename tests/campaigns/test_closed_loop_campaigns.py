"""Campaigns of closed loops answer their questions: the cruise missile, the rendezvous, the orbit correction."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy import stats

import mcnav
from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.contract.samples import Batch
from mcnav.report.statements.lincov import mean_words
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.systems.steady.linearized import linearize
from mcnav.systems.steady.truth import Error
from tests.closed_loops import FILE, campaign, tables
from tests.conftest import ROOT

CHANCE = 1e-4
"""False-alarm rate of each statistical comparison; its seed is fixed."""


def covariance(described: Campaign, *outputs: str) -> Array:
    """Linear covariance of some outputs at the end."""
    rows = [[output.name for output in described.scenario.outputs].index(name) for name in outputs]
    return described.scenario.linear().covariance(described.errors.covariance)[0][np.ix_(rows, rows)]


def samples(described: Campaign, count: int, *outputs: str) -> Array:
    """Outputs of the first samples, shape (outputs, count)."""
    rows = [[output.name for output in described.scenario.outputs].index(name) for name in outputs]
    errors = described.errors.draw("random", described.seed, count, 0, count)
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(count), errors, described.seed))
    assert not result.failures
    return result.values[:, rows].T


MISSILE = {
    "range_rate": (Error.RANGE_RATE, 1.0),
    "cross_range_rate": (Error.CROSS_RANGE_RATE, 1.0),
    "true_platform_roll": (Error.ROLL_MISALIGNMENT, 1.0),
    "true_platform_pitch": (Error.MISALIGNMENT, -1.0),
    "drift_roll": (Error.ROLL_DRIFT, 1.0),
    "drift_pitch": (Error.GYRO_DRIFT, -1.0),
    "bias_x": (Error.BIAS_X, 1.0),
    "bias_y": (Error.BIAS_Y, 1.0),
}
"""Sources of campaign 28 and those of type cruise, with the sign of the rotation."""


@pytest.fixture(scope="module")
def missile() -> Campaign:
    return campaign("CruiseMissile")


def test_navigation_errors_of_the_missile_are_those_along_a_given_truth(missile: Campaign) -> None:
    """Type cruise has its own equations of variation; Runge-Kutta's steps of 12 s miss a Schuler period by 1e-8."""
    given = mcnav.read_campaign(ROOT / "campaigns" / "11_cruise.toml")
    scenario: Any = missile.scenario
    flight: Any = given.scenario
    model = scenario.linear().end
    names, sources = [each.name for each in scenario.outputs], [each.name for each in scenario.sources]
    rows = [names.index(name) for name in ("range", "cross_range", "range_rate", "cross_range_rate")]
    mine = model.partials[rows]
    expected = linearize(flight.flight, np.array([scenario.plan.end_time]))[0][[1, 2, 4, 5]]
    sizes = np.array([each.nominal for each in scenario.sources])
    largest = np.abs(mine * sizes).max(axis=1)
    for name, (error, sign) in MISSILE.items():
        place = sources.index(name)
        assert np.all(np.abs(mine[:, place] - sign * expected[:, error]) * sizes[place] < 1e-7 * largest), name
    # it is launched along the azimuth of its platform: there an error of azimuth is one of cross-range rate, too
    azimuth = -mine[:, sources.index("true_platform_azimuth")]
    azimuth += flight.flight.speed * mine[:, sources.index("cross_range_rate")]
    gap = np.abs(azimuth - expected[:, Error.AZIMUTH_MISALIGNMENT]) * sizes[sources.index("true_platform_azimuth")]
    assert np.all(gap < 1e-7 * largest)
    # where the missile is, and the gusts, do not matter to its navigator
    for name in ("true_range", "true_cross_range", "true_range_rate", "true_cross_range_rate"):
        assert np.all(np.abs(mine[:, sources.index(name)]) * sizes[sources.index(name)] < 1e-9 * largest)
    sigma = np.sqrt(np.diag(covariance(missile, *(names[row] for row in rows))))
    cruise = np.sqrt(np.diag(given.scenario.linear().covariance(given.errors.covariance)[0]))
    np.testing.assert_allclose(sigma, cruise, rtol=2e-5)  # digits of the correlation in the campaign


def test_the_miss_of_the_missile_is_minus_its_navigation_error(missile: Campaign) -> None:
    """Along the track exactly; across it within what the steering lags, by linear analysis and in samples.

    Intervals of the correlation by Fisher's z, of the ratio of two correlated sigmas by Pitman and Morgan.
    """
    (error, across), (_, truth) = covariance(missile, "cross_range", "true_cross_range")
    correlation, ratio = across / np.sqrt(error * truth), np.sqrt(truth / error)
    assert correlation == pytest.approx(-0.99996, abs=5e-6)
    assert ratio == pytest.approx(1.0020, abs=5e-5)
    assert np.sqrt([error, truth, error + truth + 2.0 * across]) == pytest.approx([2_693.9, 2_699.4, 24.0], abs=0.06)
    count = 200
    of_range, true_range, of_cross, true_cross = samples(
        missile, count, "range", "true_range", "cross_range", "true_cross_range"
    )
    assert np.abs(of_range + true_range).max() < 1e-6
    measured = np.corrcoef(of_cross, true_cross)[0, 1]
    z = stats.norm.isf(CHANCE / 2.0) / np.sqrt(count - 3.0)
    assert abs(np.arctanh(measured) - np.arctanh(correlation)) < z
    spread = true_cross.var() / of_cross.var()
    t = stats.t.isf(CHANCE / 2.0, count - 2) ** 2
    wide = 1.0 + 2.0 * (1.0 - measured**2) * t / (count - 2.0)
    low, high = spread * (wide - np.sqrt(wide**2 - 1.0)), spread * (wide + np.sqrt(wide**2 - 1.0))
    assert low < ratio**2 < high
    assert high / low < 1.01  # the intervals say something
    scenario: Any = missile.scenario
    assert scenario.remarks == ()


NODES, WEIGHTS = np.polynomial.legendre.leggauss(100)


def below(size: float, principal: Array) -> float:
    """Probability that |N(0, S)| is below a size, from the sigmas along S's principal axes.

    The integral over the ball is the normal distribution along the last axis, over two coordinates for the others. Each
    is the sine of an angle times what it reaches: the ball, or eight sigma.
    """
    first, second, third = principal
    sine, turn = np.sin(0.5 * np.pi * NODES), 0.5 * np.pi * np.cos(0.5 * np.pi * NODES) * WEIGHTS
    reach = min(size, 8.0 * first)
    x = reach * sine[:, None]
    disc = np.sqrt(size**2 - x**2)
    across = np.minimum(disc, 8.0 * second)
    y = across * sine
    left = np.sqrt(np.maximum(disc**2 - y**2, 0.0))
    density = stats.norm.pdf(x, scale=first) * stats.norm.pdf(y, scale=second)
    inside = 2.0 * stats.norm.cdf(left, scale=third) - 1.0
    return float(np.sum(density * inside * reach * turn[:, None] * across * turn))


@pytest.mark.parametrize(
    ("burn", "median", "bound", "mean", "sigma"),
    [("transfer", 4.6361, 20.413, 5.5133, 4.0376), ("arrival", 2.6269, 11.367, 3.1278, 2.2144)],
)
def test_mean_plus_three_sigma_of_a_burn_of_zero_mean_is_too_small(
    burn: str, median: float, bound: float, mean: float, sigma: float
) -> None:
    """The law of the size follows from the components, which linear analysis has; the samples follow the law."""
    described = campaign("OrbitCorrection")
    spread = covariance(described, *(f"{burn}_{axis}" for axis in "xyz"))
    principal = np.sqrt(np.linalg.eigvalsh(spread))
    assert below(median, principal) == pytest.approx(0.5, abs=1e-5)
    assert below(bound, principal) == pytest.approx(0.9973, abs=2e-6)
    x, weights = np.polynomial.legendre.leggauss(40)
    above = 1.0 - np.array([below(size, principal) for size in 5.0 * sigma * (x + 1.0)])
    assert 5.0 * sigma * np.sum(weights * above) == pytest.approx(mean, abs=1e-4)
    assert np.sqrt(np.trace(spread) - mean**2) == pytest.approx(sigma, abs=1e-4)
    short = 1.0 - below(mean + 3.0 * sigma, principal)
    assert 1.0 / short == pytest.approx(104.2 if burn == "transfer" else 100.5, abs=0.1)
    count = 1_500
    (sizes,) = samples(described, count, f"{burn}_size")
    for size in (median, mean + 3.0 * sigma, bound):
        share = below(size, principal)
        low, high = stats.binom.ppf([CHANCE / 2.0, 1.0 - CHANCE / 2.0], count, share)
        assert low <= np.sum(sizes < size) <= high


def test_a_burn_that_is_nominally_rounding_has_no_direction() -> None:
    """Gravity as a difference leaves a nominal burn of 1e-11 m/s, which is none."""
    described = campaign("OrbitCorrection")
    scenario: Any = described.scenario
    assert any("the nominal transfer is zero" in remark for remark in scenario.remarks)
    assert np.all(covariance(described, "transfer_size", "arrival_size") == 0.0)


def test_corrections_and_times_are_no_errors() -> None:
    """A nominal burn of 1.5 m/s is no mean error."""
    answer = linear_covariance(campaign("Rendezvous"))
    assert list(mean_words(answer)) == []
    assert answer.mean.any()


def test_a_size_is_allocated_to_sensors_and_processes(tmp_path: Path) -> None:
    limit = {"output": "true_position", "probability": 0.9973, "below": "4 m"}
    described = tables("DoubleIntegrator", accept={"quantile": [limit]})
    path = tmp_path / "loop.toml"
    path.write_text(tomli_w.dumps(described), encoding="utf-8")
    shutil.copy(FILE, tmp_path)
    allocation = mcnav.allocate(path, confirm=0)
    assert {"measurements.ranging", "processes.disturbance"} <= {
        path for goal in allocation.goals for change in goal.changes for path in change.paths
    }
