"""Chunks of samples distributed over the cores; each worker stores its own.

The chunk size depends on the engine, a sample's errors on the campaign and its index, neither on workers: files are the
same, bit for bit, for any number of workers. Numerical libraries use one thread, on which their sums would depend.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from pathlib import Path

from mcnav.errors import TooManyFailures
from mcnav.execution.progress import Progress
from mcnav.runner.chunks import ChunkJob, SampleRange, find_earlier, find_file, simulate_chunk
from mcnav.runner.memory import keep_freed_memory
from mcnav.runner.processes import run_in_processes
from mcnav.runner.worker_processes import end_workers
from mcnav.store.chunk_files import ChunkFile, chunk_name
from mcnav.store.summaries import double_blocks

ChunkExecutor = Callable[[ChunkJob, Sequence[SampleRange], int], Generator[ChunkFile, None, None]]
"""Function that simulates chunks by so many workers and yields their files as they become ready, until it is closed."""


def _run_in_threads(work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[ChunkFile, None, None]:
    keep_freed_memory()
    workers = min(jobs, len(missing))
    if workers <= 1:
        yield from (simulate_chunk(work, place) for place in missing)
        return
    from joblib import Parallel, delayed  # a twentieth of a second, which one chunk does not need

    parallel = Parallel(n_jobs=workers, return_as="generator_unordered", backend="threading")
    yield from parallel(delayed(simulate_chunk)(work, place) for place in missing)


def _refuse_failures(folder: Path, chunks: Sequence[ChunkFile], most: int | None) -> None:
    failed, ready = sum(chunk.failed for chunk in chunks), sum(chunk.end - chunk.begin for chunk in chunks)
    if most is not None and failed > most:
        raise TooManyFailures(f"{folder}: {failed:,} of the {ready:,} samples flown so far failed, where {most:,} may")


def _stored_and_missing(
    work: ChunkJob, first: int, progress: Progress, notice: Callable[[str], None]
) -> tuple[list[ChunkFile], list[SampleRange]]:
    """Find the chunks from a sample on that are stored undamaged, and those that are not."""
    samples, chunk = work.draws.samples, work.chunk
    chunks, missing = [], []
    for number, begin in enumerate(range(first, samples, chunk), start=first // chunk):
        place = SampleRange(number, begin, min(begin + chunk, samples))
        file = find_file(work, number)
        earlier = find_earlier(work, number) if file is None and work.earlier else None
        if earlier is not None:
            file, times = earlier
            if (file.begin, file.end) == (begin, place.end):
                file = double_blocks(work.folder.chunk_folder, file, work.identity, times)
        if file is not None and (file.begin, file.end) == (begin, place.end):
            chunks.append(file)
            progress.advance(place.end - begin, stored=True)
            continue
        missing.append(place)
        path = work.folder.chunk_folder / chunk_name(number)
        if path.exists() and (file is None or file.begin != begin):
            state = "is damaged" if file is None else "begins with another sample"
            notice(f"{path}: {state}; its samples are flown again")
    _delete_other_chunks(work, len(range(0, samples, chunk)))
    return chunks, missing


def _delete_other_chunks(work: ChunkJob, needed: int) -> None:
    """Delete chunks of this run behind those needed that begin elsewhere: of a version with chunks of another size."""
    for path in work.folder.chunk_folder.glob("part-*.parquet"):
        number = int(path.stem.removeprefix("part-"))
        file = find_file(work, number) if number >= needed else None
        if file is not None and file.begin != number * work.chunk:
            path.unlink()


def run_chunks(
    work: ChunkJob,
    jobs: int,
    progress: Progress,
    first: int = 0,
    notice: Callable[[str], None] = lambda line: None,
    most_failures: int | None = None,
    executor: ChunkExecutor | None = None,
) -> tuple[list[ChunkFile], int]:
    """Simulate every chunk that is not stored undamaged.

    Parameters
    ----------
    jobs : int
        Workers: threads for an engine that runs free of the interpreter lock, else processes.
    first : int
        Sample to begin with, the first of a chunk.
    notice : callable
        Receives a line for each stored chunk that is damaged.
    most_failures : int, optional
        Samples that may fail.
    executor : ChunkExecutor, optional
        Used in place of this machine's threads and processes.

    Returns
    -------
    chunks : list of ChunkFile
        All chunks from there on, in order of index.
    simulated : int
        Samples that were not stored already.

    Raises
    ------
    TooManyFailures
        As soon as more samples have failed; what is stored is kept.
    """
    chunks, missing = _stored_and_missing(work, first, progress, notice)
    simulate = executor or (run_in_processes if work.in_processes else _run_in_threads)
    try:
        _refuse_failures(work.folder.path, chunks, most_failures)
        with closing(simulate(work, missing, jobs)) as ready:
            for stored in ready:
                chunks.append(stored)
                progress.advance(stored.end - stored.begin)
                _refuse_failures(work.folder.path, chunks, most_failures)
    finally:
        if work.in_processes or executor is not None:
            end_workers()
    return sorted(chunks, key=lambda chunk: chunk.begin), sum(place.end - place.begin for place in missing)
