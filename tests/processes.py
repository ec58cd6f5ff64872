"""Processes that tests start: tests wait for events, not for times, and always end their processes."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, TypeVar

Found = TypeVar("Found")

LONG: Final = 600.0
"""Longest wait of a test, s: far more than any step takes on a slow and busy machine."""


@contextmanager
def running(command: Sequence[object], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start a process in a new session; at the end, kill it and its children and close its pipes.

    Output and errors are text pipes unless the options of `subprocess.Popen` replace them.
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    pipes["encoding"] = (options.get("env") or os.environ).get("PYTHONIOENCODING") or None
    with subprocess.Popen([*map(str, command)], start_new_session=True, **(pipes | options)) as process:
        try:
            yield process
        finally:
            if os.name == "nt":
                process.kill()
            else:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)


def run_to_end(command: Sequence[object], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a process to its end and capture its output."""
    with running(command, **options) as process:
        output, errors = process.communicate(timeout=LONG)
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def wait_for(found: Callable[[], Found], process: subprocess.Popen[str] | None = None) -> Found:
    """Wait until a result is true, and return it; fail when the process ends first, or after `LONG`."""
    until = time.monotonic() + LONG
    while True:
        ended = process is not None and process.poll() is not None
        if result := found():
            return result
        if process is not None and ended:
            errors = process.stderr.read() if process.stderr else ""
            raise AssertionError(f"ended with status {process.returncode} before: {errors[-2000:]}")
        assert time.monotonic() < until, f"no result in {LONG:g} s"
        time.sleep(0.005)


def largest_memory(reset: bool = False) -> int:
    """Return the peak memory of this process, bytes; 0 on a system without POSIX, which does not tell it.

    With ``reset`` the peak starts again at the present memory first, where the system allows it (Linux).
    """
    try:
        import resource
    except ModuleNotFoundError:
        return 0
    if reset:
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
