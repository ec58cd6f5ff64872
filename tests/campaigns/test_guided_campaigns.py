"""Campaigns of the guided reentry: their answers, and what is said where no linear model holds."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import Campaign, parse_campaign
from mcnav.contract.samples import Batch
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.systems.reentry.guided.linear import LinearFlight
from mcnav.systems.reentry.guided.remarks import doubtful_end, draw_flights, rival_maxima
from mcnav.systems.reentry.guided.scenario import GuidedReentry
from mcnav.workflow.run import run_campaign
from tests.commands import invoke
from tests.conftest import ROOT

SAMPLES = 1_000
"""Samples of a campaign here: a root mean square is known to 2.2 %, 1 sigma, if it is of a normal distribution."""


def _entries(number: int) -> dict[str, Any]:
    (path,) = (ROOT / "campaigns").glob(f"{number}_*.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _without_law() -> Campaign:
    """Campaign 26 by the report's own law, from the first point, with an altitude rate wrong by 0.1 m/s alone."""
    entries = _entries(26) | {"samples": 200, "name": "by the report's law", "errors": {"altitude_rate": "0.1 m/s"}}
    del entries["scenario"]["guidance"]["law"], entries["scenario"]["start"]
    return parse_campaign(entries, "test.toml", "test")


@pytest.mark.parametrize(("number", "linear", "sampled"), [(25, 290.29, 297.9), (26, 2.935, 3.00)])
def test_the_landing_point_moves_as_the_campaign_says(number: int, linear: float, sampled: float) -> None:
    """Linear sigma and samples against the answer; 4.4 standard errors, 1e-5 on both sides, of the samples' size."""
    campaign = parse_campaign(_entries(number), "test.toml", "test")
    found = linear_covariance(campaign)
    at = [output.name for output in campaign.scenario.outputs].index("true_range")
    assert found.sigma[at] / 1e3 == pytest.approx(linear, rel=5e-4)
    errors = campaign.errors.draw(campaign.design, campaign.seed, SAMPLES, 0, SAMPLES)
    engine = campaign.scenario.engine("ensemble", errors)
    moved = engine.simulate(Batch(np.arange(SAMPLES), errors, campaign.seed)).values[:, at] / 1e3
    error = np.std(moved**2) / np.sqrt(SAMPLES)
    assert abs(np.mean(moved**2) - sampled**2) < 4.4 * error


def test_it_is_the_navigation_error_that_decides_about_the_miss() -> None:
    """Campaign 26: what final altitude and range errors do not explain is what air and vehicle add, 0.26 km."""
    campaign = parse_campaign(_entries(26), "test.toml", "test")
    partials, start = campaign.scenario.linear().end.partials, campaign.errors.covariance
    covariance = partials @ start @ partials.T / 1e6
    names = [output.name for output in campaign.scenario.outputs]
    known, at = [names.index("altitude"), names.index("range")], names.index("true_range")
    factors = np.linalg.solve(covariance[np.ix_(known, known)], covariance[known, at])
    np.testing.assert_allclose(factors, [-3.3, -1.0], atol=0.02)
    assert np.sqrt(covariance[at, at] - factors @ covariance[known, at]) == pytest.approx(0.26, abs=0.005)


def _at_the_limit(share: float = 1.0) -> Campaign:
    """Campaign 26 started 21.7 min before reentry, with a share of the report's errors: the L/D reaches its limit."""
    errors = {name: quantity.split(" ", 1) for name, quantity in _entries(25)["errors"].items()}
    entries = _entries(26) | {"samples": 200, "name": "limited"}
    entries |= {"errors": {name: f"{share * float(number)!r} {unit}" for name, (number, unit) in errors.items()}}
    entries["scenario"]["start"] = "-21.7 min"
    return parse_campaign(entries, "test.toml", "test")


def _remarks(campaign: Campaign) -> tuple[str, ...]:
    return campaign.scenario.remarks_on(campaign.errors.mean, campaign.errors.covariance)


@pytest.mark.parametrize(
    ("share", "told"),
    [
        (1.0, ["in true_range (48.9 km)", "one sigma of the commanded L/D is", "the deceleration has two maxima"]),
        (0.3, ["in true_range (14.7 km)"]),
        (0.1, ["in true_range_rate (4.87 m/s)"]),
        (0.03, []),
    ],
)
def test_flights_that_depart_from_linear_analysis_are_noticed(share: float, told: list[str]) -> None:
    """In 3,000 other flights 35 % are farther than five sigma with 0.3 of the errors, 9 % with 0.1, 0.3 % with 0.03."""
    remarks = _remarks(_at_the_limit(share))
    assert len(remarks) == len(told)
    assert all(words in remark for words, remark in zip(told, remarks, strict=True))


@pytest.mark.parametrize("number", [25, 26])
def test_campaigns_whose_landing_point_is_linear_have_no_remarks(number: int) -> None:
    """At most 1.6 % of 3,000 other flights are farther than five sigma, and 36 % farther than one, in any output."""
    assert _remarks(parse_campaign(_entries(number), "test.toml", "test")) == ()


def _flight(**options: Any) -> LinearFlight:
    described = {"type": "reentry", "trajectory": 4, "guidance": {"final": "true"}, **options}
    scenario = parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario
    assert isinstance(scenario, GuidedReentry)
    return scenario._flight


def test_maxima_of_deceleration_that_may_change_places_are_noticed() -> None:
    """Trajectory 4 has 3.05 g and, 20 min later, 2.10 g: sigmas of their difference of 0.94 and of 0.96 g."""
    flight = _flight()
    flight = replace(flight, peaks=flight.peaks[:2])
    first, second = flight.peaks
    apart, by_source = first.size - second.size, first.partials - second.partials
    assert apart == pytest.approx(0.9526 * 9.80665, abs=1e-3)
    one = np.outer(by_source, by_source) / (by_source @ by_source) ** 2  # of which the sigma of the difference is one
    assert [*rival_maxima(flight, (0.99 * apart) ** 2 * one)] == []
    (remark,) = rival_maxima(flight, (1.01 * apart) ** 2 * one)
    assert "two maxima, at 1.3 and 20.9 min from reentry, that differ by 0.95 g with a sigma of 0.96 g" in remark


@pytest.mark.parametrize(
    ("altitude", "sigma", "told"), [(67.53, 50.0, False), (67.53, 150.0, True), (29.5, 150.0, False)]
)
def test_an_end_that_grazes_its_altitude_is_noticed(altitude: float, sigma: float, told: bool) -> None:
    """The first dip of trajectory 4 has its bottom at 67.424 km, a hundred metres below the final altitude."""
    flight = _flight(final_altitude=f"{altitude} km")
    joint = flight.phases[-1].solution(flight.final_time)
    by_source = joint[8:].reshape(8, -1)[0]
    covariance = np.outer(by_source, by_source) * (sigma / (by_source @ by_source)) ** 2
    remarks = [*doubtful_end(flight, covariance)]
    assert bool(remarks) == told
    if told:
        assert "grazes the final altitude" in remarks[0]
        below = float(remarks[0].split("sink by ")[1].split(" m")[0])
        assert below == pytest.approx(1e3 * altitude - 67_424.3, rel=0.2)  # the lift changes on the way down


def test_drawn_flights_have_the_moments_of_the_campaign() -> None:
    """Also where errors are correlated, one is twice another, and some have none; 4.4 standard errors of the mean."""
    mean, covariance = np.arange(4.0), np.array([[4.0, 8.0, 1.0, 0.0], [8.0, 16.0, 2.0, 0.0], [1, 2, 9, 0], [0] * 4])
    errors = draw_flights(mean, covariance).errors - mean
    np.testing.assert_allclose(errors[:, 1], 2.0 * errors[:, 0], atol=1e-6)
    assert not errors[:, 3].any()
    sampled, variances = errors.T @ errors / len(errors), np.diag(covariance)
    error = np.sqrt((np.outer(variances, variances) + covariance**2) / len(errors))
    assert np.all(np.abs(sampled - covariance) <= 4.4 * error + 1e-12)


def test_remarks_are_shown_by_run_and_lincov_and_kept(tmp_path: Path) -> None:
    """In the terminal, on both pages, in both files; `mcnav report` writes them from the manifest."""
    campaign, folder = _at_the_limit(), tmp_path / "run"
    remarks = _remarks(campaign)
    assert len(remarks) == 3
    (tmp_path / "limited.toml").write_text(campaign.to_toml(), encoding="utf-8")
    shown = [
        invoke("lincov", "limited.toml", "--out", "lincov", cwd=tmp_path).stdout,
        invoke("run", "limited.toml", "--out", "run", cwd=tmp_path).stdout,
        invoke("show", "run", cwd=tmp_path).stdout,
        (tmp_path / "lincov" / "lincov.html").read_text(encoding="utf-8"),
        (folder / "report.html").read_text(encoding="utf-8"),
    ]
    (folder / "summary.json").unlink()
    (folder / "report.html").unlink()
    invoke("report", "run", cwd=tmp_path)
    shown.append((folder / "report.html").read_text(encoding="utf-8"))
    for text in shown:
        assert all(f"Warning: {remark}." in " ".join(text.split()) for remark in remarks)
    for path in (tmp_path / "lincov" / "lincov.json", folder / "summary.json"):
        assert json.loads(path.read_text(encoding="utf-8"))["remarks"] == [*remarks]


def test_a_skip_without_range_control_has_no_linear_model(tmp_path: Path) -> None:
    """The report's law on trajectory 4: `lincov` and `run` say so, in words and without a NaN."""
    campaign = _without_law()
    words = "rrors are beyond the range of linear analysis from 20.6 min on"
    (tmp_path / "skip.toml").write_text(campaign.to_toml(), encoding="utf-8")
    told = invoke("lincov", "skip.toml", "--out", "lincov", cwd=tmp_path)
    assert told.stdout.startswith(f"E{words}: true range exceeds 637.8 km")
    assert told.stdout.count("beyond linear range") == len(campaign.scenario.outputs)
    folder = tmp_path / "run"
    run_campaign(campaign, folder, "ensemble", 1, report=False)
    shown = invoke("show", folder, cwd=tmp_path)
    assert f"No: e{words} (true range)." in shown.stdout
    assert "within the tolerance" not in shown.stdout
    for text in (told.stdout, shown.stdout):
        assert "nan" not in text.lower().split()
    json.loads((folder / "summary.json").read_text(), parse_constant=lambda name: pytest.fail(f"{name} in a summary"))
