"""Chunks simulated in worker processes that may die.

A worker that dies ends its pool; stored chunks are kept. The first time, all remaining chunks go to a new pool. When
that dies as well, the next chunks are simulated one at a time, and a chunk that ends its worker again sample by sample:
only the sample at fault fails.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav._subprocess import end_with_parent, interrupts_blocked
from mcnav._types import Array
from mcnav.contract.engine import ConditionalEngine, ConditionalNoise, Engine, conditions_noise
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import ScenarioError
from mcnav.runner.chunks import (
    ChunkJob,
    SampleRange,
    check_not_cancelled,
    draw_pieces,
    find_chunk,
    simulate_batch,
    simulate_chunk,
    store,
)
from mcnav.runner.memory import SMALL_PIECES, keep_freed_memory
from mcnav.store.chunk_files import ChunkFile
from mcnav.systems.sample_loop import join_results
from mcnav.systems.timeouts import timeout_message

if TYPE_CHECKING:
    from joblib.externals.loky.process_executor import ProcessPoolExecutor

TRIED_WHOLE: Final = 2
"""Pools that may die before chunks are simulated one at a time."""

IDLE: Final = 60.0
"""Seconds after which an unused isolated process ends."""


def _begin_worker(parent: int) -> None:
    """Let a worker process end with its parent, and keep the memory of a step for the next one."""
    end_with_parent(parent)
    keep_freed_memory(*SMALL_PIECES)


_isolated_executors: dict[int, ProcessPoolExecutor] = {}
"""One isolated process for each thread; joblib keeps its own pool."""


def _isolated_worker() -> ProcessPoolExecutor:
    from joblib.externals.loky.process_executor import ProcessPoolExecutor  # a twentieth of a second, as joblib

    thread = threading.get_ident()
    if thread not in _isolated_executors:
        executor = ProcessPoolExecutor(1, timeout=IDLE, initializer=_begin_worker, initargs=(os.getpid(),))
        _isolated_executors[thread] = executor
    return _isolated_executors[thread]


def _submit(task: Callable[..., Any], *arguments: Any) -> Future[Any]:
    """Submit a task to the isolated process, which starts unless it runs."""
    with interrupts_blocked():
        submitted: Future[Any] = _isolated_worker().submit(task, *arguments)
    return submitted


def end_workers() -> None:
    """Kill all worker processes: what they have simulated is stored, and an orderly end takes seconds.

    Without ``reuse`` loky would let the workers of joblib's pool end in order and start another pool.
    """
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True, kill_workers=True).shutdown(wait=True, kill_workers=True)
    end_workers_apart()


def end_workers_apart() -> None:
    """End the isolated processes."""
    while _isolated_executors:
        _isolated_executors.popitem()[1].shutdown(wait=True, kill_workers=True)


def _run_pool(work: ChunkJob, places: Sequence[SampleRange], jobs: int) -> Iterator[tuple[int, ChunkFile]]:
    """Simulate chunks in worker processes; yield their numbers and files. Raises `BrokenExecutor`."""
    workers = min(jobs, len(places))
    if workers == 1:  # joblib would use this process
        yield from (_submit(_numbered, work, place).result() for place in places)
        return
    from joblib import Parallel, delayed

    with interrupts_blocked():
        result = Parallel(
            n_jobs=workers,
            return_as="generator_unordered",
            backend="loky",
            initializer=_begin_worker,
            initargs=(os.getpid(),),
        )(delayed(_numbered)(work, place) for place in places)
    yield from result


def run_in_processes(work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[ChunkFile, None, None]:
    """Simulate the missing chunks; yield their files as they become ready."""
    left = {place.number: place for place in missing}
    broken = 0
    while left:
        try:
            for number, stored in _run_pool(work, tuple(left.values()), jobs):
                del left[number]
                yield stored
        except BrokenExecutor:
            broken += 1
            end_workers()
            for place in list(left.values()):
                chunk = find_chunk(work, place)
                if chunk is not None:
                    del left[place.number]
                    yield chunk
            if broken >= TRIED_WHOLE:
                for place in list(left.values())[: 2 * jobs]:
                    del left[place.number]
                    yield simulate_isolated(work, place)
                end_workers()


def _numbered(work: ChunkJob, place: SampleRange) -> tuple[int, ChunkFile]:
    return place.number, simulate_chunk(work, place)


def _ready() -> None:
    """Let a worker import what it needs."""


def _in_one_worker(task: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task in an isolated process; none when the process dies. An interrupt kills the process."""
    try:
        return _submit(task, *arguments).result()
    except (BrokenExecutor, KeyboardInterrupt) as end:
        executor = _isolated_executors.pop(threading.get_ident(), None)
        if executor is not None:
            executor.shutdown(wait=True, kill_workers=True)
        if isinstance(end, KeyboardInterrupt):
            raise
        return None


@dataclass(frozen=True)
class IsolatedEngine:
    """An engine in a process of its own: when that dies, its samples have failed."""

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

    @property
    def epochs(self) -> Epochs | None:
        """See `Engine`."""
        return self.engine.epochs

    @property
    def noisy(self) -> bool:
        """See `Engine`."""
        return self.engine.noisy

    @property
    def filter(self) -> FilterSchema | None:
        """See `Engine`."""
        return self.engine.filter

    def in_one(self, batch: Batch, noise: bool = True) -> SimulationResult | None:
        """Simulate samples; none when the process dies."""
        outcomes = _in_one_worker(simulate_batch, self.engine, self.timeout, self.outputs, batch, noise)
        return outcomes if isinstance(outcomes, SimulationResult) else None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        _in_one_worker(_ready)  # starting the process takes time that is not the samples'
        began = time.monotonic()
        result = self.in_one(batch, noise)
        if result is not None:
            return result
        failure = Failure.of(Reason.PROCESS_DIED)
        if self.timeout is not None and time.monotonic() - began > self.timeout:
            failure = Failure(Reason.TIMEOUT, timeout_message(self.timeout))
        count = len(batch.errors)
        return SimulationResult(np.full((count, self.outputs), np.nan), dict.fromkeys(range(count), failure))

    def simulate_each(self, batch: Batch) -> SimulationResult:
        """Simulate samples one by one, so that only the one at fault fails."""
        return join_results([self.simulate(batch[row : row + 1]) for row in range(len(batch.errors))])


@dataclass(frozen=True)
class ConditionalIsolatedEngine(IsolatedEngine):
    """The same of an engine that simulates samples under conditions on their noise."""

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalNoise:
        """Return the samples with conditions on what noise adds to some outputs."""
        found: ConditionalNoise | None = _in_one_worker(_conditional_noise, self.engine, outputs, epochs)
        if found is None:
            raise ScenarioError("type", "the process died that computes what noise adds to outputs")
        return _IsolatedNoise(self, found)


def _conditional_noise(
    engine: ConditionalEngine, outputs: tuple[int, ...], epochs: tuple[int, ...] | None
) -> ConditionalNoise:
    return engine.conditional_noise(outputs, epochs)


@dataclass(frozen=True)
class _IsolatedNoise:
    """Samples with conditions on their noise in a process of its own."""

    isolated: IsolatedEngine
    conditional: ConditionalNoise

    @property
    def factor(self) -> Array:
        """See `ConditionalNoise`."""
        return self.conditional.factor

    def simulate(self, batch: Batch, normals: Array) -> SimulationResult:
        """See `ConditionalNoise`."""
        engine = _ErrorsAndNoise(self.isolated.engine, self.conditional)
        widened = Batch(batch.index, np.column_stack([batch.errors, normals]), batch.seed)
        return IsolatedEngine(engine, self.isolated.outputs, self.isolated.timeout).simulate(widened)


@dataclass(frozen=True)
class _ErrorsAndNoise:
    """An engine of samples whose last errors are normals of their noise."""

    engine: Engine
    conditional: ConditionalNoise
    epochs: Epochs | None = None
    filter: FilterSchema | None = None
    noisy: bool = True

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

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        own = batch.errors.shape[1] - self.conditional.factor.shape[1]
        errors, normals = np.split(batch.errors, [own], axis=1)
        return self.conditional.simulate(Batch(batch.index, errors, batch.seed), normals)


def isolated_engine(engine: Engine, outputs: int, timeout: float | None) -> IsolatedEngine:
    """Return an engine in a process of its own."""
    kind = ConditionalIsolatedEngine if conditions_noise(engine) else IsolatedEngine
    return kind(engine, outputs, timeout)


def simulate_isolated(work: ChunkJob, place: SampleRange) -> ChunkFile:
    """Simulate one chunk in an isolated process; if that dies, each of its samples."""
    stored = _in_one_worker(simulate_chunk, work, place)
    if isinstance(stored, ChunkFile):
        return stored
    check_not_cancelled(work)
    isolated = IsolatedEngine(work.engine, len(work.layout.outputs), work.timeout)
    several = place.end - place.begin > work.engine.chunk  # then another piece may be at fault

    def simulate(batch: Batch) -> SimulationResult:
        return (isolated.in_one(batch) if several else None) or isolated.simulate_each(batch)

    return store(work, place, ((batch.errors, simulate(batch)) for batch in draw_pieces(work, place)))
