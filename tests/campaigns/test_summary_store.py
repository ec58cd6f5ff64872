"""Runs that keep a summary in place of samples: the same answers, the same bits, and nothing that grows."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest

from mcnav.analysis.comparison import Criterion, Model, compare
from mcnav.analysis.convergence import convergence
from mcnav.analysis.failed_samples import failure_bias
from mcnav.analysis.summed import compare_sums, normalization_of
from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError, RunFolderError
from mcnav.lincov.block_sums import column_count
from mcnav.lincov.sample_reduction import reduce_samples
from mcnav.store import summaries as store
from mcnav.store.manifest import find_fault
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import summary_of
from mcnav.workflow.run import run_campaign
from tests.conftest import campaign, content

SAMPLES, KEPT, CHUNK = 60_000, 10_000, 1 << 14


@pytest.fixture(autouse=True)
def _small() -> Any:
    """Chunks and kept samples small enough for several of them."""
    with (
        patch.object(store, "CHUNK", CHUNK),
        patch("mcnav.execution.chunks.KEPT", KEPT),
        patch("mcnav.workflow.run.KEPT", KEPT),
    ):
        yield


def _digests(folder: Path) -> dict[str, str]:
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in sorted((folder / "samples").iterdir())}


def _run(folder: Path, jobs: int = 2, engine: str = "ensemble", **entries: Any) -> dict[str, Any]:
    described = campaign(4, **{"samples": SAMPLES, "store": "summary"} | entries)
    return run_campaign(described, folder, engine, jobs).summary


def test_the_same_answers_as_from_samples(tmp_path: Path) -> None:
    """Every estimate to rounding; standard errors, from larger blocks, within five of their own: 1 / sqrt(2 blocks)."""
    summed = _run(tmp_path / "summed")
    whole = run_campaign(campaign(4, samples=SAMPLES), tmp_path / "whole", "ensemble", 2).summary
    for key in (
        "mean_sample", "covariance_sample", "covariance_paired", "sigma_ratio", "sigma_ratio_paired", "nees_mean",
        "nees_mean_paired", "principal_ratios", "skewness", "excess_kurtosis", "correlation_difference", "contained",
    ):  # fmt: skip
        if key == "contained":
            assert [entry["share"] for entry in summed[key]] == [entry["share"] for entry in whole[key]]
            continue
        values = [np.array(each[key], dtype=float) for each in (summed, whole)]
        scale = np.nanmax(np.abs(values[1]))
        np.testing.assert_allclose(values[0], values[1], rtol=1e-7, atol=1e-9 * scale, err_msg=key)
    blocks = SAMPLES / normalization_of(_model(), SAMPLES, 1).block
    for key in ("bias_standard_error", "nees_standard_error", "nees_paired_standard_error", "skewness_standard_error"):
        ratio = np.array(summed[key]) / np.array(whole[key])
        assert np.all(np.abs(ratio - 1.0) < 5.0 / np.sqrt(2.0 * blocks)), key
    assert summed["verdict"] == whole["verdict"]
    sampled = [np.array(each["causes"]["terms"]["sampled_sigmas"]) for each in (summed, whole)]
    np.testing.assert_allclose(*sampled, rtol=1e-6)
    assert (summed["store"], summed["kept"]) == ("summary", KEPT)


def test_rows_of_the_first_samples_are_kept_and_no_others(tmp_path: Path) -> None:
    _run(tmp_path / "summed")
    rows = pd.read_parquet(tmp_path / "summed" / "samples")
    assert np.array_equal(rows["index"], np.arange(KEPT))
    assert "of the first 10,000" in (tmp_path / "summed" / "report.html").read_text()


def test_bits_do_not_depend_on_jobs_or_on_breaks(tmp_path: Path) -> None:
    """A chunk that is lost or damaged is flown again, and the sums come out the same."""
    first, second = _run(tmp_path / "one", 1), _run(tmp_path / "two", 2)
    assert first == second
    digests = _digests(tmp_path / "one")
    assert digests == _digests(tmp_path / "two")
    assert len(digests) == 4
    parts = sorted((tmp_path / "two" / "samples").iterdir())
    parts[1].unlink()
    damaged = bytearray(parts[2].read_bytes())
    damaged[len(damaged) // 2] ^= 1
    parts[2].write_bytes(damaged)
    flown = run_campaign(campaign(4, samples=SAMPLES, store="summary"), tmp_path / "two", "ensemble", 2).flown
    assert flown == 2 * CHUNK
    assert _digests(tmp_path / "two") == digests
    assert summary_of(tmp_path / "two")["covariance_paired"] == json.loads(json.dumps(first["covariance_paired"]))


@pytest.mark.parametrize("design", ["antithetic", "latin-hypercube", "sobol"])
def test_blocks_of_a_design_stay_whole(design: str, tmp_path: Path) -> None:
    """Estimates are those of the samples; errors those of the design's own blocks, where these are large."""
    summed = _run(tmp_path / "summed", samples=40_000, design=design)
    whole = run_campaign(campaign(4, samples=40_000, design=design), tmp_path / "whole", "ensemble", 2).summary
    np.testing.assert_allclose(summed["covariance_paired"], whole["covariance_paired"], rtol=1e-7)
    if design != "antithetic":  # the very blocks of the design
        np.testing.assert_allclose(summed["bias_standard_error"], whole["bias_standard_error"], rtol=1e-7)


def test_the_map_streams(tmp_path: Path) -> None:
    summed = _run(tmp_path / "summed", engine="map")
    assert summed["engine"] == "map"
    assert summed["verdict"] == "agrees"


def test_failures_are_counted_by_reason(tmp_path: Path) -> None:
    """Of a sample that fails nothing is in the sums, and its reason is kept."""
    model = _model()
    errors = np.random.default_rng(3).standard_normal((1_000, 2))
    outcomes = errors @ model.partials.T
    outcomes[[5, 700]] = np.nan
    frame = normalization_of(model, 1_000, 1)
    found = reduce_samples(frame, 0, errors, outcomes)
    assert found.blocks[:, 0].sum() == 998
    kept = compare(model, errors, outcomes, np.arange(1_000), Criterion())
    summed = compare_sums(model, frame, found, 1_000, kept, Criterion(), 100, True, True)
    assert (summed.comparison.samples, summed.comparison.failed) == (998, 2)
    np.testing.assert_allclose(summed.comparison.covariance_sample, kept.covariance_sample, rtol=1e-12)
    assert [output.paired.verdict for output in summed.comparison.outputs] == [
        output.paired.verdict for output in kept.outputs
    ]
    first = store.Summary.of(found, 1_000, {5: "failed: a", 700: "failed: a"})
    failing = first + store.Summary.of(found_after(found), 10, {1_003: "failed: b"})
    assert failing.failures == {"failed: a": store.Failure(2, (5, 700)), "failed: b": store.Failure(1, (1_003,))}
    again = store.Summary.from_mark(failing.as_mark())
    assert np.array_equal(again.sums.blocks, failing.sums.blocks)
    assert (again.samples, again.failures) == (failing.samples, failing.failures)


def test_what_failed_samples_hide_is_told_from_sums() -> None:
    model = _model()
    errors = np.random.default_rng(4).standard_normal((1_000, 2))
    outcomes = errors @ model.partials.T
    outcomes[errors[:, 0] > 1.5] = np.nan
    found = reduce_samples(normalization_of(model, 1_000, 1), 0, errors, outcomes)
    kept = compare(model, errors, outcomes, np.arange(1_000), Criterion())
    summed = compare_sums(model, normalization_of(model, 1_000, 1), found, 1_000, kept, Criterion(), 100, True, True)
    known = failure_bias(model, errors, np.isfinite(outcomes).all(axis=1))
    assert known is not None
    assert summed.left_out is not None
    assert summed.left_out.samples == known.samples
    np.testing.assert_allclose(summed.left_out.sigma_ratio, known.sigma_ratio, rtol=1e-10)


def test_reasons_are_bounded() -> None:
    """Those that differ in their numbers are told as one, and whatever is still too much as the rest."""
    found = reduce_samples(normalization_of(_model(), 10_000, 1), 0, np.zeros((10, 2)), np.zeros((10, 2)))
    many = {index: f"failed: fell to {index} km" for index in range(2_000)}
    assert store.Summary.of(found, 2_000, many).failures == {
        "failed: fell to … km": store.Failure(2_000, tuple(range(store.FIRST)))
    }
    words = {index: f"failed: {''.join(chr(97 + int(digit)) for digit in str(index))}" for index in range(2_000)}
    known = store.Summary.of(found, 2_000, words).failures
    assert len(known) == store.MOST_REASONS
    assert sum(failure.samples for failure in known.values()) == 2_000


def test_with_equal_blocks_everything_agrees_with_the_samples() -> None:
    """Third powers of the blocks too: the intervals reach as far to either side."""
    model, generator = _model(), np.random.default_rng(5)
    errors = generator.standard_normal((1_000, 2))
    outcomes = errors @ model.partials.T + 0.2 * errors**2
    frame = replace(normalization_of(model, 1_000, 1), block=1)
    found = reduce_samples(frame, 0, errors, outcomes)
    kept = compare(model, errors, outcomes, np.arange(1_000), Criterion())
    summed = compare_sums(model, frame, found, 1_000, kept, Criterion(), 100, True, True)
    assert kept.joint is not None
    assert kept.ellipsoid is not None
    assert summed.comparison.joint is not None
    assert summed.comparison.ellipsoid is not None
    pairs = [(summed.comparison.ellipsoid.nees_paired, kept.ellipsoid.nees_paired)]
    for one, other in zip(summed.comparison.outputs, kept.outputs, strict=True):
        pairs += [(one.paired_variance, other.paired_variance), (one.bias, other.bias)]
        assert one.paired.interval == pytest.approx(other.paired.interval, rel=1e-10)
        assert one.plain.interval == pytest.approx(other.plain.interval, rel=1e-10)
        assert one.samples_to_see == other.samples_to_see
    for one, other in zip(summed.comparison.joint.correlations, kept.joint.correlations, strict=True):
        pairs.append((one.difference, other.difference))
    for one, other in pairs:
        assert abs(other.asymmetry) > 1e-3
        assert one.interval(0.99) == pytest.approx(other.interval(0.99), rel=1e-9)
    assert summed.comparison.joint.nees_expected == kept.joint.nees_expected
    running = convergence(model, errors, outcomes, np.arange(1_000), kept, 100)
    assert running is not None
    assert summed.convergence is not None
    np.testing.assert_allclose(summed.convergence.paired.low, running.paired.low, rtol=1e-9)
    np.testing.assert_allclose(summed.convergence.paired.high, running.paired.high, rtol=1e-9)


def found_after(found: Any) -> Any:
    """A stretch that begins in the last block of another."""
    return replace(found, first=found.first + len(found.blocks) - 1, blocks=found.blocks[:1])


def _model() -> Model:
    return Model(np.array([[1.0, 0.5], [0.0, 2.0]]), np.zeros(2), np.zeros(2), np.eye(2))


def test_a_block_has_as_many_sums_as_are_counted() -> None:
    found = reduce_samples(normalization_of(_model(), 10_000, 1), 0, np.zeros((10, 2)), np.zeros((10, 2)))
    assert found.blocks.shape == (3, column_count(2))


def test_more_samples_than_can_be_stored_need_a_summary() -> None:
    with pytest.raises(CampaignError, match=r"samples: got 2000000000; more than 1000000000 need store = 'summary'"):
        parse_campaign(content(samples=2_000_000_000), "test.toml", "test")
    assert parse_campaign(content(samples=2_000_000_000, store="summary"), "test.toml", "test").store == "summary"


def test_a_stopping_rule_needs_samples() -> None:
    until = {"until": "sigma_ratio 1 %", "at_most": 100_000}
    with pytest.raises(CampaignError, match=r"samples.until: needs store = 'samples'"):
        parse_campaign(content(samples=until, store="summary"), "test.toml", "test")


def test_a_summary_is_extended_while_its_blocks_stay(tmp_path: Path) -> None:
    """From 60,000 to 65,000 samples blocks have 16 samples; at 70,000 they would have 32."""
    _run(tmp_path / "one")
    described = campaign(4, samples=65_000, store="summary")
    longer = run_campaign(described, tmp_path / "one", "ensemble", 2)
    assert longer.flown == 65_000 - 3 * CHUNK
    assert longer.summary == run_campaign(described, tmp_path / "two", "ensemble", 2).summary
    with pytest.raises(RunFolderError, match=r"one of 70,000 is kept in larger blocks"):
        _run(tmp_path / "one", samples=70_000)


def test_samples_are_as_before_beside_a_summary(tmp_path: Path) -> None:
    """Stored samples do not know of another store; a folder of theirs is not taken for a summary's."""
    assert "store" not in campaign(4).resolved
    run_campaign(campaign(4, samples=1_000), tmp_path, "ensemble", 1)
    with pytest.raises(RunFolderError, match=r"store was absent, is summary"):
        _run(tmp_path, samples=1_000)


def test_a_manifest_of_as_many_samples_as_a_campaign_may_have(tmp_path: Path) -> None:
    """10^12, all that `store = "summary"` allows, can be read again."""
    _run(tmp_path / "run")
    manifest = RunFolder(tmp_path / "run").manifest()
    assert manifest is not None
    last = manifest["parts"][-1] | {"end": 10**12}
    assert find_fault(manifest | {"samples": 10**12, "parts": [*manifest["parts"][:-1], last]}) is None
    assert find_fault(manifest | {"samples": 10**12}) is not None
