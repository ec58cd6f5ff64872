"""When to stop adding samples, without spoiling the intervals by looking at them.

Whoever adds samples until an interval is narrow enough, looks at many intervals, and stops at one that may be narrow by
chance. Here the looks are laid down beforehand: at a first size, at its doubles, and at the largest size allowed. With
K of them each interval is formed at ``1 - (1 - confidence) / K``, so that with the stated confidence not one of the K
misses (Bonferroni), and so not the one at which was stopped, whatever made one stop there. Doubling keeps K small: from
8192 samples to a million there are eight looks, which widen the intervals by a quarter.
"""

from __future__ import annotations

from typing import Final

FEWEST: Final = 256
"""Samples before which is not looked."""


def interim_sizes(chunk: int, at_most: int) -> tuple[int, ...]:
    """Sample sizes at which is looked, rising; the last is the largest allowed.

    Parameters
    ----------
    chunk : int
        All but the last size are multiples of it, by powers of two.

    Examples
    --------
    >>> looks(8192, 50_000), looks(100, 1000), looks(8192, 500)
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
    """Confidence at which each of so many looks must hold, for all of them to hold together at the one stated.

    >>> confidence_of_each(0.95, 5)
    0.99
    """
    return 1.0 - (1.0 - confidence) / number
