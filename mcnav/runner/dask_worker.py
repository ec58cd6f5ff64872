"""Work of a cluster's worker for a run: check that it is compatible, simulate and store chunks.

Results depend on versions, and each worker stores the chunks that it simulates. So a worker must have the run's
versions and see its folder; both are checked before every chunk, because workers come and go during a run.
"""

from __future__ import annotations

import multiprocessing
import os
import platform
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from mcnav.errors import ClusterError
from mcnav.execution.child_processes import end_with_parent
from mcnav.runner.chunks import ChunkJob, SampleRange, find_chunk, simulate_chunk
from mcnav.runner.identity import versions
from mcnav.runner.processes import simulate_isolated
from mcnav.store.chunk_files import ChunkFile


def processor() -> str:
    """Return the processor that code is compiled for; the same versions give the same bits for the same processors."""
    from mcnav.compiled.target import target

    return target()


def incompatibility(needed: Mapping[str, str], wanted: Path | None = None) -> str | None:
    """Return why this process must not simulate for a run; none when it may.

    Parameters
    ----------
    needed : mapping of str to str
        The run's `versions`.
    wanted : Path, optional
        A file that the run has just written beside its chunks.
    """
    result = versions()
    other = [name for name, version in needed.items() if result.get(name) != version]
    if other:
        has, needs = (
            ", ".join(f"{name} {versions.get(name, 'none')}" for name in other) for versions in (result, needed)
        )
        return f"has {has} where this run has {needs}; its results would be others"
    if wanted is None:
        return None
    try:
        wanted.read_bytes()
    except OSError:
        return f"does not see {wanted.parent}; the run folder must be shared by all machines, under one path"
    return None if os.access(wanted.parent, os.W_OK) else f"must not write to {wanted.parent}"


def simulate_on_worker(work: ChunkJob, places: Sequence[SampleRange], needed: Mapping[str, str]) -> list[ChunkFile]:
    """Draw, simulate and store some chunks, except those that another worker stored before it died.

    Raises `ClusterError` when the worker is not compatible with the run.
    """
    fault = incompatibility(needed, work.wanted)
    if fault is not None:
        raise ClusterError(f"a worker on {platform.node()} {fault}")
    with _one_thread_each():
        if work.in_processes:
            _let_have_children()
        simulate = simulate_isolated if work.in_processes else simulate_chunk
        return [find_chunk(work, place) or simulate(work, place) for place in places]


_simulating = 0
_limits: list[threadpool_limits] = []
_counting = threading.Lock()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Limit numerical libraries to one thread while any thread of this process simulates a chunk.

    A limit of each chunk's own would be lifted by the first that ends, in the middle of the others.
    """
    global _simulating
    with _counting:
        if _simulating == 0:
            _limits.append(threadpool_limits(1))
        _simulating += 1
    try:
        yield
    finally:
        with _counting:
            _simulating -= 1
            if _simulating == 0:
                _limits.pop().restore_original_limits()


def _let_have_children() -> None:
    """Let this process start a process that simulates for it.

    Workers under a nanny are daemons, which must not have children because nobody would end them. These children end
    with their parent, and before it when it ends in order, which would otherwise wait for them.
    """
    process = multiprocessing.current_process()
    if process.daemon:
        process.daemon = False


def dask_setup(worker: Any) -> None:
    """Let a worker of a local cluster end with its parent, which handles Ctrl-C; dask calls this in the worker."""
    end_with_parent(os.getppid())
