"""One chunk of a run: drawn, simulated and stored by one worker."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, has_histories, smoother_of
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.entries.inputs import InputFile
from mcnav.execution.threads import one_thread
from mcnav.linear.block_sums import Normalization
from mcnav.linear.sample_reduction import BlockReduction
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.runner.draws import DrawPlan
from mcnav.statistics.filter_sums import FilterSums
from mcnav.store.chunk_files import (
    ChunkFile,
    ChunkTotals,
    SampleSchema,
    chunk_name,
    identity_in,
    verify_chunk,
    write_chunk,
)
from mcnav.store.filters import SMOOTHER_MARK, filter_marks
from mcnav.store.histories import FIRST_SMOOTHED_MARK, SMOOTHED_MARK, STORED, first_marks, history_marks
from mcnav.store.inputs import check_unchanged
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import MOST_REASONS, STORED_ROWS, Summary, summary_chunk
from mcnav.systems.guard import CodeMisbehaved
from mcnav.systems.sample_loop import simulate_alone
from mcnav.systems.timeouts import SampleTimeout, time_limit

Sums = TypeVar("Sums", PowerSums, FilterSums, Summary)
"""Sums over samples, which add up."""


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
        Normalization of the sums, where only a summary is stored.
    earlier : tuple of str
        Digests of runs of fewer samples whose summaries have blocks half as long, a quarter, and so on.
    wanted : Path or None
        File that exists as long as the run lasts: later no worker may write into the folder.
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
    earlier: tuple[str, ...] = ()

    @property
    def in_processes(self) -> bool:
        """Return whether chunks need worker processes: time limits use signals, which reach main threads only."""
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


def simulate_batch(
    engine: Engine, timeout: float | None, outputs: int, batch: Batch, noise: bool = True
) -> SimulationResult:
    """Simulate samples, with noise where the engine has any; what it raises fails only the samples that cause it."""

    def simulate(some: Batch) -> SimulationResult:
        return engine.simulate(some, noise)

    with time_limit(timeout):
        try:
            result = simulate(batch)
        except (MemoryError, CodeMisbehaved):
            raise
        except (Exception, SampleTimeout):
            result = simulate_alone(lambda row: simulate(batch[row : row + 1]), len(batch.errors), outputs)
    lost = np.flatnonzero(~np.isfinite(result.values).all(axis=1))
    failures = {int(row): Failure.of(Reason.NOT_FINITE) for row in lost} | dict(result.failures)
    values = result.values.copy()
    values[list(failures)] = np.nan
    return replace(result, values=values, failures=failures)


def simulate_chunk(work: ChunkJob, place: SampleRange) -> ChunkFile:
    """Draw, simulate and store one chunk."""
    check_unchanged(work.inputs, work.folder.path)
    outputs = len(work.layout.outputs)
    with one_thread():
        pieces = draw_pieces(work, place)
        results = ((batch.errors, simulate_batch(work.engine, work.timeout, outputs, batch)) for batch in pieces)
        return store(work, place, results)


def draw_pieces(work: ChunkJob, place: SampleRange) -> Iterator[Batch]:
    """Draw a chunk's samples, in pieces of the engine's own chunk."""
    step = work.engine.chunk
    for begin in range(place.begin, place.end, step):
        yield work.draws.batch(begin, min(begin + step, place.end))


@dataclass
class _Chunk:
    """A chunk being put together from its pieces: rows that are stored, and sums over all of its samples."""

    work: ChunkJob
    place: SampleRange
    done: int = 0
    failed: int = 0
    fallback_count: int = 0
    summary: Summary | None = None
    reduction: BlockReduction | None = None
    power_sums: PowerSums | None = None
    filter_sums: FilterSums | None = None
    smoothed_sums: PowerSums | None = None
    smoother_sums: FilterSums | None = None
    followed: Array | None = None
    followed_smoothed: Array | None = None
    rows: list[tuple[Array, ...]] = field(default_factory=list)
    failures: dict[int, Failure] = field(default_factory=dict)
    tracebacks: dict[int, str] = field(default_factory=dict)

    def add(self, errors: Array, result: SimulationResult) -> None:
        """Add a piece: errors of its samples, shape (n, sources), and their outcomes."""
        by_row = dict(sorted(result.failures.items()))
        self._add_rows(errors, result, by_row)
        self._add_histories(errors, result, by_row)
        self.failed += len(by_row)
        self.fallback_count += result.fallback_count
        self.done += len(errors)

    def _add_rows(self, errors: Array, result: SimulationResult, by_row: Mapping[int, Failure]) -> None:
        """Keep the rows that are stored, and add a summary of all where the run has one."""
        work, begin, frame = self.work, self.place.begin + self.done, self.work.frame
        stored = self.place.end if frame is None else STORED_ROWS
        count = min(max(stored - begin, 0), len(errors))
        linear = np.full((len(errors), len(work.layout.linear)), np.nan)  # nothing of samples whose process died
        linear = linear if result.linear_values is None else result.linear_values
        filters = _final_filters(work.engine.filter, result)
        self.rows.append(tuple(array[:count].copy() for array in (errors, result.values, linear, filters)))
        self.failures |= {self.done + row: failure for row, failure in by_row.items() if row < count}
        raised = ((self.done + row, failure.traceback) for row, failure in by_row.items() if failure.traceback)
        self.tracebacks |= dict(islice(raised, None if frame is None else MOST_REASONS - len(self.tracebacks)))
        if frame is not None:
            status = {begin + row: failure.status for row, failure in by_row.items()}
            self.reduction = self.reduction or BlockReduction(frame, begin)
            block_sums = self.reduction.add(errors, result.values, result.linear_values)
            self.summary = _total(self.summary, Summary.of(block_sums, len(errors), status))

    def _add_histories(self, errors: Array, result: SimulationResult, by_row: Mapping[int, Failure]) -> None:
        """Add the sums over time, and keep the histories of the campaign's first samples where they are slow."""
        engine, schema, begin = self.work.engine, self.work.engine.filter, self.place.begin + self.done
        sums = None if result.history is None else sum_powers_about_zero(result.history)
        if has_histories(engine):
            sums = engine.history_sums(errors)
        if sums is not None:
            self.power_sums = _total(self.power_sums, sums)
        if schema is not None and result.history is not None and begin < STORED:  # slow: not to be simulated again
            self.followed = _followed(self.followed, result.history, begin)
        if schema is not None and result.filter_values is not None:
            simulated = np.delete(result.filter_values, list(by_row), axis=0) if by_row else result.filter_values
            self.filter_sums = _total(self.filter_sums, FilterSums.of(schema, simulated))
        smoother = smoother_of(engine)
        if smoother is not None and result.smoothed_history is not None and result.smoother_values is not None:
            simulated = np.delete(result.smoother_values, list(by_row), axis=0)
            self.smoother_sums = _total(self.smoother_sums, FilterSums.of(smoother, simulated))
            self.smoothed_sums = _total(self.smoothed_sums, sum_powers_about_zero(result.smoothed_history))
        if smoother is not None and result.smoothed_history is not None and begin < STORED:
            self.followed_smoothed = _followed(self.followed_smoothed, result.smoothed_history, begin)

    def marks(self) -> dict[str, str]:
        """Return the sums as metadata of the chunk's file."""
        marks = history_marks(self.power_sums) | filter_marks(self.filter_sums) | first_marks(self.followed)
        marks |= history_marks(self.smoothed_sums, SMOOTHED_MARK) | filter_marks(self.smoother_sums, SMOOTHER_MARK)
        marks |= first_marks(self.followed_smoothed, FIRST_SMOOTHED_MARK)
        if self.summary is None or self.reduction is None:
            return marks
        return marks | self.summary.followed_by(self.reduction.rest()).marks(self.place.begin)


def _total(total: Sums | None, more: Sums) -> Sums:
    """Add sums to those of earlier pieces, if there are any."""
    return more if total is None else total + more


def _followed(known: Array | None, histories: Array, begin: int) -> Array:
    """Append the histories, shape (n, m, outputs), of samples from an index on that are among the first."""
    first = histories[: STORED - begin]
    return first if known is None else np.concatenate([known, first])


def store(work: ChunkJob, place: SampleRange, results: Iterable[tuple[Array, SimulationResult]]) -> ChunkFile:
    """Store a chunk that comes in pieces: its samples, or a summary with the rows of the campaign's first samples.

    With a summary, one piece at a time is in memory.
    """
    chunk = _Chunk(work, place)
    for errors, result in results:
        chunk.add(errors, result)
    errors, values, linear, filters = (np.concatenate(columns) for columns in zip(*chunk.rows, strict=True))
    totals = ChunkTotals(place.end - place.begin, chunk.failed, chunk.fallback_count, chunk.tracebacks)
    check_not_cancelled(work)
    return write_chunk(
        work.folder.chunk_folder,
        place.number,
        place.begin,
        work.identity,
        work.layout,
        errors,
        values,
        chunk.failures,
        totals,
        chunk.marks(),
        linear,
        filters,
    )


def _final_filters(schema: FilterSchema | None, result: SimulationResult) -> Array:
    """Return what the samples' filters say at the end, shape (n, outputs + 1), or without a filter (n, 0)."""
    if schema is None:
        return np.empty((len(result.values), 0))
    if result.filter_values is None:
        return np.full((len(result.values), schema.outputs + 1), np.nan)
    return schema.final(result.filter_values)


def check_not_cancelled(work: ChunkJob) -> None:
    """Raise `RunCancelled` when the run is over, `RunFolderError` when a file that the scenario reads has changed."""
    check_unchanged(work.inputs, work.folder.path)
    if work.wanted is None:
        return
    try:
        work.wanted.read_bytes()  # on a shared file system a look at the folder may be out of date
    except OSError:
        raise RunCancelled(f"{work.folder.path}: no run wants this chunk any more") from None


def find_chunk(work: ChunkJob, place: SampleRange) -> ChunkFile | None:
    """Return the file of a chunk, if it is undamaged and of this run."""
    file = find_file(work, place.number)
    return file if file is not None and (file.begin, file.end) == (place.begin, place.end) else None


def find_file(work: ChunkJob, number: int) -> ChunkFile | None:
    """Return the file of a chunk's number, if it is undamaged and of this run, however many samples it has."""
    return verify_chunk(work.folder.chunk_folder, number, work.identity, None if work.frame is None else STORED_ROWS)


def find_earlier(work: ChunkJob, number: int) -> tuple[ChunkFile, int] | None:
    """Return the file of a chunk that a run of fewer samples left, and how often its blocks must be doubled."""
    identity = identity_in(work.folder.chunk_folder / chunk_name(number))
    if identity not in work.earlier:
        return None
    file = verify_chunk(work.folder.chunk_folder, number, identity, STORED_ROWS)
    return None if file is None else (file, work.earlier.index(identity) + 1)
