"""Lines along half-spaces: those of a pilot, where those of the estimate are laid, and the estimate.

    P = sum_j E_v [ ratio(v) (Phi(-t*(v)) 1(event at w + t' alpha_j)) ]

with v from a fitted `Proposal`, t* where the line enters the event, and t' a standard normal beyond t*, which is flown:
each line carries its own check that the event goes on beyond its entry, and the estimate is unbiased where it does not.
Each line has noise of its own, where there is any: what noise adds to the linear outcomes is among the coordinates of
the line, and the expectation is over what is left of it as well. Over time points are shared by the half-spaces of all
epochs: a weight has the share pi_j of the point that is flown as a factor (`mcnav.rare.facets`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav._types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.flights import Flown, Places
from mcnav.rare.informed import Informed
from mcnav.rare.interval import weights_interval
from mcnav.rare.lines import NARROW, Crossings, crossings
from mcnav.rare.proposal import Proposal, hazard_at
from mcnav.rare.strata import draw_members, strata_of
from mcnav.rare.unseen import UnseenNoise

END: Final = 3.5
"""Distance beyond the farthest entry expected to which a line is followed."""

PILOT: Final = 36
OTHERS: Final = 8
"""Lines of the pilot: along the nearest half-spaces, and along one that the linear model does not expect."""

LIKELY: Final = 0.05
"""Probability of a half-space over that of the nearest from which it has as many lines in the pilot."""

DRAWS: Final = 1_000
"""Lines by which a fit is turned into a proposal; they are not flown."""

SHARED_DRAWS: Final = 100
"""The same for the shares of half-spaces that share their points."""

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
"""Variance of the logarithm of a line's probability about the fit, at most, where the linear model misses noise."""

NEVER: Final = 37.0
"""Entry of lines of which none was seen to enter; its probability is 1e-299."""

CHEAP: Final = 4
"""Times as many lines where points of the event inform them: flights are cheap there."""

EACH: Final = 5
"""Lines that each cell gets at least: few cells carry much, but together the small ones may."""

SHARED_LINES: Final = 160
"""Lines of the pilot along half-spaces that share their points, at least one each."""

LINEAR: Final = 0.25
"""Share of the lines of the estimate that half-spaces that share their points have by the linear model alone."""

LEAST_SHARE: Final = 1e-3
"""Share of the lines of such a half-space that is expected to have none: the side opposite to all ways to fail."""

SLACK: Final = 1.1
"""Factor by which the lines of a fit may weigh more than those of moments, which scatter."""

NEAR: Final = 0.05
"""Distance before its entry at which a point of the event counts as beyond: as far as entries are inexact."""

UNLIKELY: Final = 0.05
"""Share of the estimate that a line would carry from which on too few like it are drawn to be sure of any."""

BEFORE: Final = "flights fail before the limit is reached along their line as well: it is crossed more than once"


@dataclass(frozen=True)
class Lines:
    """Lines that were followed.

    Facet, v, entry, whether a flight beyond it fails, and the share of that flight's point that is the facet's, shape
    (n,); entries as points with their noise; points before the entry of a line that fail as well; flights to find the
    entries.
    """

    facet: IndexArray
    across: Array
    entry: Array
    beyond: Array
    share: Array
    points: Places
    before: Places
    begin: Array
    flights: int

    def weights(self, proposals: list[Proposal]) -> Array:
        """Return ``ratio(v) Phi(-t*) pi``, zero where the flight beyond the entry is not in the event, shape (n,)."""
        ratio = np.empty(len(self.facet))
        for j, proposal in enumerate(proposals):
            ratio[self.facet == j] = proposal.ratio(self.across[self.facet == j])
        return np.asarray(ratio * special.ndtr(-self.entry) * self.beyond * self.share)


@dataclass(frozen=True)
class Laid:
    """Lines of the estimate, and what follows from them.

    Attributes
    ----------
    value, low, high : float
        The probability and its two-sided interval.
    doubt : str
        What contradicts the lines; empty where nothing does. Without any lines all else is NaN or empty.
    light : tuple of float
        The value and its interval without lines that carry more than `UNLIKELY` of it each.
    point : ndarray, shape (d,)
    sides : int
        See `mcnav.rare.estimate.Rare`.
    proposals : list of Proposal
    each : ndarray, shape (facets,)
        Share of the estimate that a line of each half-space has for each unit of its weight.
    """

    value: float
    low: float
    high: float
    doubt: str
    point: Array
    sides: int = 0
    proposals: Sequence[Proposal] = ()
    each: Array = field(default_factory=lambda: np.zeros(0))
    light: tuple[float, float, float] = (math.nan, math.nan, math.nan)


def slopes_of_logarithm(at: Array) -> Array:
    """Return the slope of ``-log Phi(-t)``, about, shape (n,)."""
    return np.asarray(np.abs(at) + 1.0 / np.maximum(np.abs(at), 1.0))


def nothing_laid(reason: str, dimensions: int) -> Laid:
    """Return that no lines are laid, and why."""
    return Laid(math.nan, math.nan, math.nan, reason, np.full(dimensions, math.nan))


@dataclass
class Plan:
    """Lines along some half-spaces: those of the pilot, and those of the estimate."""

    flown: Flown
    expected: Callable[[Array], Array]
    facets: Facets
    generator: np.random.Generator
    unseen: UnseenNoise | None
    informed: Informed | None = None
    """Points of the event, where there are some, by which lines are laid."""

    few: NDArray[np.bool_] = field(init=False)
    """Half-spaces with too few lines in the pilot for a fit: they enter where the linear model has it, shifted."""

    shift: float = 0.0
    plain: int = 0
    """Lines of the pilot from the standard normal; they come first."""

    def __post_init__(self) -> None:
        self.few = np.arange(len(self.facets.distances)) < (self.facets.foreseen if self.facets.shared else 0)

    def crossed(
        self, facet: IndexArray, across: Array, noise: IndexArray, proposals: Sequence[Proposal]
    ) -> tuple[Crossings, Array]:
        """Return the entries of lines, each with its noise, and their begins, shape (n,)."""
        facets, number = self.facets, len(facet)
        feet, along = facets.feet(facet, across), facets.directions[facet]
        nearest = float(np.min([proposal.constant for proposal in proposals]))
        ends = np.full(number, max(nearest, float(np.min(facets.distances))) + END)
        begins = np.maximum(facets.starts(facet, feet), -ends)
        guesses = np.empty(number)
        for j in np.unique(facet):
            guesses[facet == j] = self.entry(int(j), across[facet == j], proposals[j])
        guesses = np.where((guesses > 0.0) & (guesses < ends), guesses, facets.distances[facet])
        step = 1e-4
        at = feet + facets.distances[facet][:, None] * along
        slopes = (self.expected(at + step * along) - self.expected(at - step * along)) / (2.0 * step)
        return crossings(self.flown, noise, feet, along, guesses, slopes, begins, ends), begins

    def follow(self, facet: IndexArray, across: Array, proposals: list[Proposal], check: bool = True) -> Lines:
        """Follow lines, and fly a point beyond the entry of each, if that is checked, and before that of some."""
        facets, number, noise = self.facets, len(facet), self.flown.new_noise(len(facet))
        feet, along = facets.feet(facet, across), facets.directions[facet]
        entered_at, begins = self.crossed(facet, across, noise, proposals)
        entry = entered_at.at
        uniform = self.generator.random((number, 2))
        entered = np.isfinite(entry)
        beyond, some = np.zeros(number), entered & (np.arange(number) % BETWEEN == 0)
        t = -special.ndtri(uniform[:, 0] * special.ndtr(-entry))
        shared_at = np.where(entered, t if check else entry, 0.0)
        share = facets.shares(facet, feet + shared_at[:, None] * along)
        if check:
            tails = feet[entered] + t[entered, None] * along[entered]
            beyond[entered] = ~(self.flown(tails, noise[entered]) <= 0.0)
        begin = np.maximum(begins, 0.5 * entry)[some]
        t = begin + uniform[some, 1] * (entry[some] * (1.0 - 1e-2) - begin)
        inside = np.asarray(t > begins[some])
        earlier = Places(feet[some][inside] + t[inside, None] * along[some][inside], noise[some][inside])
        before = earlier[~(self.flown(earlier.points, earlier.noise) <= 0.0)]
        entries = Places(feet + np.where(entered, entry, 0.0)[:, None] * along, noise)
        return Lines(facet, across, entry, beyond, share, entries, before, begins, entered_at.flights)

    def pilot(self) -> tuple[Lines, list[Proposal]]:
        """Follow lines from the standard normal, and fit where those of the estimate are laid."""
        facets, d = self.facets, self.facets.directions.shape[1] - 1
        lines = self.pilot_lines()
        facet = np.repeat(np.arange(len(lines)), lines if d or self.unseen is not None else 1)
        plain = [Proposal.plain(d, float(each)) for each in facets.distances]
        across, self.plain = self.generator.standard_normal((len(facet), d)), len(facet)
        if self.informed is not None and d:
            facet, across = np.append(facet, self.informed.facet), np.vstack([across, self.informed.across])
            lines = np.bincount(facet, minlength=len(lines))
        followed = self.follow(facet, across, plain, check=False)
        fitted = []
        normal = self.generator.standard_normal((DRAWS, d))
        self.few = facets.shared & (lines <= d + 3) & (np.arange(len(lines)) < facets.foreseen)
        self.shift = self.shifted(followed)
        for j, count in enumerate(lines):
            mine = facet == j
            mine &= np.isfinite(followed.entry) & (followed.entry > followed.begin)  # others enter with their cell
            entered = followed.entry[mine] - self.moved(j, followed.across[mine])
            fit = Proposal.plain(d, float(np.mean(entered)) if len(entered) else NEVER)
            if self.few[j]:
                fitted.append(plain[j])
                continue
            if count > (d + 3 if j < facets.foreseen else 2 * d + 3) and d:
                fit = Proposal.fitted(followed.across[mine], entered, fit.constant)
            if self.unseen is not None and fit.constant < NEVER:
                fit = fit.with_scatter(*self.unseen.scatter(facets, j, self.flown.limit))
            fit = fit.improved(normal, partial(self.mass_of_fit, j))[0] if fit.constant < NEVER else fit
            moments = None if self.informed is None else self.informed.moments[j]
            fitted.append(fit if moments is None else self.lighter(j, followed, fit, moments.applied(fit)))
        return followed, fitted

    def lighter(self, facet: int, lines: Lines, fit: Proposal, moments: Proposal) -> Proposal:
        """Return the proposal whose lines through points of the event weigh less: their mean is that of squares."""
        mine = (lines.facet == facet) & (np.arange(len(lines.facet)) >= self.plain)
        tails = special.ndtr(-lines.entry[mine])
        heavy = [float(np.sum(proposal.ratio(lines.across[mine]) * tails)) for proposal in (fit, moments)]
        return fit if heavy[0] <= SLACK * heavy[1] else moments

    def pilot_lines(self) -> IndexArray:
        """Return how many lines of the pilot are laid along each half-space, shape (facets,)."""
        facets, d = self.facets, self.facets.directions.shape[1] - 1
        likely = facets.probabilities / np.max(facets.probabilities)
        likely[facets.foreseen : facets.foreseen + 1] = 0.0  # the opposite side
        if facets.shared:
            number = max(SHARED_LINES, 2 * d + 12)
            lines = np.ceil(number * likely / likely.sum()).astype(int)
            lines[facets.foreseen :] = np.maximum(lines[facets.foreseen :], OTHERS)
            return np.asarray(np.maximum(lines, 1))
        number, likely = max(PILOT, 2 * d + 12), np.minimum(1.0, likely / LIKELY)
        return np.asarray(np.maximum(OTHERS, np.ceil(number * likely / max(1.0, likely.sum() / 4.0)).astype(int)))

    def shifted(self, pilot: Lines) -> float:
        """Return how much later lines of half-spaces without a fit enter, by their probabilities, than expected."""
        facets, mine = self.facets, self.few[pilot.facet]
        if not mine.any():
            return 0.0
        facet, across = pilot.facet[mine], pilot.across[mine]
        feet = facets.feet(facet, across)
        at = np.maximum(facets.entries(facet, feet), 0.0)
        expected = special.ndtr(-at) * facets.shares(facet, feet + at[:, None] * facets.directions[facet])
        found = float(np.sum(special.ndtr(-pilot.entry[mine]) * pilot.share[mine])) / float(np.sum(expected))
        return -math.log(found) / hazard_at(float(np.min(facets.distances))) if found > 0.0 else NEVER

    def entry(self, facet: int, across: Array, proposal: Proposal) -> Array:
        """Return the entries of lines at v of one facet that its fit expects, shape (n,)."""
        moved = self.moved(facet, across)
        return moved + (self.facets.distances[facet] + self.shift if self.few[facet] else proposal.entry(across))

    def moved(self, facet: int, across: Array) -> Array:
        """Return how much later lines at v of a half-space that shares its points enter any by the linear model.

        Later than their own, shape (n,): what is fitted is the rest.
        """
        if not self.facets.shared or facet >= self.facets.foreseen:
            return np.zeros(len(across))
        expected = self.facets.entries(np.full(len(across), facet), self.facets.feet_of(facet, across))
        return np.asarray(expected - self.facets.distances[facet])

    def mass_of_fit(self, facet: int, across: Array, fitted: Array) -> Array:
        """Return the same as `mass` for values of a fit."""
        return self.mass(facet, across, self.moved(facet, across) + fitted)

    def mass(self, facet: int, across: Array, entry: Array) -> Array:
        """Return ``Phi(-t*) pi`` of lines of one facet with their entries, or their begins, shape (n,)."""
        facets, feet = np.full(len(across), facet), self.facets.feet_of(facet, across)
        at = np.maximum(entry, self.facets.starts(facets, feet))
        points = feet + at[:, None] * self.facets.directions[facet]
        return np.asarray(special.ndtr(-at) * self.facets.shares(facets, points))

    def means(self, lines: Lines) -> Array:
        """Return the probability of each cell by the pilot, shape (facets,)."""
        plain, facet = (special.ndtr(-lines.entry) * lines.share)[: self.plain], lines.facet[: self.plain]
        return np.array([np.mean(plain[facet == j]) for j in range(len(self.facets.distances))])

    def shares(self, pilot: Lines, proposals: list[Proposal]) -> Array:
        """Return the share of the lines of each cell: its probability by the pilot and by the fit, shape (facets,).

        The fit alone knows what few lines of a small cell miss; where no line enters, it knows nothing.
        """
        d, facets = self.facets.directions.shape[1] - 1, self.facets
        normal = self.generator.standard_normal((DRAWS, d))
        means, fitted = self.means(pilot), np.zeros(len(proposals))
        for j, proposal in enumerate(proposals):
            if proposal.constant < NEVER and not self.few[j]:
                v = proposal.draw((np.arange(DRAWS) + 0.5) / DRAWS, normal)
                fitted[j] = float(np.mean(proposal.ratio(v) * self.mass(j, v, self.entry(j, v, proposal))))
        if facets.shared:
            points = self.generator.standard_normal((SHARED_DRAWS, d + 1))
            fitted = np.where(self.few, facets.expected_masses(points, self.shift)[0], fitted)
        shares = means / means.sum() + fitted / max(fitted.sum(), 1e-300)
        shares /= shares.sum()
        if self.informed is not None:
            shares = 0.5 * (shares + self.informed.shares)
        if not facets.shared:
            return np.asarray(shares)
        linear, _ = facets.expected_masses(points, 0.0)
        shares = (1.0 - LINEAR) * shares + LINEAR * linear / linear.sum()
        shares[shares == 0.0] = LEAST_SHARE
        return np.asarray(shares / shares.sum())

    def nearest(self, pilot: Lines) -> float:
        """Return the distance of a half-space as probable as the event is by the pilot."""
        total = float(np.sum(self.means(pilot)))
        return float(-special.ndtri(total)) if total > 0.0 else float(np.min(self.facets.distances))

    def estimate(self, pilot: Lines, proposals: list[Proposal], precision: float, confidence: float, most: int) -> Laid:
        """Lay the lines of the estimate, about as many as its precision needs with so many flights at most."""
        d = self.facets.directions.shape[1]
        means = self.means(pilot)
        if not np.sum(means) > 0.0:
            return nothing_laid("no flight fails where the linear model expects it", d)
        shares = self.shares(pilot, proposals)
        per_line = pilot.flights / len(pilot.facet) + 1.0 + 1.0 / BETWEEN
        number = self.lines_needed(pilot, proposals, precision)
        times = 1 if self.informed is None else CHEAP
        number = int(np.clip(min(number, most / per_line), times * FEWEST, times * MOST))
        strata = strata_of(shares) if self.facets.shared else np.arange(len(shares))
        of_stratum = np.bincount(strata, shares)
        lines_of = np.maximum(np.rint(number * of_stratum), times * EACH).astype(np.int64)
        stratum, number = np.repeat(np.arange(len(of_stratum)), lines_of), int(lines_of.sum())
        facet = draw_members(stratum, strata, shares, self.generator) if self.facets.shared else stratum
        within = shares / of_stratum[strata] if self.facets.shared else 1.0
        shares = (lines_of / number)[strata] * within
        uniform, normal = self.generator.random(number), self.generator.standard_normal((number, d - 1))
        across = np.empty((number, d - 1))
        for j, proposal in enumerate(proposals):
            mine = facet == j
            across[mine] = proposal.draw(uniform[mine], normal[mine])
        lines = self.follow(facet, across, proposals)
        weights = lines.weights(proposals) / shares[facet]
        value, low, high = weights_interval(weights, stratum, confidence)
        parts = np.array([weights[facet == j].sum() for j in range(len(shares))]) / number
        sides = int(np.count_nonzero(parts > 0.01 * value))
        doubt = self.doubt(lines, weights, value, proposals, shares)
        point = self.likely(lines, weights, proposals) if value > 0.0 else np.full(d, math.nan)
        light = weights_interval(np.where(weights > UNLIKELY * value * number, 0.0, weights), stratum, confidence)
        return Laid(value, low, high, doubt, point, sides, proposals, 1.0 / (number * shares), light)

    def expected_lines(self, pilot: Lines, proposals: list[Proposal]) -> Laid:
        """Return what the fewest lines of an estimate would be by the pilot, of which none is laid."""
        means = self.means(pilot)
        shares = np.maximum(means / max(float(np.sum(means)), 1e-300), MINOR)
        expected = nothing_laid("", self.facets.directions.shape[1])
        return replace(expected, value=float(np.sum(means)), proposals=proposals, each=1.0 / (FEWEST * shares))

    def left_out(self, places: Places, laid: Laid) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which points of the event lie on no line, and which on few lines of the estimate, both shape (n,).

        The line of the first enters later; that of the others is so heavy that few or none like it were drawn.
        """
        facets = self.facets
        cells = facets.cells(places.points)
        across = np.einsum("nij,ni->nj", facets.bases[cells], places.points)
        along = np.einsum("nd,nd->n", places.points, facets.directions[cells])
        entry = self.crossed(cells, across, places.noise, laid.proposals)[0].at
        entered = np.isfinite(entry)
        share = facets.shares(cells, facets.points(cells, across, np.where(entered, entry, 0.0)))
        carried = special.ndtr(-entry) * share * laid.each[cells]
        for j, proposal in enumerate(laid.proposals):
            carried[cells == j] *= proposal.ratio(across[cells == j])
        late = entry > along + NEAR
        return np.asarray(late), np.asarray(~late & (carried > UNLIKELY * laid.value))

    def scatter(self, lines: Lines, weights: Array, proposals: list[Proposal]) -> float:
        """Return the variance of the logarithm of a line's probability about the fit, of the heaviest half-space."""
        j = int(np.argmax(np.bincount(lines.facet, weights, len(proposals))))
        mine = (lines.facet == j) & np.isfinite(lines.entry)
        at, fitted = lines.entry[mine], self.entry(j, lines.across[mine], proposals[j])
        return float(np.var(slopes_of_logarithm(at) * (at - fitted)))

    def lines_needed(self, pilot: Lines, proposals: list[Proposal], precision: float) -> float:
        """Return the lines that a relative standard error needs, from the scatter about the fit of the pilot."""
        j = int(np.argmax(self.means(pilot)))
        if self.few[j]:
            return self.few_lines_needed(pilot, precision)
        mine = (pilot.facet == j) & np.isfinite(pilot.entry) & (pilot.entry > pilot.begin)
        t, proposal = pilot.entry[mine], proposals[j]
        if len(t) < 8:
            return math.inf if len(proposal.mean) or self.unseen is not None else 0.0
        scatter = float(np.std(slopes_of_logarithm(t) * (t - self.entry(j, pilot.across[mine], proposal))))
        freedom = max(len(t) - 2.0 * len(proposal.mean) - 2.0, 1.0)
        scatter *= math.sqrt(len(t) / freedom)
        normal = self.generator.standard_normal((DRAWS, len(proposal.mean)))
        fitted = proposal.improved(normal, partial(self.mass_of_fit, j))[1]
        return (math.expm1(min(scatter**2, 20.0)) + fitted) / precision**2

    def few_lines_needed(self, pilot: Lines, precision: float) -> float:
        """Return the same where half-spaces follow the linear model: from the scatter about it, and its shares'."""
        facets, mine = self.facets, self.few[pilot.facet] & np.isfinite(pilot.entry) & (pilot.entry > pilot.begin)
        if np.count_nonzero(mine) < 8:
            return math.inf
        facet = pilot.facet[mine]
        expected = facets.entries(facet, facets.feet(facet, pilot.across[mine])) + self.shift
        scatter = float(np.std(pilot.entry[mine] - expected)) * hazard_at(float(np.min(facets.distances)))
        masses, variations = facets.expected_masses(
            self.generator.standard_normal((SHARED_DRAWS, facets.directions.shape[1])), self.shift
        )
        shared = float(masses @ variations / np.sum(masses))
        return (math.expm1(min(scatter**2, 20.0)) + shared) / precision**2

    def doubt(self, lines: Lines, weights: Array, value: float, proposals: list[Proposal], shares: Array) -> str:
        """Say what contradicts the estimate; nothing where nothing does."""
        if self.flown.failed:
            return f"{self.flown.failed} of {self.flown.flights} flights failed"
        if not value > 0.0:
            return "no flight fails where the linear model expects it"
        if self.unseen is not None and self.scatter(lines, weights, proposals) > SCATTERED:
            return "noise that the linear model does not see moves the limit too far"
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

    def agreement(self, lines: Lines, weights: Array, proposals: list[Proposal], shares: Array) -> float:
        """Return the weights of lines in the major cells over those that the fit of the pilot predicts."""
        predicted = np.zeros(len(lines.facet))
        major = (shares[lines.facet] > MINOR) | self.facets.shared
        for j, proposal in enumerate(proposals):
            mine = (lines.facet == j) & major
            v = lines.across[mine]
            predicted[mine] = proposal.ratio(v) * self.mass(j, v, self.entry(j, v, proposal))
        return float(np.sum(weights[major]) / np.sum(predicted / shares[lines.facet]))

    def likely(self, lines: Lines, weights: Array, proposals: list[Proposal]) -> Array:
        """Return the most likely point of failure: the mean of the entries of the heaviest cell, by their weights."""
        j = int(np.argmax(np.bincount(lines.facet, weights, len(self.facets.distances))))
        mine = (lines.facet == j) & (weights > 0.0)
        share = weights[mine] / weights[mine].sum()
        across = lines.across[mine]
        if self.facets.shared and len(share) < 2 * self.facets.directions.shape[1]:
            across = np.repeat(proposals[j].mean[None], len(share), axis=0)  # the mean of few is no centre
        feet = self.facets.feet(lines.facet[mine], across)
        centre = share @ feet
        along = float(share @ lines.entry[mine]) + NARROW
        return np.asarray(centre + along * self.facets.directions[j])
