"""Interim analyses: stopping rules that keep the coverage of intervals.

Adding samples until an interval is narrow enough selects an interval that may be narrow by chance. Interim looks are
therefore fixed in advance: at a first size, at its doubles, and at the largest size. With K looks each interval is
formed at ``1 - (1 - confidence) / K``, so that with the stated confidence all K hold (Bonferroni), including the last
one, whatever the reason to stop. Doubling keeps K small: from 8192 samples to a million there are eight looks, which
widen the intervals by a quarter.
"""

from __future__ import annotations

from typing import Final

FEWEST: Final = 256
"""Smallest size of an interim look."""


def interim_sizes(chunk: int, at_most: int) -> tuple[int, ...]:
    """List the sample sizes of the interim looks, rising: a chunk times powers of two, and last the largest allowed.

    >>> interim_sizes(8192, 50_000), interim_sizes(100, 1000), interim_sizes(8192, 500)
    ((8192, 16384, 32768, 50000), (400, 800, 1000), (500,))
    """
    size = chunk
    while size < FEWEST:
        size *= 2
    sizes = []
    while size < at_most:
        sizes.append(size)
        size *= 2
    return (*sizes, at_most)


def confidence_of_each(confidence: float, number: int) -> float:
    """Return the confidence of each look with which all looks together hold at the stated confidence.

    >>> confidence_of_each(0.95, 5)
    0.99
    """
    return 1.0 - (1.0 - confidence) / number
