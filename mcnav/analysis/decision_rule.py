"""Rule by which the sigma ratios of one comparison are estimated and judged."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.analysis.floor import widened
from mcnav.analysis.verdict import Judgement, Verdict, judge
from mcnav.arrays.types import Array
from mcnav.statistics.estimates import Estimate, summed_mean
from mcnav.statistics.power import detectable_ratio, samples_to_detect

WIDEST: Final = 1_000.0
"""Factor between a ratio and an end of its interval from which on the interval is not bounded: it says nothing."""


@dataclass(frozen=True)
class DecisionRule:
    """Rule by which the estimates of one comparison are formed and judged."""

    samples: int
    tolerance: float
    confidence: float
    fewest_blocks: float

    def mean(self, sums: Array, counts: Array) -> Estimate:
        """Estimate a mean from block sums."""
        return summed_mean(sums, counts, self.fewest_blocks)

    def judge(self, estimate: Estimate, expected: float, floor: float = 0.0) -> Judgement:
        """Judge the square root of an estimated variance over the expected one.

        A difference of variances up to the floor counts as agreement (`mcnav.analysis.floor`).
        """
        if expected <= 0.0:
            agrees = estimate.value <= floor
            negligible = agrees and estimate.value > 0.0
            verdict = Verdict.AGREES if agrees else Verdict.DIFFERS
            return Judgement(verdict, None, None, certain=not agrees, negligible=negligible)
        ratio, interval = ratio_interval(estimate, expected, self.confidence)
        plain = judge(ratio, interval, self.tolerance, self.samples, self.confidence)
        tolerance = widened(self.tolerance, floor / expected)
        if plain.verdict == Verdict.AGREES or tolerance == self.tolerance:
            return plain
        wide = judge(ratio, interval, tolerance, self.samples, self.confidence)
        return replace(wide, negligible=wide.verdict == Verdict.AGREES)

    def power(self, estimate: Estimate, expected: float) -> tuple[float, float]:
        """Return the smallest departure of the sigma ratio from one that would have been found.

        With it come the samples with which a departure as large as the tolerance would be found.
        """
        if expected <= 0.0 or estimate.value <= 0.0:
            return math.nan, math.nan
        error = 0.5 * estimate.standard_error / estimate.value
        smallest = detectable_ratio(error, estimate.degrees_of_freedom, self.confidence)
        needed = samples_to_detect(self.tolerance, error, self.samples, self.confidence)
        return smallest, float(np.ceil(needed)) if math.isfinite(error) else math.nan


def spread_of(half_width: float) -> float:
    """Return the factor of an interval's half width of a logarithm; infinite beyond `WIDEST`.

    >>> spread_of(0.0), spread_of(7.0), spread_of(math.inf)
    (1.0, inf, inf)
    """
    return math.exp(half_width) if half_width <= math.log(WIDEST) else math.inf


def ratio_interval(estimate: Estimate, expected: float, confidence: float) -> tuple[float, tuple[float, float]]:
    """Return the square root of an estimated variance over the expected one, and its interval.

    The interval is formed on the scale of the logarithm, where a variance's error is nearly symmetric, and reaches
    further where the skewness of the blocks requires it (`mcnav.statistics.estimates`).
    """
    share = estimate.value / expected
    half = estimate.half_width(confidence) / expected
    ratio = float(np.sqrt(max(share, 0.0)))
    if not np.isfinite(half):
        return ratio, (0.0, float("inf"))
    down, up = (reach / expected for reach in estimate.reach_of_skewness(confidence))
    low, high = (float(np.sqrt(max(each, 0.0))) for each in (share - down, share + up))
    if share > 0.0:
        spread = spread_of(0.5 * half / share)
        return ratio, (min(ratio / spread, low), max(ratio * spread, high))
    return ratio, (0.0, max(float(np.sqrt(max(share + half, 0.0))), high))
