"""Finished chunks survive a kill, and the rest is flown again to the same bits."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
import tomli_w

from mcnav.execution.processes import TRIED_WHOLE
from tests.commands import invoke
from tests.conftest import TWO_ERRORS, content
from tests.faults.kinds import KINDS, Case
from tests.faults.remains import digests
from tests.faults.scenarios import KillsWorkers, command, environment
from tests.processes import LONG, run_to_end, running, wait_for

SAMPLES = 192
"""Six chunks: when the first is stored, two workers have flown three or four at most."""


def _arguments(folder: Path, jobs: int = 2) -> list[object]:
    """Without a report, and with few errors: neither what is flown on the side nor what is drawn is at stake."""
    path = folder.parent / "campaign.toml"
    path.write_text(tomli_w.dumps(content(1, samples=SAMPLES, errors=TWO_ERRORS)))
    return ["run", path, "--engine", "reference", "--no-report", "--jobs", jobs, "--out", folder]


def _run(folder: Path) -> None:
    done = invoke(*_arguments(folder), cwd=folder.parent)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    _run(folder)
    return digests(folder)


@pytest.mark.parametrize(
    ("sign", "status", "jobs"), [(signal.SIGKILL, -9, 2), (signal.SIGINT, 130, 2), (signal.SIGTERM, 143, 1)]
)
def test_resume_after_a_signal(
    sign: signal.Signals, status: int, jobs: int, tmp_path: Path, undisturbed: dict[str, str]
) -> None:
    folder = tmp_path / "run"
    with running(command(*_arguments(folder, jobs)), env=environment()) as process:
        wait_for(lambda: digests(folder), process)
        process.send_signal(sign)
        _, said = process.communicate(timeout=LONG)  # the pipes stay open as long as any worker lives
    left = digests(folder)
    assert process.returncode == status
    assert 0 < len(left) < len(undisturbed)
    assert left.items() <= undisturbed.items()
    if sign != signal.SIGKILL:
        assert said == "error: interrupted; stored samples are kept, and the same command resumes the run\n"
    _run(folder)
    assert digests(folder) == undisturbed


def test_killed_workers_of_an_aided_run(tmp_path: Path) -> None:
    """One of each of two pools: what is left is simulated chunk by chunk, and no sample is lost."""
    case, kills = Case("aided, own gains", "samples"), KillsWorkers(TRIED_WHOLE)
    case.run(tmp_path, tmp_path / "calm")
    case.run(tmp_path, tmp_path / "hit", progress=kills, sample_timeout="1 h")  # with a limit, in processes
    assert kills.killed
    assert digests(tmp_path / "hit") == digests(tmp_path / "calm")


def test_resume_of_every_kind() -> None:
    """Killed after the first chunk, then amid the writing of the second: all files are those of a run at one go.

    With samples by every engine of inertial navigation, and with a summary by one of each kind; `tests.faults.kills`
    says what else is looked at, and names what goes wrong.
    """
    sampled = [kind for kind in KINDS if kind.startswith(("free", "aided"))]
    summed = ["free, ensemble", "aided, own gains", "own, stochastic"]
    cases = [f"{kind}, samples" for kind in sampled] + [f"{kind}, summary" for kind in summed]
    tool = [sys.executable, "-m", "tests.faults.kills", "--mode", "fixed", "--backends", "joblib", "--cases", *cases]
    done = run_to_end(tool, env=environment())
    assert done.returncode == 0, done.stdout + done.stderr
    runs, kills, *_, wrong = done.stdout.splitlines()[-1].split()[1:]
    assert (runs, kills, wrong) == (f"{len(cases)}", f"{2 * len(cases)}", "0")
