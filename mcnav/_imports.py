"""Modules that libraries import and few commands use: executed when they are used.

Two threads that use such a module first at the same time could see half of it (a lock came with Python 3.11.9). Our own
code imports from them before threads begin, or by import statements, which have locks. Others' code may do otherwise:
before it is executed, they are.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType
from typing import Final

UNUSED: Final = frozenset({"numpy.f2py", "numpy.testing", "scipy.spatial"})
"""Parts of numpy that scipy imports, because it copies the names of all of them, and of scipy that its optimisation
imports; many commands use none of them. They take a twentieth of a command's time."""


class _WhenUsed(MetaPathFinder):
    """Finds the modules of `UNUSED`, before the usual finders."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return how to load a module of `UNUSED`; none for others."""
        found = PathFinder.find_spec(name, path, target) if name in UNUSED else None
        if found is not None and found.loader is not None:
            found.loader = LazyLoader(found.loader)
        return found


def load_when_used() -> None:
    """Let modules of `UNUSED` be executed when something of them is used, in this process from now on."""
    sys.meta_path.insert(0, _WhenUsed())


def load_at_once() -> None:
    """Execute those modules of `UNUSED` that have been imported, and others as soon as they are, from now on."""
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, _WhenUsed)]
    for name in UNUSED & sys.modules.keys():
        dir(sys.modules[name])
