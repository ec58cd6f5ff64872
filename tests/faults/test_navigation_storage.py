"""Runs of inertial navigation on full disks, in folders that cannot be written, and beside other commands."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import pytest

from mcnav.contract.samples import SimulationResult
from mcnav.errors import RunFolderBusy, RunFolderError
from mcnav.systems.ins.aided import AidedEngine
from mcnav.systems.ins.scenario import EnsembleEngine
from mcnav.workflow.analyse import report_run, samples_of
from mcnav.workflow.stored_summary import summary_of
from tests.commands import invoke
from tests.faults.kinds import small_summaries
from tests.faults.navigation import (
    BOTH,
    CHUNKS,
    HALF,
    KINDS,
    break_off,
    run_navigation,
    undisturbed_chunks,
    write_navigation,
)
from tests.faults.remains import digests, every_byte
from tests.faults.scenarios import NOBODY, OnAdvance, as_nobody

ENGINES: dict[str, Any] = {"free": EnsembleEngine, "aided, summary": AidedEngine}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Return the chunks of runs that nothing happens to, by kind."""
    return {kind: undisturbed_chunks(kind, tmp_path_factory.mktemp("undisturbed")) for kind in BOTH}


def full_after(writes: int) -> Callable[[int], None]:
    """Return a function in place of ``os.fsync`` that finds the disk full from some file on."""
    left = [writes]

    def fsync(file: int) -> None:
        left[0] -= stat.S_ISREG(os.fstat(file).st_mode)  # and nothing of folders
        if left[0] < 0:
            os.ftruncate(file, os.fstat(file).st_size // 2)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return fsync


BEGIN = ("development.parquet", "manifest.json", "history.parquet", "campaign.toml", "flight.csv")
"""Files that a run writes before its chunks."""


@pytest.mark.parametrize("kind", BOTH)
def test_a_disk_that_fills(kind: str, tmp_path: Path, undisturbed: dict[str, dict[str, str]]) -> None:
    """At each file in turn: one line, what is stored is whole and stays, and the run goes on to the same bits."""
    campaign, run = write_navigation(tmp_path, kind), tmp_path / "run"
    for writes, stored in ((0, 0), (3, 0), (len(BEGIN) + 1, 1), (len(BEGIN) + CHUNKS - 1, CHUNKS)):
        with patch("mcnav.files.whole.os.fsync", full_after(writes)), pytest.raises(RunFolderError) as full:
            run_navigation(campaign, kind, run)
        assert "No space left on device" in str(full.value)
        assert len(str(full.value).splitlines()) == 1
        assert len(digests(run)) == stored
        assert digests(run).items() <= undisturbed[kind].items()
        assert not list(run.rglob(".*.tmp"))
        with pytest.raises(RunFolderError, match="holds no" if writes == 0 else "is not finished"):
            report_run(run)
    assert run_navigation(campaign, kind, run).simulated == 0
    assert digests(run) == undisturbed[kind]


@pytest.fixture
def place() -> Iterator[Path]:
    """Return a folder that anyone may enter, as those of pytest are not."""
    with TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@contextmanager
def read_only(folder: Path, whole: Path) -> Iterator[None]:
    """Take the right to write into a folder, and that of root; ``whole`` belongs to whoever is left."""
    for path in (whole, *whole.rglob("*")):
        if os.geteuid() == 0:
            os.chown(path, NOBODY, NOBODY)
    folder.chmod(0o555)
    try:
        with as_nobody():
            yield
    finally:
        folder.chmod(0o755)


@pytest.mark.parametrize("kind", BOTH)
def test_a_folder_made_read_only_before_a_run_resumes(
    kind: str, place: Path, undisturbed: dict[str, dict[str, str]]
) -> None:
    """One line; nothing there is touched, or only what describes the run where nothing but its chunks is closed."""
    campaign, run = write_navigation(place, kind), place / "run"
    with read_only(place, place), pytest.raises(RunFolderError, match="run: cannot be written to: Permission denied"):
        run_navigation(campaign, kind, run)
    assert not run.exists()
    break_off(campaign, kind, run)
    before = every_byte(run)
    with read_only(run, run), pytest.raises(RunFolderError, match=r"run.*: cannot be written.*: Permission denied"):
        run_navigation(campaign, kind, run)
    assert every_byte(run) == before
    with (
        read_only(run / "samples", run),
        pytest.raises(RunFolderError, match="run: cannot be written to: Permission denied; what is stored there is"),
    ):
        run_navigation(campaign, kind, run)
    assert every_byte(run).keys() == before.keys()
    assert digests(run).items() <= undisturbed[kind].items()
    assert run_navigation(campaign, kind, run).simulated < KINDS[kind][2]
    assert digests(run) == undisturbed[kind]


@pytest.mark.parametrize("kind", BOTH)
def test_commands_beside_a_run(kind: str, tmp_path: Path, undisturbed: dict[str, dict[str, str]]) -> None:
    """The same campaign, the same with --fresh, another and a report are refused; nothing is mixed or deleted."""
    campaign, run = write_navigation(tmp_path, kind), tmp_path / "run"
    other = tmp_path / "other.toml"
    other.write_text(campaign.read_text().replace("seed = 5", "seed = 6"))
    refused = [0]

    def beside() -> None:
        before = every_byte(run)
        for file, options in ((campaign, {}), (campaign, {"fresh": True}), (other, {}), (other, {"fresh": True})):
            with pytest.raises(RunFolderBusy, match="another mcnav is writing here; wait for it, or choose --out"):
                run_navigation(file, kind, run, **options)
        with pytest.raises(RunFolderBusy):
            report_run(run)
        with pytest.raises(RunFolderError, match="is not finished"):
            samples_of(run)
        with pytest.raises(RunFolderError, match="holds no finished run"):
            summary_of(run)
        assert every_byte(run) == before
        refused[0] += 1

    run_navigation(campaign, kind, run, progress=OnAdvance(beside))
    assert refused == [CHUNKS]
    assert digests(run) == undisturbed[kind]


@pytest.mark.parametrize("kind", BOTH)
def test_too_little_memory_for_a_chunk(kind: str, tmp_path: Path, undisturbed: dict[str, dict[str, str]]) -> None:
    """One line with what would do; the chunks before it stay, and the same command goes on."""
    campaign, run, calls = write_navigation(tmp_path, kind), tmp_path / "run", [0]
    engine = ENGINES[kind]
    simulate = engine.simulate

    def simulate_or_fail(*arguments: Any) -> SimulationResult:
        calls[0] += 1
        if calls[0] == 2:
            raise MemoryError
        return simulate(*arguments)

    command = ("run", campaign, "--engine", KINDS[kind][1], "--jobs", 1, "--no-report", "--out", run)
    with small_summaries(HALF):
        with patch.object(engine, "simulate", simulate_or_fail):
            done = invoke(*command, cwd=tmp_path)
        assert done.returncode == 2
        remedy = "stored samples are kept, and the same command resumes the run (fewer --jobs need less)"
        assert done.stderr == f"error: {campaign}: not enough memory; {remedy}\n"
        assert len(digests(run)) == 1
        assert invoke(*command, cwd=tmp_path).returncode == 0
    assert digests(run) == undisturbed[kind]
