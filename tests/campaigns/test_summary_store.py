"""Runs that keep a summary in place of samples: the same answers, the same bits, and nothing that grows."""

from __future__ import annotations

import hashlib
import json
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcnav.analysis.block_moments import ReducedSamples
from mcnav.analysis.comparison import Criterion, compare_reduced, reduce_stored, reduce_summary
from mcnav.analysis.failed_samples import failure_bias
from mcnav.analysis.model import Model
from mcnav.analysis.running_ratios import convergence
from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError, RunFolderError
from mcnav.linear.block_sums import BlockSums, Normalization, column_count
from mcnav.linear.sample_reduction import BlockReduction
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.shape import shape_of_sums
from mcnav.store import summaries as store
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import ManifestError
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import report_run
from mcnav.workflow.stored_summary import summary_of
from tests.conftest import campaign, content
from tests.faults.scenarios import normalization
from tests.runs import simulate

DESIGN = SamplingDesign()
SAMPLES, KEPT, CHUNK = 60_000, 10_000, 1 << 14


@pytest.fixture(autouse=True)
def _small() -> Any:
    """Chunks and kept samples small enough for several of them."""
    with (
        patch.object(store, "CHUNK", CHUNK),
        patch("mcnav.runner.chunks.STORED_ROWS", KEPT),
        patch("mcnav.workflow.run.STORED_ROWS", KEPT),
    ):
        yield


def _digests(folder: Path) -> dict[str, str]:
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in sorted((folder / "samples").iterdir())}


def _run(folder: Path, jobs: int = 2, engine: str = "ensemble", **entries: Any) -> dict[str, Any]:
    described = campaign(4, **{"samples": SAMPLES, "store": "summary"} | entries)
    return simulate(described, folder, engine, jobs).summary


def test_the_same_answers_as_from_samples_and_rows_of_the_first(tmp_path: Path) -> None:
    """Every estimate to rounding; standard errors, from larger blocks, within five of their own: 1 / sqrt(2 blocks)."""
    summed = _run(tmp_path / "summed")
    whole = simulate(campaign(4, samples=SAMPLES), tmp_path / "whole", "ensemble", 2).summary
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
    blocks = SAMPLES / normalization(_model(), SAMPLES, 1).block
    for key in ("bias_standard_error", "nees_standard_error", "nees_paired_standard_error", "skewness_standard_error"):
        ratio = np.array(summed[key]) / np.array(whole[key])
        assert np.all(np.abs(ratio - 1.0) < 5.0 / np.sqrt(2.0 * blocks)), key
    assert summed["verdict"] == whole["verdict"]
    sampled = [np.array(each["causes"]["terms"]["sampled_sigmas"]) for each in (summed, whole)]
    np.testing.assert_allclose(*sampled, rtol=1e-6)
    assert (summed["store"], summed["kept"]) == ("summary", KEPT)
    rows = pd.read_parquet(tmp_path / "summed" / "samples")
    assert np.array_equal(rows["index"], np.arange(KEPT))
    report_run(tmp_path / "summed")
    assert "use the first 10,000." in (tmp_path / "summed" / "report.html").read_text()


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
    flown = simulate(campaign(4, samples=SAMPLES, store="summary"), tmp_path / "two", "ensemble", 2).simulated
    assert flown == 2 * CHUNK
    assert _digests(tmp_path / "two") == digests
    assert summary_of(tmp_path / "two")["covariance_paired"] == json.loads(json.dumps(first["covariance_paired"]))


@pytest.mark.parametrize("design", ["antithetic", "latin-hypercube", "sobol"])
def test_blocks_of_a_design_stay_whole(design: str, tmp_path: Path) -> None:
    """Estimates are those of the samples; errors those of the design's own blocks, where these are large."""
    summed = _run(tmp_path / "summed", samples=40_000, design=design)
    whole = simulate(campaign(4, samples=40_000, design=design), tmp_path / "whole", "ensemble", 2).summary
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
    found, stored, restored = _both_ways(model, errors, outcomes)
    assert found.blocks[:, 0].sum() == 998
    kept, summed = (compare_reduced(model, each, Criterion(), DESIGN) for each in (stored, restored))
    assert (summed.samples, summed.failed) == (998, 2)
    np.testing.assert_allclose(summed.covariance_sample, kept.covariance_sample, rtol=1e-12)
    assert [output.paired.verdict for output in summed.outputs] == [output.paired.verdict for output in kept.outputs]
    first = store.Summary.of(found, 1_000, {5: "failed: a", 700: "failed: a"})
    failing = first + store.Summary.of(found_after(found), 10, {1_003: "failed: b"})
    assert failing.failures == {
        "failed: a": store.FailureCount(2, (5, 700)),
        "failed: b": store.FailureCount(1, (1_003,)),
    }
    again = store.Summary.from_mark(failing.marks(0)[store.MARK])
    assert np.array_equal(again.sums.blocks, failing.sums.blocks)
    assert (again.samples, again.failures) == (failing.samples, failing.failures)


def test_what_failed_samples_hide_is_told_from_sums() -> None:
    model = _model()
    errors = np.random.default_rng(4).standard_normal((1_000, 2))
    outcomes = errors @ model.partials.T
    outcomes[errors[:, 0] > 1.5] = np.nan
    _, stored, restored = _both_ways(model, errors, outcomes)
    linear = errors @ model.partials.T
    ratio = linear[np.isfinite(outcomes).all(axis=1)].std(axis=0) / linear.std(axis=0)
    for reduced in (stored, restored):
        found = failure_bias(model, reduced)
        assert found is not None
        assert found.samples == np.count_nonzero(errors[:, 0] > 1.5)
        np.testing.assert_allclose(found.sigma_ratio, ratio, rtol=1e-10)


def test_reasons_are_bounded() -> None:
    """Those that differ in their numbers are told as one, and whatever is still too much as the rest."""
    found = reduce_samples(normalization(_model(), 10_000, 1), 0, np.zeros((10, 2)), np.zeros((10, 2)))
    many = {index: f"failed: fell to {index} km" for index in range(2_000)}
    assert store.Summary.of(found, 2_000, many).failures == {
        "failed: fell to … km": store.FailureCount(2_000, tuple(range(store.FIRST)))
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
    _, stored, restored = _both_ways(model, errors, outcomes)
    kept, summed = (compare_reduced(model, each, Criterion(), DESIGN) for each in (stored, restored))
    assert kept.joint is not None
    assert kept.ellipsoid is not None
    assert summed.joint is not None
    assert summed.ellipsoid is not None
    pairs = [(summed.ellipsoid.nees_paired, kept.ellipsoid.nees_paired)]
    for one, other in zip(summed.outputs, kept.outputs, strict=True):
        pairs += [(one.paired_variance, other.paired_variance), (one.bias, other.bias)]
        assert one.paired.interval == pytest.approx(other.paired.interval, rel=1e-10)
        assert one.plain.interval == pytest.approx(other.plain.interval, rel=1e-10)
        assert one.samples_to_see == other.samples_to_see
    for one, other in zip(summed.joint.correlations, kept.joint.correlations, strict=True):
        pairs.append((one.difference, other.difference))
    for one, other in pairs:
        assert abs(other.asymmetry) > 1e-3
        assert one.interval(0.99) == pytest.approx(other.interval(0.99), rel=1e-9)
    assert summed.joint.nees_expected == kept.joint.nees_expected
    running, restored_running = (convergence(each.moments, kept, DESIGN) for each in (stored, restored))
    assert running is not None
    assert restored_running is not None
    np.testing.assert_allclose(restored_running.paired.low, running.paired.low, rtol=1e-9)
    np.testing.assert_allclose(restored_running.paired.high, running.paired.high, rtol=1e-9)


@pytest.mark.parametrize("block", [1, 4, 128])
def test_block_sums_are_those_of_the_samples(block: int) -> None:
    """Every sum that the analysis asks for, whether of stored samples or of a summary, about any mean."""
    model, generator = replace(_model(), nominal=np.array([3.0, -1.0])), np.random.default_rng(6)
    errors = generator.standard_normal((1_000, 2))
    outcomes = model.nominal + errors @ model.partials.T + 0.2 * errors**2
    outcomes[7] = np.nan
    _, stored, restored = _both_ways(model, errors, outcomes, block)
    one, other = stored.moments, restored.moments
    pairs = [(one.mean, other.mean), (one.counts, other.counts), (one.within(), other.within())]
    pairs += [*zip(one.covariances, other.covariances, strict=True), *zip(one.nees(), other.nees(), strict=True)]
    for i in range(2):
        pairs.append((one.differences(i), other.differences(i)))
        pairs += [pair for j in range(2) for pair in zip(one.products(i, j), other.products(i, j), strict=True)]
        shapes = [shape_of_sums(each.powers(i), each.counts) for each in (one, other)]
        pairs += [(np.array(astuple(mine)), np.array(astuple(its))) for mine, its in zip(*shapes, strict=True)]
    pairs.append(tuple(np.concatenate([sums for sums, _ in each.whitened()], axis=1) for each in (one, other)))
    for mine, its in pairs:
        np.testing.assert_allclose(mine, its, rtol=1e-9, atol=1e-11)


def reduce_samples(frame: Normalization, begin: int, errors: np.ndarray, outcomes: np.ndarray) -> BlockSums:
    """Sums of a stretch of samples that is known as a whole."""
    reduction = BlockReduction(frame, begin)
    return reduction.add(errors, outcomes).followed_by(reduction.rest())


def _both_ways(
    model: Model, errors: np.ndarray, outcomes: np.ndarray, block: int = 1
) -> tuple[Any, ReducedSamples, ReducedSamples]:
    """A thousand samples as the sums of a summary, as stored in the same blocks, and as restored from the sums."""
    frame = replace(normalization(model, len(errors), 1), block=block)
    sums = reduce_samples(frame, 0, errors, outcomes)
    stored = reduce_stored(model, errors, outcomes, np.arange(len(errors)) // block)
    return sums, stored, reduce_summary(model, frame, sums, len(errors), stored.stored)


def found_after(found: Any) -> Any:
    """A stretch that begins in the last block of another."""
    return replace(found, first=found.first + len(found.blocks) - 1, blocks=found.blocks[:1])


def _model() -> Model:
    return Model(np.array([[1.0, 0.5], [0.0, 2.0]]), np.zeros(2), np.zeros(2), np.eye(2))


def test_a_block_has_as_many_sums_as_are_counted() -> None:
    found = reduce_samples(normalization(_model(), 10_000, 1), 0, np.zeros((10, 2)), np.zeros((10, 2)))
    assert found.blocks.shape == (3, column_count(2))


def test_more_samples_than_can_be_stored_need_a_summary() -> None:
    with pytest.raises(CampaignError, match=r"samples: got 2000000000; more than 1000000000 need store = 'summary'"):
        parse_campaign(content(samples=2_000_000_000), "test.toml", "test")
    assert parse_campaign(content(samples=2_000_000_000, store="summary"), "test.toml", "test").store == "summary"


def test_a_stopping_rule_needs_samples() -> None:
    until = {"until": "sigma_ratio 1 %", "at_most": 100_000}
    with pytest.raises(CampaignError, match=r"samples.until: needs store = 'samples'"):
        parse_campaign(content(samples=until, store="summary"), "test.toml", "test")


def test_a_summary_is_extended_beyond_its_blocks(tmp_path: Path) -> None:
    """As if all had been flown at once, with any workers, also where writing longer blocks was broken off.

    Blocks of 60,000 samples are doubled for 66,000, and of the other files twice for 132,000. The manifest may be lost:
    chunks say themselves which run they are of.
    """
    _run(tmp_path / "one", 1)
    doubled = list[int]()

    def break_off(folder: Path, file: ChunkFile, identity: str, times: int) -> ChunkFile:
        if doubled == [1]:
            raise KeyboardInterrupt
        doubled.append(times)
        return store.double_blocks(folder, file, identity, times)

    with patch("mcnav.runner.runner.double_blocks", break_off):
        with pytest.raises(KeyboardInterrupt):
            _run(tmp_path / "one", 1, samples=66_000)
        (tmp_path / "one" / "manifest.json").unlink()
        doubled.append(0)
        described = campaign(4, samples=132_000, store="summary")
        extended = simulate(described, tmp_path / "one", "ensemble", 1)
    assert (doubled, extended.simulated) == ([1, 0, 1, 2, 2], 132_000 - 3 * CHUNK)
    assert not extended.notices
    assert extended.summary == simulate(described, tmp_path / "two", "ensemble", 2).summary
    assert _digests(tmp_path / "one") == _digests(tmp_path / "two")


def test_a_summary_of_longer_files_is_not_extended(tmp_path: Path) -> None:
    _run(tmp_path / "one", samples=100)
    with (
        patch.object(store, "CHUNKS", 1),
        pytest.raises(RunFolderError, match=r"summary of 100 samples, and one of 40,000 has fewer, longer files; --fr"),
    ):
        _run(tmp_path / "one", samples=40_000)


@given(st.integers(0, 40), st.lists(st.integers(0, 30), min_size=1, max_size=6), st.integers(0, 3), st.integers(1, 3))
def test_bits_of_blocks_depend_on_no_pieces(begin: int, pieces: list[int], size: int, times: int) -> None:
    """Sums of a stretch are those of its pieces, and doubled blocks those of a run of longer blocks; failures too."""
    model, generator, count = _model(), np.random.default_rng(8), sum(pieces) + 1
    errors = generator.standard_normal((count, 2))
    outcomes = errors @ model.partials.T
    outcomes[generator.random(count) < 0.2] = np.nan
    frame = replace(normalization(model, 1_000, 1), block=2**size)
    whole = reduce_samples(frame, begin, errors, outcomes)
    reduction, blocks, done = BlockReduction(frame, begin), list[np.ndarray](), 0
    for piece in (*pieces, 1):
        blocks.append(reduction.add(errors[done : done + piece], outcomes[done : done + piece]).blocks)
        done += piece
    assert np.array_equal(np.concatenate([*blocks, reduction.rest()]), whole.blocks)
    longer = reduce_samples(replace(frame, block=2 ** (size + times)), begin, errors, outcomes)
    for _ in range(times):
        whole = whole.doubled()
    assert (whole.first, whole.blocks.tobytes()) == (longer.first, longer.blocks.tobytes())
    ok = np.isfinite(outcomes).all(axis=1)
    sums = [np.count_nonzero(ok), *((outcomes[ok] - frame.centre) / frame.scale).sum(axis=0)]
    np.testing.assert_allclose(longer.blocks.sum(axis=0)[:3], sums, rtol=1e-12, atol=1e-12)


def test_samples_are_as_before_beside_a_summary(tmp_path: Path) -> None:
    """Stored samples do not know of another store; a folder of theirs is not taken for a summary's."""
    assert "store" not in campaign(4).resolved
    simulate(campaign(4, samples=1_000), tmp_path, "ensemble", 1)
    with pytest.raises(RunFolderError, match=r"store was absent, is summary"):
        _run(tmp_path, samples=1_000)


def test_a_manifest_of_as_many_samples_as_a_campaign_may_have(tmp_path: Path) -> None:
    """10^12, all that `store = "summary"` allows, can be read again."""
    _run(tmp_path / "run")
    content = RunFolder(tmp_path / "run").existing_manifest().to_json() | {"samples": 10**12}
    last = content["parts"][-1] | {"end": 10**12}
    assert Manifest.from_json(content | {"parts": [*content["parts"][:-1], last]}).chunks[-1].end == 10**12
    with pytest.raises(ManifestError, match=r"^parts: do not hold the samples from 0 to 999999999999 in order$"):
        Manifest.from_json(content)


def test_a_manifest_of_another_format_is_refused(tmp_path: Path) -> None:
    _run(tmp_path / "run")
    content = RunFolder(tmp_path / "run").existing_manifest().to_json() | {"format": 2}
    with pytest.raises(ManifestError, match=r"^format: got '2'; this version reads format 1$"):
        Manifest.from_json(content)
