"""Whether further workers are worth what they cost: the one rule of runs and of `mcnav.simulate`."""

from __future__ import annotations

import math
from typing import Final

WORTH: Final = 2.0
"""Time that further workers must spare, in times of their cost: as they start they slow the first one, and side by side
all are slower. A loop of three chunks that spared what a worker cost took 7.4 s in place of 6.5 s on two cores."""


def worth_from(jobs: int, chunks: int, cost: float) -> float:
    """Return the time of a chunk from which on all workers are worth their cost, s.

    One worker takes n t for n chunks of t seconds, and w workers take ceil(n / w) t, so that they are worth it where
    (n - ceil(n / w)) t exceeds twice the cost of one, which all of them pay at the same time.

    Parameters
    ----------
    jobs : int
        Workers at most, w.
    chunks : int
        Chunks that are left, n.
    cost : float
        Time that a worker takes until it simulates, s.

    Returns
    -------
    float
        Infinite where nothing can be spared: for one worker, or one chunk.

    Examples
    --------
    >>> worth_from(2, 8, 2.0), worth_from(2, 2, 2.0), worth_from(1, 8, 2.0)
    (1.0, 4.0, inf)
    """
    spared = chunks - math.ceil(chunks / jobs)
    return WORTH * cost / spared if spared > 0 else math.inf
