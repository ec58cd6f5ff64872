"""The runner: chunks of samples over the cores, each stored by the worker that flew it.

The chunk belongs to the engine, a sample's errors to the campaign and its index. Neither knows of workers, so that the
files come out the same, bit for bit, however many there are. Numerical libraries are held to one thread everywhere:
their sums would depend on it.
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
"""Flies chunks by so many workers and gives their parts as they become ready; closed, it flies no more."""


def _fly_in_threads(work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[Part, None, None]:
    workers = min(jobs, max(1, len(missing)))
    flights = Parallel(n_jobs=workers, return_as="generator_unordered", backend="threading")
    yield from flights(delayed(simulate_chunk)(work, place) for place in missing)


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
    """Fly every chunk that is not already stored whole.

    Parameters
    ----------
    work : ChunkJob
    jobs : int
        Workers: threads for an engine that runs free of the interpreter lock, else processes.
    progress : Progress
        Told how many samples have become ready, each time some do, and first how many are stored already.
    first : int
        Sample to begin with, the first of a chunk.
    notice : callable
        Told, in a line, of each stored chunk that turned out damaged.
    most_failures : int, optional
        Samples that may fail.
    elsewhere : ChunkExecutor, optional
        Who flies in place of this machine's threads and processes.

    Returns
    -------
    parts : list of Part
        All parts from there on, in the order in which they became ready.
    flown : int
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
        known = find_part(work, number)
        if known is not None and (known.begin, known.end) == (begin, place.end):
            parts.append(known)
            progress.advance(place.end - begin, stored=True)
            continue
        missing.append(place)
        path = work.folder.parts / part_name(number)
        if path.exists() and (known is None or known.begin != begin):
            notice(f"{path}: is damaged; its samples are flown again")
    flights = elsewhere or (run_in_processes if work.in_processes else _fly_in_threads)
    try:
        _refuse_failures(work.folder.path, parts, most_failures)
        with closing(flights(work, missing, jobs)) as ready:
            for part in ready:
                parts.append(part)
                progress.advance(part.end - part.begin)
                _refuse_failures(work.folder.path, parts, most_failures)
    finally:
        if work.in_processes or elsewhere is not None:
            end_workers()
    return parts, sum(place.end - place.begin for place in missing)
