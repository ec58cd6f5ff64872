"""Probability of a rare event without a model of it: subset simulation (Au and Beck, 2001).

With margins g of standard normals u and levels ``b_1 < b_2 < ... < 0``, each exceeded by a tenth of the samples beyond
the level before,

    P(g > 0) = P(g > b_1) P(g > b_2 | g > b_1) ... P(g > 0 | g > b_m)

Samples beyond a level come from Markov chains that start in the samples there and propose

    u' = sqrt(1 - s^2) u + s z,      z standard normal,

accepted where ``g(u') > b``; s is adapted to 44 % accepted (Papaioannou and others, 2015). The chains are correlated,
so that the scatter within a simulation says little: the interval is that of independent repeats, in the logarithm.

It needs no half-space and works in any dimension, where margins rise towards the event. Of a jump out of a plain margin
it sees no more than plain sampling does (`mcnav.rare.widened` looks for those).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.flights import Flown

REPEATS: Final = 8
"""Independent simulations, whose scatter is the interval."""

SAMPLES: Final = 800
"""Samples of each level of each simulation."""

KEPT: Final = 0.1
"""Share of the samples beyond a level that are beyond the next one."""

PLAIN: Final = 0.5
"""Share of samples at one margin from which it is a plain, which has no levels."""

MOST_LEVELS: Final = 16
"""Levels, of a tenth each, after which nothing is estimated."""

ACCEPTED: Final = 0.44
FIRST_STEP: Final = 0.6


@dataclass(frozen=True)
class Levels:
    """Result of the simulations.

    Attributes
    ----------
    estimates : ndarray, shape (repeats,)
        Probability by each simulation; NaN of one that found no way up.
    points : ndarray, shape (n, d)
        Points of the event, distributed as normals that lie in it, with correlations.
    weights : ndarray, shape (n,)
        Their weights, which add up to one: each simulation's points have its estimate together.
    simulation : ndarray of int, shape (n,)
        The simulation that each is of.
    """

    estimates: Array
    points: Array
    weights: Array
    simulation: IndexArray

    @property
    def value(self) -> float:
        """Mean of the estimates, which is not biased but for the choice of the levels; NaN where one is missing."""
        return float(np.mean(self.estimates))

    @property
    def scatter(self) -> float:
        """Standard error of the logarithm of the mean."""
        if not (np.isfinite(self.estimates).all() and np.all(self.estimates > 0.0)):
            return math.inf
        return float(np.std(np.log(self.estimates), ddof=1) / math.sqrt(len(self.estimates)))

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return Student's interval of the logarithms of the estimates, about their mean."""
        reach = float(special.stdtrit(len(self.estimates) - 1, 0.5 + 0.5 * confidence)) * self.scatter
        return (self.value * math.exp(-reach), self.value * math.exp(min(reach, 700.0))) if reach < math.inf else (
            0.0, 1.0)  # fmt: skip


def simulate_levels(flown: Flown, dimensions: int, generator: np.random.Generator) -> Levels:
    """Simulate an event in ``dimensions`` standard normals; all simulations together, one step of them at a time.

    A flight without a result counts as beyond each level.
    """
    estimates, steps = np.ones(REPEATS), np.full(REPEATS, FIRST_STEP)
    points = generator.standard_normal((REPEATS, SAMPLES, dimensions))
    margins = _margins(flown, points)
    active = np.arange(REPEATS)
    for _ in range(MOST_LEVELS):
        levels = np.sort(margins[active], axis=1)[:, SAMPLES - int(KEPT * SAMPLES)]
        arrived = levels > 0.0
        active, levels = active[~arrived], levels[~arrived]
        if not len(active):
            break
        shares = np.mean(margins[active] >= levels[:, None], axis=1)
        estimates[active] *= np.where(shares < PLAIN, shares, math.nan)
        active, levels = active[shares < PLAIN], levels[shares < PLAIN]
        for repeat, level in zip(active, levels, strict=True):
            seeds = generator.permutation(np.flatnonzero(margins[repeat] >= level))[: int(KEPT * SAMPLES)]
            points[repeat, : len(seeds)], margins[repeat, : len(seeds)] = points[repeat, seeds], margins[repeat, seeds]
        _climb(flown, points, margins, active, levels, steps, generator)
    else:
        estimates[active] = math.nan
    beyond = margins > 0.0
    estimates *= np.mean(beyond, axis=1)
    counts = np.sum(beyond, axis=1)
    each = np.divide(estimates, counts, out=np.zeros(REPEATS), where=(counts > 0) & np.isfinite(estimates))
    weights = np.repeat(each, counts)
    simulation = np.repeat(np.arange(REPEATS), counts)
    return Levels(estimates, points[beyond], weights / max(float(np.sum(weights)), 1e-300), simulation)


def _margins(flown: Flown, points: Array) -> Array:
    """Fly points, shape (repeats, n, d), and return their margins, shape (repeats, n)."""
    flat = points.reshape(-1, points.shape[-1])
    margins = flown(flat, flown.new_noise(len(flat)))
    return np.where(np.isnan(margins), np.inf, margins).reshape(points.shape[:2])


def _climb(
    flown: Flown, points: Array, margins: Array, active: Array, levels: Array, steps: Array,
    generator: np.random.Generator,
) -> None:  # fmt: skip
    """Fill the samples of the simulations in progress by chains from their first ones, all beyond their levels."""
    if not len(active):
        return
    chains = int(KEPT * SAMPLES)
    for begin in range(chains, SAMPLES, chains):
        before, now = slice(begin - chains, begin), slice(begin, begin + chains)
        step = steps[active][:, None, None]
        start = points[active, before]
        proposed = np.sqrt(1.0 - step**2) * start + step * generator.standard_normal(start.shape)
        reached = _margins(flown, proposed)
        accepted = reached >= levels[:, None]
        points[active, now] = np.where(accepted[:, :, None], proposed, start)
        margins[active, now] = np.where(accepted, reached, margins[active, before])
        steps[active] *= np.exp(np.mean(accepted, axis=1) - ACCEPTED)
        np.clip(steps, 0.02, 1.0, out=steps)
