"""A user's code while it runs: what it does to the process that it runs in is noticed, undone or refused.

===========================================  ========================================================================
it changes                                   and then
===========================================  ========================================================================
the current folder                           it is restored, and `CodeMisbehaved` raised: the code looks for files there
standard input or output, or other open      `CodeMisbehaved`; a command with a supervisor ends at once
files of the program
``sys.stdout`` and the like, numpy's error   they are restored
handling, the mask of new files, handlers
of signals, a lower recursion limit
its process makes a copy of itself that      the copy is ended, and `CodeMisbehaved` raised
comes back (``fork``)
===========================================  ========================================================================

A command notes for its supervisor where its threads are (`mcnav.execution.supervision`).
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, NoReturn, ParamSpec, TypeVar

import numpy as np

from mcnav.contract.samples import Batch
from mcnav.contract.scenario import ScenarioError
from mcnav.execution import supervision
from mcnav.execution.child_processes import is_worker
from mcnav.execution.interrupts import interrupts
from mcnav.execution.progress import NotCompiled
from mcnav.execution.stopping import Stopped
from mcnav.systems.timeouts import SampleTimeout

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

COPY_RETURNS: Final = 0.1
"""Seconds within which a copy of the process comes back that the code has made and does not end."""

LINEARIZING: Final = "while it was linearized"
TRYING: Final = "while it was tried out"
"""What a user's code does that simulates the nominal and small errors, and other samples than the campaign's."""

COPIED: Final = "made a copy of the program by fork that came back (it was ended; end copies by os._exit)"

_HANDLED: Final = (signal.SIGINT, signal.SIGTERM)


class CodeMisbehaved(ScenarioError):
    """A user's code that has changed its process in a way that other code would suffer from."""


class Halted(Exception):
    """What a user's code raised to end more than a sample, such as SystemExit: the cause of this exception."""


def raised_by(failure: BaseException) -> BaseException:
    """Return what a user's code raised; other exceptions as they are."""
    return failure.__cause__ if isinstance(failure, Halted) and failure.__cause__ is not None else failure


def call_user(function: Callable[Parameters, Result], *values: Parameters.args, **named: Parameters.kwargs) -> Result:
    """Call a function of the user's.

    Raises `Halted` in place of exceptions that would end more than a sample, such as SystemExit. A copy of the process
    that the function has made ends when it comes back. An interrupt that the function has caught is raised again.
    """
    process = os.getpid()
    try:
        result = function(*values, **named)
    except BaseException as failure:
        if _halts(failure):
            raise Halted from failure
        raise
    finally:
        if os.getpid() != process:
            _end_copy()
    if interrupts.received and threading.current_thread() is threading.main_thread() and not interrupts.deferred:
        raise KeyboardInterrupt
    return result


def _halts(failure: BaseException) -> bool:
    """Return whether an exception would end more than a sample, and the user's code has raised it."""
    if isinstance(failure, (Exception, SampleTimeout, Stopped, NotCompiled)):
        return False
    return not (isinstance(failure, KeyboardInterrupt) and _may_be_interrupted())


def _may_be_interrupted() -> bool:
    """Return whether a KeyboardInterrupt may be of a person: workers ignore theirs, and a command notes it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        return False
    return bool(interrupts.received) or not interrupts.heeded


def simulating(batch: Batch, noise: bool) -> str:
    """Say what a user's code does that simulates samples."""
    if not noise:
        return TRYING
    first, last = int(batch.index[0]), int(batch.index[-1])
    return f"while it simulated sample{f' {first:,}' if first == last else f's {first:,} to {last:,}'}"


@dataclass(frozen=True)
class _Process:
    """What a user's code may change of its process; ``files`` are those that are open."""

    folder: str
    files: tuple[object, ...]
    streams: tuple[Any, Any, Any]
    limit: int
    handlers: tuple[Any, ...]
    mask: int

    @classmethod
    def now(cls) -> _Process:
        """Look at the process; nobody else may look at the same time."""
        mask = os.umask(0o077)
        os.umask(mask)
        handlers, streams = tuple(map(signal.getsignal, _HANDLED)), (sys.stdin, sys.stdout, sys.stderr)
        return cls(_folder(), _files(streams), streams, sys.getrecursionlimit(), handlers, mask)

    def restore(self) -> str:
        """Restore what the code has changed; return what must be refused, empty where there is nothing."""
        os.umask(self.mask)
        sys.stdin, sys.stdout, sys.stderr = self.streams
        if sys.getrecursionlimit() < self.limit:
            sys.setrecursionlimit(self.limit)
        if threading.current_thread() is threading.main_thread():
            for number, handler in zip(_HANDLED, self.handlers, strict=True):
                if signal.getsignal(number) is not handler:
                    signal.signal(number, handler)
        if self.folder != (folder := _folder()):
            with suppress(OSError):
                os.chdir(self.folder)
            return (
                f"changed the current folder (to {folder or 'one that is gone'}; name files by settings of type Path)"
            )
        return ""

    def spoilt_files(self) -> str:
        """Return what the code has done to open files; empty where there is nothing."""
        return "" if _files(self.streams) == self.files else "closed or redirected files that the program has open"


def _folder() -> str:
    try:
        return os.getcwd()  # noqa: PTH109
    except OSError:
        return ""


@cache
def _canary() -> int:
    """Open a file that nobody uses: where it is closed, the code has closed others as well."""
    return os.open(os.devnull, os.O_RDONLY)


def _files(streams: tuple[Any, ...]) -> tuple[object, ...]:
    """Identify standard input, output, errors, and the canary; and say which streams are closed."""
    return (*map(_file, (0, 1, 2, _canary())), *(getattr(stream, "closed", False) for stream in streams))


def _file(number: int) -> tuple[int, int] | None:
    """Return device and inode of an open file."""
    try:
        found = os.fstat(number)
    except OSError:
        return None
    return found.st_dev, found.st_ino


@cache
def _copies() -> mmap.mmap:
    """Return memory that copies of this process share with it: a byte that is one when a copy has come back."""
    if hasattr(os, "register_at_fork"):  # Windows copies no process
        os.register_at_fork(before=_end_copy_again, after_in_parent=_count_copy, after_in_child=_be_copy)
    return mmap.mmap(-1, 1)


@dataclass
class _Running:
    """Code of the user's that runs in this process.

    Attributes
    ----------
    threads : dict of int to (int, str)
        Line of the notes of each thread, and the file whose code it runs.
    before : _Process, optional
        The process before the first of them.
    copies : int
        Copies of the process that have been made.
    copy : bool
        This process is a copy that was made while they ran.
    """

    threads: dict[int, tuple[int, str]]
    before: _Process | None = None
    copies: int = 0
    copy: bool = False


_running: Final = _Running({})
_lock: Final = threading.RLock()


def _count_copy() -> None:
    _running.copies += 1


def _be_copy() -> None:
    _running.copy = bool(_running.threads)


def _end_copy_again() -> None:
    """End a copy that makes another one: it has come back to where it was made. Those of multiprocessing may."""
    if _running.copy and multiprocessing.parent_process() is None:
        _end_copy()


def _end_copy() -> NoReturn:
    """End this copy of a process, and tell the process that it came back."""
    _copies()[0] = 1
    os._exit(0)


@contextmanager
def in_user_code(file: str, doing: str) -> Iterator[None]:
    """Run code of the user's file; ``doing`` says what it does, such as ``while it was read``.

    Raises `CodeMisbehaved` when it has changed what it must not, and `Halted` as `call_user` does.
    """
    process, thread = os.getpid(), threading.get_ident()
    notes = supervision.own_notes()
    with _lock:
        outer = thread in _running.threads
        if not outer:
            taken = {line for line, _ in _running.threads.values()}
            line = next((line for line in range(supervision.PLACES) if line not in taken), supervision.PLACES)
            if not _running.threads:
                _running.before = _Process.now()
                _copies()
            _running.threads[thread] = line, file
            copies = _running.copies
        line, _ = _running.threads[thread]
        before = ""
        if notes is not None and line < supervision.PLACES:
            before = notes.read(line) if outer else ""
            notes.write(line, before if outer and doing == TRYING else f"{file}\t{doing}")
    raised = True
    try:
        with np.errstate():
            yield
        raised = False
    except BaseException as failure:
        if _halts(failure):
            raise Halted from failure
        raise
    finally:
        if os.getpid() != process:
            _end_copy()
        if notes is not None and line < supervision.PLACES:
            notes.write(line, before)
        refused = "" if outer else _leave(thread, copies, file, doing)
        if refused and not raised:
            raise CodeMisbehaved("type", f"{file} {refused} {doing}")


def _leave(thread: int, copies: int, file: str, doing: str) -> str:
    """Restore the process behind code of the user's; return what must be refused, empty where there is nothing."""
    with _lock:
        assert _running.before is not None
        del _running.threads[thread]
        last = not _running.threads
        changed = _running.before.restore()
        spoilt = _running.before.spoilt_files() if last else ""
    if _running.copies > copies:
        _wait_for_copy()
    if _copies()[0]:
        _copies()[0] = 0
        changed = COPIED
    if spoilt and supervision.own_notes() is not None:  # no other words would be read
        supervision.give_up(f"{file} {spoilt} {doing}")
    if spoilt and is_worker() and _file(_canary()) is None:  # nor can its pool hear of it
        os._exit(1)
    return spoilt or changed


def _wait_for_copy() -> None:
    until = time.monotonic() + COPY_RETURNS
    while not _copies()[0] and time.monotonic() < until:
        time.sleep(0.001)
