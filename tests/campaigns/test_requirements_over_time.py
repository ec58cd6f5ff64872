"""Requirements over time from campaign file to report, on an unaided flight of five minutes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

import mcnav
from mcnav.config.read import parse_campaign
from mcnav.errors import RunFolderError
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.figures.captions import words_on
from mcnav.report.figures.requirements import requirements_over_time
from mcnav.report.results.model import RunAnalysis
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.run import run_campaign
from tests.campaigns.test_ins import described

HORIZONTAL = ["position_north", "position_east"]
SPATIAL = [*HORIZONTAL, "position_down"]


def test_requirements_at_epochs_of_a_flight(tmp_path: Path) -> None:
    """Errors grow, so that the largest are at the end; those at the start are as stated: 5 m along each axis."""
    accept = {
        "quantile": [{"output": "position_down", "probability": 0.9, "below": "500 m", "after": "0 s"}],
        "cep": [{"outputs": HORIZONTAL, "below": "6.5 m", "at": "0 s"}, {"outputs": HORIZONTAL, "below": "500 m"}],
        "r95": [{"outputs": HORIZONTAL, "below": "1 m", "after": "0 s"}],
        "sep": [{"outputs": SPATIAL, "below": "500 m", "during": ["0 s", "60 s"]}],
    }
    samples = 400
    campaign = parse_campaign(described(samples, accept=accept), "test.toml", "test")
    summary = run_campaign(campaign, tmp_path / "run", None, 1).summary
    by_kind = {(entry["kind"], entry.get("when", "")): entry for entry in summary["requirements"]}
    epochs = pq.read_table(tmp_path / "run" / "epochs.parquet").to_pandas()
    worst = epochs["linear sigma position_down [m]"].max()
    quantile = by_kind["quantile", "from 0 s on"]
    assert quantile["linear"] == pytest.approx(stats.norm.ppf(0.95) * worst, rel=1e-9)
    assert quantile["samples"] == samples
    start = by_kind["cep", "at 0 s"]
    assert start["linear"] == pytest.approx(5.0 * np.sqrt(2.0 * np.log(2.0)), rel=1e-9)
    assert (start["finding"], start["time"]) == ("met", 0.0)
    last = by_kind["cep", ""]
    assert not {"when", "epochs", "time", "samples"} & last.keys()
    assert by_kind["r95", "from 0 s on"]["finding"] == "not met"
    assert by_kind["sep", "from 0 s to 60 s"]["linear"] >= 5.0 * stats.chi(3).ppf(0.5) * (1.0 - 1e-9)
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "radius of 95 % of the errors of position north and position east below 1 m, from 0 s on" in report
    assert "largest at 0 min, of 400 samples" in report
    assert "spherical error probable of position north, position east and position down" in report
    _figure_has_what_was_judged(mcnav.open_run(tmp_path / "run").content)


def _figure_has_what_was_judged(content: RunAnalysis) -> None:
    """The largest of the curve where a requirement holds is what was found of it; the limit is drawn there alone."""
    figure = requirements_over_time(content)
    assert figure is not None
    asked = [entry for entry in content.summary.requirements if entry.epochs]
    assert len(figure.panels) == len(asked) == 4
    assert requirements_over_time(replace(content, histories=None)) is None
    for entry, row in zip(content.summary.requirements, requirement_rows(content.summary), strict=True):
        drawn = figure.data[figure.data["requirement"] == row.words]
        assert len(drawn) == (0 if not entry.epochs else len(content.histories.times if content.histories else ()))
        if entry.epochs:
            holds = drawn[np.isfinite(drawn["limit"])]
            assert len(holds) == len(entry.epochs)
            assert set(holds["limit"]) == {entry.limits[0]}
            assert holds["Monte Carlo"].max() == pytest.approx(entry.estimate, rel=1e-12)
            assert holds["linear"].max() == pytest.approx(entry.linear, rel=1e-9)
            assert holds["upper bound"].max() == pytest.approx(entry.interval[1], rel=1e-12)
            assert (drawn["lower bound"] <= drawn["Monte Carlo"]).all()
    told = words_on("requirements_over_time", content)
    (r95,) = (entry for entry in asked if entry.kind == "r95")  # 1 m, and errors of 5 m from the start
    assert told.startswith("R95 of position north and position east is ")
    over = 100.0 * ((r95.estimate or 0.0) / 1.0 - 1.0)
    assert f" {over:.3g} % above its limit, the least margin." in told


@pytest.mark.parametrize("engine", ["ensemble", "reference"])
@pytest.mark.parametrize("aided", [False, True], ids=["free", "aided"])
def test_the_time_of_a_requirement_becomes_an_epoch(engine: str, aided: bool, tmp_path: Path) -> None:
    """The sigma there is that of `mcnav lincov` at this time.

    So do the begin of a span, and an instant just before its end.
    """
    at = 151.5
    required = {"output": "position_north", "probability": 0.95, "below": "1 km"}
    asked = [required | {"at": f"{at} s"}, required | {"during": ["31.25 s", "32.25 s"]}]
    entries = described(40 if engine == "ensemble" else 8, accept={"quantile": asked})
    if aided:
        entries |= {
            "aiding": [{"type": "gnss", "interval": "20 s", "position": "3 m"}],
            "filter": {"estimates": ["position", "velocity", "attitude"]},
        }
    campaign = parse_campaign(entries, "test.toml", "test")
    run = run_campaign(campaign, tmp_path / "run", engine, 1, report=False)
    epochs = pq.read_table(tmp_path / "run" / "epochs.parquet").to_pandas()
    assert len(epochs) == 64
    assert {31.25, 32.24} <= set((60.0 * epochs["time [min]"]).round(9))
    row = epochs.iloc[(epochs["time [min]"] - at / 60.0).abs().argmin()]
    assert row["time [min]"] == pytest.approx(at / 60.0, rel=1e-12)
    answer = linear_covariance(campaign, np.array([at]))
    assert answer.asked is not None
    assert row["linear sigma position_north [m]"] == pytest.approx(answer.asked.sigma[0, 0], rel=1e-9)
    found, over = run.summary["requirements"]
    assert [60.0 * time for time in over["times"]] == pytest.approx([31.25, 32.24]) if "times" in over else over
    assert found["time"] == pytest.approx(at / 60.0)
    assert found["linear"] == pytest.approx(stats.norm.ppf(0.975) * answer.asked.sigma[0, 0], rel=1e-9)


def test_samples_without_the_epoch_of_a_new_requirement_are_not_mixed(tmp_path: Path) -> None:
    accept = {"quantile": [{"output": "position_north", "probability": 0.95, "below": "1 km"}]}
    run_campaign(
        parse_campaign(described(40, accept=accept), "test.toml", "test"), tmp_path / "run", None, 1, report=False
    )
    accept["quantile"][0]["at"] = "151.5 s"
    with pytest.raises(RunFolderError, match=r"further_epochs was absent, is \[151.5\]"):
        run_campaign(
            parse_campaign(described(40, accept=accept), "test.toml", "test"), tmp_path / "run", None, 1, report=False
        )


OTHERS = {
    "reentry": ({"type": "reentry", "trajectory": 4}, {"altitude": "1 km"}, "altitude", -30.5),
    "guided": ({"type": "reentry", "trajectory": 4, "guidance": {}}, {"altitude": "10 m"}, "altitude", -30.5),
    "cruise": ({"type": "cruise", "speed": "250 m/s", "duration": "1 h"}, {"bias_x": "50 ug"}, "range", 1_000.5),
}
"""Systems without noise, their errors, an output, and a time that is none of the usual epochs, s."""


@pytest.mark.parametrize("kind", OTHERS)
def test_systems_without_noise_have_requirements_over_time(kind: str, tmp_path: Path) -> None:
    """Counted at the time itself: with one error the quantile is 1.645 sigma of the linear system there."""
    scenario, errors, output, time = OTHERS[kind]
    entry = {"output": output, "probability": 0.9, "below": "1000 km"}
    accept = {"quantile": [entry | {"at": f"{time} s"}, entry | {"after": f"{time} s"}]}
    content = {"samples": 400, "seed": 1, "scenario": scenario, "errors": errors, "accept": accept}
    campaign = parse_campaign(content, "test.toml", "test")
    place = [each.name for each in campaign.scenario.outputs].index(output)
    partials = campaign.scenario.linear(np.array([time])).partials[0, place]
    sigma = float(np.sqrt(partials @ campaign.errors.covariance @ partials))
    summary = run_campaign(campaign, tmp_path / "run", None, 1, report=False).summary
    at, later = summary["requirements"]
    assert at["linear"] == pytest.approx(stats.norm.ppf(0.95) * sigma, rel=1e-4)  # histories' by differences
    assert at["estimate"] == pytest.approx(at["linear"], rel=0.15)  # 400 samples: 4 % a sigma
    assert (at["finding"], at["samples"]) == ("met", 400)
    assert later["linear"] >= at["linear"] * (1.0 - 1e-9)
    judged = linear_covariance(campaign).requirements
    assert judged[0].value == pytest.approx(stats.norm.ppf(0.95) * sigma, rel=1e-9)
    assert [each.met for each in judged] == [True, True]
