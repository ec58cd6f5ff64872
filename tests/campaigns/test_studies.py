"""Studies of start times and of the range of linearity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.linearity import alone, together
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.contract.samples import SimulationResult
from mcnav.errors import CampaignError
from mcnav.linear.partials import Propagate
from mcnav.report.statements.linearity import answer, linearity_rows
from mcnav.report.statements.start_times import answer as start_answer
from mcnav.sampler.designs import SamplingDesign
from mcnav.studies.linearity import linearity_study
from mcnav.studies.start_times import check_start_time, checked_times, start_time_study
from tests.conftest import campaign

QUADRATIC = 0.01
"""Second-order coefficient of a system with one output, ``y = s + a s^2``."""


def _quadratic(multiple: float) -> Propagate:
    def propagate(errors: np.ndarray) -> SimulationResult:
        return SimulationResult(errors + QUADRATIC * errors**2)

    return propagate


def test_range_of_linearity_of_a_known_system() -> None:
    """The departure is a m, so that it reaches 5 % at m = 0.05 / a = 5 for either sign; the root is good to 1e-6."""
    linear = LinearModel(np.eye(1), np.zeros(1))
    found = alone(_quadratic, linear, np.ones((1, 1)), 0.05, 100.0)
    assert found.multiples[0, 0] == pytest.approx(5.0, rel=1e-5)
    never = alone(_quadratic, linear, np.ones((1, 1)), 0.05, 2.0)
    assert np.isinf(never.multiples[0, 0])
    assert never.signs[0, 0] == 0.0


def test_no_effect_has_no_range() -> None:
    linear = LinearModel(np.zeros((1, 1)), np.zeros(1))
    assert np.isnan(alone(_quadratic, linear, np.ones((1, 1)), 0.05, 10.0).multiples[0, 0])


def test_range_of_dispersion_of_a_known_system() -> None:
    """For a normal s the ratio is sqrt(1 + 2 a^2 m^2): 1.05 at m = sqrt(1.05^2 - 1) / (a sqrt 2).

    The interval holds at 95 % for output and joint distribution each; seed and draws are fixed.
    """
    draws = np.random.default_rng(3).standard_normal((4000, 1))
    model = Model(np.eye(1), np.zeros(1), np.zeros(1), np.eye(1))
    found = together(_quadratic, model, draws, Criterion(0.05, 0.95), SamplingDesign(), 100.0)
    exact = np.sqrt(1.05**2 - 1.0) / (QUADRATIC * np.sqrt(2.0))
    assert found.agrees_until[0] < exact < found.differs_from[0]
    assert found.agrees_until[0] < found.departs[0] < found.differs_from[0]
    assert found.departs[0] == pytest.approx(exact, rel=0.15)


def test_dispersion_that_linear_analysis_has_not_ends_the_range() -> None:
    """Of y = a, z = 2 a + 0.03 a^2 and w = b^2 the sigma of z is linear up to a multiple; the others never are.

    The combination z - 2 y has a linear sigma of zero, as w has, at every multiple.
    """

    def simulate(multiple: float) -> Propagate:
        def propagate(errors: Array) -> SimulationResult:
            a, b = errors.T
            return SimulationResult(np.column_stack([a, 2.0 * a + 0.03 * a**2, b**2]))

        return propagate

    partials = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    draws = np.random.default_rng(5).standard_normal((2000, 2))
    model = Model(partials, np.zeros(3), np.zeros(2), np.eye(2))
    found = together(simulate, model, draws, Criterion(0.05, 0.95), SamplingDesign(), 10.0)
    assert found.agrees_until.tolist()[0] == np.inf
    assert found.agrees_until[1] > 5.0
    assert found.agrees_until[2:].tolist() == [0.1, 0.1]
    words = answer(["y", "z", "w"], found, 0.05)
    assert words.startswith("At no multiple is every sigma shown to be within ±5 % of the linear one: w is not")
    assert words.endswith("The full covariance matrix is not shown to agree even at 0.1 times the stated errors.")
    assert [row[1][0] for row in linearity_rows(["y", "z", "w"], found)][2:] == ["< 0.1", "< 0.1"]


def test_flights_that_fail_end_the_range() -> None:
    def failing(multiple: float) -> Propagate:
        return lambda errors: SimulationResult(np.where(np.abs(errors) > 7.0, np.nan, errors))

    found = alone(failing, LinearModel(np.eye(1), np.zeros(1)), np.ones((1, 1)), 0.05, 100.0)
    assert found.multiples[0, 0] == pytest.approx(7.0, rel=1e-5)


def test_linearity_of_trajectory_1() -> None:
    """At the multiples where the verdicts change, a campaign of those errors has these verdicts."""
    study = linearity_study(campaign(1, design="random"), samples=2_000, largest=20.0)
    joint = study.together
    last = joint.departs[-1]
    assert joint.agrees_until[-1] <= last <= joint.differs_from[-1]
    # mean NEES of 4.12 at three times and 5.37 at ten times: sqrt(NEES / 4) passes 1.05, NEES 4.41, between them
    assert 3.0 < last < 10.0


def test_dispersion_by_start_time_is_checked() -> None:
    described = campaign(4)
    study = start_time_study(described, count=25)
    times = checked_times(described, study)
    assert len(times) >= 6
    for time in times[:2]:
        comparison = check_start_time(described, time, study.axes)
        expected = [np.interp(time, study.times, study.sigma[:, i]) for i in range(4)]
        found = [output.sigma_linear for output in comparison.outputs]
        np.testing.assert_allclose(found, expected, rtol=2e-3)  # interpolated between 25 start times
        assert comparison.verdict == "agrees"


def test_errors_that_change_with_the_start_time() -> None:
    """Altitude errors that fall to a fifth until reentry make a later start the better one; dispersion scales."""
    constant = campaign(4)
    entries: dict[str, Any] = {
        "errors": {"altitude": [["-60 min", "5 km"], ["0 min", "1 km"]]},
        "weights": {"altitude": "1 km", "range": "2 km"},
        "check": ["-10 min"],
        "count": 201,
    }
    changing = campaign(4, start_times=entries)
    before, after = start_time_study(constant, count=201), start_time_study(changing)
    assert after.times[after.best[0]] > before.times[before.best[0]] + 600.0
    assert changing.start_times.check == (-600.0,)
    multiple = np.interp(-600.0, [-3600.0, 0.0], [1.0, 0.2])
    found = check_start_time(changing, -600.0, "start")
    by_altitude = before.effects[:, 0, 0] * np.interp(before.times, [-3600.0, 0.0], [1.0, 0.2])
    rest = before.sigma[:, 0] ** 2 - before.effects[:, 0, 0] ** 2
    np.testing.assert_allclose(after.sigma[:, 0], np.sqrt(rest + by_altitude**2), rtol=1e-9)
    assert 0.2 < multiple < 1.0
    assert found.verdict == "agrees"
    np.testing.assert_allclose(after.weights, [1e-3, 0.5e-3, 0.0, 0.0])
    np.testing.assert_allclose(after.weighted, 1e-3 * np.hypot(after.sigma[:, 0], 0.5 * after.sigma[:, 1]), rtol=1e-12)


def test_start_times_rank_by_root_mean_square_where_mean_errors_matter() -> None:
    """Accelerometers off above 80 km leave 387 km in every start: means are those of samples."""
    scenario = {"type": "reentry", "trajectory": 4, "accelerometers_off_above": "80 km"}
    switched = campaign(4, scenario=scenario)
    study = start_time_study(switched, count=7)
    assert study.means is not None
    checked = check_start_time(switched, float(study.times[0]), study.axes)
    # four standard errors of a mean, and what curvature adds: less than a twentieth of a sigma
    reach = (4.0 / np.sqrt(checked.samples) + 0.05) * study.sigma[0]
    assert np.all(np.abs(study.means[0] - checked.mean_sample) <= reach)
    assert study.means[0, 0] == pytest.approx(387e3, abs=1e3)
    np.testing.assert_allclose(study.weights, 1.0 / np.hypot(study.sigma[0], study.means[0]))
    told = start_answer(study, {}, switched.scenario.outputs)
    assert "a mean error exceeds its sigma. Worst: the mean error of altitude for a start at −34.4 min" in told
    assert "It is +387 km, 21.7 times its sigma of 17.9 km." in told
    assert "Start times rank by root mean square." in told
    assert start_time_study(campaign(4), count=7).means is None


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"cout": 3}, "start_times.cout: unknown key; did you mean 'count'?"),
        ({"weights": {"height": "1 km"}}, "start_times.weights.height: unknown output"),
        ({"weights": {"altitude": "0 km"}}, "expected a sigma greater than zero"),
        ({"weights": {"altitude": "1 deg"}}, "which is an angle"),
        ({"errors": {"altitude": [["0 min", "5 km"], ["-10 min", "1 km"]]}}, "expected start times in rising order"),
        ({"errors": {"altitude": ["5 km"]}}, "expected a pair"),
        ({"errors": {"altitude": [["0 min", "5 deg"]]}}, "start_times.errors.altitude #1: got '5 deg'"),
        ({"errors": {"altitude": [["0 min", "-5 km"]]}}, "expected a sigma of at least zero"),
        ({"errors": {"alttude": [["0 min", "5 km"]]}}, "did you mean 'altitude'?"),
        ({"check": ["5 km"]}, "which is a length"),
    ],
    ids=str,
)
def test_mistakes_in_the_plan(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(CampaignError, match=r"start_times") as refused:
        campaign(4, start_times=entries)
    assert message in str(refused.value)


def test_a_check_that_is_not_on_the_trajectory() -> None:
    with pytest.raises(CampaignError, match="is not on the trajectory"):
        check_start_time(campaign(4), -1e5, "start")
