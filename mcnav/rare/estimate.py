"""Probability of a rare event by lines along the linear model, with two searches for what the linear model misses.

Lines (`mcnav.rare.plan`) are sharp where half-spaces describe the event. What lies before their entries, or away from
them, is looked for by flights with widened errors (`mcnav.rare.widened`), in any number of dimensions. Where flights
are cheap, levels (`mcnav.rare.levels`), which know nothing of half-spaces, look for it as well. A failure that nothing
foresees is followed, and adds a half-space (`mcnav.rare.search`). What still lies on no line of the estimate is
counted, by the share of the widened flights that fail there, and added. Where levels and lines contradict each other,
the interval contains both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav._types import Array
from mcnav.rare.curvature import ALL_PAIRS, Curvature
from mcnav.rare.facets import Facets, Outputs
from mcnav.rare.flights import Flown, Outcomes, Places
from mcnav.rare.informed import inform
from mcnav.rare.jumps import known_facets
from mcnav.rare.levels import Levels, simulate_levels
from mcnav.rare.limits import AnyEpoch, Limit
from mcnav.rare.plan import BEFORE, CHEAP, Laid, Plan
from mcnav.rare.proposal import Proposal
from mcnav.rare.search import Search, foreseen, search_elsewhere
from mcnav.rare.unseen import UnseenNoise
from mcnav.rare.widened import Widened, draw_widened, fly_widened

FEW, MANY, MORE = 400, 4_000, 20_000
"""Flights with widened errors: where flights are dear, where they are cheap, and there where lines do not suffice."""

FOLLOWED_FEW, FOLLOWED_MANY = 5, 12
"""Unforeseen failures that are followed to the nearest point."""

OF_LEVELS: Final = 100
"""Points of the event by levels that are followed where nothing foresees them."""

CHECKED_FEW, CHECKED_MANY = 40, 800
"""Failures with widened errors whose lines are checked, those that stand for most probability first."""

MUCH: Final = 0.25
"""Share of the estimate by which its interval may be widened for what few failures away from the lines stand for."""

COUNTED: Final = 20.0
"""Independent failures away from the lines from which they may stand for more."""

SPREAD: Final = 0.05
"""Share of the flights with widened errors that may fail away from the lines: more is a region of its own."""

ROUNDS: Final = 2
"""Times that failures on no line, or on few, are followed: those of the pilot, and those of the estimate."""

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


def estimate_probability(
    fly: Outcomes, linear: Outputs, limit: Limit, dimensions: int, seed: int, precision: float = 0.05,
    confidence: float = 0.95, most: int = 1_000, noisy: bool = False, cheap: bool = True, allowed: float = 1e-6,
) -> Rare:  # fmt: skip
    """Estimate the probability of a rare event.

    Parameters
    ----------
    fly : callable
        Outputs of standard normals, shape (n, d), and of the noise with some numbers, shape (n,), by simulation: with
        the same numbers it returns the same, with others its noise is independent.
    linear : callable
        Outputs of standard normals by the linear model, to which noise adds nothing else.
    limit : Limit
        What the event is.
    dimensions : int
        d.
    seed : int
        All draws depend on it alone.
    precision : float
        Relative standard error for which the number of lines is chosen, after the pilot and before the estimate.
    confidence : float
        Of the two-sided interval.
    most : int
        Flights, about, at most, for the lines; where they are cheap, `CHEAP` times as many.
    noisy : bool
        Whether flights depend on the number of their noise.
    cheap : bool
        Whether tens of thousands of flights are affordable; not with noise.
    allowed : float
        Probability for which the power of the search is stated.
    """
    flown = Flown(fly, limit)
    facets = known_facets(linear, limit, dimensions)
    if not len(facets.distances):
        return _refused(flown, "the linear model has no way to fail", dimensions)
    if float(np.min(facets.distances)) <= 0.0:
        return _refused(flown, "the nominal itself lies beyond the limit", dimensions)
    routes = _Routes(flown, linear, limit, dimensions, seed, noisy, cheap and not noisy)
    return routes.estimate(facets, precision, confidence, most, allowed)


def _refused(flown: Flown, reason: str, dimensions: int) -> Rare:
    return Rare(math.nan, math.nan, math.nan, flown.flights, reason, np.full(dimensions, math.nan))


@dataclass
class _Routes:
    """Lines, levels and widened errors, each with draws of its own."""

    flown: Flown
    linear: Outputs
    limit: Limit
    dimensions: int
    seed: int
    noisy: bool
    cheap: bool

    def estimate(self, facets: Facets, precision: float, confidence: float, most: int, allowed: float) -> Rare:
        """Lay the lines of a pilot, search, lay those of the estimate, and compare."""
        generator, flown = self._generator(0), self.flown
        facets = replace(facets, shared=isinstance(self.limit, AnyEpoch))
        curvature = None
        if self.dimensions <= ALL_PAIRS or not facets.shared:
            curvature = Curvature.measure(flown.outcomes(), self.dimensions, generator)
            facets = curvature.turned(facets, self.limit)
        unseen = UnseenNoise.measure(flown, facets, self.linear) if self.noisy else None
        plan = Plan(flown, self.expected, facets, generator, unseen)
        pilot, proposals = plan.pilot()
        nearest = plan.nearest(pilot)
        lost = flown.failed
        levels = simulate_levels(flown, self.dimensions, self._generator(1)) if self.cheap else None
        widened = self._widened(facets, proposals, MANY if self.cheap else FEW)
        failures = pilot.points[(pilot.facet >= facets.foreseen) & np.isfinite(pilot.entry)].and_also(pilot.before)
        failures = failures.and_also(widened.places[widened.heaviest(self.checked)])
        if levels is not None:
            failures = failures.and_also(self._of_levels(levels))
        surprises = failures[np.logical_or(*plan.left_out(failures, plan.expected_lines(pilot, proposals)))]
        for attempt in range(ROUNDS):
            search = search_elsewhere(flown, facets, nearest, surprises, FOLLOWED_MANY if self.cheap else FOLLOWED_FEW)
            grown, facets = len(search.facets.distances) > len(facets.distances), search.facets
            if attempt and not grown:
                break
            if grown or levels is not None:
                if curvature is not None:
                    facets = curvature.turned(replace(facets, turned=None), self.limit)
                informed = None
                if levels is not None and len(levels.points) and not facets.shared:
                    informed = inform(facets, levels)
                    facets = informed.facets
                plan = Plan(flown, self.expected, facets, generator, unseen, informed)
                pilot, proposals = plan.pilot()
            flown.failed = lost  # far out flights may have no result
            affordable = CHEAP * most if self.cheap else most - flown.flights
            laid = plan.estimate(pilot, proposals, precision, confidence, affordable)
            if flown.failed:
                return _refused(flown, laid.doubt, self.dimensions)
            if laid.doubt:
                break
            missed = np.logical_or(*self._missed(plan, laid, widened))
            if not 0.0 < float(np.mean(missed)) <= SPREAD:
                break
            surprises = widened.places[missed & widened.seen]
        if not laid.doubt and len(pilot.before):
            laid = replace(laid, doubt=BEFORE)
        rare = self._weighed(plan, laid, widened, levels, search, confidence, allowed)
        if self.cheap and (rare.refusal or rare.by_levels):
            widened = self._widened(plan.facets, laid.proposals, MORE)
            rare = self._weighed(plan, laid, widened, levels, search, confidence, allowed)
        return rare

    def expected(self, points: Array) -> Array:
        """Return the margins by the linear model."""
        return self.limit.margin(self.linear(points))

    def _generator(self, route: int) -> np.random.Generator:
        return np.random.Generator(np.random.Philox(np.random.SeedSequence(self.seed, spawn_key=(route,))))

    def _widened(self, facets: Facets, proposals: Sequence[Proposal], count: int) -> Widened:
        points = draw_widened(count, self.dimensions, self._generator(count))
        return fly_widened(self.flown, points, foreseen(points, self.expected, facets, proposals))

    @property
    def checked(self) -> int:
        """How many failures with widened errors are put on their lines."""
        return CHECKED_MANY if self.cheap else CHECKED_FEW

    def _of_levels(self, levels: Levels) -> Places:
        """Return some points of the event by levels."""
        points = levels.points[:: max(1, len(levels.points) // OF_LEVELS)]
        return Places(points, self.flown.new_noise(len(points)))

    def _weighed(
        self, plan: Plan, laid: Laid, widened: Widened, levels: Levels | None, search: Search,
        confidence: float, allowed: float,
    ) -> Rare:  # fmt: skip
        """Compare the routes, and state what they agree on."""
        flown, smooth = self.flown, levels
        if levels is None or levels.scatter > ROUGHEST or search.jumps or search.corner <= search.far:
            smooth = None
        stated = partial(
            Rare, flights=flown.flights, refusal="", point=laid.point, sides=laid.sides, power=widened.power(allowed)
        )
        if laid.doubt:
            everywhere = widened.failed & widened.seen
            value, low, high = widened.probability(everywhere, confidence)
            if widened.counted(everywhere) >= COUNTED:
                return stated(value, low, high, by_levels=True)
            if smooth is None:
                return _refused(flown, laid.doubt, self.dimensions)
            of_levels = smooth.interval(confidence)
            return stated(smooth.value, min(low, of_levels[0]), max(high, of_levels[1]), by_levels=True)
        late, heavy = self._missed(plan, laid, widened)
        counted, known = widened.counted(late | heavy) >= COUNTED, True
        if counted:
            value, low, high = _sum(laid.light, widened.probability(late | heavy, confidence))
        else:
            value, low, high = _sum((laid.value, laid.low, laid.high), widened.probability(late, confidence))
            high = max(high, laid.light[0] + widened.probability(late | heavy, confidence)[0])
            known = high - laid.high <= MUCH * laid.value and search.corner == math.inf
            known &= float(np.mean(late | heavy)) <= SPREAD
        if not known and smooth is None:
            nearest = np.min(np.linalg.norm(widened.places.points[late | heavy], axis=1), initial=search.corner)
            where = f"{nearest:.2g} sigma from the nominal"
            reason = f"a flight fails {where} where no failure is expected, by a jump or a gate"
            return _refused(flown, reason, self.dimensions)
        if levels is None or levels.scatter > ROUGHEST:
            return stated(value, low, high)
        reach = float(special.stdtrit(len(levels.estimates) - 1, 0.5 + 0.5 * AGREE)) * levels.scatter
        difference, of_levels = math.log(levels.value / value), levels.interval(confidence)
        if difference > reach or not known:
            return stated(levels.value, min(low, of_levels[0]), max(high, of_levels[1]), by_levels=True)
        if difference < -reach and smooth is not None and not counted:
            low = min(low, of_levels[0])
        return stated(value, low, high)

    def _missed(self, plan: Plan, laid: Laid, widened: Widened) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which flights with widened errors fail on no line of the estimate, and which on few, shape (n,)."""
        picked, late = widened.heaviest(self.checked), ~widened.seen & ~widened.foreseen
        heavy = np.zeros_like(late)
        if len(picked):
            late[picked], heavy[picked] = plan.left_out(widened.places[picked], laid)
        return late, heavy


def _sum(lines: tuple[float, float, float], rest: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the sum of two independent estimates with the ends of its interval, each of a value and its ends."""
    value = lines[0] + rest[0]
    low, high = (math.hypot(lines[k] - lines[0], rest[k] - rest[0]) for k in (1, 2))
    return value, max(value - low, 0.0), value + high
