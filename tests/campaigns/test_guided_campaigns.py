"""Campaigns of the guided reentry: their answers, and what is said where no linear model holds."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import Campaign, parse_campaign
from mcnav.contract.samples import Batch
from mcnav.studies.lincov import linear_covariance
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


def test_a_skip_without_range_control_has_no_linear_model(tmp_path: Path) -> None:
    """The report's law on trajectory 4: `lincov` and `run` say so, in words and without a NaN."""
    campaign = _without_law()
    words = "rrors are beyond the range of linear analysis from 20.6 min on"
    (tmp_path / "skip.toml").write_text(campaign.to_toml(), encoding="utf-8")
    told = invoke("lincov", "skip.toml", "--out", "lincov", cwd=tmp_path)
    assert told.stdout.startswith(f"E{words}: true range exceeds 637.8 km")
    assert told.stdout.count("beyond linear range") == len(campaign.scenario.outputs)
    folder = tmp_path / "run"
    run_campaign(campaign, folder, "ensemble", 1)
    shown = invoke("show", folder, cwd=tmp_path)
    assert f"No: e{words} (true range)." in shown.stdout
    assert "within the tolerance" not in shown.stdout
    for text in (told.stdout, shown.stdout):
        assert "nan" not in text.lower().split()
    json.loads((folder / "summary.json").read_text(), parse_constant=lambda name: pytest.fail(f"{name} in a summary"))
