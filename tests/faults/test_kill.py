"""Finished chunks survive a kill, and the rest is flown again to the same bits."""

from __future__ import annotations

import hashlib
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import ROOT

CAMPAIGN = ROOT / "campaigns" / "02_tn_d1772_trajectory_1.toml"


def _command(folder: Path) -> list[str]:
    options = ["--engine", "reference", "--samples", "320", "--out", str(folder)]
    return [sys.executable, "-m", "mcnav", "run", str(CAMPAIGN), *options]


def _parts(folder: Path) -> dict[str, str]:
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed")
    subprocess.run(_command(folder), check=True, capture_output=True, timeout=120)
    return _parts(folder)


@pytest.mark.parametrize(("sign", "status"), [(signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_resume_after_a_signal(sign: signal.Signals, status: int, tmp_path: Path, undisturbed: dict[str, str]) -> None:
    folder = tmp_path / "run"
    process = subprocess.Popen(_command(folder), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60.0
    while not _parts(folder) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(sign)
    _, said = process.communicate(timeout=5)  # the pipes stay open as long as any worker lives
    left = _parts(folder)
    assert process.returncode == status
    assert 0 < len(left) < len(undisturbed)
    assert left.items() <= undisturbed.items()
    if sign != signal.SIGKILL:
        assert said.startswith("error: interrupted; what is stored is kept")
        assert "Traceback" not in said
    subprocess.run(_command(folder), check=True, capture_output=True, timeout=120)
    assert _parts(folder) == undisturbed
