"""Demonstration of a probability by counting: how many runs show it, by the consumer's risk.

With n runs of which f fail, a probability of success R is shown at confidence C when it would fail so rarely with a
probability of at most 1 - C if the true one were smaller,

    P(Bin(n, 1 - R) <= f) <= 1 - C

(Clopper and Pearson, 1934; with f = 0 the success-run theorem, n = ln(1 - C) / ln R).
"""

from __future__ import annotations

import math
from bisect import bisect_left

import scipy  # its special functions are imported when one is called

from mcnav.statistics.samples_to_decide import MOST


def runs_to_show(probability: float, confidence: float, failures: int = 0) -> int | None:
    """Return the runs that show a probability at a confidence if so many of them fail; none beyond a billion.

    >>> [runs_to_show(0.95, 0.95, failures) for failures in range(3)]
    [59, 93, 124]
    """
    if not (0.0 < probability < 1.0 and 0.0 < confidence < 1.0):
        raise ValueError(f"probability and confidence must lie between 0 and 1; got {probability} and {confidence}")
    risk = 1.0 - confidence

    def shown(runs: int) -> bool:
        if failures == 0:
            return runs * math.log(probability) <= math.log(risk) * (1.0 - 1e-12)
        return bool(scipy.special.bdtr(failures, runs, 1.0 - probability) <= risk)

    runs = bisect_left(range(MOST), True, lo=failures + 1, key=shown)
    return runs if runs < MOST else None
