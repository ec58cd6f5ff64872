"""What the routes agree on: lines, failures with widened errors that lie on none, and levels.

The probability of failures on no line, or on lines so heavy that few like them were drawn, is that of the widened
flights that fail there; lines count without those. With fewer than `COUNTED` such failures, all lines count, what lies
on none is added, and what lies on few widens the interval: a little, or nothing is stated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array
from mcnav.rare.follow import Follower
from mcnav.rare.laid import Laid
from mcnav.rare.levels import Levels
from mcnav.rare.search import Search
from mcnav.rare.widened import Widened

CHECKED_FEW, CHECKED_MANY = 40, 800
"""Failures with widened errors that are checked, where flights are dear and cheap, the likeliest first."""

CHECKED: Final = 0.999
"""Share of the probability of all of them that are checked at least, where flights are cheap."""

MUCH: Final = 0.25
"""Share of the estimate by which its interval may be widened for what few failures away from the lines stand for."""

COUNTED: Final = 20.0
"""Independent failures away from the lines from which they may stand for more, if their weights' tail allows it."""

SPREAD: Final = 0.05
"""Share of the flights with widened errors that may fail away from the lines: more is a region of its own."""

WIDER: Final = 1.2
"""Factor of the interval's reach to each side.

Of 120 log-normal weights, the fewest lines, with logarithms of the variance `mcnav.rare.laid.SCATTERED`, Student's and
Hall's intervals of 95 % hold in 92 %, and with it in 95 %: by simulation, in the tests.
"""

AGREE: Final = 0.995
"""Confidence at which levels and lines must contradict each other."""

ROUGHEST: Final = 0.6
"""Standard error of the logarithm by levels from which they are no estimate."""


@dataclass(frozen=True)
class Rare:
    """Probability of a rare event.

    Attributes
    ----------
    estimate, low, high : float
        The probability and its two-sided interval; NaN where it is refused.
    flights : int
    refusal : str
        Why nothing is stated; empty where it is.
    point : ndarray, shape (d,)
        The most likely way to fail: the point of the event nearest to zero on the line that matters most.
    sides : int
        Separate ways to fail that carry at least a hundredth of the estimate.
    power : float
        Probability with which the search finds a second half-space of the allowed probability.
    by_levels : bool
        Whether levels decide the interval, since lines contradict them or do not cover the event.
    """

    estimate: float
    low: float
    high: float
    flights: int
    refusal: str
    point: Array
    sides: int = 0
    power: float = 0.0
    by_levels: bool = False


@dataclass(frozen=True)
class Routes:
    """Lines, flights with widened errors, levels where flights are cheap, and the last search for other ways."""

    follower: Follower
    laid: Laid
    widened: Widened
    levels: Levels | None
    search: Search

    def stated(self, confidence: float, allowed: float) -> Rare:
        """Compare the routes, and state what they agree on."""
        laid, levels = self.laid, self.levels
        if levels is not None and levels.scatter > ROUGHEST:
            levels = None
        smooth = None if self.search.jumps or self.search.corner < self.search.far else levels
        stated = partial(self._rare, self.widened.power(allowed))
        if laid.doubt:
            everywhere = self.widened.failed & self.widened.seen
            value, low, high = self.widened.probability(everywhere, confidence)
            if self.levels is not None and self.widened.counted(everywhere) >= COUNTED:
                return stated(value, low, high, by_levels=True)
            if smooth is None:
                return self.refused(laid.doubt)
            of_levels = smooth.interval(confidence)
            return stated(smooth.value, min(low, of_levels[0]), max(high, of_levels[1]), by_levels=True)
        missed = self.missed()
        counted = self.widened.counted(np.logical_or(*missed)) >= COUNTED
        (value, low, high), known = self._with_missed(*missed, counted, confidence)
        if not known and smooth is None:
            return self.refused(self._somewhere(np.logical_or(*missed)))
        if levels is None or counted:
            return stated(value, low, high, by_levels=counted)
        reach = float(special.stdtrit(len(levels.estimates) - 1, 0.5 + 0.5 * AGREE)) * levels.scatter
        difference, of_levels = math.log(levels.value / value), levels.interval(confidence)
        if difference > reach or not known:
            return stated(levels.value, min(low, of_levels[0]), max(high, of_levels[1]), by_levels=True)
        if difference < -reach and smooth is not None:
            low = min(low, of_levels[0])
        return stated(value, low, high)

    def _rare(self, power: float, value: float, low: float, high: float, by_levels: bool = False) -> Rare:
        """State a probability with an interval that reaches farther by `WIDER`."""
        low, high = max(0.0, value - WIDER * (value - low)), value + WIDER * (high - value)
        flights = self.follower.flown.flights
        return Rare(value, low, high, flights, "", self.laid.point, self.laid.sides, power, by_levels)

    def refused(self, reason: str) -> Rare:
        """State nothing, and why."""
        nothing = math.nan
        flown, dimensions = self.follower.flown, self.widened.places.points.shape[1]
        return Rare(nothing, nothing, nothing, flown.flights, reason, np.full(dimensions, nothing))

    def missed(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which flights with widened errors fail on no line of the estimate, and which on few, shape (n,)."""
        widened = self.widened
        picked = widened.heaviest(CHECKED_FEW) if self.levels is None else widened.heaviest(CHECKED_MANY, CHECKED)
        late = ~widened.seen & ~widened.foreseen
        heavy = np.zeros_like(late)
        if len(picked):
            late[picked], heavy[picked] = self.laid.left_out(self.follower, widened.places[picked])
        return late, heavy

    def _with_missed(
        self, late: NDArray[np.bool_], heavy: NDArray[np.bool_], counted: bool, confidence: float
    ) -> tuple[tuple[float, float, float], bool]:
        """Return the estimate with its interval, and whether failures away from the lines are few enough for it."""
        laid, widened = self.laid, self.widened
        missed = late | heavy
        if counted:
            return _sum(laid.light, widened.probability(missed, confidence)), True
        value, low, high = _sum((laid.value, laid.low, laid.high), widened.probability(late, confidence))
        high = max(high, laid.light[0] + widened.probability(missed, confidence)[0])
        few = high - laid.high <= MUCH * laid.value and float(np.mean(missed)) <= SPREAD
        return (value, low, high), few and self.search.corner == math.inf

    def _somewhere(self, missed: NDArray[np.bool_]) -> str:
        sizes = np.linalg.norm(self.widened.places.points[missed], axis=1)
        where = f"{np.min(sizes, initial=self.search.corner):.2g} sigma from the nominal"
        return f"a flight fails {where} where no failure is expected, by a jump or a gate"


def _sum(lines: tuple[float, float, float], rest: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the sum of two independent estimates with the ends of its interval, each of a value and its ends."""
    value = lines[0] + rest[0]
    low, high = (math.hypot(lines[k] - lines[0], rest[k] - rest[0]) for k in (1, 2))
    return value, max(value - low, 0.0), value + high
