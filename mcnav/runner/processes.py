"""Chunks simulated in worker processes that may die.

Processes take one chunk at a time. One begins; the others start when the chunks that are left are worth it.

A worker that dies ends its pool; stored chunks are kept. The first time, all remaining chunks go to a new pool. When
that dies as well, the next chunks are simulated one at a time, and a chunk that ends its worker again sample by sample:
only the sample at fault fails.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
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
from mcnav.runner.worker_processes import end_worker, end_workers, ready, start_first, submit
from mcnav.runner.worth import worth_from
from mcnav.store.chunk_files import ChunkFile
from mcnav.systems.sample_loop import join_results
from mcnav.systems.timeouts import timeout_message

TRIED_WHOLE: Final = 2
"""Pools that may die before chunks are simulated one at a time."""


@dataclass
class _Crew:
    """Workers of a run: one begins, and all others start as soon as the chunks that are left are worth it.

    Attributes
    ----------
    cost : float
        Time that a worker takes to start, s.
    idle : list of int
        Numbers of the workers that have no chunk, and have started or may now.
    begun : float
        When the last chunk was begun, s.
    """

    jobs: int
    cost: float
    idle: list[int] = field(default_factory=lambda: [0])
    alone: bool = True
    begun: float = 0.0

    def patience(self, chunks: int) -> float | None:
        """Return how long to wait for a chunk of the first worker until others are worth it, s; none for ever."""
        threshold = worth_from(self.jobs, chunks, self.cost)
        if not self.alone or math.isinf(threshold):
            return None
        return max(threshold - (time.monotonic() - self.begun), 0.0)

    def start_others(self) -> None:
        """Let all workers take chunks."""
        self.alone = False
        self.idle += range(1, self.jobs)


def _run_pool(work: ChunkJob, places: Sequence[SampleRange], jobs: int) -> Iterator[tuple[int, ChunkFile]]:
    """Simulate chunks in worker processes; yield their numbers and files. Raises `BrokenExecutor`."""
    left, running = deque(places), dict[Future[tuple[int, ChunkFile]], int]()
    crew = _Crew(jobs, math.inf if min(jobs, len(places)) == 1 else start_first())
    while left or running:
        while left and crew.idle:
            worker = crew.idle.pop(0)
            running[submit(_numbered, work, left.popleft(), worker=worker)] = worker
            crew.begun = time.monotonic()
        chunks = len(left) + len(running)
        ready, _ = wait(running, crew.patience(chunks), return_when=FIRST_COMPLETED)
        if crew.patience(chunks) == 0.0:
            crew.start_others()
        for future in ready:
            crew.idle.insert(0, running.pop(future))  # which has loaded all, before one that has to start
            yield future.result()


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


def _in_one_worker(task: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task in an isolated process; none when the process dies. An interrupt kills the process."""
    try:
        return submit(task, *arguments).result()
    except (BrokenExecutor, KeyboardInterrupt) as end:
        end_worker()
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
        _in_one_worker(ready)  # starting the process takes time that is not the samples'
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
