"""Processes that tests start: waited for by what they do, not by the clock, and ended whatever becomes of the test."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Final, TypeVar

Found = TypeVar("Found")

LONG: Final = 600.0
"""Seconds after which a test gives up waiting: far more than anything takes on a slow and busy machine."""


@contextmanager
def running(command: Sequence[object], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start a process in a session of its own; at the end it and its children are killed, and its pipes closed.

    Its output and errors are pipes of text unless the options of `subprocess.Popen` say otherwise.
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([*map(str, command)], start_new_session=True, **(pipes | options)) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def run_to_end(command: Sequence[object], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a process to its end, as `subprocess.run` with its output captured."""
    with running(command, **options) as process:
        said, errors = process.communicate(timeout=LONG)
        return subprocess.CompletedProcess(process.args, process.returncode, said, errors)


def wait_for(found: Callable[[], Found], process: subprocess.Popen[str] | None = None) -> Found:
    """Wait until something is found (is true), and return it; fail when the process ends before, or after `LONG`."""
    until = time.monotonic() + LONG
    while True:
        ended = process is not None and process.poll() is not None
        if result := found():
            return result
        if process is not None and ended:
            said = process.stderr.read() if process.stderr else ""
            raise AssertionError(f"ended with status {process.returncode} before: {said[-2000:]}")
        assert time.monotonic() < until, f"nothing in {LONG:g} s"
        time.sleep(0.005)
