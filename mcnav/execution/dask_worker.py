"""What a worker of a cluster does for a run: show that it is fit for it, and fly and store chunks like any other.

Results depend on versions, and chunks are stored by whoever flew them. So a worker must have the run's versions and see
its folder, and proves both before every chunk: workers come and go while a run goes on.
"""

from __future__ import annotations

import multiprocessing
import os
import platform
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from mcnav._subprocess import end_with_parent
from mcnav.errors import ClusterError
from mcnav.execution.chunks import ChunkJob, SampleRange, find_range, simulate_chunk
from mcnav.execution.identity import versions
from mcnav.execution.processes import end_workers_apart, simulate_isolated
from mcnav.store.parts import Part


def processor() -> str:
    """Return the processor that code is compiled for; the same versions give the same bits on the same processors."""
    from llvmlite.binding import get_host_cpu_name

    return str(get_host_cpu_name())


def incompatibility(needed: Mapping[str, str], wanted: Path | None = None) -> str | None:
    """Why this process must not fly for a run; none when it may.

    Parameters
    ----------
    needed : mapping of str to str
        The run's `versions`.
    wanted : Path, optional
        A file that the run has just put beside its chunks.
    """
    found = versions()
    other = [name for name, version in needed.items() if found.get(name) != version]
    if other:
        has, needs = (", ".join(f"{name} {each.get(name, 'none')}" for name in other) for each in (found, needed))
        return f"has {has} where this run has {needs}; its results would be others"
    if wanted is None:
        return None
    try:
        wanted.read_bytes()
    except OSError:
        return f"does not see {wanted.parent}; the run folder must be shared by all machines, under one path"
    return None if os.access(wanted.parent, os.W_OK) else f"must not write to {wanted.parent}"


def simulate_on_worker(work: ChunkJob, places: Sequence[SampleRange], needed: Mapping[str, str]) -> list[Part]:
    """Draw, fly and store some chunks on a worker of a cluster, but for those that another stored before it died.

    Raises
    ------
    ClusterError
        When the worker is not fit for the run.
    """
    fault = incompatibility(needed, work.wanted)
    if fault is not None:
        raise ClusterError(f"a worker on {platform.node()} {fault}")
    with _one_thread_each():
        if work.in_processes:
            _let_have_children()
        flown = simulate_isolated if work.in_processes else simulate_chunk
        return [find_range(work, place) or flown(work, place) for place in places]


_flying = 0
_limits: list[threadpool_limits] = []
_counting = threading.Lock()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Hold numerical libraries to one thread for as long as any thread of this process flies a chunk.

    A limit of each chunk's own would be lifted by the first that ends, in the middle of the others.
    """
    global _flying
    with _counting:
        if _flying == 0:
            _limits.append(threadpool_limits(1))
        _flying += 1
    try:
        yield
    finally:
        with _counting:
            _flying -= 1
            if _flying == 0:
                _limits.pop().restore_original_limits()


def _let_have_children() -> None:
    """Let this process have a process that flies for it.

    Workers under a nanny are daemons, which must not have children because nobody would end them. Ours end with their
    parent by themselves, and before it when it ends in order, which would otherwise wait for them.
    """
    process = multiprocessing.current_process()
    if process.daemon:
        process.daemon = False
        Finalize(None, end_workers_apart, exitpriority=100)


def dask_setup(worker: Any) -> None:
    """Let a worker of a local cluster, in which dask calls this, end with its parent, and leave Ctrl-C to that."""
    end_with_parent(os.getppid())
