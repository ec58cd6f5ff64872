"""Ctrl-C and termination of a command: one message and an exit status, whatever the command is doing."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final

from mcnav.execution import supervision

INTERRUPTED: Final = 130
TERMINATED: Final = 143
"""Exit statuses."""

RESUMES: Final = "stored samples are kept, and the same command{} resumes the run"
"""Remedy of a command that stores samples, with room for options to leave out."""


@dataclass
class Interrupts:
    """Signals of this process.

    Attributes
    ----------
    received : list of int
        Signals that end the command.
    resumes : bool
        The command resumes where it stopped.
    deferred : bool
        The first signal interrupts later.
    heeded : bool
        This process listens to signals.
    arrived : int
        Signals that have arrived, those of the supervisor included.
    counted : int
        Signals among them: a terminal sends one to this process and to its supervisor, which passes it on.
    """

    received: list[int] = field(default_factory=list)
    resumes: bool = False
    deferred: bool = False
    heeded: bool = False
    arrived: int = 0
    counted: int = 0

    def count(self) -> bool:
        """Count a signal that has arrived; return whether it is a new one.

        Of the signals that the supervisor has passed on, any number came from the terminal as well.
        """
        self.arrived += 1
        notes = supervision.own_notes()
        passed_on = 0 if notes is None else notes.numbers[supervision.PASSED_ON]
        before, self.counted = self.counted, max(self.counted, passed_on, self.arrived - passed_on)
        return self.counted > before

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return TERMINATED if self.received[:1] == [signal.SIGTERM] else INTERRUPTED


interrupts: Final = Interrupts()


def listen() -> None:
    """Interrupt the command at a signal; end it at once at a second one, and where a library ignored the first."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    interrupts.heeded = True
    sys.unraisablehook = _end_if_ignored
    threading.excepthook = _print_before_a_signal


@contextmanager
def interruptible() -> Iterator[None]:
    """After a signal, end the process with one message, however the block ends and whatever its threads do."""
    listen()
    supervision.unblock_signals()
    try:
        yield
    finally:
        if interrupts.received:
            _end()


def _interrupt(number: int, frame: object) -> None:
    if not interrupts.count():
        return
    interrupts.received.append(number)
    if len(interrupts.received) > 1:  # files are written whole, and workers end with this process
        supervision.end(interrupts.status)
    if not interrupts.deferred:
        raise KeyboardInterrupt


@contextmanager
def deferred() -> Iterator[None]:
    """Let a signal interrupt the command when the block ends: in a library that would leave its work half done."""
    interrupts.deferred = True
    try:
        yield
    finally:
        interrupts.deferred = False
    if interrupts.received:
        raise KeyboardInterrupt


@contextmanager
def until_interrupted() -> Iterator[None]:
    """Run a block that Ctrl-C ends as it is meant to: the command goes on behind it. Termination ends the command."""
    try:
        yield
    except KeyboardInterrupt:
        if interrupts.received != [signal.SIGINT]:
            raise
        interrupts.received.clear()


def _end_if_ignored(ignored: Any) -> None:
    """End the process when an interrupt came in a finalizer or callback, from which exceptions do not propagate."""
    if interrupts.received and issubclass(ignored.exc_type, KeyboardInterrupt):
        _end()
    sys.__unraisablehook__(ignored)


def _print_before_a_signal(failed: threading.ExceptHookArgs) -> None:
    """Print the exception of a thread, but not when the command is ending: libraries' threads may lose their work."""
    if not interrupts.received:
        threading.__excepthook__(failed)


def _end() -> None:
    with suppress(OSError):  # the reader of the output may have ended
        sys.stdout.flush()
        remedy = f"; {RESUMES.format('')}" if interrupts.resumes else ""
        print(f"error: interrupted{remedy}", file=sys.stderr, flush=True)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # libraries may print errors when they are ended at any moment
    atexit._run_exitfuncs()  # temporary folders, semaphores; an ordinary exit would join threads first
    with suppress(OSError):
        sys.stdout.flush()
    supervision.end(interrupts.status)
