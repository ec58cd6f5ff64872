"""Worker processes that end with their parent, and threads that are abandoned when work is interrupted."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Final

from mcnav.execution.streams import tolerate

_PR_SET_PDEATHSIG: Final = 1
_workers: Final[list[int]] = []
_TRACKERS_SILENT: Final = "ignore:resource_tracker"


def end_with_parent(parent: int) -> None:
    """End this worker process when its parent ends, even when the parent is killed; the parent handles Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tolerate()  # classes of users print
    _workers.append(os.getpid())
    follow_parent(parent)


def is_worker() -> bool:
    """Return whether this process is a worker, whose end its parent notices."""
    return os.getpid() in _workers


def follow_parent(parent: int) -> None:
    """End this process when its parent ends, even when the parent is killed.

    On Linux the kernel ends it at once; elsewhere a thread notices it within half a second.
    """
    if sys.platform == "linux" and hasattr(signal, "SIGKILL"):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)

    def watch() -> None:
        _wait_for_end(parent)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _wait_for_end(parent: int, number_stays: bool = os.name == "nt") -> None:
    """Wait until the parent has ended. On Windows a process keeps the number of a parent that has ended."""
    from multiprocessing import connection, parent_process  # commands that start no process do without

    ends = getattr(parent_process(), "sentinel", None)
    if number_stays and ends is not None:
        connection.wait([ends])
        return
    while os.getppid() == parent:
        time.sleep(0.5)


def start_trackers() -> None:
    """Start the processes in which Python and loky remove semaphores and folders that others leave behind.

    They say nothing of what they find: a finalizer that is interrupted after it has removed a semaphore, and before it
    has told them so, leaves nothing that a user could do anything about.
    """
    from multiprocessing import resource_tracker  # commands that start no process do without

    from joblib.externals.loky.backend import resource_tracker as tracker_of_loky

    sys.warnoptions.append(_TRACKERS_SILENT)  # options of this process are those of the processes it starts
    try:
        if os.name == "posix":
            resource_tracker.ensure_running()
        tracker_of_loky.ensure_running()
    finally:
        sys.warnoptions.remove(_TRACKERS_SILENT)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block SIGINT in this thread and in what it starts, so that workers print no traceback while they import.

    Processes and threads inherit the mask of signals. Workers ignore SIGINT from `end_with_parent` on.
    """
    start_trackers()  # the start of Python's own, with that of the first process, would end the block
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Inline(Executor):
    """Executor that calls at once, in the caller's thread."""

    def submit(self, function: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*given, **named))
        except Exception as wrong:
            future.set_exception(wrong)
        return future


@contextmanager
def side_threads(count: int) -> Iterator[Executor]:
    """Provide an executor of threads that an exception, such as Ctrl-C, does not wait for; without any it is inline."""
    executor: Executor = ThreadPoolExecutor(count) if count else _Inline()
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        raise
    executor.shutdown()
