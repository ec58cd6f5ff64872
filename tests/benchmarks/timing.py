"""Honest times: the least of several runs, in wall time and in what was taken of the processor."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

FEWEST: Final = 3
"""Runs, however long they take."""


@dataclass(frozen=True)
class Timed:
    """Least wall time, least processor time of this process with all its threads, s; and of how many runs."""

    wall: float
    processor: float
    runs: int


def fastest(work: Callable[[], object], seconds: float = 0.5, fewest: int = FEWEST) -> Timed:
    """The least times of runs repeated for some seconds: what other processes took from the rest does not count."""
    found: list[tuple[float, float]] = []
    until = time.perf_counter() + seconds
    while len(found) < fewest or time.perf_counter() < until:
        processor, begin = time.process_time(), time.perf_counter()
        work()
        found.append((time.perf_counter() - begin, time.process_time() - processor))
    return Timed(*(min(times) for times in zip(*found, strict=True)), len(found))


def enough(run: Callable[[int], object], fewest: int, most: int, seconds: float) -> int:
    """How many samples ``run`` takes about some seconds for: ``fewest`` times a power of two, at most ``most``."""
    count = fewest
    while count < most:
        begin = time.perf_counter()
        run(count)
        spent = time.perf_counter() - begin
        if spent > 0.6 * seconds:
            break
        count = min(2 * count, most)
    return count
