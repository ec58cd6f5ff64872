"""The pilot: a few lines, from which follows where those of the estimate are laid, and how many."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.fit import Fit
from mcnav.rare.follow import Follower, Lines
from mcnav.rare.informed import Informed
from mcnav.rare.proposal import Proposal, hazard_at
from mcnav.rare.unseen import UnseenNoise

PILOT: Final = 36
OTHERS: Final = 8
"""Lines along the nearest half-spaces, and along one that the linear model does not expect."""

SHARED_LINES: Final = 160
"""Lines along half-spaces that share their points, at least one each."""

FEWEST_FITTED: Final = 8
"""Lines from which their scatter is known."""

LIKELY: Final = 0.05
"""Probability of a half-space over that of the nearest from which it has as many lines."""

DRAWS: Final = 1_000
"""Lines by which a fit is turned into a proposal; they are not flown."""

SHARED_DRAWS: Final = 100
"""The same for the shares of half-spaces that share their points."""

NEVER: Final = 37.0
"""Entry of lines of which none was seen to enter; its probability is 1e-299."""

LINEAR: Final = 0.25
"""Share of the lines of the estimate that half-spaces that share their points have by the linear model alone."""

LEAST_SHARE: Final = 1e-3
"""Share of the lines of such a half-space that is expected to have none: the side opposite to all ways to fail."""

SLACK: Final = 1.1
"""Factor by which the lines of a fit may weigh more than those of moments, which scatter."""


@dataclass(frozen=True)
class Pilot:
    """Lines that were followed, of which the first ``plain`` are from the standard normal, and what fits them."""

    lines: Lines
    fit: Fit
    plain: int
    follower: Follower
    unseen: UnseenNoise | None
    informed: Informed | None

    @property
    def means(self) -> Array:
        """Probability of each cell, shape (facets,)."""
        lines = self.lines
        mass, facet = (special.ndtr(-lines.entry) * lines.share)[: self.plain], lines.facet[: self.plain]
        return np.array([np.mean(mass[facet == j]) for j in range(len(self.fit.proposals))])

    @property
    def nearest(self) -> float:
        """Distance of a half-space as probable as the event; infinite where no line enters it."""
        return float(-special.ndtri(np.sum(self.means)))

    def shares(self) -> Array:
        """Return the share of the lines of each cell: its probability by the pilot and by the fit, shape (facets,).

        The fit alone knows what few lines of a small cell miss; where no line enters, it knows nothing.
        """
        fit, facets, generator = self.fit, self.fit.facets, self.follower.generator
        d = facets.directions.shape[1] - 1
        normal = generator.standard_normal((DRAWS, d))
        means, fitted = self.means, np.zeros(len(fit.proposals))
        for j, proposal in enumerate(fit.proposals):
            if proposal.constant < NEVER and not fit.few[j]:
                v = proposal.draw((np.arange(DRAWS) + 0.5) / DRAWS, normal)
                fitted[j] = float(np.mean(proposal.ratio(v) * fit.mass(j, v, fit.entry(j, v))))
        if facets.shared:
            points = generator.standard_normal((SHARED_DRAWS, d + 1))
            fitted = np.where(fit.few, facets.expected_masses(points, fit.shift)[0], fitted)
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

    def lines_needed(self, precision: float) -> float:
        """Return the lines that a relative standard error needs, from the scatter about the fit."""
        lines, fit, j = self.lines, self.fit, int(np.argmax(self.means))
        entered = np.isfinite(lines.entry) & (lines.entry > lines.begin)
        mine = entered & (fit.few[lines.facet] if fit.few[j] else lines.facet == j)
        t, across = lines.entry[mine], lines.across[mine]
        if fit.few[j]:
            return self._few_lines_needed(lines.facet[mine], across, t, precision)
        proposal = fit.proposals[j]
        if len(t) < FEWEST_FITTED:
            return math.inf if len(proposal.mean) or self.unseen is not None else 0.0
        scatter = float(np.std(slopes_of_logarithm(t) * (t - fit.entry(j, across))))
        freedom = max(len(t) - 2.0 * len(proposal.mean) - 2.0, 1.0)
        scatter *= math.sqrt(len(t) / freedom)
        normal = self.follower.generator.standard_normal((DRAWS, len(proposal.mean)))
        fitted = proposal.improved(normal, partial(fit.mass_of_fit, j))[1]
        return (math.expm1(min(scatter**2, 20.0)) + fitted) / precision**2

    def _few_lines_needed(self, facet: IndexArray, across: Array, entry: Array, precision: float) -> float:
        """Return the same where half-spaces follow the linear model: from the scatter about it, and its shares'."""
        facets, shift = self.fit.facets, self.fit.shift
        if len(entry) < FEWEST_FITTED:
            return math.inf
        expected = facets.entries(facet, facets.feet(facet, across)) + shift
        scatter = float(np.std(entry - expected)) * hazard_at(float(np.min(facets.distances)))
        normal = self.follower.generator.standard_normal((SHARED_DRAWS, facets.directions.shape[1]))
        masses, variations = facets.expected_masses(normal, shift)
        shared = float(masses @ variations / np.sum(masses))
        return (math.expm1(min(scatter**2, 20.0)) + shared) / precision**2


def slopes_of_logarithm(at: Array) -> Array:
    """Return the slope of ``-log Phi(-t)``, about, shape (n,)."""
    return np.asarray(np.abs(at) + 1.0 / np.maximum(np.abs(at), 1.0))


def fly_pilot(follower: Follower, facets: Facets, unseen: UnseenNoise | None, informed: Informed | None) -> Pilot:
    """Follow lines from the standard normal, and through points of the event where there are some, and fit them."""
    d, generator = facets.directions.shape[1] - 1, follower.generator
    lines = _lines_of_each(facets)
    facet = np.repeat(np.arange(len(lines)), lines if d or unseen is not None else 1)
    across, plain = generator.standard_normal((len(facet), d)), len(facet)
    if informed is not None and d:
        facet, across = np.append(facet, informed.facet), np.vstack([across, informed.across])
        lines = np.bincount(facet, minlength=len(lines))
    followed = follower.follow(Fit.plain(facets), facet, across, check=False)
    normal = generator.standard_normal((DRAWS, d))
    few = facets.shared & (lines <= d + 3) & (np.arange(len(lines)) < facets.foreseen)
    fit = replace(Fit.plain(facets), few=few, shift=_shift(facets, few, followed))
    proposals = [
        fit.proposals[j] if few[j] else _proposal(fit, j, followed, normal, follower, unseen) for j in range(len(lines))
    ]
    if informed is not None:
        through = np.arange(len(facet)) >= plain
        for j, moments in enumerate(informed.moments):
            if moments is not None and not few[j]:
                mine = through & (followed.facet == j)
                proposals[j] = _lighter(followed, mine, proposals[j], moments.applied(proposals[j]))
    return Pilot(followed, replace(fit, proposals=proposals), plain, follower, unseen, informed)


def _proposal(
    fit: Fit, j: int, lines: Lines, normal: Array, follower: Follower, unseen: UnseenNoise | None
) -> Proposal:
    """Fit the lines of one half-space, and lay those of the estimate where that matters."""
    facets, d = fit.facets, normal.shape[1]
    own = lines.facet == j
    mine = own & np.isfinite(lines.entry) & (lines.entry > lines.begin)  # others enter with their cell
    entered = lines.entry[mine] - fit.moved(j, lines.across[mine])
    proposal = Proposal.plain(d, float(np.mean(entered)) if len(entered) else NEVER)
    if np.count_nonzero(own) > (d + 3 if j < facets.foreseen else 2 * d + 3) and d:
        proposal = Proposal.fitted(lines.across[mine], entered, proposal.constant)
    if unseen is not None and proposal.constant < NEVER:
        proposal = proposal.with_scatter(*unseen.scatter(facets, j, follower.flown.limit))
    return proposal.improved(normal, partial(fit.mass_of_fit, j))[0] if proposal.constant < NEVER else proposal


def _lighter(lines: Lines, mine: NDArray[np.bool_], fitted: Proposal, moments: Proposal) -> Proposal:
    """Return the proposal whose lines through points of the event weigh less: their mean is that of squares."""
    tails = special.ndtr(-lines.entry[mine])
    heavy = [float(np.sum(proposal.ratio(lines.across[mine]) * tails)) for proposal in (fitted, moments)]
    return fitted if heavy[0] <= SLACK * heavy[1] else moments


def _lines_of_each(facets: Facets) -> IndexArray:
    """Return how many lines of the pilot are laid along each half-space, shape (facets,)."""
    d = facets.directions.shape[1] - 1
    logarithms = special.log_ndtr(-facets.distances)
    likely = np.exp(logarithms - np.max(logarithms))
    likely[facets.foreseen : facets.foreseen + 1] = 0.0  # the opposite side
    if facets.shared:
        number = max(SHARED_LINES, 2 * d + 12)
        lines = np.ceil(number * likely / likely.sum()).astype(int)
        lines[facets.foreseen :] = np.maximum(lines[facets.foreseen :], OTHERS)
        return np.asarray(np.maximum(lines, 1))
    number, likely = max(PILOT, 2 * d + 12), np.minimum(1.0, likely / LIKELY)
    return np.asarray(np.maximum(OTHERS, np.ceil(number * likely / max(1.0, likely.sum() / 4.0)).astype(int)))


def _shift(facets: Facets, few: NDArray[np.bool_], lines: Lines) -> float:
    """Return how much later lines of half-spaces without a fit enter, by their probabilities, than expected."""
    mine = few[lines.facet]
    if not mine.any():
        return 0.0
    facet, across = lines.facet[mine], lines.across[mine]
    feet = facets.feet(facet, across)
    at = np.maximum(facets.entries(facet, feet), 0.0)
    expected = special.ndtr(-at) * facets.shares(facet, feet + at[:, None] * facets.directions[facet])
    ratio = float(np.sum(special.ndtr(-lines.entry[mine]) * lines.share[mine])) / float(np.sum(expected))
    return -math.log(ratio) / hazard_at(float(np.min(facets.distances))) if ratio > 0.0 else NEVER
