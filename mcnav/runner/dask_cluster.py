"""Chunks simulated by the workers of a dask cluster, on this machine or on others, to the same bits.

This process hands out chunk numbers, never more than the workers can take soon. Workers draw, simulate and store the
chunks in the run folder, which all of them share, and return their manifest entries. The job is sent once. dask repeats
a chunk whose worker died; a chunk that keeps ending workers is simulated in an isolated process here, so that only the
sample at fault fails.
"""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from mcnav.errors import ClusterError
from mcnav.files.whole import write_whole
from mcnav.runner.chunks import ChunkJob, SampleRange, find_chunk
from mcnav.runner.dask_worker import incompatibility, processor, simulate_on_worker
from mcnav.runner.identity import versions
from mcnav.runner.local_cluster import local_cluster
from mcnav.runner.processes import simulate_isolated
from mcnav.runner.worker_processes import end_workers_apart
from mcnav.store.chunk_files import ChunkFile, chunk_name
from mcnav.store.run_folder import RunFolder

ANSWERS: Final = 10.0
"""Seconds that a scheduler may take to answer."""

PATIENCE: Final = 60.0
"""Seconds without any worker, or without a stored file being visible here, after which a run is ended."""

DEPTH: Final = 3
"""Tasks submitted for each thread of the cluster: one to simulate, others so that it need not wait."""

SHARES: Final = 32
MOST: Final = 64
"""A long run has several chunks in a task, at most `MOST`, as long as each thread gets `SHARES` tasks: dask takes some
milliseconds for a task, and an engine may take no more for a chunk."""

PAUSE: Final = 0.005
WATCH: Final = 5.0
"""Seconds between looks for what is ready, and for whether the cluster is still there."""

RESUMES: Final = "what is stored is kept, and the same command goes on from there"


@dataclass
class Cluster:
    """A cluster that is ready to simulate.

    Attributes
    ----------
    address : str
        Address of the scheduler.
    threads : int
        Chunks that all workers together simulate at a time.
    """

    client: Any
    address: str
    threads: int = 0
    _seen: float = 0.0
    """Time at which there last was a worker."""

    def simulate(self, work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[ChunkFile, None, None]:
        """Simulate the missing chunks by the cluster's workers, whatever ``jobs``; yield files as they become ready.

        Raises `ClusterError` when a worker is not compatible, or the cluster is lost.
        """
        if not missing:
            return
        with _wanted(work) as there:
            self._check_workers(there.wanted)
            yield from self._run(work, there, missing)
            _wait_until_seen(work, missing)

    def _run(self, work: ChunkJob, there: ChunkJob, missing: Sequence[SampleRange]) -> Iterator[ChunkFile]:
        dask, client, needed, run = _distributed(), self.client, versions(), secrets.token_hex(6)
        # A task of its own, not scattered data: when those who hold it die, it is sent again.
        shared = client.submit(_itself, there, key=f"run-{run}", pure=False)
        left, apart, tasks = iter(missing), list[SampleRange](), dict[Any, list[SampleRange]]()
        together = min(max(len(missing) // (SHARES * max(self.threads, 1)), 1), MOST)
        finished = dask.as_completed(loop=client.loop, with_results=True, raise_errors=False)
        try:
            while True:
                while len(tasks) < DEPTH * self.threads and (places := list(islice(left, together))):
                    key = f"chunk-{run}-{places[0].number}"
                    future = client.submit(simulate_on_worker, shared, places, needed, key=key, pure=False)
                    tasks[future] = places
                    finished.add(future)
                if apart:
                    place = apart.pop()
                    yield find_chunk(work, place) or simulate_isolated(work, place)
                    continue
                if not tasks:
                    return
                for future, files in self._ready(finished, tasks):
                    places = tasks.pop(future)
                    failure = None if isinstance(files, list) else self._failure(future, files)
                    if isinstance(failure, dask.KilledWorker):
                        apart.extend(places)
                    elif failure is not None:
                        raise failure
                    else:
                        yield from files
        except Exception as failure:
            if client.status == "running" or isinstance(failure, ClusterError):
                raise
            raise self._lost() from failure  # which comes out as errors of many kinds
        finally:
            with suppress(Exception):
                client.cancel([*tasks, shared], force=True)

    def _ready(self, finished: Any, tasks: Collection[Any]) -> list[tuple[Any, Any]]:
        """Wait for futures that are ready, at least one; return them with their results."""
        looked = time.monotonic()
        while True:
            batch: list[tuple[Any, Any]] = finished.next_batch(block=False)
            if batch:
                return batch
            time.sleep(PAUSE)
            if self.client.status != "running":
                raise self._lost()
            if time.monotonic() - looked > WATCH:
                looked = time.monotonic()
                self._look(tasks)

    def _look(self, tasks: Collection[Any]) -> None:
        """Count the workers; raise `ClusterError` when there have been none for long, or tasks are cancelled."""
        if any(future.cancelled() for future in tasks):
            raise self._lost()
        try:
            self.threads = sum(self.client.nthreads().values())
        except (OSError, TimeoutError):
            raise self._lost() from None
        if self.threads:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > PATIENCE:
            raise ClusterError(f"{self.address}: has had no worker for {PATIENCE:g} s; {RESUMES}")

    def _failure(self, future: Any, exception: Any) -> BaseException:
        """Return the reason why a task has no result."""
        if future.cancelled():
            return self._lost()
        _, failure, traceback = exception
        if isinstance(failure, (ImportError, AttributeError)):
            return ClusterError(f"{self.address}: a worker cannot fly for this run: {failure}; {RESUMES}")
        if isinstance(failure, BaseException):
            return failure.with_traceback(traceback)
        return ClusterError(f"{self.address}: a chunk came to nothing ({failure})")

    def _lost(self) -> ClusterError:
        return ClusterError(f"{self.address}: the scheduler is gone, or has forgotten this run; {RESUMES}")

    def _check_workers(self, wanted: Path | None = None) -> None:
        """Raise `ClusterError` when a worker is not compatible with this run."""
        for worker, fault in self._asked(incompatibility, versions(), wanted).items():
            if isinstance(fault, Exception):
                raise ClusterError(f"worker {worker} cannot fly for this run: {fault}")
            if fault is not None:
                raise ClusterError(f"worker {worker} {fault}")

    def _asked(self, question: Any, *arguments: Any) -> dict[str, Any]:
        """Return each worker's answer to a question, or the exception it raised."""
        try:
            return dict(self.client.run(question, *arguments, on_error="return"))
        except (OSError, TimeoutError):
            raise self._lost() from None

    def connect_workers(self) -> list[str]:
        """Wait for a worker, refuse any that is not compatible, and return notices for the user."""
        try:
            self.client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, TimeoutError):
            raise ClusterError(f"{self.address}: has no worker, and none came for {PATIENCE:g} s") from None
        self._look(())
        self._check_workers()
        others = {str(answer) for answer in self._asked(processor).values()} - {processor()}
        if not others:
            return []
        told = ", ".join(sorted(others))
        return [f"workers have other processors ({told}; here {processor()}): last digits may differ from a run here"]


def _itself(work: ChunkJob) -> ChunkJob:
    return work


@contextmanager
def _wanted(work: ChunkJob) -> Iterator[ChunkJob]:
    """Yield the job as it is sent to workers, with a file in the run folder that exists as long as the run lasts.

    It has the name of an unfinished file, so that the next run deletes it if this one cannot.
    """
    folder = RunFolder(work.folder.path.resolve())
    token = folder.chunk_folder / f".wanted.{secrets.token_hex(6)}.tmp"
    write_whole(token, b"")
    try:
        yield replace(work, folder=folder, wanted=token)
    finally:
        token.unlink(missing_ok=True)


def _wait_until_seen(work: ChunkJob, places: Sequence[SampleRange]) -> None:
    """Give a shared file system time to show what was stored elsewhere; listing a folder asks it anew."""
    deadline = time.monotonic() + PATIENCE
    names = {chunk_name(place.number) for place in places}
    while names := names - {path.name for path in work.folder.chunk_folder.iterdir()}:
        if time.monotonic() > deadline:
            lost = work.folder.chunk_folder / min(names)
            raise ClusterError(f"{lost}: was stored by a worker, but is not to be seen here; is the folder shared?")
        time.sleep(0.2)


@contextmanager
def connect(scheduler: str | None, workers: int) -> Iterator[tuple[Cluster, list[str]]]:
    """Connect to a cluster, or start one; yield it with notices for the user.

    Parameters
    ----------
    scheduler : str or None
        Address of a running scheduler; with none, one is started on this machine, and ended with the context.
    workers : int
        Processes of the latter.

    Raises
    ------
    ClusterError
        When there is none, it has no worker, or one that is not compatible.
    """
    distributed = _distributed()
    with ExitStack() as stack:
        for name in ("distributed", "distributed.client"):
            stack.enter_context(distributed.utils.silence_logging_cmgr(logging.CRITICAL + 1, name))
        address = scheduler or stack.enter_context(local_cluster(distributed, workers))
        try:
            distributed.comm.get_address_host_port(address)  # a client that finds this out takes 20 s to end
            client = distributed.Client(address, timeout=ANSWERS, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as failure:
            told = "nobody answers there" if isinstance(failure, OSError) else str(failure)
            raise ClusterError(f"{address}: is no scheduler that can be used: {told}") from None
        stack.callback(client.close)
        if not scheduler:
            stack.callback(_end_isolated, client)
        cluster = Cluster(client, address)
        yield cluster, cluster.connect_workers()


def _end_isolated(client: Any) -> None:
    """End the isolated processes of the workers, so that these can end in order."""
    with suppress(Exception):
        client.run(end_workers_apart, on_error="ignore")


def _distributed() -> ModuleType:
    """Import `distributed`, an extra; it takes a second, and only runs on clusters need it."""
    try:
        import distributed
    except ImportError:
        raise ClusterError("dask.distributed is not installed; pip install 'mcnav[dask]' installs it") from None
    return distributed
