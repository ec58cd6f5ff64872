"""The runner: distributes chunks of samples over the cores; each worker stores its own.

The chunk size depends on the engine, a sample's errors on the campaign and its index, neither on workers: files are the
same, bit for bit, for any number of workers. Numerical libraries use one thread, on which their sums would depend.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from pathlib import Path

from joblib import Parallel, delayed

from mcnav.errors import TooManyFailures
from mcnav.execution.chunks import ChunkJob, SampleRange, find_part, simulate_chunk
from mcnav.execution.processes import end_workers, run_in_processes
from mcnav.progress import Progress
from mcnav.store.parts import Part, part_name

ChunkExecutor = Callable[[ChunkJob, Sequence[SampleRange], int], Generator[Part, None, None]]
"""Simulates chunks by so many workers and yields their parts as they become ready, until it is closed."""


def _run_in_threads(work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[Part, None, None]:
    workers = min(jobs, max(1, len(missing)))
    parallel = Parallel(n_jobs=workers, return_as="generator_unordered", backend="threading")
    yield from parallel(delayed(simulate_chunk)(work, place) for place in missing)


def _refuse_failures(folder: Path, parts: Sequence[Part], most: int | None) -> None:
    if most is None:
        return
    failed, flown = sum(part.failed for part in parts), sum(part.end - part.begin for part in parts)
    if failed > most:
        raise TooManyFailures(f"{folder}: {failed:,} of the {flown:,} samples flown so far failed, where {most:,} may")


def run_chunks(
    work: ChunkJob,
    jobs: int,
    progress: Progress,
    first: int = 0,
    notice: Callable[[str], None] = lambda line: None,
    most_failures: int | None = None,
    elsewhere: ChunkExecutor | None = None,
) -> tuple[list[Part], int]:
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
    elsewhere : ChunkExecutor, optional
        Used in place of this machine's threads and processes.

    Returns
    -------
    parts : list of Part
        All parts from there on, in the order in which they became ready.
    simulated : int
        Samples that were not stored already.

    Raises
    ------
    TooManyFailures
        As soon as more samples have failed; what is stored is kept.
    """
    samples, chunk = work.draws.samples, work.chunk
    parts, missing = [], []
    for number, begin in enumerate(range(first, samples, chunk), start=first // chunk):
        place = SampleRange(number, begin, min(begin + chunk, samples))
        part = find_part(work, number)
        if part is not None and (part.begin, part.end) == (begin, place.end):
            parts.append(part)
            progress.advance(place.end - begin, stored=True)
            continue
        missing.append(place)
        path = work.folder.parts / part_name(number)
        if path.exists() and (part is None or part.begin != begin):
            notice(f"{path}: is damaged; its samples are flown again")
    executor = elsewhere or (run_in_processes if work.in_processes else _run_in_threads)
    try:
        _refuse_failures(work.folder.path, parts, most_failures)
        with closing(executor(work, missing, jobs)) as ready:
            for part in ready:
                parts.append(part)
                progress.advance(part.end - part.begin)
                _refuse_failures(work.folder.path, parts, most_failures)
    finally:
        if work.in_processes or elsewhere is not None:
            end_workers()
    return parts, sum(place.end - place.begin for place in missing)
