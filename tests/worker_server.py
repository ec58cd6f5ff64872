"""Server that has imported and loaded what workers need, and forks them for runs in the tests' own process.

joblib and dask start a new interpreter for each worker, which imports for more than a second; there would be some
hundred of them. Commands of `tests.forked` are its forks as well. Tasks and results are pickled and sent all the same.
A command that a test starts as a process of its own has the workers that a user's has.
"""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import forkserver, resource_tracker
from multiprocessing.synchronize import SemLock, sem_unlink
from pathlib import Path
from typing import Final
from unittest.mock import patch

import numpy as np
from joblib.externals.loky.backend import context

from mcnav.execution import child_processes
from mcnav.numerics.power_sums import sum_powers_about_zero
from tests.compile_once import share_compilation

SERVING: Final = "MCNAV_WORKER_SERVER"
"""Variable of the environment that only the server has."""

WORKERS_NEED: Final = ("mcnav.workflow.run", "distributed.nanny")
COMMANDS_NEED: Final = (
    "mcnav.cli", "mcnav.report.pages.run.page", "mcnav.studies.lincov", "mcnav.studies.allocate", "pandas",
)  # fmt: skip
"""Modules that commands import when they are called: half a second of each command of `tests.forked`."""


def _end_with_server(_: int) -> None:
    """End this worker when the server ends, which ends with the tests: it, and not they, is the worker's parent."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(child_processes._PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _unlink(name: str) -> None:
    """Remove a semaphore that may have been removed, as joblib's own semaphores do."""
    with suppress(FileNotFoundError):
        sem_unlink(name)
    resource_tracker.unregister(name, "semaphore")


def use_server() -> None:
    """Let joblib's workers of this process be forks of the server, which starts with the first of them."""
    root = str(Path(__file__).parent.parent)
    alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # as joblib has it with a worker for each processor
    server = forkserver._forkserver
    ensure_running = server.ensure_running

    def ensure_running_for_tests() -> None:
        with patch.dict(os.environ, {"PYTHONPATH": root, SERVING: "1", **alone}):
            ensure_running()

    SemLock._cleanup = staticmethod(_unlink)  # type: ignore[method-assign]
    server.set_forkserver_preload([__name__])
    server.ensure_running = ensure_running_for_tests
    context.set_start_method("forkserver", force=True)


@contextmanager
def used_by_dask() -> Iterator[None]:
    """Let the workers of clusters that this process makes be forks of the server."""
    import dask.config
    import distributed.utils

    with dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        distributed.utils._forkserver_preload_set = True  # the server's modules are these, and not dask's choice
        yield


def load_kernels() -> None:
    """Call a kernel that every run with samples calls; with its first kernel, numba loads what all kernels need."""
    sum_powers_about_zero(np.zeros((1, 1, 1)))


if SERVING in os.environ:
    for name in WORKERS_NEED + COMMANDS_NEED:
        import_module(name)
    import_module("mcnav.runner.worker_processes").end_with_parent = _end_with_server
    share_compilation()
    load_kernels()
    gc.freeze()  # joblib's workers collect garbage again and again
    child_processes.end_with_parent = _end_with_server
