"""A limit on the time that one sample may take.

`time_limit` sets the limit, `within_limit` applies it to one sample's code. Python code, and libraries that call back
into it, are stopped by a signal; code that ignores signals, such as a compiled loop, is stopped by ending the worker
process. Signals reach the main thread only, so the runner uses worker processes when there is a limit. Where the system
has no alarm, as Windows has none, a thread lets Python handle a signal as if it had come.

Simulations in another thread are stopped between two samples (`mcnav.execution.stopping`).
"""

from __future__ import annotations

import _thread
import faulthandler
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

from mcnav.execution.stopping import check_stopped
from mcnav.execution.supervision import LATE, own_notes

Result = TypeVar("Result")

PATIENCE: Final = 1.5
"""Limits after which, and half a second more, a worker that has not listened is ended."""

READING: Final = 30.0
"""Seconds that user code may take besides samples: packages that a file imports take longer than a sample."""

_seconds: list[float] = []
_silent: list[int] = []
_limits: list[float] = []
"""Limit of the call that is under way in this process."""


class SampleTimeout(BaseException):
    """A sample that exceeded its time; a user's ``except Exception`` does not catch it."""


def timeout_message(seconds: float) -> str:
    """State how long such a sample took."""
    return f"took longer than {seconds:g} s"


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Limit each call of `within_limit` to so many seconds; the process ends when a call ignores signals."""
    if seconds is None:
        yield
        return
    _seconds.append(seconds)
    try:
        yield
    finally:
        _seconds.pop()


def current_limit() -> float | None:
    """Return the limit of a sample that holds now, s; none without one."""
    return _seconds[-1] if _seconds else None


def within_limit(call: Callable[[], Result]) -> Result:
    """Return the result of a call.

    Raises `SampleTimeout` when the call exceeds the limit; `Stopped` when its result is not needed any more.
    """
    check_stopped()
    if not _seconds or threading.current_thread() is not threading.main_thread():
        return call()
    return _limited(call, _seconds[-1])


def within_reading_limit(call: Callable[[], Result]) -> Result:
    """Return the result of a call besides samples, which may take `READING` as well; in a call of a sample, its limit.

    Raises `SampleTimeout` when the call exceeds the limit.
    """
    alone = threading.current_thread() is threading.main_thread() and not _limits
    return _limited(call, max(_seconds[-1], READING)) if _seconds and alone else call()


def _limited(call: Callable[[], Result], seconds: float) -> Result:
    if not _silent:
        _silent.append(os.open(os.devnull, os.O_WRONLY))
    longest = PATIENCE * seconds + 0.5
    faulthandler.dump_traceback_later(longest, exit=True, file=_silent[0])
    notes = own_notes()
    if notes is not None:
        notes.numbers[LATE] = int(time.monotonic() + longest)
    _limits.append(seconds)
    try:
        with _alarm(seconds):
            return call()
    finally:
        _limits.pop()
        if notes is not None:
            notes.numbers[LATE] = 0
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """Raise `SampleTimeout` in the main thread after so many seconds, and again and again: some code swallows it."""
    over = threading.Event()

    def stop(number: int, frame: object) -> None:
        if not over.is_set():
            raise SampleTimeout(timeout_message(seconds))

    number: signal.Signals = getattr(signal, "SIGALRM", signal.SIGTERM)
    earlier = signal.signal(number, stop)
    try:
        with _timer(seconds, number, over):
            yield
    finally:
        over.set()
        signal.signal(number, earlier)


@contextmanager
def _timer(seconds: float, number: signal.Signals, over: threading.Event) -> Iterator[None]:
    """Let a signal come each time that so many seconds have passed; where there are no timers, by a thread."""
    if hasattr(signal, "SIGALRM"):
        signal.setitimer(signal.ITIMER_REAL, seconds, seconds)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        return

    def remind() -> None:
        while not over.wait(seconds):
            _thread.interrupt_main(number)

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield
    finally:
        over.set()
        reminder.join()
