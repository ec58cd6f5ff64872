"""Finished chunks survive a kill, and the rest is flown again to the same bits."""

from __future__ import annotations

import hashlib
import signal
from pathlib import Path

import pytest
import tomli_w

from tests.conftest import TWO_ERRORS, content
from tests.faults.scenarios import command, environment
from tests.processes import LONG, run_to_end, running, wait_for

SAMPLES = 192
"""Six chunks: when the first is stored, two workers have flown three or four at most."""


def _arguments(folder: Path) -> list[object]:
    """Without a report, and with few errors: neither what is flown on the side nor what is drawn is at stake."""
    path = folder.parent / "campaign.toml"
    path.write_text(tomli_w.dumps(content(1, samples=SAMPLES, errors=TWO_ERRORS)))
    return ["run", path, "--engine", "reference", "--no-report", "--out", folder]


def _run(folder: Path) -> None:
    done = run_to_end(command(*_arguments(folder)), env=environment())
    assert done.returncode == 0, done.stderr


def _parts(folder: Path) -> dict[str, str]:
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    _run(folder)
    return _parts(folder)


@pytest.mark.parametrize(("sign", "status"), [(signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_resume_after_a_signal(sign: signal.Signals, status: int, tmp_path: Path, undisturbed: dict[str, str]) -> None:
    folder = tmp_path / "run"
    with running(command(*_arguments(folder)), env=environment()) as process:
        wait_for(lambda: _parts(folder), process)
        process.send_signal(sign)
        _, said = process.communicate(timeout=LONG)  # the pipes stay open as long as any worker lives
    left = _parts(folder)
    assert process.returncode == status
    assert 0 < len(left) < len(undisturbed)
    assert left.items() <= undisturbed.items()
    if sign != signal.SIGKILL:
        assert said == "error: interrupted; stored samples are kept, and the same command resumes the run\n"
    _run(folder)
    assert _parts(folder) == undisturbed
