"""Worker processes of this process: each thread has its own, by number, and each process takes one task at a time."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from multiprocessing.util import Finalize
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.runner.memory import SMALL_PIECES, keep_freed_memory

if TYPE_CHECKING:
    from joblib.externals.loky.process_executor import ProcessPoolExecutor

IDLE: Final = 60.0
"""Seconds after which an unused process ends."""


def _begin_worker(parent: int) -> None:
    """Let a worker process end with its parent, and keep the memory of a step for the next one."""
    global _started
    end_with_parent(parent)
    keep_freed_memory(*SMALL_PIECES)


def ready() -> None:
    """Let a worker import what it needs, which is most of what its start costs."""
    import mcnav.runner.chunks  # noqa: F401


_executors: dict[tuple[int, int], ProcessPoolExecutor] = {}
"""One process for each thread and number."""

_starts: dict[tuple[int, int], float] = {}
"""Time that each of them took to start, s."""


def _executor(worker: int) -> ProcessPoolExecutor:
    from joblib.externals.loky.process_executor import ProcessPoolExecutor  # a twentieth of a second, as joblib

    key = threading.get_ident(), worker
    if key not in _executors:
        if not _executors:  # before this process ends, which would wait until they are idle for long
            Finalize(None, end_workers_apart, exitpriority=100)
        begun = time.monotonic()
        executor = ProcessPoolExecutor(1, timeout=IDLE, initializer=_begin_worker, initargs=(os.getpid(),))
        _executors[key] = executor
        executor.submit(ready).add_done_callback(lambda _: _starts.update({key: time.monotonic() - begun}))
    return _executors[key]


def start_first() -> float:
    """Start the first process of this thread unless it runs; return how long its start took, s.

    Raises `BrokenExecutor` when it dies.
    """
    submit(ready).result()
    return _starts[threading.get_ident(), 0]


def submit(task: Callable[..., Any], *arguments: Any, worker: int = 0) -> Future[Any]:
    """Submit a task to a process of this thread, which starts unless it runs, and works in the folder of this one."""
    with interrupts_blocked():
        submitted: Future[Any] = _executor(worker).submit(_work_in, _current_folder(), task, *arguments)
    return submitted


def _current_folder() -> Path | None:
    """Return the current folder; none where it has been deleted."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        return None


def _work_in(folder: Path | None, task: Callable[..., Any], *arguments: Any) -> Any:
    """Do a task in a folder, from which relative paths count: a process may have begun in another."""
    if folder is not None:
        os.chdir(folder)
    return task(*arguments)


def end_worker() -> None:
    """Kill the first process of this thread, if it runs."""
    executor = _executors.pop((threading.get_ident(), 0), None)
    if executor is not None:
        executor.shutdown(wait=True, kill_workers=True)


def end_workers_apart() -> None:
    """Kill the processes of all threads."""
    while _executors:
        _executors.popitem()[1].shutdown(wait=True, kill_workers=True)


def end_workers() -> None:
    """Kill all worker processes: what they have simulated is stored, and an orderly end takes seconds.

    Without ``reuse`` loky would let the workers of joblib's pool end in order and start another pool.
    """
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True, kill_workers=True).shutdown(wait=True, kill_workers=True)
    end_workers_apart()
