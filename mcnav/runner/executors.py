"""Executors of the chunks of a command: on this machine, or by the workers of a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from mcnav.errors import ClusterError
from mcnav.runner.runner import ChunkExecutor

JOBS: Final = 2
"""Default number of workers."""


@contextmanager
def open_executor(
    scheduler: str | None, workers: int | None, jobs: int | None
) -> Iterator[tuple[ChunkExecutor | None, int, list[str]]]:
    """Yield the executor of a command's options, none for this machine; its workers, and notices for the user.

    Raises `ClusterError` when the options contradict each other, or the cluster cannot be used.
    """
    if scheduler is not None and workers is not None:
        raise ClusterError("--dask makes a cluster of its own, --scheduler names one that is there; give one of them")
    if scheduler is None and workers is None:
        yield None, jobs or JOBS, []
        return
    if jobs is not None:
        raise ClusterError("--jobs counts workers without a cluster; --dask N makes N, and a --scheduler has its own")
    from mcnav.runner.dask_cluster import connect  # which a run on this machine does not need

    with connect(scheduler, workers or JOBS) as (cluster, notices):
        yield cluster.simulate, cluster.threads, notices
