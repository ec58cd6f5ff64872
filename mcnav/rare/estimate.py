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
from mcnav.rare.search import RELEVANT, Search, foreseen, search_elsewhere
from mcnav.rare.unseen import UnseenNoise
from mcnav.rare.widened import Widened, draw_widened, fly_widened, ratio

FEW, MANY = 400, 4_000
"""Flights with widened errors: where flights are dear, and where they are cheap."""

FOLLOWED_FEW, FOLLOWED_MANY = 5, 12
"""Unforeseen failures that are followed to the nearest point."""

OF_LEVELS: Final = 100
"""Points of the event by levels that are followed where nothing foresees them."""

CHECKED_FEW, CHECKED_MANY = 40, 800
"""Failures with widened errors whose lines are checked, those that stand for most probability first."""

MUCH: Final = 0.25
"""Share of the estimate that few lines may cover, by which its interval is widened; with more it is refused."""

COUNTED: Final = 20.0
"""Independent failures from which a probability that no line covers is added; with fewer it is refused."""

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


def _left_out_by(plan: Plan, laid: Laid, places: Places) -> NDArray[np.bool_]:
    late, heavy = plan.left_out(places, laid)
    return late | heavy


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
        widened = self._widened(facets, proposals)
        surprises = pilot.points[(pilot.facet >= facets.foreseen) & np.isfinite(pilot.entry)].and_also(pilot.before)
        surprises = surprises.and_also(widened.unforeseen)
        if levels is not None:
            surprises = surprises.and_also(self._of_levels(levels, facets, proposals))
        followed = FOLLOWED_MANY if self.cheap else FOLLOWED_FEW
        left_out = partial(_left_out_by, plan, plan.expected_lines(pilot, proposals))
        search = search_elsewhere(flown, facets, nearest, surprises, followed, left_out)
        if len(search.facets.distances) > len(facets.distances) or levels is not None:
            facets = search.facets
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
        if not laid.doubt and len(pilot.before):
            laid = replace(laid, doubt=BEFORE)
        return self._weighed(plan, laid, widened, levels, search, confidence, allowed)

    def expected(self, points: Array) -> Array:
        """Return the margins by the linear model."""
        return self.limit.margin(self.linear(points))

    def _generator(self, route: int) -> np.random.Generator:
        return np.random.Generator(np.random.Philox(np.random.SeedSequence(self.seed, spawn_key=(route,))))

    def _widened(self, facets: Facets, proposals: Sequence[Proposal]) -> Widened:
        points = draw_widened(MANY if self.cheap else FEW, self.dimensions, self._generator(2))
        return fly_widened(self.flown, points, foreseen(points, self.expected, facets, proposals))

    def _of_levels(self, levels: Levels, facets: Facets, proposals: Sequence[Proposal]) -> Places:
        """Return some points of the event by levels that nothing foresees."""
        surprising = levels.points[~foreseen(levels.points, self.expected, facets, proposals)]
        surprising = surprising[:: max(1, len(surprising) // OF_LEVELS)]
        return Places(surprising, self.flown.new_noise(len(surprising)))

    def _weighed(
        self, plan: Plan, laid: Laid, widened: Widened, levels: Levels | None, search: Search,
        confidence: float, allowed: float,
    ) -> Rare:  # fmt: skip
        """Compare the routes, and state what they agree on."""
        flown, corner = self.flown, search.corner <= search.far
        scatter = math.inf if levels is None else levels.scatter
        stated = partial(
            Rare, flights=flown.flights, refusal="", point=laid.point, sides=laid.sides, power=widened.power(allowed)
        )
        if laid.doubt:
            failures = widened.failed & widened.seen
            if levels is not None and scatter <= ROUGHEST and not search.jumps and not corner:
                return stated(levels.value, *levels.interval(confidence), by_levels=True)
            if self.cheap and widened.counted(failures) >= COUNTED:
                return stated(*widened.probability(failures, confidence), by_levels=True)
            return _refused(flown, laid.doubt, self.dimensions)
        if scatter > ROUGHEST:
            levels = None
        smooth = None if search.jumps or corner else levels
        left, above, reason = self._left_out(plan, laid, widened, smooth, search.corner, confidence)
        if reason:
            return _refused(flown, reason, self.dimensions)
        value, low, high = laid.value + left[0], max(laid.low, left[1]), laid.high + left[2] + above
        if levels is None:
            return stated(value, low, high)
        reach = float(special.stdtrit(len(levels.estimates) - 1, 0.5 + 0.5 * AGREE)) * scatter
        difference = math.log(levels.value / value)
        of_levels = levels.interval(confidence)
        if difference > reach:
            return stated(levels.value, min(low, of_levels[0]), max(high, of_levels[1]), by_levels=True)
        if difference < -reach and not search.jumps and not left[0] > 0.0:
            low = min(low, of_levels[0])
        return stated(value, low, high)

    def _left_out(
        self, plan: Plan, laid: Laid, widened: Widened, levels: Levels | None, corner: float, confidence: float
    ) -> tuple[tuple[float, float, float], float, str]:
        """Return what lines leave out: the probability of failures on none, and that on few lines, or a refusal.

        The first has an interval and is part of the event's; lines contain the second on average, so that it widens the
        interval upwards alone.
        """
        places, nothing = widened.places, (0.0, 0.0, 0.0)
        weights = np.where(widened.failed & widened.seen, ratio(places.points), 0.0)
        most = CHECKED_MANY if self.cheap else CHECKED_FEW
        picked = np.argsort(-weights, kind="stable")[: min(most, int(np.count_nonzero(weights)))]
        late, heavy = ~widened.seen & ~widened.foreseen, np.zeros(len(weights), dtype=bool)
        if len(picked):
            late[picked], heavy[picked] = plan.left_out(Places(places.points[picked], places.noise[picked]), laid)
        whole = widened.probability(late | heavy, confidence)
        if widened.counted(late | heavy) >= COUNTED and whole[0] > MUCH * laid.value:
            return whole, 0.0, ""
        on_none, on_few = widened.probability(late, confidence), widened.probability(heavy, confidence)
        if levels is not None and widened.counted(heavy) < COUNTED:
            above = self._on_few_lines(plan, laid, levels)
        else:  # few flights: a single one far from all others shows nothing
            above = on_few[2] if self.cheap or on_few[1] > 0.0 else 0.0
        if on_none[0] > RELEVANT * laid.value:
            left = on_none
        else:
            left, above = nothing, above + on_none[2]
        surely = left == nothing or widened.counted(late) >= COUNTED
        if (self.cheap or corner == math.inf) and surely and (above <= MUCH * laid.value or levels is not None):
            return left, above, ""
        nearest = min(corner, float(np.min(np.linalg.norm(places.points[late | heavy], axis=1), initial=math.inf)))
        where = f"{nearest:.2g} sigma from the nominal"
        return left, above, f"a flight fails {where} where no failure is expected, by a jump or a gate"

    def _on_few_lines(self, plan: Plan, laid: Laid, levels: Levels) -> float:
        """Return the probability of points by levels that are on few lines of the estimate."""
        picked = np.linspace(0, len(levels.points) - 1, min(OF_LEVELS, len(levels.points))).astype(np.int64)
        places = Places(levels.points[picked], self.flown.new_noise(len(picked)))
        weights = levels.weights[picked] / np.sum(levels.weights[picked])
        return levels.value * float(np.sum(weights[plan.left_out(places, laid)[1]]))
