"""Trajectory files that change or vanish at any moment of a run, and clocks that are set back."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest

from mcnav.config.read import read_campaign
from mcnav.entries import inputs
from mcnav.entries.inputs import content_of
from mcnav.errors import CampaignError, RunFolderError
from mcnav.files.whole import read_whole
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.prepare import prepare_system
from mcnav.workflow.trajectory import describe_campaign
from tests.commands import invoke
from tests.faults.navigation import (
    KINDS,
    SECONDS,
    break_off,
    run_navigation,
    undisturbed_chunks,
    write_navigation,
)
from tests.faults.remains import digests, every_byte
from tests.faults.scenarios import OnAdvance
from tests.unit.config.test_trajectory_file import flight, write_csv

KIND = "free"
DAY = 86_400.0


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the chunks of a run that nothing happens to."""
    return undisturbed_chunks(KIND, tmp_path_factory.mktemp("undisturbed"))


def change(path: Path) -> None:
    """Replace a trajectory by another of the same length, with the same time of its last change."""
    before, content = path.stat(), path.read_text()
    other = content.replace(",3000.0,", ",3001.0,", 1)
    path.write_text(other if other != content else content.replace(",3001.0,", ",3000.0,", 1))
    assert path.read_text() != content
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def test_a_trajectory_that_changes_between_start_and_resume(tmp_path: Path, undisturbed: dict[str, str]) -> None:
    """Refused in one line, nothing in the folder is touched; put back, or read from its copy, the run goes on."""
    campaign, run, file = write_navigation(tmp_path, KIND), tmp_path / "run", tmp_path / "flight.csv"
    break_off(campaign, KIND, run)
    before, kept, was = every_byte(run), file.read_bytes(), digest(file)
    change(file)
    with pytest.raises(RunFolderError) as refused:
        run_navigation(campaign, KIND, run)
    assert str(refused.value) == (
        f"{run}: holds the results of another run (files.flight.csv was {was}, is {digest(file)}); "
        "--fresh replaces them, --out writes elsewhere"
    )
    file.unlink()
    done = invoke("run", campaign, "--engine", KINDS[KIND][1], "--out", run, cwd=tmp_path)
    assert done.returncode == 2
    told = f"{campaign}: scenario.trajectory: {file} does not exist; paths are relative to the campaign file"
    assert done.stderr == f"error: {told}\n"
    assert every_byte(run) == before
    shutil.copytree(run, tmp_path / "other")
    run_navigation(tmp_path / "other" / "campaign.toml", KIND, tmp_path / "other")
    assert digests(tmp_path / "other") == undisturbed
    file.write_bytes(kept)
    assert run_navigation(campaign, KIND, run).simulated < KINDS[KIND][2]
    assert digests(run) == undisturbed


def changing(file: Path, function: Callable[..., object]) -> Callable[..., object]:
    """Return a function before whose first call a file changes."""
    left = [file]

    def call(*arguments: object, **options: object) -> object:
        while left:
            change(left.pop())
        return function(*arguments, **options)

    return call


def test_a_trajectory_that_changes_while_it_is_read(tmp_path: Path) -> None:
    """A run is identified by the digest of what was read."""
    campaign, file = write_navigation(tmp_path, KIND), tmp_path / "flight.csv"
    write_csv(file, flight(SECONDS, rate=2.5))  # not among the trajectories read last
    with (
        patch("mcnav.systems.ins.tables.trajectory_file.read_whole", changing(file, read_whole)),
        pytest.raises(CampaignError, match=r"flight\.csv: has changed while it was read; run the command again"),
    ):
        read_campaign(campaign)
    run_navigation(campaign, KIND, tmp_path / "run")
    (record,) = RunFolder(tmp_path / "run").existing_manifest().files
    assert record.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    with (
        patch("mcnav.systems.ins.tables.trajectory_file.read_whole", changing(file, read_whole)),
        pytest.raises(CampaignError, match=r"scenario\.trajectory: .*flight\.csv: has changed while it was read"),
    ):
        describe_campaign(campaign)


def test_a_trajectory_that_changes_before_a_run_begins(tmp_path: Path) -> None:
    """Between the reading of the campaign and the run, or while its system is prepared: nothing is stored."""
    campaign, run, file = write_navigation(tmp_path, KIND), tmp_path / "run", tmp_path / "flight.csv"
    kept = file.read_bytes()
    for place, function, told in (
        ("identity_of", None, "has changed; the campaign was read before that; read it again"),
        ("prepare_system", prepare_system, "changed while the run began; run the campaign again"),
    ):
        from mcnav.workflow import run as workflow

        with (
            patch.object(workflow, place, changing(file, function or workflow.identity_of)),
            pytest.raises(RunFolderError, match=re.escape(f"{file}: {told}")),
        ):
            run_navigation(campaign, KIND, run)
        assert not digests(run)
        assert not (run / "inputs" / "flight.csv").exists()
        file.write_bytes(kept)


@pytest.mark.parametrize(("fault", "told"), [(change, "has changed"), (Path.unlink, "is gone, or not to be seen")])
def test_a_trajectory_that_changes_amid_a_run(
    fault: Callable[[Path], None], told: str, tmp_path: Path, undisturbed: dict[str, str]
) -> None:
    """Before the chunks that follow and before the end: what is stored comes from the file as it was."""
    campaign, run, file = write_navigation(tmp_path, KIND), tmp_path / "run", tmp_path / "flight.csv"
    kept = file.read_bytes()
    for stored in (1, len(undisturbed)):

        def spoil(stored: int = stored) -> None:
            if len(digests(run)) == stored and file.exists() and file.read_bytes() == kept:
                fault(file)

        with pytest.raises(RunFolderError, match=rf"flight\.csv: {told}.*; samples stored in .* come from the file as"):
            run_navigation(campaign, KIND, run, progress=OnAdvance(spoil))
        assert len(digests(run)) == stored
        assert not RunFolder(run).existing_manifest().complete
        file.write_bytes(kept)
    assert run_navigation(campaign, KIND, run).simulated == 0
    assert digests(run) == undisturbed


@pytest.mark.parametrize("kind", ["free", "aided, summary"])
def test_a_clock_set_back_before_a_run_resumes(kind: str, tmp_path: Path) -> None:
    """Files from the future are known by content, a trajectory that is changed afterwards too."""
    whole = undisturbed_chunks(kind, tmp_path / "whole")
    campaign, run = write_navigation(tmp_path, kind), tmp_path / "run"
    break_off(campaign, kind, run)
    for path in (tmp_path, *tmp_path.rglob("*")):
        os.utime(path, (time.time() + DAY, time.time() + DAY))
    now = time.time
    with patch("time.time", lambda: now() - DAY):
        kept = (tmp_path / "flight.csv").read_bytes()
        change(tmp_path / "flight.csv")
        with pytest.raises(RunFolderError, match=r"holds the results of another run \(files\.flight\.csv was"):
            run_navigation(campaign, kind, run)
        (tmp_path / "flight.csv").write_bytes(kept)
        done = run_navigation(campaign, kind, run)
        assert done.notices == ()
        assert 0 < done.simulated < KINDS[kind][2]
        assert digests(run) == whole
        assert run_navigation(campaign, kind, run).simulated == 0


def test_content_is_known_whatever_clocks_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file server's clock is a day ahead and coarse: two contents within one tick have the same time stamps."""
    path, ticks, reads = tmp_path / "flight.csv", [0.0], [0]
    path.write_text("0")
    stamped = path.stat()
    ahead = os.stat_result((*stamped[:7], *(time.time() + DAY,) * 3))
    assert ahead.st_mtime == ahead.st_ctime
    monkeypatch.setattr(inputs.time, "monotonic", lambda: ticks[0])
    digest_of = hashlib.file_digest

    def counted(*arguments: object) -> object:
        reads[0] += 1
        return digest_of(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(inputs.hashlib, "file_digest", counted)
    with patch.object(Path, "stat", lambda self: ahead):
        for text in ("1", "2", "3"):
            path.write_text(text)
            assert content_of(str(path))[0] == hashlib.sha256(text.encode()).hexdigest()
            ticks[0] += 0.5
        ticks[0] += inputs.SETTLED_AFTER
        for _ in range(3):
            assert content_of(str(path))[0] == hashlib.sha256(b"3").hexdigest()
    assert reads[0] == 4  # once more after the time stamps have settled, and never again
