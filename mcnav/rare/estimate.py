"""Probability of a rare event by lines along the linear model, with a search for what the linear model misses.

    P = sum_j E_v [ ratio(v) (Phi(-t*(v)) 1(event at w + t' alpha_j)) ]

with v from a fitted `Proposal`, t* where the line enters the event, and t' a standard normal beyond t*, which is flown:
each line carries its own check that the event goes on beyond its entry, and the estimate is unbiased where it does not.
Each line has noise of its own, where there is any: what noise adds to the linear outcomes is among the coordinates of
the line, and the expectation is over what is left of it as well.

What lies before the entries, or away from the lines, is looked for by flights in other places (`mcnav.rare.search`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.rare.curvature import turned
from mcnav.rare.facets import Facets, Outputs, linear_facets
from mcnav.rare.flights import Flown, Outcomes, Places
from mcnav.rare.interval import weights_interval
from mcnav.rare.limits import Limit
from mcnav.rare.lines import crossings
from mcnav.rare.proposal import Proposal, hazard_at
from mcnav.rare.search import Search, search_elsewhere
from mcnav.rare.unseen import UnseenNoise

END: Final = 3.5
"""How far beyond the farthest entry expected a line is followed."""

PILOT: Final = 36
OTHERS: Final = 8
"""Lines of the pilot: along the nearest half-spaces, and along one that the linear model does not expect."""

DRAWS: Final = 1_000
"""Lines by which a fit is turned into a proposal; they are not flown."""

FEWEST, MOST = 120, 1_000
"""Lines of the estimate."""

HEAVIEST: Final = 0.25
"""Share of the estimate that a single line may carry."""

BETWEEN: Final = 4
"""One line in so many is flown at a point before its entry as well."""

DISAGREEMENT: Final = 2.5
"""Factor between the estimate and what the fit of the pilot predicts of the same lines."""

MINOR: Final = 0.02
"""Share of a cell in the probability below which the pilot, of few lines there, is not compared with."""

SCATTERED: Final = 2.5
"""Variance of the logarithm of a line's probability by noise that the linear model does not see, at most."""

NEVER: Final = 37.0
"""Entry of lines of which none was seen to enter; its probability is 1e-299."""

EACH: Final = 5
"""Lines that each cell gets at least: few cells carry much, but together the small ones may."""

BEFORE: Final = "flights fail before the limit is reached along their line as well: it is crossed more than once"


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
    """

    estimate: float
    low: float
    high: float
    flights: int
    refusal: str
    point: Array
    sides: int = 0


@dataclass(frozen=True)
class _Lines:
    """Lines that were followed.

    Facet, v, entry and whether a flight beyond it fails, shape (n,); entries as points with their noise; points before
    the entry of a line that fail as well; flights to find the entries.
    """

    facet: IndexArray
    across: Array
    entry: Array
    beyond: Array
    points: Places
    before: Places
    begin: Array
    flights: int

    def weights(self, proposals: list[Proposal]) -> Array:
        """Return ``ratio(v) Phi(-t*)``, zero where the flight beyond the entry is not in the event, shape (n,)."""
        ratio = np.empty(len(self.facet))
        for j, proposal in enumerate(proposals):
            ratio[self.facet == j] = proposal.ratio(self.across[self.facet == j])
        return np.asarray(ratio * special.ndtr(-self.entry) * self.beyond)


def estimate_probability(
    fly: Outcomes, linear: Outputs, limit: Limit, dimensions: int, seed: int, precision: float = 0.05,
    confidence: float = 0.95, most: int = 1_000, noisy: bool = False,
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
        Flights, about, at most.
    noisy : bool
        Whether flights depend on the number of their noise.
    """
    flown = Flown(fly, limit)
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    facets = linear_facets(linear, limit, dimensions)
    if not len(facets.distances):
        return _refused(flown, "the linear model has no way to fail", dimensions)
    if float(np.min(facets.distances)) <= 0.0:
        return _refused(flown, "the nominal itself lies beyond the limit", dimensions)
    expected = lambda points: limit.margin(linear(points))  # noqa: E731
    facets = turned(facets, flown.outcomes(), limit, generator)
    unseen = UnseenNoise.measure(flown, dimensions) if noisy else None
    plan = _Plan(flown, expected, facets, generator, unseen)
    pilot, proposals = plan.pilot()
    unforeseen = pilot.points[(pilot.facet >= facets.foreseen) & np.isfinite(pilot.entry)]
    unexpected = pilot.before.and_also(unforeseen)
    search = search_elsewhere(flown, expected, facets, proposals, plan.nearest(pilot), unexpected, generator)
    flown.failed = 0  # far out flights may have no result
    if search.refusal:
        return _refused(flown, search.refusal, dimensions)
    if len(search.facets.distances) > len(facets.distances):
        plan = _Plan(flown, expected, search.facets, generator, unseen)
        pilot, proposals = plan.pilot()
    if len(pilot.before):
        return _refused(flown, BEFORE, dimensions)
    return plan.estimate(pilot, proposals, search, precision, confidence, most)


def _refused(flown: Flown, reason: str, dimensions: int) -> Rare:
    return Rare(math.nan, math.nan, math.nan, flown.flights, reason, np.full(dimensions, math.nan))


@dataclass
class _Plan:
    """Lines along some half-spaces: those of the pilot, and those of the estimate."""

    flown: Flown
    expected: Callable[[Array], Array]
    facets: Facets
    generator: np.random.Generator
    unseen: UnseenNoise | None

    def follow(self, facet: IndexArray, across: Array, proposals: list[Proposal], check: bool = True) -> _Lines:
        """Follow lines, and fly a point beyond the entry of each, if that is checked, and before that of some."""
        facets, number = self.facets, len(facet)
        feet, along, noise = facets.feet(facet, across), facets.directions[facet], self.flown.new_noise(number)
        nearest = float(np.min([each.constant for each in proposals]))
        ends = np.full(number, max(nearest, float(np.min(facets.distances))) + END)
        begins = np.maximum(facets.starts(facet, feet), -ends)
        guesses = np.array([proposals[j].entry(v[None])[0] for j, v in zip(facet, across, strict=True)])
        guesses = np.where((guesses > 0.0) & (guesses < ends), guesses, facets.distances[facet])
        step = 1e-4
        at = feet + facets.distances[facet][:, None] * along
        slopes = (self.expected(at + step * along) - self.expected(at - step * along)) / (2.0 * step)
        entered_at = crossings(self.flown, noise, feet, along, guesses, slopes, begins, ends)
        entry = entered_at.at
        uniform = self.generator.random((number, 2))
        entered = np.isfinite(entry)
        beyond, some = np.zeros(number), entered & (np.arange(number) % BETWEEN == 0)
        t = -special.ndtri(uniform[:, 0] * special.ndtr(-entry))
        if check:
            tails = feet[entered] + t[entered, None] * along[entered]
            beyond[entered] = ~(self.flown(tails, noise[entered]) <= 0.0)
        begin = np.maximum(begins, 0.5 * entry)[some]
        t = begin + uniform[some, 1] * (entry[some] * (1.0 - 1e-2) - begin)
        inside = np.asarray(t > begins[some])
        earlier = Places(feet[some][inside] + t[inside, None] * along[some][inside], noise[some][inside])
        before = earlier[~(self.flown(earlier.points, earlier.noise) <= 0.0)]
        entries = Places(feet + np.where(entered, entry, 0.0)[:, None] * along, noise)
        return _Lines(facet, across, entry, beyond, entries, before, begins, entered_at.flights)

    def pilot(self) -> tuple[_Lines, list[Proposal]]:
        """Follow lines from the standard normal, and fit where those of the estimate are laid."""
        facets, d = self.facets, self.facets.directions.shape[1] - 1
        likely = facets.probabilities / np.max(facets.probabilities)
        likely[facets.foreseen : facets.foreseen + 1] = 0.0  # the opposite side
        lines = np.maximum(OTHERS, np.ceil(max(PILOT, 2 * d + 12) * likely / max(1.0, likely.sum() / 3.0)).astype(int))
        facet = np.repeat(np.arange(len(lines)), lines if d or self.unseen is not None else 1)
        plain = [Proposal.plain(d, float(each)) for each in facets.distances]
        followed = self.follow(facet, self.generator.standard_normal((len(facet), d)), plain, check=False)
        fitted = []
        normal = self.generator.standard_normal((DRAWS, d))
        for j, count in enumerate(lines):
            mine = facet == j
            mine &= np.isfinite(followed.entry) & (followed.entry > followed.begin)  # others enter with their cell
            entered = followed.entry[mine]
            fit = Proposal.plain(d, float(np.mean(entered)) if len(entered) else NEVER)
            if d and count > d + 3:
                fit = Proposal.fitted(followed.across[mine], entered, fit.constant)
            if self.unseen is not None and fit.constant < NEVER:
                fit = fit.with_scatter(*self.unseen.scatter(facets, j, self.flown.limit))
            fitted.append(fit.improved(normal, partial(self.begins, j))[0] if fit.constant < NEVER else fit)
        return followed, fitted

    def begins(self, facet: int, across: Array) -> Array:
        """Return where lines of one facet begin, shape (n,)."""
        facets = np.full(len(across), facet)
        return self.facets.starts(facets, self.facets.feet(facets, across))

    def means(self, lines: _Lines) -> Array:
        """Return the probability of each cell by the pilot, shape (facets,)."""
        plain = special.ndtr(-lines.entry)
        return np.array([np.mean(plain[lines.facet == j]) for j in range(len(self.facets.distances))])

    def shares(self, pilot: _Lines, proposals: list[Proposal]) -> Array:
        """Return the share of the lines of each cell: its probability by the pilot and by the fit, shape (facets,).

        The fit alone knows what few lines of a small cell miss; where no line enters, it knows nothing.
        """
        normal = self.generator.standard_normal((DRAWS, self.facets.directions.shape[1] - 1))
        means, fitted = self.means(pilot), np.zeros(len(proposals))
        for j, proposal in enumerate(proposals):
            if proposal.constant < NEVER:
                v = proposal.draw((np.arange(DRAWS) + 0.5) / DRAWS, normal)
                entry = np.maximum(proposal.entry(v), self.begins(j, v))
                fitted[j] = float(np.mean(proposal.ratio(v) * special.ndtr(-entry)))
        shares = means / means.sum() + fitted / max(fitted.sum(), 1e-300)
        return np.asarray(shares / shares.sum())

    def nearest(self, pilot: _Lines) -> float:
        """Return the distance of a half-space as probable as the event is by the pilot."""
        total = float(np.sum(self.means(pilot)))
        return float(-special.ndtri(total)) if total > 0.0 else float(np.min(self.facets.distances))

    def estimate(
        self, pilot: _Lines, proposals: list[Proposal], search: Search, precision: float, confidence: float, most: int
    ) -> Rare:
        """Lay the lines of the estimate, as many as its precision needs, and form it."""
        d = self.facets.directions.shape[1]
        means = self.means(pilot)
        if not np.sum(means) > 0.0:
            return _refused(self.flown, "no flight fails where the linear model expects it", d)
        scatter = self.unseen_scatter(int(np.argmax(means)), proposals)
        if scatter > SCATTERED:
            return _refused(self.flown, "noise that the linear model does not see moves the limit too far", d)
        shares = self.shares(pilot, proposals)
        per_line = pilot.flights / len(pilot.facet) + 1.0 + 1.0 / BETWEEN
        number = self.lines_needed(pilot, proposals, precision)
        number = int(np.clip(min(number, (most - self.flown.flights) / per_line), FEWEST, MOST))
        lines_of = np.maximum(np.rint(number * shares), EACH).astype(np.int64)
        facet, number = np.repeat(np.arange(len(shares)), lines_of), int(lines_of.sum())
        shares = lines_of / number
        uniform, normal = self.generator.random(number), self.generator.standard_normal((number, d - 1))
        across = np.empty((number, d - 1))
        for j, proposal in enumerate(proposals):
            mine = facet == j
            across[mine] = proposal.draw(uniform[mine], normal[mine])
        lines = self.follow(facet, across, proposals)
        weights = lines.weights(proposals) / shares[facet]
        value, low, high = weights_interval(weights, facet, confidence)
        refusal = self.doubt(lines, weights, value, proposals, shares)
        if refusal:
            return _refused(self.flown, refusal, d)
        parts = np.array([weights[facet == j].sum() for j in range(len(shares))]) / number
        point = self.likely(lines, weights)
        return Rare(value, low, high, self.flown.flights, "", point, int(np.count_nonzero(parts > 0.01 * value)))

    def unseen_scatter(self, facet: int, proposals: list[Proposal]) -> float:
        """Return the variance of the logarithm of a line's probability by noise that the linear model does not see."""
        if self.unseen is None:
            return 0.0
        proposal = proposals[facet]
        at, by = self.unseen.scatter(self.facets, facet, self.flown.limit)
        square = np.mean((at + by @ proposal.mean) ** 2) + np.mean(by**2, axis=0) @ proposal.spread**2
        return float(square * hazard_at(proposal.constant) ** 2)

    def lines_needed(self, pilot: _Lines, proposals: list[Proposal], precision: float) -> float:
        """Return the lines that a relative standard error needs, from the scatter about the fit of the pilot."""
        j = int(np.argmax(self.means(pilot)))
        mine = (pilot.facet == j) & np.isfinite(pilot.entry) & (pilot.entry > pilot.begin)
        t, proposal = pilot.entry[mine], proposals[j]
        if len(t) < 8:
            return math.inf if len(proposal.mean) or self.unseen is not None else 0.0
        hazard = np.abs(t) + 1.0 / np.maximum(np.abs(t), 1.0)
        scatter = float(np.std(hazard * (t - proposal.entry(pilot.across[mine]))))
        freedom = max(len(t) - 2.0 * len(proposal.mean) - 2.0, 1.0)
        scatter *= math.sqrt(len(t) / freedom)
        normal = self.generator.standard_normal((DRAWS, len(proposal.mean)))
        fitted = proposal.improved(normal, partial(self.begins, j))[1]
        return (math.expm1(min(scatter**2, 20.0)) + fitted) / precision**2

    def doubt(self, lines: _Lines, weights: Array, value: float, proposals: list[Proposal], shares: Array) -> str:
        """Say what contradicts the estimate; nothing where nothing does."""
        if self.flown.failed:
            return f"{self.flown.failed} of {self.flown.flights} flights failed"
        if not value > 0.0:
            return "no flight fails where the linear model expects it"
        if len(lines.before):
            return BEFORE
        largest = float(np.max(weights) / np.sum(weights))
        if largest > HEAVIEST:
            return f"a single line carries {100.0 * largest:.0f} % of the estimate"
        agreement = self.agreement(lines, weights, proposals, shares)
        if not 1.0 / DISAGREEMENT < agreement < DISAGREEMENT:
            return f"the lines of the estimate have {agreement:.2g} times the probability that the first ones had"
        if np.mean(lines.beyond[np.isfinite(lines.entry)]) < 0.5:
            return "most flights beyond the crossing do not fail"
        return ""

    def agreement(self, lines: _Lines, weights: Array, proposals: list[Proposal], shares: Array) -> float:
        """Return the weights of lines in the major cells over those that the fit of the pilot predicts."""
        predicted = np.zeros(len(lines.facet))
        major = shares[lines.facet] > MINOR
        for j, proposal in enumerate(proposals):
            mine = (lines.facet == j) & major
            v = lines.across[mine]
            predicted[mine] = proposal.ratio(v) * special.ndtr(-np.maximum(proposal.entry(v), lines.begin[mine]))
        return float(np.sum(weights[major]) / np.sum(predicted / shares[lines.facet]))

    def likely(self, lines: _Lines, weights: Array) -> Array:
        """Return the most likely point of failure: the mean of the entries of the heaviest cell, by their weights."""
        j = int(np.argmax(np.bincount(lines.facet, weights, len(self.facets.distances))))
        mine = (lines.facet == j) & (weights > 0.0)
        share = weights[mine] / weights[mine].sum()
        feet = self.facets.feet(lines.facet[mine], lines.across[mine])
        centre = share @ feet
        along = float(share @ lines.entry[mine])
        return np.asarray(centre + along * self.facets.directions[j])
