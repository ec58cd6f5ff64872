"""Sample files: written and read back, and every flipped bit noticed."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from mcnav.config.read import read_campaign
from mcnav.contract.failure import Failure
from mcnav.files.parquet import parquet_bytes
from mcnav.runner.chunks import SampleRange, find_chunk, simulate_chunk
from mcnav.store.chunk_files import ChunkFile, ChunkTotals, SampleSchema, samples_from, verify_chunk, write_chunk
from tests.faults.scenarios import chunk_job, write_campaign

LAYOUT = SampleSchema(("error a [m]", "error b [rad]"), ("output c [m]",))
IDENTITY = "f" * 64


@pytest.fixture
def stored(tmp_path: Path) -> ChunkFile:
    values = np.arange(40.0)[:, None] ** 3
    values[7] = np.nan
    errors = np.random.default_rng(1).standard_normal((40, 2))
    failures, totals = {7: Failure.of("fell")}, ChunkTotals(40, 1, 2, {})
    return write_chunk(tmp_path, 3, 120, IDENTITY, LAYOUT, errors, values, failures, totals, {})


def test_what_is_written_is_read_back(stored: ChunkFile, tmp_path: Path) -> None:
    assert (stored.begin, stored.end, stored.failed, stored.fallback_count) == (120, 160, 1, 2)
    assert verify_chunk(tmp_path, 3, IDENTITY) == stored
    samples = samples_from(pq.read_table(tmp_path / stored.file), LAYOUT)
    assert samples.status[7] == "failed: fell"
    assert np.isnan(samples.outputs[7, 0])
    assert samples.outputs[8, 0] == 512.0
    assert samples.index.tolist() == list(range(120, 160))


def test_a_chunk_of_another_run_or_number_is_not_found(stored: ChunkFile, tmp_path: Path) -> None:
    assert verify_chunk(tmp_path, 3, "e" * 64) is None
    assert verify_chunk(tmp_path, 4, IDENTITY) is None


def test_a_chunk_of_an_earlier_version_is_found(stored: ChunkFile, tmp_path: Path) -> None:
    """It has no checksum of its metadata, but has them twice: one that has them once is not believed."""
    path = tmp_path / stored.file
    table = pq.read_table(path)
    marks = {key: value for key, value in table.schema.metadata.items() if key != b"mcnav.checksum"}
    assert len(marks) == len(table.schema.metadata) - 1
    table = table.replace_schema_metadata(marks)
    path.write_bytes(parquet_bytes(table, ["status"], described_twice=True))
    found = verify_chunk(tmp_path, 3, IDENTITY)
    assert found is not None
    assert (found.begin, found.end, found.failed) == (stored.begin, stored.end, stored.failed)
    path.write_bytes(parquet_bytes(table, ["status"]))
    assert verify_chunk(tmp_path, 3, IDENTITY) is None


def test_a_chunk_of_other_samples_is_not_found(tmp_path: Path) -> None:
    """A file has its own samples in it: under another number, or shorter than the chunk, it is not the chunk."""
    work = chunk_job(read_campaign(write_campaign(tmp_path, "")), tmp_path / "run")
    first = SampleRange(0, 0, 20)
    stored = simulate_chunk(work, first)
    assert find_chunk(work, first) == stored
    assert find_chunk(work, SampleRange(0, 0, 40)) is None
    shutil.copy(work.folder.chunk_folder / stored.file, work.folder.chunk_folder / "part-00001.parquet")
    assert find_chunk(work, SampleRange(1, 20, 40)) is None


@pytest.mark.slow
def test_every_flipped_bit_is_noticed(stored: ChunkFile, tmp_path: Path) -> None:
    """One bit in each byte of the file, headers and footer included: none is read as if nothing were wrong."""
    path = tmp_path / stored.file
    whole = path.read_bytes()
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << (position % 8)
        path.write_bytes(damaged)
        assert verify_chunk(tmp_path, 3, IDENTITY) is None, position


def test_every_truncation_is_noticed(stored: ChunkFile, tmp_path: Path) -> None:
    path = tmp_path / stored.file
    whole = path.read_bytes()
    for length in range(0, len(whole), 37):
        path.write_bytes(whole[:length])
        assert verify_chunk(tmp_path, 3, IDENTITY) is None, length
