"""A dask cluster on this machine, which ends with this process however that ends."""

from __future__ import annotations

import logging
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing.context import get_spawning_popen
from multiprocessing.reduction import DupFd
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from mcnav.errors import ClusterError
from mcnav.execution.child_processes import interrupts_blocked, start_trackers
from mcnav.execution.interrupts import deferred
from mcnav.physics.units import printable

DEATHS: Final = 1
"""Workers of a local cluster that a chunk may end and be tried again; other schedulers have a number of their own."""


@contextmanager
def local_cluster(distributed: ModuleType, workers: int) -> Iterator[str]:
    """Start a cluster on this machine, open to nobody else, and yield its address; it ends with this process."""
    import dask

    settings = {
        "distributed.worker.profile.enabled": False,
        # dask would give up the place of a lost worker when the next one is lost within seconds.
        "distributed.deploy.lost-worker-timeout": "1000 days",
    }
    with (
        _scratch() as (folder, held),
        dask.config.set(settings | {"temporary-directory": folder, "mcnav": {"held": held}}),
        ExitStack() as stack,
    ):
        with deferred(), interrupts_blocked():  # dask cannot end what it is starting
            made = stack.enter_context(_started(distributed, workers))
        yield str(made.scheduler_address)


def _started(distributed: ModuleType, workers: int) -> Any:
    """Start a scheduler and its workers; `ClusterError` when one of them ends before it is ready."""
    try:
        return distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=None,
            silence_logs=logging.CRITICAL,
            scheduler_kwargs={"allowed_failures": DEATHS, "dashboard": False, "dashboard_address": "127.0.0.1:0"},
            preload=["mcnav.runner.dask_worker"],
        )
    except (RuntimeError, OSError) as failure:
        told = printable(str(failure.__cause__ or failure), 200)
        remedy = "the same command tries again, fewer workers need less memory"
        raise ClusterError(f"--dask {workers}: the cluster could not be started: {told}; {remedy}") from None


class _Held:
    """A file that processes that are started with it have open as long as they last."""

    def __init__(self, file: int) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Any, ...]:
        started = get_spawning_popen()
        return (_Held, (self.file,)) if started is None else (_hold, (DupFd(self.file),))


def _hold(passed: Any) -> _Held:
    return _Held(passed.detach())


@contextmanager
def _scratch() -> Iterator[tuple[str, _Held]]:
    """Create a folder that joblib's tracker removes even when this process is killed: it must know of it before.

    It does so when nobody holds its pipe any more, which is yielded as well for processes that make files there.
    """
    from joblib.externals.loky.backend import resource_tracker

    start_trackers()
    folder = str(Path(tempfile.gettempdir()) / f"mcnav-{secrets.token_hex(8)}")
    resource_tracker.register(folder, "folder")
    try:
        Path(folder).mkdir(mode=0o700)
        yield folder, _Held(resource_tracker.getfd())
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        resource_tracker.unregister(folder, "folder")
