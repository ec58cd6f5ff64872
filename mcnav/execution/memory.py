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


@cache
def keep_freed_memory() -> bool:
    """Let this process keep what it frees, up to its peak, where the C library is glibc; return whether it does."""
    try:
        set_parameter = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return bool(set_parameter(MMAP_THRESHOLD, LARGEST_KEPT) and set_parameter(TRIM_THRESHOLD, (1 << 31) - 1))
