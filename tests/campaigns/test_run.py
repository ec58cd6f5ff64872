"""Runs end to end: formats, the same bits whatever the workers, resuming, refusing."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mcnav
from mcnav.campaign.file import read_campaign
from mcnav.campaign.folder import RunFolder
from mcnav.campaign.problems import RunFolderBusy, RunFolderError
from mcnav.study import report_run, run_campaign, summary_of
from tests.conftest import campaign

SOURCES = [
    ("altitude", "m"), ("range", "m"), ("altitude_rate", "m/s"), ("range_rate", "m/s"), ("misalignment", "rad"),
    ("gyro_drift", "rad/s"), ("bias_x", "m/s^2"), ("bias_z", "m/s^2"), ("scale_factor_x", "1"), ("scale_factor_z", "1"),
]  # fmt: skip
OUTPUTS = SOURCES[:4]


def _digests(folder: Path) -> dict[str, str]:
    parts = sorted((folder / "samples").iterdir())
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A run of two chunks."""
    folder = tmp_path_factory.mktemp("runs") / "finished"
    return folder, run_campaign(campaign(4, samples=9_000), folder, "ensemble", 2).summary


def test_run_folder(finished: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = finished
    names = {entry.name for entry in folder.iterdir()} - {".lock"}
    expected = {"campaign.toml", "manifest.json", "samples", "history.parquet", "summary.json", "report.html"}
    assert names == expected
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["complete"]
    assert {part["file"]: part["sha256"] for part in manifest["parts"]} == _digests(folder)
    assert manifest["identity"]["versions"].keys() >= {"mcnav", "python", "numpy", "scipy", "numba"}


def test_samples(finished: tuple[Path, dict[str, Any]]) -> None:
    """Index, status, every error and output with its unit; the errors are those that the campaign draws."""
    folder, _ = finished
    samples = pd.read_parquet(folder / "samples")
    pd.testing.assert_frame_equal(samples, mcnav.samples_of(folder), check_exact=True)
    columns = ["index", "status"]
    columns += [f"error {name} [{unit}]" for name, unit in SOURCES]
    columns += [f"output {name} [{unit}]" for name, unit in OUTPUTS]
    assert samples.columns.tolist() == columns
    assert np.array_equal(samples["index"], np.arange(9_000))
    assert (samples["status"] == "ok").all()
    run = campaign(4, samples=9_000)
    assert np.array_equal(samples[columns[2:12]].to_numpy(), run.errors.draw("random", 1772, 9_000, 0, 9_000))


def test_summary(finished: tuple[Path, dict[str, Any]]) -> None:
    folder, returned = finished
    summary = json.loads((folder / "summary.json").read_text())
    samples = pd.read_parquet(folder / "samples")
    flown = samples.filter(like="output").to_numpy()
    assert summary["campaign"] == "test"
    assert (summary["samples"], summary["failed"], summary["engine"], summary["seed"]) == (9_000, 0, "ensemble", 1772)
    assert [(entry["name"], entry["unit"]) for entry in summary["sources"]] == SOURCES
    assert [(entry["name"], entry["unit"]) for entry in summary["outputs"]] == OUTPUTS
    partials, start = np.array(summary["partials"]), np.array(summary["start_covariance"])
    linear, paired = np.array(summary["covariance_linear"]), np.array(summary["covariance_paired"])
    np.testing.assert_allclose(linear, partials @ start @ partials.T, rtol=1e-9)
    np.testing.assert_allclose(summary["covariance_sample"], np.cov(flown.T), rtol=1e-9)
    predicted = samples.filter(like="error").to_numpy() @ partials.T
    np.testing.assert_allclose(paired, np.cov(flown.T) - np.cov(predicted.T) + linear, rtol=1e-6)
    np.testing.assert_allclose(summary["mean_sample"], flown.mean(axis=0), rtol=1e-9)
    ratio = np.array(summary["sigma_sample"]) / np.array(summary["sigma_linear"])
    np.testing.assert_allclose(summary["sigma_ratio"], ratio, rtol=1e-12)
    for (low, high), value in zip(summary["sigma_ratio_interval"], ratio, strict=True):
        assert low < value < high
    nees = np.einsum("ni,ij,nj->n", flown, np.linalg.inv(linear), flown)
    assert summary["nees_mean"] == pytest.approx(nees.mean(), rel=1e-6)
    assert summary["verdict"] in {"agrees", "differs", "undecided"}
    assert summary_of(folder) == summary
    assert summary["nees_mean"] == returned["nees_mean"]


@pytest.mark.parametrize(("engine", "samples"), [("ensemble", 20_000), ("reference", 70)])
def test_one_and_two_jobs_give_the_same_bits(engine: str, samples: int, tmp_path: Path) -> None:
    for jobs in (1, 2):
        run_campaign(campaign(3, samples=samples), tmp_path / str(jobs), engine, jobs)
    assert _digests(tmp_path / "1") == _digests(tmp_path / "2")
    assert len(_digests(tmp_path / "1")) == 3


def test_both_engines_carry_the_same_draws(tmp_path: Path) -> None:
    """Errors are the same bits, outputs agree to 1e-5 of their dispersion."""
    frames = {}
    for engine in ("ensemble", "reference"):
        run_campaign(campaign(2, samples=40), tmp_path / engine, engine, 1)
        frames[engine] = pd.read_parquet(tmp_path / engine / "samples")
    errors, outputs = ({k: f.filter(like=kind).to_numpy() for k, f in frames.items()} for kind in ("error", "output"))
    assert np.array_equal(errors["ensemble"], errors["reference"])
    difference = np.abs(outputs["ensemble"] - outputs["reference"]).max(axis=0)
    assert np.all(difference < 1e-5 * outputs["reference"].std(axis=0))


def test_the_resolved_campaign_runs_again(finished: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    folder, _ = finished
    run_campaign(read_campaign(folder / "campaign.toml"), tmp_path / "again", "ensemble", 1)
    assert (tmp_path / "again" / "campaign.toml").read_text() == (folder / "campaign.toml").read_text()
    first, again = (pd.read_parquet(path / "samples") for path in (folder, tmp_path / "again"))
    pd.testing.assert_frame_equal(first, again, check_exact=True)


def test_report_from_stored_samples(finished: tuple[Path, dict[str, Any]]) -> None:
    """The same bytes, from what is stored alone."""
    folder, _ = finished
    before = {name: (folder / name).read_bytes() for name in ("summary.json", "report.html")}
    report_run(folder)
    assert {name: (folder / name).read_bytes() for name in before} == before


def test_a_missing_or_damaged_part_is_flown_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = campaign(4, samples=20_000)
    run_campaign(run, folder, "ensemble", 2)
    before = _digests(folder)
    parts = sorted((folder / "samples").iterdir())
    parts[0].unlink()
    content = bytearray(parts[1].read_bytes())
    content[len(content) // 2] ^= 1
    parts[1].write_bytes(content)
    with pytest.raises(RunFolderError, match=r"part-00000\.parquet: cannot be read"):
        report_run(folder)
    told: list[int] = []
    done = run_campaign(run, folder, "ensemble", 1, progress=told.append)
    assert _digests(folder) == before
    assert sum(told) == 20_000
    assert done.flown == 2 * 8_192


def test_another_campaign_does_not_touch_earlier_results(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run_campaign(campaign(1), folder, "ensemble", 1)
    before = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(RunFolderError, match=r"holds the results of another run \(seed was 1772, is 5\)"):
        run_campaign(campaign(1, seed=5), folder, "ensemble", 1)
    with pytest.raises(RunFolderError, match="engine was ensemble, is reference"):
        run_campaign(campaign(1), folder, "reference", 1)
    assert {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    summary = run_campaign(campaign(1, seed=5), folder, "ensemble", 1, fresh=True).summary
    assert summary["seed"] == 5


def test_a_folder_of_someone_elses_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(RunFolderError, match=r"holds 'thesis.tex', which is not of a run"):
        run_campaign(campaign(1), tmp_path, "ensemble", 1, fresh=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_folder_in_use_is_respected(tmp_path: Path) -> None:
    with RunFolder(tmp_path).held(), pytest.raises(RunFolderBusy, match="another mcnav is writing here"):
        run_campaign(campaign(1), tmp_path, "ensemble", 1)


def test_a_part_that_is_not_of_the_run_is_named(tmp_path: Path) -> None:
    run_campaign(campaign(1), tmp_path / "run", "ensemble", 1)
    samples = tmp_path / "run" / "samples"
    (samples / "part-00009.parquet").write_bytes((samples / "part-00000.parquet").read_bytes())
    with pytest.raises(RunFolderError, match=r"part-00009\.parquet: is not of this run; remove it"):
        report_run(tmp_path / "run")


@pytest.mark.parametrize("name", ["manifest.json", "summary.json", "history.parquet", "campaign.toml"])
@pytest.mark.parametrize("damage", ["missing", "cut", "flipped"])
def test_damage_is_noticed_and_named(
    name: str, damage: str, finished: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """And mended by running the campaign again, except for the manifest, which takes ``--fresh``."""
    folder = tmp_path / "run"
    shutil.copytree(finished[0], folder)
    run = campaign(4, samples=9_000)
    path = folder / name
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 4]) + whole[middle + 1 :]
    path.write_bytes({"missing": b"", "cut": whole[:middle], "flipped": flipped}[damage])
    if damage == "missing":
        path.unlink()
    if name == "manifest.json" and damage != "missing":
        with pytest.raises(RunFolderError, match=r"manifest\.json: is damaged"):
            run_campaign(run, folder, "ensemble", 1)
    elif name == "history.parquet" or (name, damage) in {("campaign.toml", "missing"), ("manifest.json", "missing")}:
        with pytest.raises(RunFolderError, match=r"run the campaign|holds no run"):
            report_run(folder)
    run_campaign(run, folder, "ensemble", 1, fresh=name == "manifest.json")
    assert summary_of(folder) == finished[1]


def test_nothing_to_compare_is_said_so(tmp_path: Path) -> None:
    """Errors that are all fixed, or absent: no verdict, no empty figures, no warnings."""
    for errors in ({}, {"altitude": {"distribution": "fixed", "value": "1 km"}}):
        summary = run_campaign(campaign(1, errors=errors), tmp_path / str(len(errors)), "ensemble", 1).summary
        assert summary["verdict"] == "undecided"
        page = (tmp_path / str(len(errors)) / "report.html").read_text()
        assert "Nothing to compare: no error has a dispersion." in page
        assert page.count("<svg") == 1


@pytest.mark.parametrize("design", ["random", "antithetic", "latin-hypercube", "sobol"])
def test_a_handful_of_samples_decides_nothing(design: str, tmp_path: Path) -> None:
    summary = run_campaign(campaign(4, samples=8, design=design), tmp_path / "run", "ensemble", 1).summary
    assert summary["verdict"] == "undecided"
    assert summary["verdict_matrix"] == "undecided"
    assert summary["sigma_ratio_paired_interval"][0] == [0.0, None]


def test_heavy_tails_are_remarked_upon(tmp_path: Path) -> None:
    tails = {"distribution": "student-t", "sigma": "5 km", "degrees_of_freedom": 5}
    run_campaign(campaign(4, errors={"altitude": tails}), tmp_path / "run", "ensemble", 1)
    assert "The intervals are only nominal" in (tmp_path / "run" / "report.html").read_text()


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="cannot be written to"):
        run_campaign(campaign(1), tmp_path / "file", "ensemble", 1)


def test_failed_samples_are_rows_with_their_reason(tmp_path: Path) -> None:
    """Initial altitude errors that put the navigator near the earth's centre, or below it."""
    run = campaign(4, samples=64, errors={"altitude": {"distribution": "uniform", "half_width": "40000 km"}})
    summary = run_campaign(run, tmp_path / "run", "ensemble", 1).summary
    samples = pd.read_parquet(tmp_path / "run" / "samples")
    failed = samples["status"] != "ok"
    outputs = samples.filter(like="output")
    assert 0 < failed.sum() < 64
    assert samples["status"][failed].str.startswith("failed: the indicated").all()
    assert outputs[failed].isna().all(axis=None)
    assert outputs[~failed].notna().all(axis=None)
    assert summary["failed"] == failed.sum()
    assert sum(summary["failures"].values()) == failed.sum()
    np.testing.assert_allclose(summary["covariance_sample"], np.cov(outputs[~failed].to_numpy().T), rtol=1e-9)
    assert "samples failed and are left out" in (tmp_path / "run" / "report.html").read_text()


def test_samples_beyond_the_kernel_are_handed_over(tmp_path: Path) -> None:
    """They come out as the reference engine flies them, and no range angle is wrapped: some go more than half round."""
    run = campaign(7, 300.0, samples=32)
    for engine in ("ensemble", "reference"):
        run_campaign(run, tmp_path / engine, engine, 1)
    manifest = json.loads((tmp_path / "ensemble" / "manifest.json").read_text())
    handed_over = sum(part["handed_over"] for part in manifest["parts"])
    assert handed_over > 0
    one, other = (pd.read_parquet(tmp_path / engine / "samples") for engine in ("ensemble", "reference"))
    assert np.array_equal(one["status"], other["status"])
    same = (one.filter(like="output") == other.filter(like="output")).all(axis=1)
    assert same.sum() >= handed_over - (one["status"] != "ok").sum()
    assert np.abs(other["output range [m]"]).max() > np.pi * 6378140.0


def test_a_status_that_is_html_stays_text(tmp_path: Path) -> None:
    """Reasons and names go into the page as text, whatever they hold."""
    name = "</script><script>alert(1)</script> $\\frac{$ 🚀 עברית"
    run_campaign(campaign(1, name=name, samples=20), tmp_path / "run", "ensemble", 1)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "<script" not in page
    assert "&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt; $\\frac{$ 🚀 עברית" in page
