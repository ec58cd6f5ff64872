"""Kernels that several processes of the tests need at the same time: one compiles, the others wait and load its code.

Workers take files of a kind at about the same time, and would all compile what these have in common.
"""

from __future__ import annotations

import os
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from filelock import FileLock, Timeout
from numba.core import event

from mcnav.compiled.objects import Code
from mcnav.compiled.target import INTO
from mcnav.execution.progress import COMPILATION
from tests.processes import LONG

VARIABLE: Final = "MCNAV_TESTS_COMPILE_IN"
"""Variable of the environment with the folder of the locks, for processes that the tests start."""

_held: Final[dict[int, list[FileLock]]] = defaultdict(list)
"""Locks of functions that this process compiles, by their code."""

_load, _save = Code.load_overload, Code.save_overload


class _Failures(event.Listener):  # type: ignore[misc]
    """Release the lock of a function that cannot be compiled, whose code is never stored."""

    def on_start(self, event: Any) -> None:
        """Ignore what begins."""

    def on_end(self, event: Any) -> None:
        """Release it; a function that has been compiled is known."""
        dispatcher = event.data["dispatcher"]
        if tuple(event.data["args"]) not in dispatcher.overloads:
            _release(dispatcher._cache)


def share_compilation(folder: Path | None = None) -> None:
    """Let all processes with the same folder of locks compile a function once; without one it is that of `VARIABLE`."""
    if folder is not None:
        folder.mkdir(exist_ok=True)
        os.environ[VARIABLE] = str(folder)
    if VARIABLE in os.environ:
        Code.load_overload, Code.save_overload = _load_or_wait, _save_and_release  # type: ignore[method-assign]
        event.register("numba:compile", _Failures())


def _load_or_wait(code: Code, sig: Any, target_context: Any) -> Any:
    """Load a function, once the process that compiles it has stored it; none where this process is to compile it."""
    found = _load(code, sig, target_context)
    if found is not None or code._stored is None or COMPILATION.refused or INTO in os.environ:
        return found
    name = code._stored._path(code._key(sig, target_context.codegen())).stem
    lock = FileLock(Path(os.environ[VARIABLE], f"{name}.lock"))
    with suppress(Timeout):
        lock.acquire(timeout=LONG)
    found = _load(code, sig, target_context)
    if found is None:
        _held[id(code)].append(lock)
    else:
        lock.release()
    return found


def _save_and_release(code: Code, sig: Any, data: Any) -> None:
    """Store a function that has been compiled, and let others load it."""
    try:
        _save(code, sig, data)
    finally:
        _release(code)


def _release(code: Any) -> None:
    if locks := _held.get(id(code)):
        locks.pop().release()
