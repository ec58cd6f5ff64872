"""A limit on the time that one sample may take.

Whoever flies says what the limit is (`time_limit`), whoever calls one sample's code keeps it (`within_limit`). Python
code, and libraries that call back into it, are stopped by a signal; what does not listen to signals, such as a loop in
compiled code, is stopped by ending the worker process, which the runner outlives. Signals reach the main thread alone:
elsewhere there is no limit, and so the runner flies in worker processes when there is to be one.

Flights in a thread beside the run are stopped between two flights (`stopped_by`).
"""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

Result = TypeVar("Result")

PATIENCE: Final = 1.5
"""Limits after which, and half a second more, a worker that has not listened is ended."""

_seconds: list[float] = []
_silent: list[int] = []
_stop = threading.local()


class SampleTimeout(BaseException):
    """A sample that exceeded its time; no ``except Exception`` of a user's keeps it."""


class Stopped(BaseException):
    """Flights whose results are not wanted any more."""


@contextmanager
def stopped_by(event: threading.Event) -> Iterator[None]:
    """Raise `Stopped` in this thread at its next flight once the event is set."""
    _stop.event = event
    try:
        yield
    finally:
        del _stop.event


def check_stopped() -> None:
    """Raise `Stopped` when the event of `stopped_by` is set in this thread."""
    event = getattr(_stop, "event", None)
    if event is not None and event.is_set():
        raise Stopped


def timeout_reason(seconds: float) -> str:
    """Why such a sample failed."""
    return f"took longer than {seconds:g} s"


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Let each call of `within_limit` take so many seconds, in this process; it ends when one does not listen."""
    if seconds is None:
        yield
        return
    _seconds.append(seconds)
    try:
        yield
    finally:
        _seconds.pop()


def within_limit(call: Callable[[], Result]) -> Result:
    """What a call returns, when it does so in time.

    Raises
    ------
    SampleTimeout
        When it does not.
    Stopped
        When it is not wanted any more.
    """
    check_stopped()
    if not _seconds or threading.current_thread() is not threading.main_thread():
        return call()
    seconds = _seconds[-1]

    def stop(number: int, frame: object) -> None:
        raise SampleTimeout(timeout_reason(seconds))

    if not _silent:
        _silent.append(os.open(os.devnull, os.O_WRONLY))
    earlier = signal.signal(signal.SIGALRM, stop)
    faulthandler.dump_traceback_later(PATIENCE * seconds + 0.5, exit=True, file=_silent[0])
    signal.setitimer(signal.ITIMER_REAL, seconds, seconds)  # again and again: some code swallows the first
    try:
        return call()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, earlier)
