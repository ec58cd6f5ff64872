"""Chunks flown in worker processes, also when workers die under them.

A worker that is killed, or that its own code ends, takes the pool with it. What the others had stored by then is kept.
The first time everything that is left is given to a new pool: someone may have killed a worker. When that one dies as
well, the chunks that were next in turn are flown one at a time, and one that ends its worker even then is flown sample
by sample, so that only the sample at fault fails.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import BrokenProcessPool, ProcessPoolExecutor

from mcnav._subprocess import end_with_parent
from mcnav._types import Array
from mcnav.execution.chunks import (
    ChunkJob,
    SampleRange,
    check_not_cancelled,
    draw_pieces,
    find_range,
    simulate_chunk,
    simulate_errors,
    store,
)
from mcnav.scenarios.failure import Failure, Reason
from mcnav.scenarios.protocol import Engine, SimulationResult
from mcnav.scenarios.timeouts import timeout_message
from mcnav.store.parts import Part

TRIED_WHOLE: Final = 2
"""Pools that may die before chunks are flown one at a time."""

IDLE: Final = 60.0
"""Seconds after which a process for what is flown apart ends by itself: that of a cluster's worker outlives no run."""


_alone_executors: dict[int, ProcessPoolExecutor] = {}
"""One worker for what each thread flies apart; joblib keeps its own."""


def _alone_worker() -> ProcessPoolExecutor:
    thread = threading.get_ident()
    if thread not in _alone_executors:
        executor = ProcessPoolExecutor(1, timeout=IDLE, initializer=end_with_parent, initargs=(os.getpid(),))
        _alone_executors[thread] = executor
    return _alone_executors[thread]


def end_workers() -> None:
    """End all worker processes."""
    get_reusable_executor().shutdown(wait=True, kill_workers=True)
    end_workers_apart()


def end_workers_apart() -> None:
    """End the processes for what is flown apart."""
    while _alone_executors:
        _alone_executors.popitem()[1].shutdown(wait=True, kill_workers=True)


def _flights(work: ChunkJob, places: Sequence[SampleRange], jobs: int) -> Iterator[tuple[int, Part]]:
    """Numbers and parts of some chunks, from worker processes also when there is only one; `BrokenProcessPool`."""
    workers = min(jobs, len(places))
    if workers == 1:  # for which joblib would take this process
        yield from (_alone_worker().submit(_numbered, work, place).result() for place in places)
        return
    yield from Parallel(
        n_jobs=workers,
        return_as="generator_unordered",
        backend="loky",
        initializer=end_with_parent,
        initargs=(os.getpid(),),
    )(delayed(_numbered)(work, place) for place in places)


def run_in_processes(work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[Part, None, None]:
    """Parts of the missing chunks, as they become ready."""
    left = {place.number: place for place in missing}
    broken = 0
    while left:
        try:
            for number, part in _flights(work, tuple(left.values()), jobs):
                del left[number]
                yield part
        except BrokenProcessPool:
            broken += 1
            end_workers()
            for place in list(left.values()):
                known = find_range(work, place)
                if known is not None:
                    del left[place.number]
                    yield known
            if broken >= TRIED_WHOLE:
                for place in list(left.values())[: 2 * jobs]:
                    del left[place.number]
                    yield simulate_isolated(work, place)
                end_workers()


def _numbered(work: ChunkJob, place: SampleRange) -> tuple[int, Part]:
    return place.number, simulate_chunk(work, place)


def _ready() -> None:
    """Let a worker import what it needs."""


def _in_one_worker(task: Callable[..., Any], *arguments: Any) -> Any:
    """A task in a process of its own; none when the process dies."""
    try:
        return _alone_worker().submit(task, *arguments).result()
    except BrokenProcessPool:
        executor = _alone_executors.pop(threading.get_ident(), None)
        if executor is not None:
            executor.shutdown(wait=True, kill_workers=True)
        return None


@dataclass(frozen=True)
class IsolatedEngine:
    """An engine whose flights go to a process of their own: when that dies, they have failed, and nothing else."""

    engine: Engine
    outputs: int
    timeout: float | None = None

    @property
    def parallel(self) -> str:
        """See `Engine`."""
        return self.engine.parallel

    @property
    def chunk(self) -> int:
        """See `Engine`."""
        return self.engine.chunk

    @property
    def accuracy(self) -> str:
        """See `Engine`."""
        return self.engine.accuracy

    def in_one(self, errors: Array) -> SimulationResult | None:
        """Outcomes of samples, shape (n, sources); none when the process dies."""
        outcomes = _in_one_worker(simulate_errors, self.engine, self.timeout, self.outputs, errors)
        return outcomes if isinstance(outcomes, SimulationResult) else None

    def propagate(self, errors: Array) -> SimulationResult:
        """Fly samples, shape (n, sources)."""
        _in_one_worker(_ready)  # starting the process takes time that is not the samples'
        began = time.monotonic()
        result = self.in_one(errors)
        if result is not None:
            return result
        failure = Failure.of(Reason.PROCESS_DIED)
        if self.timeout is not None and time.monotonic() - began > self.timeout:
            failure = Failure(Reason.TIMEOUT, timeout_message(self.timeout))
        values = np.full((len(errors), self.outputs), np.nan)
        return SimulationResult(values, dict.fromkeys(range(len(errors)), failure))


def simulate_isolated(work: ChunkJob, place: SampleRange) -> Part:
    """One chunk in a process of its own; if that dies, each of its samples."""
    part = _in_one_worker(simulate_chunk, work, place)
    if isinstance(part, Part):
        return part
    check_not_cancelled(work)
    guarded = IsolatedEngine(work.engine, len(work.layout.outputs), work.timeout)
    several = place.end - place.begin > work.engine.chunk
    return store(work, place, ((errors, _apart(guarded, errors, several)) for errors in draw_pieces(work, place)))


def _apart(guarded: IsolatedEngine, errors: Array, several: bool) -> SimulationResult:
    """One piece of a chunk: whole, when there are several of which another may be at fault, else sample by sample."""
    if several:
        outcomes = guarded.in_one(errors)
        if outcomes is not None:
            return outcomes
    each = [guarded.propagate(errors[row : row + 1]) for row in range(len(errors))]
    return SimulationResult(
        np.concatenate([one.values for one in each]),
        {row: failure for row, one in enumerate(each) for failure in one.failures.values()},
        sum(one.fallback_count for one in each),
    )
