"""Runs end to end: formats, the same bits whatever the workers, resuming, refusing."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mcnav
from mcnav.compiled import kept
from mcnav.compiled.target import target
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.errors import RunFolderBusy, RunFolderError
from mcnav.execution.progress import SILENT, Phase
from mcnav.linear.corrections import Corrections
from mcnav.runner.runner import run_chunks
from mcnav.store.provenance import commit
from mcnav.store.run_folder import RunFolder
from mcnav.systems.reentry import scenario as reentry
from mcnav.systems.steady.scenario import Cruise
from mcnav.workflow import run as workflow_run
from mcnav.workflow.analyse import report_run
from mcnav.workflow.corrections import compute_corrections
from mcnav.workflow.prepare import PreparedSystem
from mcnav.workflow.replay import replay
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_summary import summary_of
from tests.commands import invoke
from tests.conftest import ROOT, TWO_ERRORS, RecordedProgress, campaign, content, tn_errors
from tests.faults.scenarios import chunk_job
from tests.printed import count_scripts
from tests.runs import simulate

SOURCES = [(source.name, source.unit) for source in reentry.SOURCES]
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
    assert names == expected | {"development.parquet", "epochs.parquet", "histories.parquet"}
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
    assert np.array_equal(
        samples[columns[2 : 2 + len(SOURCES)]].to_numpy(), run.errors.draw("random", 1772, 9_000, 0, 9_000)
    )


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


@pytest.mark.parametrize(("engine", "samples", "chunks"), [("ensemble", 20_000, 3), ("reference", 40, 2)])
def test_one_and_two_jobs_give_the_same_bits(engine: str, samples: int, chunks: int, tmp_path: Path) -> None:
    errors = TWO_ERRORS if engine == "reference" else tn_errors()
    for jobs in (1, 2):
        simulate(campaign(1, samples=samples, errors=errors), tmp_path / str(jobs), engine, jobs)
    assert _digests(tmp_path / "1") == _digests(tmp_path / "2")
    assert len(_digests(tmp_path / "1")) == chunks


def test_both_engines_carry_the_same_draws(tmp_path: Path) -> None:
    """Errors are the same bits, outputs agree to 1e-5 of their dispersion."""
    frames = {}
    for engine in ("ensemble", "reference"):
        simulate(campaign(2, samples=40, errors=TWO_ERRORS), tmp_path / engine, engine, 1)
        frames[engine] = pd.read_parquet(tmp_path / engine / "samples")
    errors, outputs = ({k: f.filter(like=kind).to_numpy() for k, f in frames.items()} for kind in ("error", "output"))
    assert np.array_equal(errors["ensemble"], errors["reference"])
    difference = np.abs(outputs["ensemble"] - outputs["reference"]).max(axis=0)
    assert np.all(difference < 1e-5 * outputs["reference"].std(axis=0))


def test_the_resolved_campaign_runs_again(finished: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    folder, _ = finished
    simulate(read_campaign(folder / "campaign.toml"), tmp_path / "again", "ensemble", 1)
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
    run_campaign(run, folder, "ensemble", 2, report=False)
    before = _digests(folder)
    parts = sorted((folder / "samples").iterdir())
    parts[0].unlink()
    content = bytearray(parts[1].read_bytes())
    content[len(content) // 2] ^= 1
    parts[1].write_bytes(content)
    with pytest.raises(RunFolderError, match=r"part-00000\.parquet: cannot be read"):
        report_run(folder)
    progress = RecordedProgress()
    done = run_campaign(run, folder, "ensemble", 1, progress=progress)
    assert _digests(folder) == before
    assert progress.samples == 20_000
    assert progress.stored == 20_000 - 2 * 8_192
    assert progress.phases == [
        (Phase.PREPARING, None, ""),
        (Phase.SIMULATING, 20_000, ""),
        (Phase.ANALYSING, None, ""),
        (Phase.REPORTING, None, ""),
    ]
    assert done.simulated == 2 * 8_192


def test_another_campaign_does_not_touch_earlier_results(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    simulate(campaign(1), folder, "ensemble", 1)
    before = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(RunFolderError, match=r"holds the results of another run \(seed was 1772, is 5\)"):
        simulate(campaign(1, seed=5), folder, "ensemble", 1)
    with pytest.raises(RunFolderError, match="engine was ensemble, is reference"):
        simulate(campaign(1), folder, "reference", 1)
    (folder / "manifest.json").rename(tmp_path / "kept")
    with pytest.raises(RunFolderError, match=r"holds samples of another run, and the manifest\.json .* is missing"):
        simulate(campaign(1, seed=5), folder, "ensemble", 1)
    (tmp_path / "kept").rename(folder / "manifest.json")
    assert {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    summary = simulate(campaign(1, seed=5), folder, "ensemble", 1, fresh=True).summary
    assert summary["seed"] == 5


def test_samples_with_other_last_digits_are_not_mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of cruise that was stored before its kernel changed is neither extended nor taken for the same run."""
    described = {"scenario": {"type": "cruise", "speed": "250 m/s", "duration": "1 h"}, "errors": {"bias_x": "10 ug"}}
    run = parse_campaign(described | {"samples": 100, "seed": 1}, "test.toml", "test")
    now = Cruise.revision
    monkeypatch.delattr(Cruise, "revision")
    simulate(run, tmp_path / "run", "ensemble", 1)
    monkeypatch.undo()
    with pytest.raises(RunFolderError, match=rf"\(revision was absent, is {now}\)"):
        simulate(run, tmp_path / "run", "ensemble", 1)
    found = replay(tmp_path / "run", 7)
    assert found.notes == (
        f"the run is of revision 1 of its scenario; samples of revision {now} have other last digits",
    )
    (tmp_path / "run" / "manifest.json").unlink()
    with pytest.raises(RunFolderError, match="holds samples of another run"):
        simulate(run, tmp_path / "run", "ensemble", 1)
    assert simulate(run, tmp_path / "run", "ensemble", 1, fresh=True).simulated == 100


def test_corrections_are_kept_for_the_same_run_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other samples, another seed and other errors have other corrections; tolerance and folder do not count."""
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)
    computed = list[str]()
    models = {}

    def models_of(name: str, *given: Any, **entries: Any) -> None:
        def counted(system: PreparedSystem) -> Corrections:
            computed.append(name)
            return compute_corrections(system)

        monkeypatch.setattr(workflow_run, "compute_corrections", counted)
        simulate(campaign(4, *given, **entries), tmp_path / name, "ensemble", 1)
        models[name] = json.loads((tmp_path / name / "manifest.json").read_text())["model"]

    models_of("first", samples=100)
    models_of("again", samples=100)
    assert models["again"] == models["first"]
    models_of("more", samples=101)
    models_of("seed", samples=100, seed=7)
    models_of("errors", 1.001, samples=100)
    assert computed == ["first", "more", "seed", "errors"]


def test_a_run_that_continues_on_another_processor_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a run with an installation's machine code that is continued where code is compiled for another processor.

    The manifest names both from then on, and so does every continuation, on whichever of the two.
    """

    def run() -> tuple[tuple[str, ...], str]:
        notices = run_campaign(campaign(4, samples=120), tmp_path / "run", "ensemble", 1, report=False).notices
        return notices, json.loads((tmp_path / "run" / "manifest.json").read_text())["processor"]

    for _ in range(2):
        assert run() == ((), target())
    monkeypatch.setattr("mcnav.runner.identity.target", lambda: "another")
    for earlier in (target(), f"{target()}, another"):
        (notice,), processors = run()
        assert f"has samples by code for {earlier}, and continues with code for another" in notice
        assert processors == f"{target()}, another"


@pytest.mark.parametrize(
    ("design", "engine", "before", "after"),
    [
        ("random", "ensemble", 9_000, 17_000),
        ("antithetic", "reference", 65, 98),
        ("latin-hypercube", "ensemble", 500, 511),
        ("sobol", "ensemble", 9_000, 16_383),
    ],
)
def test_a_run_is_extended(design: str, engine: str, before: int, after: int, tmp_path: Path) -> None:
    """As if all had been flown at once, and what was there stays as it was; a step back is refused."""
    folder, at_once = tmp_path / "extended", tmp_path / "at_once"
    errors = TWO_ERRORS if engine == "reference" else tn_errors()
    short, long = (campaign(1, design=design, samples=samples, errors=errors) for samples in (before, after))
    simulate(short, folder, engine, 2)
    first = mcnav.samples_of(folder)
    extended = simulate(long, folder, engine, 2)
    whole = simulate(long, at_once, engine, 2)
    assert _digests(folder) == _digests(at_once)
    assert extended.summary == whole.summary
    assert after - before <= extended.simulated < after or before < 8_192
    pd.testing.assert_frame_equal(mcnav.samples_of(folder)[:before], first, check_exact=True)
    with pytest.raises(RunFolderError, match=f"holds a run of {after:,} samples, and {before:,} are fewer; ask"):
        simulate(short, folder, engine, 2)
    assert _digests(folder) == _digests(at_once)


@pytest.mark.parametrize(
    ("design", "before", "after", "message"),
    [
        ("sobol", 500, 512, "which design sobol would change if there were 512; up to 511 they stay as they are"),
        ("random", 40, 512, "one of fewer than 64 is too short to be extended"),
    ],
)
def test_what_cannot_be_extended_is_told(design: str, before: int, after: int, message: str, tmp_path: Path) -> None:
    simulate(campaign(4, design=design, samples=before), tmp_path / "run", "ensemble", 1)
    kept = _digests(tmp_path / "run")
    with pytest.raises(RunFolderError, match=message):
        simulate(campaign(4, design=design, samples=after), tmp_path / "run", "ensemble", 1)
    assert _digests(tmp_path / "run") == kept


def test_a_folder_of_someone_elses_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(RunFolderError, match=r"holds 'thesis.tex', which is not of a run"):
        simulate(campaign(1), tmp_path, "ensemble", 1, fresh=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_folder_in_use_is_respected(tmp_path: Path) -> None:
    with RunFolder(tmp_path).lock(), pytest.raises(RunFolderBusy, match="another mcnav is writing here"):
        simulate(campaign(1), tmp_path, "ensemble", 1)


def test_a_part_that_is_not_of_the_run_is_named(tmp_path: Path) -> None:
    run_campaign(campaign(1), tmp_path / "run", "ensemble", 1, report=False)
    samples = tmp_path / "run" / "samples"
    (samples / "part-00009.parquet").write_bytes((samples / "part-00000.parquet").read_bytes())
    with pytest.raises(RunFolderError, match=r"part-00009\.parquet: is not of this run; remove it"):
        report_run(tmp_path / "run")


@pytest.mark.parametrize("name", ["manifest.json", "summary.json", "history.parquet", "campaign.toml"])
@pytest.mark.parametrize("damage", ["missing", "cut", "flipped"])
def test_damage_is_noticed_and_named(
    name: str, damage: str, finished: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """And mended by running the campaign again; a manifest that was damaged is named in a notice."""
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
            report_run(folder)
    elif name == "history.parquet" or (name, damage) in {("campaign.toml", "missing"), ("manifest.json", "missing")}:
        with pytest.raises(RunFolderError, match=r"run the campaign|holds no run"):
            report_run(folder)
    mended = run_campaign(run, folder, "ensemble", 1, report=False)
    assert mended.simulated == 0
    assert len(mended.notices) == (name == "manifest.json" and damage != "missing")
    assert summary_of(folder) == finished[1]


def test_nothing_to_compare_is_said_so(tmp_path: Path) -> None:
    """Errors that are all fixed, or absent: no verdict, no empty figures, no warnings."""
    for errors in ({}, {"altitude": {"distribution": "fixed", "value": "1 km"}}):
        summary = run_campaign(campaign(1, errors=errors), tmp_path / str(len(errors)), "ensemble", 1).summary
        assert summary["verdict"] == "undecided"
        page = (tmp_path / str(len(errors)) / "report.html").read_text()
        assert "Nothing to compare: no error source varies." in page
        assert page.count("<svg") == 4  # the plots of the flight


@pytest.mark.parametrize("design", ["random", "antithetic", "latin-hypercube", "sobol"])
def test_a_handful_of_samples_decides_nothing(design: str, tmp_path: Path) -> None:
    summary = simulate(campaign(4, samples=8, design=design), tmp_path / "run", "ensemble", 1).summary
    assert summary["verdict"] == "undecided"
    assert summary["verdict_matrix"] == "undecided"
    assert summary["sigma_ratio_paired_interval"][0] == [0.0, None]


def test_heavy_tails_have_no_intervals(tmp_path: Path) -> None:
    """None can be promised for them; long ones are remarked upon, and normal ones are not."""
    for degrees, remark, verdict in (
        (5, "No interval and no verdict is given", "undecided"),
        (10, "intervals are approximate", "agrees"),
    ):
        tails = {"distribution": "student-t", "sigma": "5 km", "degrees_of_freedom": degrees}
        folder = tmp_path / str(degrees)
        summary = run_campaign(campaign(4, errors={"altitude": tails}), folder, "ensemble", 1).summary
        page = (folder / "report.html").read_text()
        assert remark in page
        assert summary["verdict"] == verdict
        assert (summary["sigma_ratio_paired_interval"][0] == [0.0, None]) == (degrees == 5)
        assert summary["tests"]["covariance"] is None
        assert summary["tests"]["skewness"] is None or degrees == 10
        assert not re.search(r"\b(inf|nan)\b", page)


def _until(written: str, at_most: int) -> Campaign:
    return campaign(4, samples={"until": written, "confidence": 0.9, "at_most": at_most})


def test_flown_until_precise_enough(tmp_path: Path) -> None:
    """At a size laid down beforehand, with the samples of a longer campaign, and intervals for every look."""
    folder = tmp_path / "run"
    run = _until("sigma_ratio 2 %", 100_000)
    done = run_campaign(run, folder, "ensemble", 2)
    summary = done.summary
    assert summary["samples"] == done.simulated == 16_384
    rule = summary["stopping"]
    assert (rule["looks"], rule["reached"], rule["at_most"]) == (5, True, 100_000)
    assert rule["found"] <= 0.02
    assert summary["confidence_each"] == pytest.approx(1.0 - 0.05 / 5 / 5)
    drawn = pd.read_parquet(folder / "samples").filter(like="error").to_numpy()
    assert np.array_equal(drawn, campaign(4).errors.draw("random", 1772, 10**6, 0, 16_384))
    assert (
        "Sampled until every plain sigma ratio was known to ±2 % with 90 % confidence"
        in (folder / "report.html").read_text()
    )
    again = run_campaign(read_campaign(folder / "campaign.toml"), folder, "ensemble", 1)
    assert (again.simulated, again.summary) == (0, summary)
    assert report_run(folder) == summary


def test_a_run_until_that_was_broken_off_goes_on(tmp_path: Path) -> None:
    """Parts beyond the look at hand are there already; the result is that of a run without a break."""
    folder, run = tmp_path / "run", _until("sigma_ratio 2 %", 100_000)
    whole = simulate(run, folder, "ensemble", 2).summary
    (folder / "samples" / "part-00000.parquet").unlink()
    (folder / "manifest.json").unlink()
    done = simulate(run, folder, "ensemble", 2)
    assert (done.simulated, done.summary) == (8_192, whole)


def test_flown_to_the_most_that_is_allowed(tmp_path: Path) -> None:
    summary = run_campaign(_until("sigma_ratio 0.1 %", 500), tmp_path / "run", "ensemble", 1).summary
    assert (summary["samples"], summary["stopping"]["reached"]) == (500, False)
    assert "Stopped at the maximum of" in (tmp_path / "run" / "report.html").read_text()


def test_a_table_goes_with_its_run(tmp_path: Path) -> None:
    """Its values are kept in the folder, whose campaign runs again; other values are another run."""
    values = tmp_path / "values.csv"
    pd.DataFrame({"x": np.random.default_rng(1).standard_normal(500)}).to_csv(values)
    described = content(samples=200)
    described["errors"]["range"] = {"distribution": "table", "file": "values.csv", "column": "x", "unit": "km"}
    run = parse_campaign(described, str(tmp_path / "test.toml"), "test")
    folder = tmp_path / "run"
    first = simulate(run, folder, "ensemble", 1).summary
    assert set(pd.read_parquet(folder / "samples")["error range [m]"]) <= set(1000.0 * pd.read_csv(values)["x"])
    again = simulate(read_campaign(folder / "campaign.toml"), folder, "ensemble", 1)
    assert (again.simulated, again.summary) == (0, first)
    pd.DataFrame({"x": [0.0, 1.0]}).to_csv(values)
    changed = parse_campaign(described, str(tmp_path / "test.toml"), "test")
    with pytest.raises(RunFolderError, match=r"errors\.range\.sha256 was"):
        simulate(changed, folder, "ensemble", 1)
    simulate(changed, folder, "ensemble", 1, fresh=True)


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="cannot be written to"):
        simulate(campaign(1), tmp_path / "file", "ensemble", 1)


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
    assert "samples failed and are excluded" in (tmp_path / "run" / "report.html").read_text()


def test_samples_beyond_the_kernel_are_handed_over(tmp_path: Path) -> None:
    """They come out as the reference engine flies them, and no range angle is wrapped: some go more than half round."""
    run = campaign(7, 300.0, samples=32)
    parts = {
        engine: run_chunks(chunk_job(run, tmp_path / engine, engine), 1, SILENT)[0]
        for engine in ("ensemble", "reference")
    }
    handed_over = sum(part.fallback_count for part in parts["ensemble"])
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
    assert "<script>alert" not in page
    assert count_scripts(page) == 1  # our own
    assert "&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt; $\\frac{$ 🚀 עברית" in page


def test_the_commit_is_that_of_the_programs_own_checkout(tmp_path: Path) -> None:
    """As a branch, detached, packed, in a linked work tree; none outside of a checkout."""
    package, git = tmp_path / "project" / "mcnav", tmp_path / "project" / ".git"
    package.mkdir(parents=True)
    assert commit(package) is None
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "packed-refs").write_text(f"# pack-refs\n{'a' * 40} refs/heads/main\n")
    assert commit(package) == "a" * 40
    (git / "refs" / "heads" / "main").write_text("b" * 40 + "\n")
    assert commit(package) == "b" * 40
    linked = git / "worktrees" / "other"
    linked.mkdir(parents=True)
    (linked / "HEAD").write_text("ref: refs/heads/main\n")
    (linked / "commondir").write_text("../..\n")
    other = tmp_path / "other" / "mcnav"
    other.mkdir(parents=True)
    (other.parent / ".git").write_text(f"gitdir: {linked}\n")
    assert commit(other) == "b" * 40
    (git / "HEAD").write_text("c" * 40 + "\n")
    assert commit(package) == "c" * 40


def test_a_figure_by_itself(tmp_path: Path) -> None:
    """It is written as asked, or one line says what is wrong."""

    def figure(*arguments: str, out: str = "figure.pdf") -> subprocess.CompletedProcess[str]:
        return invoke("export", "run", "--figure", *arguments, "--out", out, cwd=tmp_path)

    done = invoke("run", ROOT / "campaigns" / "14_polar.toml", "--samples", 300, "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert figure("scatter", "--width", "8").returncode == 0
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")
    assert figure("scatter", "--width", "8", out="figure.doc").returncode == 2
    for arguments, told in (
        (["none"], "--figure: the report has no figure 'none'; expected one of ratios, "),
        (["histogram"], "--figure: the report has no figure 'histogram'; did you mean 'histograms'?"),
        (["scatter", "--size", "88"], "--size: got '88'; expected WIDTHx"),
        (["ratios", "--panel", "none"], "ratios: the figure has no panel 'none'"),
        (["histograms", "--size", "20x20mm"], "histograms: panels and text do not fit"),
    ):
        wrong = figure(*arguments)
        assert (wrong.returncode, wrong.stderr.startswith(f"error: {told}")) == (2, True), wrong.stderr
    smaller = ("--font-scale", "0.8")
    one = figure("histograms", "--panel", "x", "--columns", "1", "--size", "88x60mm", *smaller, out="x.svg")
    assert (one.returncode, one.stderr) == (0, "")
    crowded = figure("matrices", "--size", "50x50mm", *smaller, out="x.svg")
    assert crowded.returncode == 0
    assert "labels overlap" in crowded.stderr
