"""Probability of a rare event by lines along the linear model, with two searches for what the linear model misses.

Lines (`mcnav.rare.laid`) are sharp where half-spaces describe the event. What lies before their entries, or away from
them, is looked for by flights with widened errors (`mcnav.rare.widened`), in any number of dimensions. Where flights
are cheap, levels (`mcnav.rare.levels`), which know nothing of half-spaces, look for it as well. A failure on no line,
or on few, is followed, and adds a half-space (`mcnav.rare.search`): once after the pilot, and once after the estimate.
What still lies on none is counted, and the routes are compared (`mcnav.rare.weigh`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.rare.curvature import ALL_PAIRS, Curvature
from mcnav.rare.facets import Facets, Outputs
from mcnav.rare.fit import Fit
from mcnav.rare.flights import Flown, Outcomes, Places
from mcnav.rare.follow import Follower
from mcnav.rare.informed import inform
from mcnav.rare.jumps import known_facets
from mcnav.rare.laid import BEFORE, CHEAP, expected_lines, lay_lines
from mcnav.rare.levels import Levels, simulate_levels
from mcnav.rare.limits import AnyEpoch, Limit
from mcnav.rare.pilot import Pilot, fly_pilot
from mcnav.rare.search import foreseen, search_elsewhere
from mcnav.rare.unseen import UnseenNoise
from mcnav.rare.weigh import CHECKED_FEW, CHECKED_MANY, SPREAD, Rare, Routes
from mcnav.rare.widened import Widened, draw_everywhere, draw_widened, fly_widened, ratio

FEW, MANY, MORE = 400, 4_000, 20_000
"""Flights with widened errors: where flights are dear, where they are cheap, and there where lines do not suffice."""

FOLLOWED_FEW, FOLLOWED_MANY = 5, 12
"""Failures away from the lines that are followed to the nearest point, each time."""

OF_LEVELS: Final = 100
"""Points of the event by levels of which those on no line, or on few, are followed."""

ROUNDS: Final = 2
"""Times that failures away from the lines are followed: from the lines of the pilot, and of the estimate."""


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
    reason = ""
    if not len(facets.distances):
        reason = "the linear model has no way to fail"
    elif float(np.min(facets.distances)) <= 0.0:
        reason = "the nominal itself lies beyond the limit"
    if reason:
        return Rare(math.nan, math.nan, math.nan, flown.flights, reason, np.full(dimensions, math.nan))
    follower = Follower(flown, _Expected(linear, limit), _generator(seed, 0))
    facets = replace(facets, shared=isinstance(limit, AnyEpoch))
    curvature = None
    if dimensions <= ALL_PAIRS or not facets.shared:
        curvature = Curvature.measure(flown.outcomes(), dimensions, follower.generator)
    cheap &= not noisy
    search = _Estimate(follower, linear, limit, seed, cheap, curvature, CHEAP * most if cheap else most)
    return search.estimate(facets, noisy, precision, confidence, allowed)


@dataclass(frozen=True)
class _Expected:
    """Margins by the linear model."""

    linear: Outputs
    limit: Limit

    def __call__(self, points: Array) -> Array:
        return self.limit.margin(self.linear(points))


def _generator(seed: int, route: int) -> np.random.Generator:
    """Return the draws of one route: lines, levels and widened errors have their own."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(route,))))


@dataclass(frozen=True)
class _Estimate:
    """Lines, levels and widened errors with about so many flights for the lines."""

    follower: Follower
    linear: Outputs
    limit: Limit
    seed: int
    cheap: bool
    curvature: Curvature | None
    most: int

    def estimate(self, facets: Facets, noisy: bool, precision: float, confidence: float, allowed: float) -> Rare:
        """Fly a pilot, search, lay the lines of the estimate, search again, and compare."""
        flown, dimensions = self.follower.flown, facets.directions.shape[1]
        facets = self._turned(self.follower.moved_out(facets))
        unseen = UnseenNoise.measure(flown, facets, self.linear) if noisy else None
        pilot = fly_pilot(self.follower, facets, unseen, None)
        lost = flown.failed
        levels = simulate_levels(flown, dimensions, _generator(self.seed, 1)) if self.cheap else None
        points = draw_widened(MANY if self.cheap else FEW, dimensions, _generator(self.seed, 2))
        widened = self._widened(pilot.fit, points, ratio(points))
        surprises, jumps = self._surprises(pilot, widened, levels), False
        for attempt in range(ROUNDS):
            search = search_elsewhere(
                flown, facets, pilot.nearest, surprises, FOLLOWED_MANY if self.cheap else FOLLOWED_FEW
            )
            grown, jumps = len(search.facets.distances) > len(facets.distances), jumps or search.jumps
            if attempt and not grown:
                break
            facets = search.facets
            if grown or levels is not None:
                pilot = self._pilot_of(facets, unseen, levels)
                facets = pilot.fit.facets
            flown.failed = lost  # far out flights may have no result
            affordable = self.most if self.cheap else self.most - flown.flights
            laid = lay_lines(pilot, precision, confidence, affordable)
            routes = Routes(self.follower, laid, widened, levels, search)
            if flown.failed:
                return routes.refused(laid.doubt)
            if laid.doubt:
                break
            missed = np.logical_or(*routes.missed())
            if not 0.0 < float(np.mean(missed)) <= SPREAD:
                break
            surprises = widened.places[missed & widened.seen]
        if not laid.doubt and len(pilot.lines.before):
            laid = replace(laid, doubt=BEFORE)
        routes = replace(routes, laid=laid, search=replace(search, jumps=jumps))
        rare = routes.stated(confidence, allowed)
        if self.cheap and (rare.refusal or rare.by_levels):
            points, weights = draw_everywhere(MORE, laid.fit.facets, _generator(self.seed, 3))
            rare = replace(routes, widened=self._widened(laid.fit, points, weights)).stated(confidence, allowed)
        return rare

    def _turned(self, facets: Facets) -> Facets:
        return facets if self.curvature is None else self.curvature.turned(replace(facets, turned=None), self.limit)

    def _pilot_of(self, facets: Facets, unseen: UnseenNoise | None, levels: Levels | None) -> Pilot:
        """Fly the pilot of half-spaces of a search, informed by levels where there are points of the event."""
        facets, informed = self._turned(facets), None
        if levels is not None and len(levels.points) and not facets.shared:
            informed = inform(facets, levels)
            facets = informed.facets
        return fly_pilot(self.follower, facets, unseen, informed)

    def _widened(self, fit: Fit, points: Array, weights: Array) -> Widened:
        known = foreseen(points, self.follower.expected, fit.facets, fit.proposals)
        return fly_widened(self.follower.flown, points, weights, known)

    def _surprises(self, pilot: Pilot, widened: Widened, levels: Levels | None) -> Places:
        """Return failures that lie on no line of the pilot, or on few, by all that has flown so far."""
        lines, facets = pilot.lines, pilot.fit.facets
        failures = lines.points[(lines.facet >= facets.foreseen) & np.isfinite(lines.entry)].and_also(lines.before)
        picked = widened.heaviest(CHECKED_MANY if self.cheap else CHECKED_FEW)
        failures = failures.and_also(widened.places[picked])
        if levels is not None:
            points = levels.points[:: max(1, len(levels.points) // OF_LEVELS)]
            failures = failures.and_also(Places(points, self.follower.flown.new_noise(len(points))))
        return failures[np.logical_or(*expected_lines(pilot).left_out(self.follower, failures))]
