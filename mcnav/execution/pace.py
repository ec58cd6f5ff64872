"""Time that simulations will take, estimated from a few of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

LEAST: Final = 0.05
"""Seconds of simulations from which their pace is known."""

FEW: Final = 64
"""Share of the simulations that is timed at most is one over this, and one simulation more."""

GROWTH: Final = 8
"""Times as many simulations in one call as in the call before."""


@dataclass(frozen=True)
class Pace:
    """Time of simulations: ``start + each n`` s for n of them in one call.

    Attributes
    ----------
    start, each : float
        s.
    """

    start: float
    each: float

    def seconds(self, count: int, calls: int = 1) -> float:
        """Return the time of a number of simulations in some calls, s."""
        return self.start * calls + self.each * count

    def of_workers(self, count: int, chunk: int, jobs: int) -> float:
        """Return the time that workers take for simulations in chunks, s.

        >>> Pace(0.0, 0.5).of_workers(300, chunk=128, jobs=2)  # one of them simulates two chunks
        128.0
        """
        rounds = -(-count // (chunk * jobs))
        return self.seconds(min(count, rounds * chunk), rounds)


def measure_pace(simulate: Callable[[int], object], count: int, together: bool) -> Pace:
    """Measure the pace of simulations that have been simulated once, so that all is loaded and compiled.

    Of simulations one after another some are timed, until they take `LEAST` s. Of simulations in one call, which may
    take as long as one of them, one is timed, and so many that they take twice as long or a share of all.

    Parameters
    ----------
    simulate : callable
        Simulates a number of them.
    count : int
        Simulations that there will be.
    together : bool
        Whether they are simulated in one call.
    """
    one = _time_of(simulate, 1)
    number, most, seconds = 1, max(count // FEW, 1), one
    enough = max(2.0 * one, LEAST) if together else LEAST
    while seconds < enough and number < most:
        number = min(GROWTH * number, most)
        seconds = _time_of(simulate, number)
    if not together or number == 1:
        return Pace(0.0, seconds / number)
    each = max(seconds - one, 0.0) / (number - 1)
    return Pace(max(one - each, 0.0), each)


def _time_of(simulate: Callable[[int], object], number: int) -> float:
    began = time.perf_counter()
    simulate(number)
    return time.perf_counter() - began
