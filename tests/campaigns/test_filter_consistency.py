"""Campaigns of a scenario with a filter, from samples to verdict: the scalar filter of `tests.scalar_filter`."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mcnav.analysis.summary import Summary
from mcnav.caches.recent import Recent
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.errors import RunFolderError
from mcnav.report.statements import details, verdicts
from mcnav.runner.draws import DrawPlan
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.store.filters import MARK
from mcnav.store.run_folder import RunFolder
from mcnav.store.totals import Totals, read_totals
from mcnav.workflow.analyse import samples_of
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_run import read_run
from tests.scalar_filter import SCHEMA, FilterThatBelieves, campaign, steady_variance


def run(folder: Path, samples: int = 300, jobs: int = 1, report: bool = True, **changes: Any) -> dict[str, Any]:
    return dict(run_campaign(campaign(samples, **changes), folder, None, jobs, report=report).summary)


def filter_sums(folder: RunFolder) -> FilterSums | None:
    manifest = folder.finished_manifest()
    assert manifest.model.filter is not None
    pivot = np.zeros((len(manifest.model.filter.times), len(manifest.model.outputs)))
    return read_totals(pivot, SCHEMA, folder.chunk_folder, manifest.chunks).filter_sums


def test_sums_are_the_same_bits_however_a_run_is_divided(tmp_path: Path) -> None:
    """Two jobs, an extension, and a summary in place of samples: all of chunks of 100 samples."""
    found = []
    for name, sizes, changes in (
        ("whole", (700,), {}),
        ("jobs", (700,), {"jobs": 2}),
        ("parts", (300, 700), {}),
        ("summary", (700,), {"store": "summary"}),
    ):
        for samples in sizes:
            run(tmp_path / name, samples, **changes)
        folder = RunFolder(tmp_path / name)
        sums = filter_sums(folder)
        assert sums is not None
        assert sums.samples == 700
        found.append(sums.to_numbers())
    for other in found[1:3]:
        np.testing.assert_array_equal(other, found[0])
    np.testing.assert_allclose(found[3], found[0], rtol=1e-13)  # in another order: 700 roundings
    for name in ("epochs.parquet", "filter.parquet"):
        whole = (tmp_path / "whole" / name).read_bytes()
        assert all((tmp_path / other / name).read_bytes() == whole for other in ("jobs", "parts"))


def test_samples_and_tables_have_what_the_filters_say(tmp_path: Path) -> None:
    """One sample fails; nothing of it is counted."""
    folder = tmp_path / "run"
    run(folder, failing=(7,))
    samples, own = samples_of(folder), np.sqrt(steady_variance(0.25))
    known = samples["status"] == "ok"
    assert known.sum() == 299
    assert samples.loc[~known, ["filter position [m]", "nees"]].isna().all(axis=None)
    np.testing.assert_allclose(samples.loc[known, "filter position [m]"], own, rtol=1e-15)
    errors = samples.loc[known, "output position [m]"]
    np.testing.assert_allclose(samples.loc[known, "nees"], (errors / own) ** 2, rtol=1e-13)
    table = pq.read_table(folder / "filter.parquet").to_pandas()
    assert table["nees position"].iloc[-1] == pytest.approx(np.mean((errors / own) ** 2), rel=1e-12)
    assert table["nees standard error position"].iloc[-1] == pytest.approx(
        np.std((errors / own) ** 2, ddof=1) / np.sqrt(299), rel=1e-9
    )
    assert table["accepted fix"].tolist() == [0.0] + [5.0] * 20
    assert table["nis spare"].isna().all()
    epochs = pq.read_table(folder / "epochs.parquet").to_pandas()
    for column in ("filter sigma position [m]", "linear filter sigma position [m]"):
        np.testing.assert_allclose(epochs[column], own, rtol=1e-12)  # a sum of 299 equal terms


def test_folders_without_a_filter_are_as_before(tmp_path: Path) -> None:
    """Manifest and summary of a scenario without a filter have no word of one, and its samples no columns."""
    summary = run(tmp_path / "run", 200, filtered=False)
    assert "filter" not in json.loads((tmp_path / "run" / "manifest.json").read_text())["model"]
    assert not [key for key in summary if "filter" in key]
    assert not (tmp_path / "run" / "filter.parquet").exists()
    assert "nees" not in samples_of(tmp_path / "run")


def test_means_of_a_record_by_place(tmp_path: Path) -> None:
    """Means and standard errors of what `FilterMeans` returns are numpy's."""
    run(tmp_path / "run", 200)
    folder = RunFolder(tmp_path / "run")
    sums = filter_sums(folder)
    assert sums is not None
    means = FilterMeans.of(SCHEMA, sums)
    np.testing.assert_allclose(np.sqrt(means.variances.value[:-1, 0]), np.sqrt(steady_variance(0.25)), rtol=1e-12)
    np.testing.assert_allclose(means.covariances[:, 0, 0], means.variances.value[:-1, 0], rtol=0.0)
    (name, size, fix), (spare, _, other) = means.sensors()
    assert (name, size, spare) == ("fix", 1, "spare")
    assert fix["accepted"].value[-1] == 100.0
    assert fix["lags"].value[-1] == 99.0
    assert other["accepted"].value[-1] == 0.0


def test_verdict_on_the_mismatched_scalar_filter(tmp_path: Path) -> None:
    """True variance 2.0427120591, the filter's 0.8827822185; NEES 2.313948, NIS 1.372104; the walk is neglected."""
    summary = run(tmp_path / "run", 1_000)
    assert list(summary)[-7:] == [
        "covariance_filter", "sigma_filter", "nees_filter_mean", "nees_filter_dimension", "nis_mean", "filter_verdict",
        "filter",
    ]  # fmt: skip
    found = summary["filter"]
    assert (found["verdict"], found["group"], found["output"], found["begin"], found["end"]) == (
        "optimistic", "position", "position", 0.0, 100.0,
    )  # fmt: skip
    position, fix = found["groups"]["position"], found["sensors"]["fix"]
    # epochs are one campaign's: one interval at 95 % would miss once in twenty; these hold over 42 statements
    low, high = found["factor_interval"]
    assert low < np.sqrt(2.313948) < high
    assert fix["nis_interval"][0] < 1.372104 < fix["nis_interval"][1]
    assert summary["nees_filter_mean"] == pytest.approx(2.313948, abs=5.0 * 2.313948 * np.sqrt(2.0 / 1_000))
    assert summary["nis_mean"] == {"fix": fix["nis_mean"], "spare": None}
    assert summary["covariance_filter"][0][0] == pytest.approx(0.8827822185, abs=1e-10)
    assert summary["sigma_filter"][0] ** 2 == pytest.approx(0.8827822185, abs=1e-10)
    assert summary["sigma_linear"][0] ** 2 == pytest.approx(2.0427120591, abs=1e-10)
    assert position["ratio_linear"] == pytest.approx(np.sqrt(2.313948), abs=1e-6)
    assert found["outputs"]["position"]["ratio_linear"] == pytest.approx(np.sqrt(2.313948), abs=1e-6)
    assert found["neglected"][0]["name"] == "walk"
    assert sum(each["share"] for each in found["neglected"]) == pytest.approx(1.0, rel=1e-12)
    missing = sum(each["true"] - each["believed"] for each in found["neglected"])
    assert missing == pytest.approx(2.0427120591 - 0.8827822185, abs=1e-9)
    assert fix["nis_beyond"]
    assert fix["correlation_beyond"]
    assert summary["filter_verdict"].startswith("The filter is optimistic by a factor of 1.")
    assert summary["verdict"] == "agrees"  # linear analysis is right about a filter that is not


def test_verdict_on_the_matched_scalar_filter(tmp_path: Path) -> None:
    """Of 6,000 samples the farthest of 21 ratios is within ±5 % with its interval of ±1.8 %."""
    summary = run(tmp_path / "run", 6_000, walk=1.0, report=False)
    assert summary["filter"]["verdict"] == "consistent"
    assert not summary["filter"]["sensors"]["fix"]["nis_beyond"]
    assert not summary["filter"]["sensors"]["fix"]["correlation_beyond"]
    assert summary["filter"]["neglected"] == []


def test_runs_with_noise_are_compared_by_their_paired_sigmas(tmp_path: Path) -> None:
    """Noise makes nearly all of the dispersion; the system is linear, so that the change is known without error."""
    summaries = [run(tmp_path / name, 200, walk=walk) for name, walk in (("a", 0.25), ("b", 1.0))]
    change = compare_runs([tmp_path / "a", tmp_path / "b"]).rows[0].change
    assert change is not None
    assert change.before == pytest.approx(summaries[0]["sigma_paired"][0], rel=1e-12)
    assert change.after == pytest.approx(summaries[1]["sigma_paired"][0], rel=1e-12)
    assert change.interval == pytest.approx((change.ratio, change.ratio), rel=1e-9)


def test_degenerate_campaigns_have_words_and_no_nan(tmp_path: Path) -> None:
    """Too few samples; every sample fails; a summary in place of samples has the same verdict."""
    few = run(tmp_path / "few", 15)
    assert few["filter"]["verdict"] == "undecided"
    assert few["filter_verdict"] == "Undecided: 15 samples are too few for an interval; expected 20 or more."
    lost = run(tmp_path / "lost", 30, failing=range(30))
    assert lost["filter_verdict"] == "Undecided: every sample failed."
    assert lost["sigma_filter"] is None
    for name in ("few", "lost"):
        assert "NaN" not in (tmp_path / name / "summary.json").read_text()
    whole, reduced = run(tmp_path / "whole"), run(tmp_path / "reduced", store="summary")
    assert whole["filter"]["factor"] == pytest.approx(reduced["filter"]["factor"], rel=1e-12)
    assert whole["filter_verdict"] == reduced["filter_verdict"]


def test_agreement_is_not_claimed_where_too_many_samples_failed(tmp_path: Path) -> None:
    """Thirty of 600: neither verdict has a confidence, and both sentences say why."""
    summary = run(tmp_path / "run", 600, walk=1.0, failing=range(30), report=False)
    assert (summary["verdict"], summary["verdicts"]) == ("undecided", ["agrees"])
    said = f"{verdicts.headline(Summary.of(summary), ('linear',))} {details.explanation(Summary.of(summary))}"
    assert said.startswith("570 samples do not decide whether every linear sigma is right. 30 of 600 samples failed: ")
    assert "agreement is claimed up to 0.1 %, because their errors are not known." in said
    assert "Every sigma of the other 570 samples is within ±5 % of the linear sigma." in said
    assert "confidence" not in said
    assert summary["filter_verdict"] == "Undecided: too many samples failed."
    few = run(tmp_path / "few", 600, walk=1.0, report=False)
    assert "is within ±5 % of the linear sigma (95 % confidence)" in details.explanation(Summary.of(few))


def test_histories_of_first_samples_come_from_the_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are the same bits as if simulated again, of stored samples and of a summary; the first 2,000 at most."""
    asked = campaign(2_300, failing=(7,))
    plan = DrawPlan(asked.errors, asked.design, asked.seed, 2_000)
    engine = asked.scenario.engine("exact", plan.probes())
    assert isinstance(engine, FilterThatBelieves)
    again = engine.simulate(plan.batch(0, 2_000)).history
    assert again is not None
    simulated: list[int] = []
    simulate = FilterThatBelieves.simulate

    def counted(self: FilterThatBelieves, batch: Batch, noise: bool = True) -> SimulationResult:
        simulated.extend(batch.index.tolist() if noise else [])  # corrections are of constant errors alone
        return simulate(self, batch, noise)

    monkeypatch.setattr(FilterThatBelieves, "simulate", counted)
    for store in ("samples", "summary"):
        simulated.clear()
        run(tmp_path / store, 2_300, failing=(7,), store=store, report=False)
        assert sorted(simulated) == list(range(2_300))  # each once
        found = RunFolder(tmp_path / store).histories(5_000)
        assert found is not None
        _, _, errors = found
        np.testing.assert_array_equal(errors["position [m]"], again[:, :, 0])


def test_damaged_sums_are_refused_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums of another length, and what is no number of samples."""
    run(tmp_path / "run", 60)
    folder = RunFolder(tmp_path / "run")
    sums = filter_sums(folder)
    assert sums is not None
    for numbers in (sums.to_numbers()[:-7], np.append(sums.to_numbers()[:-1], np.inf), np.zeros(0)):
        text = base64.b64encode(zlib.compress(numbers.tobytes())).decode()
        described = pa.schema([]).with_metadata({MARK: text})
        monkeypatch.setattr("mcnav.store.totals._KNOWN", Recent[Totals](most=1))
        monkeypatch.setattr("mcnav.store.totals.pq.read_metadata", lambda path, described=described: described)
        with pytest.raises(RunFolderError, match="sums of filters are damaged"):
            read_run(folder)
        monkeypatch.undo()
