"""Sample files: written and read back, and every flipped bit noticed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from mcnav.scenarios.failure import Failure
from mcnav.scenarios.protocol import SimulationResult
from mcnav.store.parts import Part, SampleSchema, samples_from, verified_part, write_part

LAYOUT = SampleSchema(("error a [m]", "error b [rad]"), ("output c [m]",))
IDENTITY = "f" * 64


@pytest.fixture
def stored(tmp_path: Path) -> Part:
    values = np.arange(40.0)[:, None] ** 3
    values[7] = np.nan
    errors = np.random.default_rng(1).standard_normal((40, 2))
    return write_part(
        tmp_path, 3, 120, IDENTITY, LAYOUT, errors, SimulationResult(values, {7: Failure.of("fell")}, fallback_count=2)
    )


def test_what_is_written_is_read_back(stored: Part, tmp_path: Path) -> None:
    assert (stored.begin, stored.end, stored.failed, stored.handed_over) == (120, 160, 1, 2)
    assert verified_part(tmp_path, 3, 120, 160, IDENTITY) == stored
    samples = samples_from(pq.read_table(tmp_path / stored.file), LAYOUT)
    assert samples.status[7] == "failed: fell"
    assert np.isnan(samples.outputs[7, 0])
    assert samples.outputs[8, 0] == 512.0
    assert samples.index.tolist() == list(range(120, 160))


def test_a_part_of_another_run_or_place_is_not_believed(stored: Part, tmp_path: Path) -> None:
    assert verified_part(tmp_path, 3, 120, 160, "e" * 64) is None
    assert verified_part(tmp_path, 3, 0, 40, IDENTITY) is None
    assert verified_part(tmp_path, 4, 120, 160, IDENTITY) is None


@pytest.mark.slow
def test_every_flipped_bit_is_noticed(stored: Part, tmp_path: Path) -> None:
    """One bit in each byte of the file, headers and footer included: none is read as if nothing were wrong."""
    path = tmp_path / stored.file
    whole = path.read_bytes()
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << (position % 8)
        path.write_bytes(damaged)
        assert verified_part(tmp_path, 3, 120, 160, IDENTITY) is None, position


def test_every_truncation_is_noticed(stored: Part, tmp_path: Path) -> None:
    path = tmp_path / stored.file
    whole = path.read_bytes()
    for length in range(0, len(whole), 37):
        path.write_bytes(whole[:length])
        assert verified_part(tmp_path, 3, 120, 160, IDENTITY) is None, length
