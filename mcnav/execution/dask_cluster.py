"""Chunks flown by the workers of a dask cluster, on this machine or on others.

A chunk there is what it is here, and so are its bits. This process hands out places of chunks, never more than the
workers can take soon; workers draw, fly and store them in the run folder, which all of them share, and answer with what
the manifest says of them. What they all need is sent once. dask flies a chunk again whose worker died; one that goes on
ending workers is flown from here as any deadly chunk is, so that only the sample at fault fails.
"""

from __future__ import annotations

import logging
import secrets
import shutil
import tempfile
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from mcnav.errors import ClusterError
from mcnav.execution.chunks import ChunkJob, SampleRange, find_range
from mcnav.execution.dask_worker import incompatibility, processor, simulate_on_worker
from mcnav.execution.identity import versions
from mcnav.execution.processes import end_workers_apart, simulate_isolated
from mcnav.execution.runner import ChunkExecutor
from mcnav.files import write_whole
from mcnav.store.parts import Part, part_name
from mcnav.store.run_folder import RunFolder

JOBS: Final = 2
"""Workers where nothing is said of them."""

ANSWERS: Final = 10.0
"""Seconds that a scheduler may take to answer."""

PATIENCE: Final = 60.0
"""Seconds without any worker, or without a stored file being seen here, after which a run is broken off."""

DEPTH: Final = 3
"""Tasks handed out for each thread of the cluster: one to fly, others so that it need not wait."""

SHARES: Final = 32
MOST: Final = 64
"""Tasks that each thread gets at least, when a run has so many chunks that several of them, no more than so many, make
one: dask takes some milliseconds for a task, and an engine may take no more for a chunk."""

DEATHS: Final = 1
"""Workers of a local cluster that a chunk may end and be tried again; other schedulers have a number of their own."""

PAUSE: Final = 0.005
WATCH: Final = 5.0
"""Seconds between looks for what is ready, and for whether the cluster is still there."""

KEPT: Final = "what is stored is kept, and the same command goes on from there"


@dataclass
class Cluster:
    """A cluster that is ready to fly.

    Attributes
    ----------
    client : distributed.Client
    address : str
        Of the scheduler.
    threads : int
        Chunks that all workers together fly at a time.
    """

    client: Any
    address: str
    threads: int = 0
    _seen: float = 0.0
    """When there last was a worker."""

    def fly(self, work: ChunkJob, missing: Sequence[SampleRange], jobs: int) -> Generator[Part, None, None]:
        """Parts of the missing chunks, as they become ready; the workers are the cluster's, however many ``jobs`` says.

        Raises
        ------
        ClusterError
            When a worker is not fit for the run, or the cluster is lost.
        """
        if not missing:
            return
        with _wanted(work) as there:
            self._admit(there.wanted)
            yield from self._flights(work, there, missing)
            _wait_until_seen(work, missing)

    def _flights(self, work: ChunkJob, there: ChunkJob, missing: Sequence[SampleRange]) -> Iterator[Part]:
        dask, client, needed, run = _distributed(), self.client, versions(), secrets.token_hex(6)
        # A task of its own, not scattered data: when those who hold it die, it is sent again.
        shared = client.submit(_itself, there, key=f"run-{run}", pure=False)
        left, apart, flying = iter(missing), list[SampleRange](), dict[Any, list[SampleRange]]()
        together = min(max(len(missing) // (SHARES * max(self.threads, 1)), 1), MOST)
        finished = dask.as_completed(loop=client.loop, with_results=True, raise_errors=False)
        try:
            while True:
                while len(flying) < DEPTH * self.threads and (places := list(islice(left, together))):
                    key = f"chunk-{run}-{places[0].number}"
                    future = client.submit(simulate_on_worker, shared, places, needed, key=key, pure=False)
                    flying[future] = places
                    finished.add(future)
                if apart:
                    place = apart.pop()
                    yield find_range(work, place) or simulate_isolated(work, place)
                    continue
                if not flying:
                    return
                for future, found in self._ready(finished, flying):
                    places = flying.pop(future)
                    failure = None if isinstance(found, list) else self._failure(future, found)
                    if isinstance(failure, dask.KilledWorker):
                        apart.extend(places)
                    elif failure is not None:
                        raise failure
                    else:
                        yield from found
        except Exception as failure:
            if client.status == "running" or isinstance(failure, ClusterError):
                raise
            raise self._lost() from failure  # which comes out as errors of many kinds
        finally:
            with suppress(Exception):
                client.cancel([*flying, shared], force=True)

    def _ready(self, finished: Any, flying: Collection[Any]) -> list[tuple[Any, Any]]:
        """Futures that are ready, at least one, with what came of them."""
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
                self._look(flying)

    def _look(self, flying: Collection[Any]) -> None:
        """Count the workers; raise `ClusterError` when there have been none for long, or nobody knows of our chunks."""
        if any(future.cancelled() for future in flying):
            raise self._lost()
        try:
            self.threads = sum(self.client.nthreads().values())
        except (OSError, TimeoutError):
            raise self._lost() from None
        if self.threads:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > PATIENCE:
            raise ClusterError(f"{self.address}: has had no worker for {PATIENCE:g} s; {KEPT}")

    def _failure(self, future: Any, found: Any) -> BaseException:
        """Why a task has no result."""
        if future.cancelled():
            return self._lost()
        _, failure, traceback = found
        if isinstance(failure, (ImportError, AttributeError)):
            return ClusterError(f"{self.address}: a worker cannot fly for this run: {failure}; {KEPT}")
        if isinstance(failure, BaseException):
            return failure.with_traceback(traceback)
        return ClusterError(f"{self.address}: a chunk came to nothing ({failure})")

    def _lost(self) -> ClusterError:
        return ClusterError(f"{self.address}: the scheduler is gone, or has forgotten this run; {KEPT}")

    def _admit(self, wanted: Path | None = None) -> None:
        """Raise `ClusterError` when a worker is not fit for this run."""
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

    def joined(self) -> list[str]:
        """Wait for a worker, refuse any that is not fit, and say in lines what the user should know of them."""
        try:
            self.client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, TimeoutError):
            raise ClusterError(f"{self.address}: has no worker, and none came for {PATIENCE:g} s") from None
        self._look(())
        self._admit()
        others = {str(each) for each in self._asked(processor).values()} - {processor()}
        if not others:
            return []
        told = ", ".join(sorted(others))
        return [f"workers have other processors ({told}; here {processor()}): last digits may differ from a run here"]


def _itself(work: ChunkJob) -> ChunkJob:
    return work


@contextmanager
def _wanted(work: ChunkJob) -> Iterator[ChunkJob]:
    """Work as it is sent to workers, with a file in the run folder that is there as long as its chunks are wanted.

    It bears the name of a file that was not finished, so that the next run sweeps it away if this one cannot.
    """
    folder = RunFolder(work.folder.path.resolve())
    token = folder.parts / f".wanted.{secrets.token_hex(6)}.tmp"
    write_whole(token, b"")
    try:
        yield replace(work, folder=folder, wanted=token)
    finally:
        token.unlink(missing_ok=True)


def _wait_until_seen(work: ChunkJob, places: Sequence[SampleRange]) -> None:
    """Give a shared file system time to show here what was stored elsewhere; listing a folder asks it anew."""
    deadline = time.monotonic() + PATIENCE
    names = {part_name(place.number) for place in places}
    while names := names - {path.name for path in work.folder.parts.iterdir()}:
        if time.monotonic() > deadline:
            lost = work.folder.parts / min(names)
            raise ClusterError(f"{lost}: was stored by a worker, but is not to be seen here; is the folder shared?")
        time.sleep(0.2)


@contextmanager
def connect(scheduler: str | None = None, workers: int = JOBS) -> Iterator[tuple[Cluster, list[str]]]:
    """Connect to a cluster, or start one; yield it with notices for the user.

    Parameters
    ----------
    scheduler : str, optional
        Address of one that is there; else one is made on this machine, and ended with the context.
    workers : int
        Processes of the latter.

    Raises
    ------
    ClusterError
        When there is none, it has no worker, or one that is not fit.
    """
    distributed = _distributed()
    with ExitStack() as stack:
        for name in ("distributed", "distributed.client"):
            stack.enter_context(distributed.utils.silence_logging_cmgr(logging.CRITICAL + 1, name))
        address = scheduler or stack.enter_context(_made(distributed, workers))
        try:
            distributed.comm.get_address_host_port(address)  # a client that finds this out takes 20 s to end
            client = distributed.Client(address, timeout=ANSWERS, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as failure:
            told = "nobody answers there" if isinstance(failure, OSError) else str(failure)
            raise ClusterError(f"{address}: is no scheduler that can be used: {told}") from None
        stack.callback(client.close)
        if not scheduler:
            stack.callback(_end_flights, client)
        cluster = Cluster(client, address)
        yield cluster, cluster.joined()


def _end_flights(client: Any) -> None:
    """End what workers fly in processes of their own, so that they can end in order; those of others go on."""
    with suppress(Exception):
        client.run(end_workers_apart, on_error="ignore")


def _distributed() -> ModuleType:
    """Import `distributed`, an extra; it takes a second, and only runs on clusters need it."""
    try:
        import distributed
    except ImportError:
        raise ClusterError("dask.distributed is not installed; pip install 'mcnav[dask]' installs it") from None
    return distributed


@contextmanager
def _made(distributed: ModuleType, workers: int) -> Iterator[str]:
    """Address of a cluster made on this machine, open to nobody else; it ends with this process, however that ends."""
    import dask

    settings = {
        "distributed.worker.profile.enabled": False,
        # Some seconds after a worker was lost dask gives up its place if another, started since, is just then lost.
        "distributed.deploy.lost-worker-timeout": "1000 days",
    }
    with (
        _scratch() as folder,
        dask.config.set(settings | {"temporary-directory": folder}),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=None,
            silence_logs=logging.CRITICAL,
            scheduler_kwargs={"allowed_failures": DEATHS, "dashboard": False, "dashboard_address": "127.0.0.1:0"},
            preload=["mcnav.execution.dask_worker"],
        ) as made,
    ):
        yield str(made.scheduler_address)


@contextmanager
def _scratch() -> Iterator[str]:
    """Create a folder that joblib's tracker removes even when this process is killed."""
    from joblib.externals.loky.backend import resource_tracker

    folder = tempfile.mkdtemp(prefix="mcnav-")
    resource_tracker.register(folder, "folder")
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        resource_tracker.unregister(folder, "folder")


@contextmanager
def open_executor(
    scheduler: str | None, workers: int | None, jobs: int | None
) -> Iterator[tuple[ChunkExecutor | None, int, list[str]]]:
    """Who flies, by how many workers, and what the user should know of it, from what the command line says.

    Raises
    ------
    ClusterError
        When it says several things, or the cluster cannot be used.
    """
    if scheduler is not None and workers is not None:
        raise ClusterError("--dask makes a cluster of its own, --scheduler names one that is there; give one of them")
    if scheduler is None and workers is None:
        yield None, jobs or JOBS, []
        return
    if jobs is not None:
        raise ClusterError("--jobs counts workers without a cluster; --dask N makes N, and a --scheduler has its own")
    with connect(scheduler, workers or JOBS) as (cluster, notices):
        yield cluster.fly, cluster.threads, notices
