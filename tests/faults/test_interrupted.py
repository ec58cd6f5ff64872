"""What an interrupted run does not wait for."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from dataclasses import dataclass
from multiprocessing import active_children
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from joblib import Parallel, delayed

from mcnav.contract.engine import without_noise
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.execution.child_processes import side_threads
from mcnav.execution.stopping import Stopped
from mcnav.linear.corrections import Corrections
from mcnav.runner.processes import IsolatedEngine
from mcnav.runner.worker_processes import end_workers
from mcnav.systems.timeouts import within_limit
from tests.conftest import ROOT, campaign
from tests.faults.scenarios import OnAdvance, command, environment
from tests.processes import LONG, run_to_end, wait_for
from tests.runs import simulate


def test_an_exception_does_not_wait_for_threads() -> None:
    release = threading.Event()

    def interrupted(started: list[Any]) -> None:
        with side_threads(1) as beside:
            started += [beside.submit(release.wait, LONG), beside.submit(int)]
            raise KeyboardInterrupt

    started: list[Any] = []
    with pytest.raises(KeyboardInterrupt):
        interrupted(started)
    waiting, queued = started
    assert not release.is_set()
    assert queued.cancelled()
    release.set()
    assert waiting.result(LONG)


def test_without_an_exception_threads_are_waited_for() -> None:
    with side_threads(2) as beside:
        found = [beside.submit(pow, 2, number) for number in range(4)]
    assert [each.done() for each in found] == [True] * 4


def test_flights_on_the_side_are_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights that would never end do not hold up a run that is broken off, and end at the next flight."""
    ended = threading.Event()
    under_way = threading.Event()

    def corrections(_: object) -> Corrections:
        try:
            while not ended.wait(0.001):
                within_limit(under_way.set)
        except Stopped:
            ended.set()
            raise
        raise AssertionError

    def broken_off() -> None:
        assert under_way.wait(LONG)
        raise KeyboardInterrupt

    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr("mcnav.workflow.run.compute_corrections", corrections)
    with pytest.raises(KeyboardInterrupt):
        simulate(campaign(4, samples=100), tmp_path / "run", "ensemble", 1, progress=OnAdvance(broken_off))
    assert ended.wait(LONG)
    assert len(list((tmp_path / "run" / "samples").glob("part-*.parquet"))) == 1
    monkeypatch.undo()
    assert simulate(campaign(4, samples=100), tmp_path / "run", "ensemble", 1).simulated == 0


def _linger() -> None:
    """Keep the process that calls from ending in order for a while."""
    threading.Thread(target=time.sleep, args=(60.0,)).start()


def test_workers_are_killed() -> None:
    """Not asked to end in order, for which a command would have to wait when it is interrupted meanwhile."""
    Parallel(n_jobs=2, backend="loky")(delayed(_linger)() for _ in range(2))
    workers = active_children()
    end_workers()
    assert workers
    assert {worker.exitcode for worker in workers} == {-signal.SIGKILL}


@dataclass(frozen=True)
class Endless:
    """An engine whose samples never end."""

    under_way: Path
    parallel: str = "processes"
    chunk: int = 1
    accuracy: str = ""
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        self.under_way.touch()
        time.sleep(LONG)
        return SimulationResult(batch.errors)


def test_an_isolated_sample_is_killed(tmp_path: Path) -> None:
    """Before samples are stored, too: a user's scenario is tried in a process of its own."""
    before, workers = set(active_children()), list[Any]()

    def interrupt() -> None:
        wait_for((tmp_path / "under way").exists)
        workers.extend(set(active_children()) - before)
        os.kill(os.getpid(), signal.SIGINT)

    beside, handler = threading.Thread(target=interrupt), signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        beside.start()
        with pytest.raises(KeyboardInterrupt):
            without_noise(IsolatedEngine(Endless(tmp_path / "under way"), 1))(np.zeros((1, 1)))
        assert [worker.exitcode for worker in workers] == [-signal.SIGKILL]
    finally:
        beside.join()
        end_workers()
        signal.signal(signal.SIGINT, handler)


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_command_that_is_interrupted_waits_for_no_thread(name: str, status: int) -> None:
    """Nor does it forget what is to be done at the end of a process.

    The errors of that, and of threads that fail when their work is taken away, are not shown.
    """
    code = f"""
import atexit, os, signal, sys, threading, time
from mcnav import cli
from mcnav.cli.program import command

@command(resumes=True)
def busy():
    threading.Thread(target=time.sleep, args=(100_000,)).start()
    atexit.register(print, "tidied up")
    atexit.register(print, "there was something to tidy up", file=sys.stderr)
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(100_000)
    finally:
        failing = threading.Thread(target=lambda: 1 // 0)
        failing.start()
        failing.join()

sys.argv = ["mcnav", "busy"]
cli.main()
"""
    done = run_to_end([sys.executable, "-c", code], env=environment())
    assert done.returncode == status
    assert done.stdout == "tidied up\n"
    assert done.stderr == "error: interrupted; stored samples are kept, and the same command resumes the run\n"


def test_a_finalizer_that_is_interrupted_leaves_no_message() -> None:
    """A semaphore that was removed, but not told to the process that removes what is left, is nobody's concern."""
    code = """
import _multiprocessing, os
from joblib.externals.loky.backend.synchronize import SemLock
from mcnav.execution.child_processes import interrupts_blocked

with interrupts_blocked():
    lock = SemLock(1, 1, 1)
_multiprocessing.sem_unlink(lock._semlock.name)
os._exit(0)
"""
    done = run_to_end([sys.executable, "-c", code], env=environment())
    assert (done.returncode, done.stderr) == (0, "")


INTERRUPTING: Final = """
import os, signal, sys
from pathlib import Path

if any(name in " ".join(sys.orig_argv) for name in ("popen_loky", "spawn_main")):
    try:
        Path("once").touch(exist_ok=False)
        os.killpg(0, signal.SIGINT)
    except FileExistsError:
        pass
"""
"""What Python imports when it starts: the first worker interrupts all processes of the command."""


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "campaigns/01_tn_d1772_trajectory_4.toml", "--engine", "reference", "--samples", "70", "--jobs", "2"),
        ("run", "campaigns/13_boost.toml", "--samples", "2"),
        ("run", "campaigns/01_tn_d1772_trajectory_4.toml", "--samples", "70", "--dask", "2"),
    ],
    ids=["pool", "one worker", "dask"],
)
def test_workers_that_are_being_started_say_nothing(arguments: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(INTERRUPTING)
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    there = environment() | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    done = run_to_end(command(*arguments, "--out", "there"), cwd=tmp_path, env=there)
    message = "error: interrupted; stored samples are kept, and the same command resumes the run\n"
    assert (done.returncode, done.stderr) == (130, message)
    assert (tmp_path / "once").exists()
