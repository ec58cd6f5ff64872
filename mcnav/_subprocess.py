"""Processes that end with the one that started them, and threads that are not waited for when work is broken off."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def end_with_parent(parent: int) -> None:
    """Let a worker process end with its parent, also when that was killed and could not say so.

    On Linux the kernel sees to it, whatever the worker is at; elsewhere the worker looks for its parent.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which says what is to be done

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def side_threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """Run some work in threads beside this one.

    Unlike the executor's own context, an exception (Ctrl-C, say) does not wait for the threads: what they are at is
    dropped when it ends.
    """
    executor = ThreadPoolExecutor(count)
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        raise
    executor.shutdown()
