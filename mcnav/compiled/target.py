"""Processor that kernels are compiled for: a level of x86-64 that many processors have, where this one has it.

The same versions of numba and llvmlite give the same code for a level, wherever they run: code that comes with an
installation (`mcnav.compiled.objects`) is the code that would be compiled here, and samples are the same bits on all
processors of a level. Another processor has code of its own, as does one that ``NUMBA_CPU_NAME`` names.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

import llvmlite.binding as llvm
from numba import config

LEVELS: Final = {
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl",
    "x86-64-v3": "avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave",
}
"""Levels of x86-64 from the highest on, and what a processor needs for each besides what those below it need."""

CHOSEN: Final = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"
"""Variables by which a user chooses a processor."""

INTO: Final = "MCNAV_OBJECTS_INTO"
"""Variable of the environment: a folder to which objects are written, from which they are packed into a wheel."""


def highest_level(features: Mapping[str, bool]) -> str | None:
    """Return the highest level that a processor with such features has; none for one below all of them.

    >>> highest_level({"sse2": True, "avx": True})
    """
    needed: list[str] = []
    has = None
    for level, more in reversed(LEVELS.items()):
        needed += more.split()
        if all(features.get(name, False) for name in needed):
            has = level
    return has


@cache
def _level_here() -> str | None:
    """Return the highest level that this processor has, if any."""
    on_x86 = llvm.get_process_triple().startswith("x86_64")
    return highest_level(llvm.get_host_cpu_features()) if on_x86 else None


def choose_target() -> None:
    """Let numba compile for this processor's level, unless the user chooses; before the first function is compiled."""
    level = _level_here()
    if level is not None and not any(name in os.environ for name in CHOSEN):
        config.CPU_NAME, config.CPU_FEATURES = level, ""


def choose_objects(into: Path, level: str | None) -> None:
    """Let this process write objects (`mcnav.compiled.objects`), for a level unless for that of its processor.

    Raises ValueError where the processor has not the level: what is compiled is run as well.
    """
    highest, levels = _level_here(), list(LEVELS)
    has = [] if highest is None else levels[levels.index(highest) :]
    if level is not None and level not in has:
        raise ValueError(f"got {level}; this processor has {', '.join(has) or 'no such level'}")
    os.environ[INTO] = str(into.resolve())
    if level is not None:
        os.environ.update(zip(CHOSEN, (level, ""), strict=True))
        config.CPU_NAME, config.CPU_FEATURES = level, ""


def target() -> str:
    """Return the name of the processor that code is compiled for, and whether it calls functions of Intel's SVML.

    numba uses this library where it is installed; its functions round otherwise.
    """
    choose_target()
    name = str(config.CPU_NAME or llvm.get_host_cpu_name())
    return f"{name} with SVML" if getattr(config, "USING_SVML", False) else name
