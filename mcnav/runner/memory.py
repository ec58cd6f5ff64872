"""Memory that a chunk has freed is kept for the next one.

The results of a chunk are some megabytes. The C library gives so much back to the system at once, and the next chunk
asks for it again, page by page; of two threads each then waits for the other's pages for up to a tenth of its time.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Final

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of the parameters of glibc's ``mallopt``."""

LARGEST_KEPT: Final = 32 << 20
"""Bytes of the largest piece that is kept; glibc takes no more."""

EVERYTHING: Final = (1 << 31) - 1

SMALL_PIECES: Final = 4 << 20, 64 << 20
"""Largest piece, and how much in all, that a worker process keeps: the arrays of a step, and not those of a chunk."""


@cache
def keep_freed_memory(largest: int = LARGEST_KEPT, most: int = EVERYTHING) -> bool:
    """Let this process keep what it frees where the C library is glibc; return whether it does.

    Parameters
    ----------
    largest, most : int
        Bytes of the largest piece, and in all; unless given, up to the peak.
    """
    try:
        set_parameter = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return bool(set_parameter(MMAP_THRESHOLD, largest) and set_parameter(TRIM_THRESHOLD, most))
