"""Lines of the estimate, and the estimate:

    P = sum_j E_v [ ratio(v) (Phi(-t*(v)) 1(event at w + t' alpha_j)) ]

with v from a fitted `Proposal`, t* where the line enters the event, and t' a standard normal beyond t*, which is flown:
each line carries its own check that the event goes on beyond its entry, and the estimate is unbiased where it does not.
Each line has noise of its own, where there is any: what noise adds to the linear outcomes is among the coordinates of
the line, and the expectation is over what is left of it as well. Over time points are shared by the half-spaces of all
epochs: a weight has the share pi_j of the point that is flown as a factor (`mcnav.rare.facets`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.rare.fit import Fit
from mcnav.rare.flights import Places
from mcnav.rare.follow import BETWEEN, UNLIKELY, Follower, Lines
from mcnav.rare.interval import weights_interval
from mcnav.rare.lines import NARROW
from mcnav.rare.pilot import Pilot, slopes_of_logarithm
from mcnav.rare.proposal import Proposal
from mcnav.rare.strata import draw_members, strata_of

FEWEST, MOST = 120, 1_000
"""Lines of the estimate."""

CHEAP: Final = 4
"""Times as many lines where points of the event inform them: flights are cheap there."""

EACH: Final = 5
"""Lines that each cell gets at least: few cells carry much, but together the small ones may."""

HEAVIEST: Final = 0.25
"""Share of the estimate that a single line may carry."""

DISAGREEMENT: Final = 2.5
"""Factor between the estimate and what the fit of the pilot predicts of the same lines."""

MINOR: Final = 0.02
"""Share of a cell in the probability below which the pilot, of few lines there, is not compared with."""

SCATTERED: Final = 2.5
"""Variance of the logarithm of a line's probability about the fit, at most, where the linear model misses noise.

It belongs to `mcnav.rare.weigh.WIDER`, which says what follows for the intervals of so few lines.
"""

SPARE: Final = 0.2
"""Share of the lines beyond the coefficients of a fit from which their scatter about it is known."""

BEFORE: Final = "flights fail before the limit is reached along their line as well: it is crossed more than once"
NOWHERE: Final = "no flight fails where the linear model expects it"


@dataclass(frozen=True)
class Laid:
    """Lines of the estimate, and what follows from them.

    Attributes
    ----------
    value, low, high : float
        The probability and its two-sided interval.
    doubt : str
        What contradicts the lines; empty where nothing does. Without any lines all else is NaN or empty.
    point : ndarray, shape (d,)
    sides : int
        See `mcnav.rare.estimate.Rare`.
    fit : Fit
    carried : ndarray, shape (facets,)
        Share of the estimate that a line of each half-space has for each unit of its weight.
    light : tuple of float
        The value and its interval without lines that carry more than `UNLIKELY` of it each.
    """

    value: float
    low: float
    high: float
    doubt: str
    point: Array
    fit: Fit
    sides: int = 0
    carried: Array = field(default_factory=lambda: np.zeros(0))
    light: tuple[float, float, float] = (math.nan, math.nan, math.nan)

    def left_out(self, follower: Follower, places: Places) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which points of the event lie on no line, and which on few; see `Follower.left_out`."""
        return follower.left_out(self.fit, self.carried, places)


def expected_lines(pilot: Pilot) -> Laid:
    """Return what the fewest lines of an estimate would be by the pilot, of which none is laid."""
    means, fit = pilot.means, pilot.fit
    value = float(np.sum(means))
    shares = np.maximum(means / max(value, 1e-300), MINOR)
    point = np.full(fit.facets.directions.shape[1], math.nan)
    return Laid(value, math.nan, math.nan, "", point, fit, carried=1.0 / (FEWEST * shares * max(value, 1e-300)))


def lay_lines(pilot: Pilot, precision: float, confidence: float, most: float) -> Laid:
    """Lay the lines of the estimate, about as many as its precision needs with so many flights at most."""
    fit, follower, facets = pilot.fit, pilot.follower, pilot.fit.facets
    d, generator = facets.directions.shape[1], pilot.follower.generator
    if not np.sum(pilot.means) > 0.0:
        return Laid(math.nan, math.nan, math.nan, NOWHERE, np.full(d, math.nan), fit)
    shares = pilot.shares()
    per_line = pilot.lines.flights / len(pilot.lines.facet) + 1.0 + 1.0 / BETWEEN
    number = pilot.lines_needed(precision)
    times = 1 if pilot.informed is None else CHEAP
    number = int(np.clip(min(number, most / per_line), times * FEWEST, times * MOST))
    strata = strata_of(shares) if facets.shared else np.arange(len(shares))
    of_stratum = np.bincount(strata, shares)
    lines_of = np.maximum(np.rint(number * of_stratum), times * EACH).astype(np.int64)
    stratum, number = np.repeat(np.arange(len(of_stratum)), lines_of), int(lines_of.sum())
    facet = draw_members(stratum, strata, shares, generator) if facets.shared else stratum
    within = shares / of_stratum[strata] if facets.shared else 1.0
    shares = (lines_of / number)[strata] * within
    uniform, normal = generator.random(number), generator.standard_normal((number, d - 1))
    across = np.empty((number, d - 1))
    for j, proposal in enumerate(fit.proposals):
        mine = facet == j
        across[mine] = proposal.draw(uniform[mine], normal[mine])
    lines = follower.follow(fit, facet, across)
    weights = lines.weights(fit) / shares[facet]
    value, low, high = weights_interval(weights, stratum, confidence)
    parts = np.array([weights[facet == j].sum() for j in range(len(shares))]) / number
    light = weights_interval(np.where(weights > UNLIKELY * value * number, 0.0, weights), stratum, confidence)
    return Laid(
        value, low, high, _doubt(pilot, lines, weights, value, shares),
        _likely_point(fit, lines, weights) if value > 0.0 else np.full(d, math.nan), fit,
        int(np.count_nonzero(parts > 0.01 * value)), 1.0 / (number * shares * max(value, 1e-300)), light,
    )  # fmt: skip


def _doubt(pilot: Pilot, lines: Lines, weights: Array, value: float, shares: Array) -> str:
    """Say what contradicts the estimate; nothing where nothing does."""
    fit, flown = pilot.fit, pilot.follower.flown
    if flown.failed:
        return f"{flown.failed} of {flown.flights} flights failed"
    if not value > 0.0:
        return NOWHERE
    if pilot.unseen is not None and _scatter(fit, lines, weights) > SCATTERED:
        return "noise that the linear model does not see moves the limit too far"
    if len(lines.before):
        return BEFORE
    largest = float(np.max(weights) / np.sum(weights))
    if largest > HEAVIEST:
        return f"a single line carries {100.0 * largest:.0f} % of the estimate"
    agreement = _agreement(fit, lines, weights, shares)
    if not 1.0 / DISAGREEMENT < agreement < DISAGREEMENT:
        return f"the lines of the estimate have {agreement:.2g} times the probability that the first ones had"
    if np.mean(lines.beyond[np.isfinite(lines.entry)]) < 0.5:
        return "most flights beyond the crossing do not fail"
    return ""


def _agreement(fit: Fit, lines: Lines, weights: Array, shares: Array) -> float:
    """Return the weights of lines in the major cells over those that the fit of the pilot predicts."""
    predicted = np.zeros(len(lines.facet))
    major = (shares[lines.facet] > MINOR) | fit.facets.shared
    for j, proposal in enumerate(fit.proposals):
        mine = (lines.facet == j) & major
        v = lines.across[mine]
        predicted[mine] = proposal.ratio(v) * fit.mass(j, v, fit.entry(j, v))
    return float(np.sum(weights[major]) / np.sum(predicted / shares[lines.facet]))


def _heaviest(fit: Fit, lines: Lines, weights: Array) -> int:
    return int(np.argmax(np.bincount(lines.facet, weights, len(fit.proposals))))


def _scatter(fit: Fit, lines: Lines, weights: Array) -> float:
    """Return the variance of the logarithm of a line's probability about the fit, of the heaviest half-space.

    About a fit of these lines, if they are more than its coefficients: that of the pilot, of fewer, scatters as well.
    """
    j = _heaviest(fit, lines, weights)
    mine = (lines.facet == j) & np.isfinite(lines.entry)
    at, across = lines.entry[mine], lines.across[mine]
    slopes, later = slopes_of_logarithm(at), at - fit.moved(j, across)
    scatter = float(np.var(slopes * (at - fit.entry(j, across))))
    freedom = len(at) - 2.0 * across.shape[1] - 1.0
    if freedom < SPARE * len(at):
        return scatter
    fitted = Proposal.fitted(across, later, float(np.mean(later))).entry(across)
    return min(scatter, float(np.sum((slopes * (later - fitted)) ** 2) / freedom))


def _likely_point(fit: Fit, lines: Lines, weights: Array) -> Array:
    """Return the most likely point of failure: the mean of the entries of the heaviest cell, by their weights."""
    j, facets = _heaviest(fit, lines, weights), fit.facets
    mine = (lines.facet == j) & (weights > 0.0)
    share = weights[mine] / weights[mine].sum()
    across = lines.across[mine]
    if facets.shared and len(share) < 2 * facets.directions.shape[1]:
        across = np.repeat(fit.proposals[j].mean[None], len(share), axis=0)  # the mean of few is no centre
    feet = facets.feet(lines.facet[mine], across)
    centre = share @ feet
    along = float(share @ lines.entry[mine]) + NARROW
    return np.asarray(centre + along * facets.directions[j])
