"""One chunk of a run: drawn, simulated and stored by one worker."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav._types import Array
from mcnav.lincov.block_sums import Normalization
from mcnav.lincov.sample_reduction import reduce_samples
from mcnav.sampling.error_model import ErrorModel
from mcnav.scenarios.failure import Failure, Reason
from mcnav.scenarios.inputs import InputFile
from mcnav.scenarios.protocol import Batch, Engine, SimulationResult, StochasticEngine
from mcnav.scenarios.sample_loop import SampleFailed, simulate_each
from mcnav.scenarios.timeouts import SampleTimeout, time_limit
from mcnav.store import histories
from mcnav.store.inputs import check_unchanged
from mcnav.store.parts import ChunkTotals, Part, SampleSchema, whole_part, write_part
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import KEPT, MARK, MOST_REASONS, Summary, summary_chunk

PROBES: Final = 64
"""Samples on which an engine's accuracy is settled: the first of the campaign itself."""


@dataclass(frozen=True)
class DrawPlan:
    """The samples of a campaign; see `ErrorModel.draw`."""

    errors: ErrorModel
    design: str
    seed: int
    samples: int

    def draw(self, begin: int, end: int) -> Array:
        """Draw samples [begin, end), or fewer at the campaign's end, shape (n, sources)."""
        return self.errors.draw(self.design, self.seed, self.samples, begin, min(end, self.samples))

    def batch(self, begin: int, end: int) -> Batch:
        """Draw samples [begin, end), or fewer at the campaign's end."""
        errors = self.draw(begin, end)
        return Batch(np.arange(begin, begin + len(errors)), errors, self.seed)

    def probes(self) -> Array:
        """Draw the samples on which an engine's accuracy is settled, shape (n, sources)."""
        return self.draw(0, PROBES)


@dataclass(frozen=True)
class ChunkJob:
    """All that a worker needs for any chunk of a run.

    Attributes
    ----------
    identity : str
        Digest of the run.
    timeout : float or None
        Time that one sample may take, s.
    frame : Normalization or None
        How samples are reduced to sums, where only a summary is stored.
    wanted : Path or None
        A file that exists as long as the run lasts: later no worker may write into the folder.
    inputs : tuple of InputFile
        Files that the scenario reads: a chunk is stored only when they have not changed.
    """

    draws: DrawPlan
    engine: Engine
    folder: RunFolder
    identity: str
    layout: SampleSchema
    timeout: float | None = None
    frame: Normalization | None = None
    wanted: Path | None = None
    inputs: tuple[InputFile, ...] = ()

    @property
    def in_processes(self) -> bool:
        """Whether chunks need worker processes: time limits use signals, which reach main threads only."""
        return self.engine.parallel == "processes" or self.timeout is not None

    @property
    def chunk(self) -> int:
        """Samples of a chunk: part of engine and campaign, never of the number of workers."""
        return self.engine.chunk if self.frame is None else summary_chunk(self.engine.chunk, self.draws.samples)


class RunCancelled(Exception):
    """Raised in a worker when the run has ended or was interrupted."""


@dataclass(frozen=True)
class SampleRange:
    """A chunk by its number, and its samples [begin, end)."""

    number: int
    begin: int
    end: int


def simulate_batch(engine: Engine, batch: Batch) -> SimulationResult:
    """Simulate samples, with their noise where the engine has any."""
    return engine.simulate(batch) if isinstance(engine, StochasticEngine) else engine.propagate(batch.errors)


def simulate_samples(engine: Engine, timeout: float | None, outputs: int, batch: Batch) -> SimulationResult:
    """Simulate samples; what an engine raises fails only the samples that cause it."""
    count = len(batch.errors)
    with time_limit(timeout):
        try:
            result = simulate_batch(engine, batch)
        except MemoryError:
            raise
        except (Exception, SampleTimeout):
            if isinstance(engine, StochasticEngine):
                raise
            each = simulate_each(lambda row: _simulate_one(engine, batch.errors[row]), range(count))
            result = each.outcomes(np.full((count, outputs), np.nan))
    lost = np.flatnonzero(~np.isfinite(result.values).all(axis=1))
    failures = {int(row): Failure.of(Reason.NOT_FINITE) for row in lost} | dict(result.failures)
    values = result.values.copy()
    values[list(failures)] = np.nan
    return replace(result, values=values, failures=failures)


def _simulate_one(engine: Engine, errors: Array) -> Array:
    result = engine.propagate(errors[None, :])
    if result.failures:
        raise SampleFailed(result.failures[0])
    return np.asarray(result.values[0])


def simulate_chunk(work: ChunkJob, place: SampleRange) -> Part:
    """Draw, simulate and store one chunk."""
    check_unchanged(work.inputs, work.folder.path)
    with threadpool_limits(1):
        outputs, pieces = len(work.layout.outputs), draw_pieces(work, place)
        return store(
            work,
            place,
            ((batch.errors, simulate_samples(work.engine, work.timeout, outputs, batch)) for batch in pieces),
        )


def draw_pieces(work: ChunkJob, place: SampleRange) -> Iterator[Batch]:
    """Draw a chunk's samples, in pieces of the engine's own chunk."""
    step = work.engine.chunk
    for begin in range(place.begin, place.end, step):
        yield work.draws.batch(begin, min(begin + step, place.end))


def store(work: ChunkJob, place: SampleRange, results: Iterable[tuple[Array, SimulationResult]]) -> Part:
    """Store a chunk that comes in pieces: its samples, or its summary, for which one piece at a time is in memory."""
    folder, identity, layout = work.folder.parts, work.identity, work.layout
    if work.frame is None:
        ((errors, result),) = results
        marks = histories.history_marks(work.engine, errors, result.history)
        check_not_cancelled(work)
        return write_part(folder, place.number, place.begin, identity, layout, errors, result, marks)
    begin, fallback_count, power_sums = place.begin, 0, None
    total: Summary | None = None
    rows: list[tuple[Array, SimulationResult]] = []
    tracebacks: dict[int, str] = {}
    for errors, result in results:
        failures = dict(sorted(result.failures.items()))
        status = {begin + row: failure.status for row, failure in failures.items()}
        sums = reduce_samples(work.frame, begin, errors, result.values, result.linear_values)
        summary = Summary.of(sums, len(errors), status)
        total = summary if total is None else total + summary
        raised = ((row, failure.traceback) for row, failure in failures.items() if failure.traceback)
        for row, text in islice(raised, MOST_REASONS - len(tracebacks)):
            tracebacks[begin - place.begin + row] = text
        power_sums = histories.add_power_sums(power_sums, histories.history_sums(work.engine, errors, result.history))
        fallback_count += result.fallback_count
        kept = min(max(KEPT - begin, 0), len(errors))
        kept_failures = {row: failure for row, failure in failures.items() if row < kept}
        linear = None if result.linear_values is None else result.linear_values[:kept].copy()
        first = SimulationResult(result.values[:kept].copy(), kept_failures, linear_values=linear)
        rows.append((errors[:kept].copy(), first))
        begin += len(errors)
    if total is None:
        raise ValueError("a chunk has at least one sample")
    marks = {**histories.history_marks_of(power_sums), MARK: total.as_mark()}
    errors, result = _concatenate(rows)
    failed = sum(count.samples for count in total.failures.values())
    totals = ChunkTotals(total.samples, failed, fallback_count, tracebacks)
    check_not_cancelled(work)
    return write_part(folder, place.number, place.begin, identity, layout, errors, result, marks, totals)


def check_not_cancelled(work: ChunkJob) -> None:
    """Raise `RunCancelled` when the run is over, `RunFolderError` when a file that the scenario reads has changed."""
    check_unchanged(work.inputs, work.folder.path)
    if work.wanted is None:
        return
    try:
        work.wanted.read_bytes()  # on a shared file system a look at the folder may be out of date
    except OSError:
        raise RunCancelled(f"{work.folder.path}: no run wants this chunk any more") from None


def _concatenate(rows: Sequence[tuple[Array, SimulationResult]]) -> tuple[Array, SimulationResult]:
    """Join pieces of a chunk."""
    failures: dict[int, Failure] = {}
    begin = 0
    for errors, result in rows:
        failures |= {begin + row: failure for row, failure in result.failures.items()}
        begin += len(errors)
    values = np.concatenate([result.values for _, result in rows])
    linear = [result.linear_values for _, result in rows if result.linear_values is not None]
    joined = SimulationResult(values, failures, linear_values=np.concatenate(linear) if linear else None)
    return np.concatenate([errors for errors, _ in rows]), joined


def find_part(work: ChunkJob, number: int) -> Part | None:
    """Return the part of a number, if it is stored undamaged by this run."""
    return whole_part(work.folder.parts, number, work.identity, None if work.frame is None else KEPT)


def find_range(work: ChunkJob, place: SampleRange) -> Part | None:
    """Return the part of a chunk, if it is stored undamaged by this run."""
    part = find_part(work, place.number)
    return part if part is not None and (part.begin, part.end) == (place.begin, place.end) else None
