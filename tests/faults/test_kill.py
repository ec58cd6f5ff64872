"""Finished chunks survive a kill, and the rest is flown again to the same bits."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from mcnav.config.read import read_campaign
from mcnav.runner.processes import TRIED_WHOLE
from mcnav.workflow.prepare import prepare_system
from tests.commands import invoke
from tests.faults.kinds import KINDS, Case
from tests.faults.remains import digests
from tests.faults.scenarios import KillsWorkers, command, environment, write_campaign
from tests.processes import LONG, run_to_end, running, wait_for

GO = "go"
"""File that the held sample waits for."""


def _held(place: Path) -> list[object]:
    """Eight chunks, of which the fifth waits for a file in its first sample: without it no run comes to its end."""
    drawn = read_campaign(write_campaign(place, "", samples=200)).errors.draw("random", 1, 200, 100, 101)
    wait = (
        f"while abs(a - {float(drawn[0, 0])!r}) < 1e-12 and not os.path.exists({str(place / GO)!r}): time.sleep(0.01)"
    )
    return ["run", write_campaign(place, wait, samples=200)]


def _run(arguments: list[object], folder: Path, jobs: int) -> dict[str, str]:
    done = invoke(*arguments, "--no-report", "--jobs", jobs, "--out", folder, cwd=folder.parent)
    assert done.returncode == 0, done.stderr
    return digests(folder)


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[object], dict[str, str]]:
    """A folder, the arguments of the held run in it, and what is stored of one that nothing holds."""
    place = tmp_path_factory.mktemp("held")
    arguments = _held(place)
    (place / GO).touch()
    return place, arguments, _run(arguments, place / "undisturbed", 1)


@pytest.mark.posix
@pytest.mark.parametrize(("name", "status", "jobs"), [("SIGKILL", -9, 2), ("SIGINT", 130, 2), ("SIGTERM", 143, 1)])
def test_resume_after_a_signal(
    name: str, status: int, jobs: int, held: tuple[Path, list[object], dict[str, str]]
) -> None:
    """A command with workers of its own, none of which is left; it is resumed by two, and undisturbed by one."""
    place, arguments, undisturbed = held
    folder = place / name
    (place / GO).unlink(missing_ok=True)
    started = command(*arguments, "--no-report", "--jobs", jobs, "--out", folder)
    with running(started, env=environment()) as process:
        wait_for(lambda: digests(folder), process)
        process.send_signal(signal.Signals[name])
        _, said = process.communicate(timeout=LONG)  # the pipes stay open as long as any worker lives
    left = digests(folder)
    assert process.returncode == status
    assert 0 < len(left) < len(undisturbed)
    assert left.items() <= undisturbed.items()
    if name != "SIGKILL":
        assert said == "error: interrupted; stored samples are kept, and the same command resumes the run\n"
    (place / GO).touch()
    assert _run(arguments, folder, 2) == undisturbed


@pytest.mark.posix
def test_killed_workers_of_an_aided_run(tmp_path: Path) -> None:
    """One of each of two pools: what is left is simulated chunk by chunk, and no sample is lost."""
    case, kills = Case("aided, own gains", "samples"), KillsWorkers(TRIED_WHOLE)
    case.run(tmp_path, tmp_path / "calm")
    case.run(tmp_path, tmp_path / "hit", progress=kills, sample_timeout="1 h")  # with a limit, in processes
    assert kills.killed
    assert digests(tmp_path / "hit") == digests(tmp_path / "calm")


@pytest.mark.parametrize("name", [name for name in KINDS if name.startswith(("free", "aided"))])
def test_engines_of_inertial_navigation_that_hold_python_s_lock_have_processes(name: str, tmp_path: Path) -> None:
    """The references, sample by sample; what is compiled releases the lock, and has threads."""
    engine = prepare_system(Case(name, "samples").campaign(tmp_path), KINDS[name].engine, force=False).engine
    assert (engine.parallel == "processes") == KINDS[name].in_processes == name.endswith("reference")


@pytest.mark.posix
def test_resume_of_every_kind() -> None:
    """Killed after the first chunk, then amid the writing of the second: all files are those of a run at one go.

    With samples by every engine of inertial navigation and of closed loops, and with a summary by the one whose summary
    has most in it, a filter's; `tests.faults.kills` says what else is looked at, and names what goes wrong.
    """
    sampled = [kind for kind in KINDS if kind.startswith(("free", "aided", "guided", "loop"))]
    cases = [*(f"{kind}, samples" for kind in sampled), "aided, own gains, summary"]
    tool = [sys.executable, "-m", "tests.faults.kills", "--mode", "fixed", "--backends", "joblib", "--cases", *cases]
    done = run_to_end(tool, env=environment())
    assert done.returncode == 0, done.stdout + done.stderr
    runs, kills, *_, wrong = done.stdout.splitlines()[-1].split()[1:]
    assert (runs, kills, wrong) == (f"{len(cases)}", f"{2 * len(cases)}", "0")
