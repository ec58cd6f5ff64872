"""Systems without the signals, calls and modules of POSIX, emulated: a campaign, a time limit, a kill.

`tests/faults/elsewhere` hides these from the package in every process, workers included, and names the system ``nt``.
"""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pandas as pd

from mcnav.config.read import read_campaign
from tests.commands import invoke
from tests.conftest import ROOT
from tests.faults.remains import digests, left_of
from tests.faults.scenarios import command, write_campaign
from tests.processes import LONG, run_to_end, running, wait_for

WINDOWS = "cp1252"
ELSEWHERE = os.environ | {
    "PYTHONPATH": os.pathsep.join((str(ROOT / "tests" / "faults" / "elsewhere"), str(ROOT))),
    "PYTHONIOENCODING": WINDOWS,
    "COLUMNS": "200",
}
HIDDEN = "import mcnav.systems.guard as guard; print(hasattr(guard.os, 'fork'), guard.os.name)"
LIMIT = 'sample_timeout = "1 s"'


def test_without_posix_a_time_limit_names_the_samples_that_exceed_it(tmp_path: Path) -> None:
    """By a loop that never ends; all others are as where there is an alarm, bit for bit."""
    calm = write_campaign(tmp_path / "calm", "", samples=60)
    drawn = read_campaign(calm).errors.draw("random", 1, 60, 0, 60)[:, 0]
    late = [int(np.argmax(drawn))]
    body = f"while a == {float(drawn.max())!r}: pass"
    path = write_campaign(tmp_path / "late", body, samples=60, more=LIMIT)
    assert run_to_end([*command()[:1], "-c", HIDDEN], env=ELSEWHERE, encoding=WINDOWS).stdout.split() == ["False", "nt"]
    done = run_to_end(command("run", path, "--jobs", 2, "--out", tmp_path / "run"), env=ELSEWHERE, encoding=WINDOWS)
    assert done.returncode == 3, done.stderr
    assert "1 of 60 samples failed" in done.stdout
    assert "Traceback" not in done.stderr
    assert invoke("run", calm, "--out", tmp_path / "other", cwd=tmp_path).returncode == 0
    hit, other = (pd.read_parquet(tmp_path / name / "samples") for name in ("run", "other"))
    assert [*np.flatnonzero(hit["status"] != "ok")] == late
    assert hit["status"][late[0]] == "failed: took longer than 1 s"
    pd.testing.assert_frame_equal(hit.drop(late), other.drop(late), check_exact=True)


def test_without_posix_a_kill_leaves_nobody_and_is_resumed(tmp_path: Path) -> None:
    """The parent alone is killed amid a run; its worker notices it by itself."""
    go = tmp_path / "go"
    drawn = read_campaign(write_campaign(tmp_path, "", samples=100)).errors.draw("random", 1, 100, 0, 100)
    wait = f"while abs(a - {float(drawn[60, 0])!r}) < 1e-12 and not os.path.exists({str(go)!r}): time.sleep(0.01)"
    path = write_campaign(tmp_path, wait, samples=100)
    arguments = ("run", path, "--no-report", "--out", tmp_path / "run", "--jobs")
    with running(command(*arguments, 2), env=ELSEWHERE, encoding=WINDOWS) as process:
        wait_for(lambda: digests(tmp_path / "run"), process)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=LONG)
        assert left_of(process.pid) == []
    left = digests(tmp_path / "run")
    go.touch()
    assert run_to_end(command(*arguments, 1), env=ELSEWHERE, encoding=WINDOWS).returncode == 0
    assert invoke("run", path, "--no-report", "--out", tmp_path / "other", cwd=tmp_path).returncode == 0
    assert left.items() <= digests(tmp_path / "run").items()
    assert digests(tmp_path / "run") == digests(tmp_path / "other")
