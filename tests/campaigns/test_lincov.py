"""Linear covariance of campaigns of every kind: what a run says of its linear model, and closed forms."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav import CampaignError, linear_covariance
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.config.templates import new_scenario
from mcnav.studies.lincov import write_lincov
from mcnav.workflow.run import run_campaign
from tests.conftest import campaign

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"

SAME = 1e-10
"""Relative difference of quantities that are computed alike: rounding, of partial derivatives to 1e-12 and of roots."""

ACCEPT = {
    "quantile": [{"output": "altitude", "probability": 0.9973, "below": "100 km"}],
    "cep": [{"outputs": ["altitude", "range"], "below": "50 km"}],
    "r95": [{"outputs": ["altitude", "range"], "below": "110 km"}],
    "box": [{"within": {"altitude": "90 km", "range": "90 km"}, "probability": 0.95}],
}


def test_a_run_says_the_same_of_its_linear_model(tmp_path: Path) -> None:
    described = campaign(samples=200, accept=ACCEPT)
    summary = run_campaign(described, tmp_path / "run", None, 1, report=False).summary
    found = linear_covariance(described)
    np.testing.assert_allclose(found.sigma, summary["sigma_linear"], rtol=SAME)
    assert len(found.requirements) == len(summary["requirements"]) == 4
    for own, entry in zip(found.requirements, summary["requirements"], strict=True):
        assert own.value == pytest.approx(entry["linear"], rel=SAME)
        assert own.met == entry["linear_meets"]
    assert found.history is not None
    np.testing.assert_allclose(found.history.sigma[-1], found.sigma, rtol=1e-6)


def test_stochastic_scenarios_of_a_user(tmp_path: Path) -> None:
    _, path, _ = new_scenario("drift", tmp_path, True)
    found = linear_covariance(path)
    assert found.history is not None
    assert found.model.processes
    np.testing.assert_allclose(found.history.sigma[-1], found.sigma, rtol=SAME)


def test_a_users_scenario_has_a_covariance_at_its_end() -> None:
    found = linear_covariance(CAMPAIGNS / "14_polar.toml")
    assert found.history is None
    expected = sorted([20.0, 1e3 * np.radians(15.0)])
    np.testing.assert_allclose(sorted(found.sigma), expected, rtol=1e-6)


def test_a_users_scenario_without_partial_derivatives_is_refused(tmp_path: Path) -> None:
    code = """
import numpy as np
from mcnav import Output, SimulationResult, Source


class Jump:
    sources = (Source("error", "m", "m", 1.0),)
    outputs = (Output("error", "m", "m"),)

    def propagate(self, errors):
        return SimulationResult(np.where(errors > 0.05, 1.0, 0.0) + np.sqrt(np.abs(errors)))
"""
    (tmp_path / "jump.py").write_text(code)
    entries: dict[str, Any] = {"scenario": {"type": "jump.py:Jump"}, "errors": {"error": "1 m"}}
    with pytest.raises(CampaignError, match="does not converge"):
        linear_covariance(parse_campaign(entries, str(tmp_path / "jump.toml"), "jump"))


def test_times_need_a_trajectory(tmp_path: Path) -> None:
    """A class whose `propagate` returns the end alone has none."""
    _, own, _ = new_scenario("own", tmp_path)
    with pytest.raises(CampaignError, match="--at: the system returns its errors at the end alone"):
        linear_covariance(own, np.array([60.0]))


def test_a_cruise_at_a_time_is_one_that_ends_there() -> None:
    """Half an hour of campaign 11, whose end is a distance: the same sigmas as a cruise of that duration has."""
    described = tomllib.loads((CAMPAIGNS / "11_cruise.toml").read_text())
    del described["scenario"]["distance"]
    described["scenario"]["duration"] = "1800 s"
    at_time = linear_covariance(CAMPAIGNS / "11_cruise.toml", np.array([1800.0]))
    ended = linear_covariance(parse_campaign(described, "cruise.toml", "cruise"))
    assert at_time.asked is not None
    np.testing.assert_allclose(at_time.asked.sigma[-1], ended.sigma, rtol=1e-9)


def test_times_outside_of_the_navigation_are_those_of_the_option() -> None:
    """The end is written with all its digits: that which is shown is accepted."""
    message = "--at: got 99999 s; navigation is from 0 s to 3598.878663 s"
    with pytest.raises(CampaignError, match=message):
        linear_covariance(CAMPAIGNS / "19_flight_with_gnss.toml", np.array([600.0, 99999.0]))
    linear_covariance(CAMPAIGNS / "15_flight_navigation_grade.toml", np.array([3598.878663]))


def test_files_of_a_linear_covariance(tmp_path: Path) -> None:
    """Requirements that are met and not met, one that needs Monte Carlo; budget and correlations add up to one."""
    accept = ACCEPT | {"sigma_ratio": "5 %", "cep": [{"outputs": ["altitude", "range"], "below": "10 km"}]}
    found, (table, page) = write_lincov(campaign(accept=accept), tmp_path)
    stored = json.loads(table.read_text())
    assert [each["met"] for each in stored["requirements"]] == [None, True, False, True, True]
    shares = np.array([each["share"] for each in stored["budget"]])
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.diag(stored["correlation"]), 1.0, rtol=1e-12)
    assert len(stored["rows"]) == 60
    text = page.read_text()
    assert "1 of 4 requirements that linear analysis can judge is not met" in text
    for figure in ("sigmas", "budget", "development", "correlations"):
        assert f'id="figure-{figure}"' in text
    assert f"{found.sigma[0] / 1e3:.5g}"[:5] in text


def test_requirements_over_time_have_a_figure(tmp_path: Path) -> None:
    described = read_campaign(CAMPAIGNS / "23_lunar_return_updated_once.toml")
    epochs = described.scenario.navigation.times
    entries = {**tomllib.loads(described.to_toml()), "accept": {
        "quantile": [{"output": "position_east", "probability": 0.9, "below": "500 m", "at": "4000 s"}],
    }}  # fmt: skip
    entries["accept"]["quantile"][0]["at"] = f"{epochs[30]} s"
    again = parse_campaign(entries, str(CAMPAIGNS / "again.toml"), "again")
    found, (_, page) = write_lincov(again, tmp_path)
    (requirement,) = found.requirements
    assert requirement.time == pytest.approx(epochs[30])
    assert 'id="figure-requirements"' in page.read_text()


def test_sources_without_a_variance_are_refused() -> None:
    with pytest.raises(CampaignError, match="no finite mean and variance"):
        linear_covariance(campaign(errors={"altitude": {"distribution": "scipy.cauchy", "scale": "1 km"}}))
