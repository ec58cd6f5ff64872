"""One thread for linear algebra, whose threads would compete with those of the samples."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from threading import Lock
from typing import Any, Final

from threadpoolctl import ThreadpoolController

_lock: Final = Lock()
_known: dict[int, ThreadpoolController] = {}
"""Libraries by the number of modules imported when they were looked for, which takes a hundredth of a second."""


def one_thread() -> AbstractContextManager[Any]:
    """Limit libraries of linear algebra to one thread within a context."""
    with _lock:
        imported = len(sys.modules)
        if imported not in _known:
            _known.clear()
            _known[imported] = ThreadpoolController()
        limited: AbstractContextManager[Any] = _known[imported].limit(limits=1)
        return limited
