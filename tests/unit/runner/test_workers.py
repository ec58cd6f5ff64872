"""The workers that a run starts, by a clock of the test: as many as are worth it, and no more."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from mcnav.runner import processes
from mcnav.runner.chunks import SampleRange
from mcnav.runner.worker_processes import submit

COST = 4.0
"""Time that a worker takes until it simulates, s."""


@dataclass
class Machine:
    """Processes that take a known time for a chunk; one that has to start takes its cost before."""

    seconds: float
    now: float = 0.0
    ends: dict[Future[Any], float] = field(default_factory=dict)
    workers: list[int] = field(default_factory=list)

    def monotonic(self) -> float:
        """Return the time."""
        return self.now

    def submit(self, task: Any, work: Any, place: SampleRange, worker: int = 0) -> Future[Any]:
        """Begin a chunk."""
        future: Future[Any] = Future()
        starting = COST if worker and worker not in self.workers else 0.0
        self.ends[future] = self.now + starting + self.seconds
        self.workers.append(worker)
        future.set_result((place.number, None))
        return future

    def wait(
        self, running: Iterable[Future[Any]], timeout: float | None, **_: Any
    ) -> tuple[set[Future[Any]], set[Any]]:
        """Go on to the end of the next chunk, or by the timeout."""
        following = min(running, key=lambda future: self.ends[future])
        late = timeout is not None and self.ends[following] > self.now + timeout
        self.now = self.now + (timeout or 0.0) if late else self.ends[following]
        return (set() if late else {following}), set()


def simulated(monkeypatch: pytest.MonkeyPatch, chunks: int, seconds: float, jobs: int) -> tuple[set[int], float]:
    """Return the numbers of the workers that had chunks, and the time that all took."""
    machine = Machine(seconds)
    monkeypatch.setattr(processes, "time", machine)
    monkeypatch.setattr(processes, "submit", machine.submit)
    monkeypatch.setattr(processes, "wait", machine.wait)
    monkeypatch.setattr(processes, "start_first", lambda: COST)
    places = [SampleRange(number, number, number + 1) for number in range(chunks)]
    numbers = [number for number, _ in processes._run_pool(None, places, jobs)]  # type: ignore[arg-type]
    assert sorted(numbers) == list(range(chunks))
    return set(machine.workers), machine.now


@pytest.mark.parametrize(
    ("chunks", "seconds", "jobs", "workers"),
    [
        (8, 0.1, 2, 1),  # 256 samples of a reentry's reference engine
        (8, 1.99, 2, 1),  # four chunks of two seconds are twice what a worker costs
        (8, 2.01, 2, 2),
        (100, 0.15, 2, 1),
        (100, 0.17, 2, 2),
        (2, 10.0, 2, 2),  # noticed while the first one is simulated
        (2, 7.9, 2, 1),
        (1, 1e3, 2, 1),
        (8, 10.0, 1, 1),
        (9, 10.0, 4, 4),
        (3, 10.0, 8, 3),
    ],
)
def test_workers_are_those_that_are_worth_it(
    chunks: int, seconds: float, jobs: int, workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks are all simulated once, and never later than by one worker."""
    used, took = simulated(monkeypatch, chunks, seconds, jobs)
    assert used == set(range(workers))
    assert took <= chunks * seconds * (1.0 + 1e-9) + (COST if workers > 1 else 0.0)


def test_several_workers_take_less_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty chunks of ten seconds: half of 200 s, the cost of the other worker and a chunk more at most."""
    _, took = simulated(monkeypatch, 20, 10.0, 2)
    assert took <= 100.0 + COST + 10.0


def test_a_worker_works_where_its_caller_does(tmp_path: Path) -> None:
    """A process that began in another folder, also in one that has gone, reads relative paths from the new one."""
    folders, numbers = [tmp_path / name for name in ("one", "two")], set[int]()
    for folder in folders:
        folder.mkdir()
        with contextlib.chdir(folder):
            assert submit(Path.cwd).result() == folder
            numbers.add(submit(os.getpid).result())
        folder.rmdir()
    assert len(numbers) == 1
