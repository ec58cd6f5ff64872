"""Campaigns of type ins from file to report: noise in every part of a run, and the same bits however it is divided."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError
from mcnav.frames.runs import open_run
from mcnav.report.statements.linearity import WITHOUT_NOISE
from mcnav.studies.linearity import linearity_study, write_linearity
from mcnav.workflow.analyse import report_run, samples_of
from mcnav.workflow.replay import as_stored, replay
from tests.runs import simulate

OUTPUTS = ["position_north", "position_east", "position_down", "velocity_north", "velocity_east", "velocity_down",
           "tilt_north", "tilt_east", "heading"]  # fmt: skip


def described(samples: int = 300, **changes: Any) -> dict[str, Any]:
    """Five minutes of a straight flight with a turn; the instruments have noise."""
    start = {"latitude": "47 deg", "longitude": "9 deg", "course": "80 deg", "speed": "60 m/s"}
    flown = {"rate": "1 Hz", "start": start, "segments": [{"hold": "60 s"}, {"turn": "40 deg"}, {"straight": "12 km"}]}
    return {
        "samples": samples,
        "seed": 5,
        "scenario": {"type": "ins", "trajectory": flown, **changes.pop("scenario", {})},
        "imu": {
            "grade": "navigation",
            "gyro": {"bias_instability": {"sigma": "0.003 deg/h", "correlation_time": "1 h"}},
        },
        "errors": {"position": "5 m", "velocity": "0.05 m/s", "tilt": "0.05 mrad", "heading": "0.5 mrad"},
        **changes,
    }


def run(folder: Path, jobs: int = 1, fresh: bool = False, engine: str | None = None, **changes: Any) -> dict[str, Any]:
    campaign = parse_campaign(described(**changes), "test.toml", "test")
    return dict(simulate(campaign, folder, engine, jobs, fresh=fresh).summary)


def test_linear_and_monte_carlo_agree_with_noise(tmp_path: Path) -> None:
    """Errors of navigation grade are small in five minutes: paired intervals are ten times narrower than plain ones."""
    summary = run(tmp_path / "run", samples=3_000)
    assert [output["name"] for output in summary["outputs"]] == OUTPUTS
    assert set(summary["verdicts"]) == {"agrees"}
    assert summary["nees_mean"] == pytest.approx(9.0, abs=5.0 * np.sqrt(18.0 / 3_000))  # five standard errors
    for plain, paired in zip(summary["sigma_ratio_interval"], summary["sigma_ratio_paired_interval"], strict=True):
        assert paired[1] - paired[0] < 0.1 * (plain[1] - plain[0])
    noise = sum(np.array(process["covariance"]) for process in summary["processes"])
    known = np.array(summary["partials"])
    covariance = known @ np.array(summary["start_covariance"]) @ known.T + noise
    np.testing.assert_allclose(covariance, summary["covariance_linear"], rtol=1e-9, atol=1e-12 * covariance.max())
    shares = np.array(summary["budget"]["shares"])
    assert shares.shape == (9, 39 + len(summary["processes"]))
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-9)
    epochs = pq.read_table(tmp_path / "run" / "epochs.parquet").to_pandas()
    assert len(epochs) == 61
    ratio = epochs["sigma position_east [m]"] / epochs["linear sigma position_east [m]"]
    assert np.abs(ratio - 1.0).max() < 5.0 / np.sqrt(2.0 * 3_000)  # five standard errors
    report_run(tmp_path / "run")
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "gyro angle random walk" in report
    assert "gyro_angle_random_walk_x" in open_run(tmp_path / "run").budget.index


def test_the_same_bits_however_a_run_is_divided(tmp_path: Path) -> None:
    """Two jobs, an extension, and a run that goes on after its last chunk is lost."""
    count = 5_000
    run(tmp_path / "whole", samples=count)
    run(tmp_path / "jobs", jobs=2, samples=count)
    run(tmp_path / "parts", samples=2_500)
    run(tmp_path / "parts", samples=count)
    for chunk in sorted((tmp_path / "jobs" / "samples").glob("*.parquet"))[-1:]:
        chunk.unlink()
    run(tmp_path / "jobs", samples=count)
    whole = samples_of(tmp_path / "whole")
    assert next(name for name in whole.columns if name.startswith("linear ")) == "linear position_north [m]"
    for other in ("jobs", "parts"):
        assert samples_of(tmp_path / other).equals(whole)


def test_a_summary_has_the_same_estimates(tmp_path: Path) -> None:
    stored, summed = run(tmp_path / "a", samples=2_000), run(tmp_path / "b", samples=2_000, store="summary")
    for key in ("sigma_linear", "sigma_sample", "sigma_paired", "nees_mean", "nees_mean_paired"):
        np.testing.assert_allclose(summed[key], stored[key], rtol=1e-9)


def test_a_sample_is_replayed_with_its_noise(tmp_path: Path) -> None:
    run(tmp_path / "run")
    found = replay(tmp_path / "run", 123)
    assert [outcome.label for outcome in found.outcomes] == ["stored", "again, ensemble"]
    assert as_stored(found)
    stored = samples_of(tmp_path / "run").iloc[123]
    np.testing.assert_array_equal(found.linear, [stored[name] for name in stored.index if name.startswith("linear ")])
    assert len(next(iter(found.history.columns.values()))) == 61


def test_the_reference_engine_has_the_same_linear_covariance(tmp_path: Path) -> None:
    """Its paired sigmas are the linear ones to their second order, whose bound follows from the sigmas.

    A variance differs by the mean of (y - z) (y + z), so that a sigma does by the share d of y - z in it. A wrong
    attitude turns a vector of errors, and changes it by its angle times its length; gravity's change of second order,
    3 x / R of an error, is 3e-5 here.
    """
    reference = run(tmp_path / "reference", samples=200, engine="reference")
    ensemble = run(tmp_path / "ensemble", samples=200)
    assert reference["sigma_linear"] == ensemble["sigma_linear"]
    linear = np.array(reference["sigma_linear"])
    turn = np.linalg.norm(linear[6:])
    lengths = np.linalg.norm(linear.reshape(3, 3), axis=1).repeat(3)
    ratio = np.array(reference["sigma_paired"]) / linear
    assert np.all(np.abs(ratio - 1.0) < turn * lengths / linear + 3e-5)


def test_without_noise_samples_have_no_linear_columns(tmp_path: Path) -> None:
    """And nets are for constant errors: a design that noise has no place in."""
    summary = run(tmp_path / "run", imu={"gyro": {"bias": "0.01 deg/h"}}, design="sobol", samples=512)
    assert not any(name.startswith("linear ") for name in samples_of(tmp_path / "run").columns)
    assert "processes" not in summary
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text(encoding="utf-8"))
    assert "processes" not in manifest["model"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"design": "sobol"},
            "design: got 'sobol', which cannot draw noise; expected one of random, antithetic, latin",
        ),
        ({"errors": {"gyro_bias_x": "1 deg/h"}}, "errors.gyro_bias_x: is given in [imu] as well; keep one"),
        ({"errors": {"positon": "1 m"}}, "errors.positon: unknown error source"),
        ({"scenario": {"start": "-5 s"}}, "scenario.start: got -5 s; the trajectory has 0 to"),
        (
            {"scenario": {"start": "10 s", "end": "10.5 s"}},
            "scenario.end: got 10.5 s; expected at least 11 s, 1 s after the start",
        ),
        ({"scenario": {"platform": "gimbal"}}, "scenario.platform: got 'gimbal'"),
        ({"scenario": {"trajectory": "nowhere.csv"}}, "scenario.trajectory: nowhere.csv does not exist"),
        ({"imu": {"gyro": {"bias": "1 km"}}}, "imu.gyro.bias: got '1 km', which is a length"),
    ],
)
def test_one_mistake_is_one_line(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(CampaignError) as refused:
        parse_campaign(described(**changes), "test.toml", "test")
    (found,) = refused.value.problems
    assert str(found).startswith(f"test.toml: {line}"), found


def test_an_imu_belongs_to_this_type_alone() -> None:
    scenario = {"type": "cruise", "speed": "250 m/s", "duration": "1 h"}
    with pytest.raises(CampaignError, match="imu: this scenario has no inertial measurement unit; remove this table"):
        parse_campaign({"scenario": scenario, "imu": {}, "errors": {}}, "test.toml", "test")


def test_the_range_of_linearity_is_that_of_constant_errors(tmp_path: Path) -> None:
    """The noise is left out, and the page says so: the ranges are those without noise, to the last bit."""
    noisy, quiet = described(), described()
    quiet["imu"] = {"gyro": {"bias": "0.005 deg/h"}}
    noisy["imu"] = {"gyro": {**quiet["imu"]["gyro"], "angle_random_walk": "0.1 deg/sqrt(h)"}}
    (found, files), (expected, others) = (
        write_linearity(parse_campaign(each, "test.toml", "test"), tmp_path / name, samples=200, largest=4.0)
        for name, each in (("noisy", noisy), ("quiet", quiet))
    )
    assert (found.noise, expected.noise) == ("left out", "")
    np.testing.assert_array_equal(found.alone.multiples, expected.alone.multiples)
    np.testing.assert_array_equal(found.together.ratios, expected.together.ratios)
    pages = [each[-1].read_text(encoding="utf-8") for each in (files, others)]
    assert [WITHOUT_NOISE in page for page in pages] == [True, False]


def test_noise_alone_has_no_range_of_linearity() -> None:
    noise = described(imu={"gyro": {"angle_random_walk": "0.1 deg/sqrt(h)"}}, errors={})
    with pytest.raises(CampaignError, match="scenario: has noise and no constant errors, and the range"):
        linearity_study(parse_campaign(noise, "test.toml", "test"))


def test_the_polynomial_engine_knows_no_noise(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="got 'map'; this scenario has ensemble, reference"):
        run(tmp_path / "run", engine="map")
