"""Judgement of one statistic of a filter: bands of ratios of sigmas over time, and findings on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_consistency import Band, Finding, Honesty
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE
from mcnav.arrays.types import Array
from mcnav.statistics.interim_sizes import confidence_of_each
from mcnav.statistics.mean_square import FEWEST, mean_square_intervals
from mcnav.statistics.samples_to_decide import samples_for_ratios


@dataclass(frozen=True)
class Rates:
    """Confidences of the statements on one table of statistics over time.

    Attributes
    ----------
    each : float
        Of an interval by itself.
    together : float
        Of each interval, such that all of them hold at the stated confidence (Bonferroni).
    statements : int
    """

    each: float
    together: float
    statements: int = 1

    @classmethod
    def of(cls, criterion: Criterion, statements: int) -> Rates:
        """Divide the error rate among so many statements, and all of it among the looks at a growing campaign."""
        each = confidence_of_each(criterion.confidence, criterion.looks)
        return cls(each, confidence_of_each(each, max(statements, 1)), max(statements, 1))


def mean_square_band(mean: Array, error: Array, count: Array, freedom: Array, rates: Rates) -> Band:
    """Return means of squares at m epochs with their intervals; see `mean_square_intervals`."""
    each, together = (
        mean_square_intervals(mean, error, count, freedom, confidence) for confidence in (rates.each, rates.together)
    )
    return Band(mean, each, together)


def root_ratio(squares: Band, expected: Array | float) -> Band:
    """Return the roots of means of squares over the expected ones; NaN where nothing is expected."""
    expected = np.broadcast_to(np.asarray(expected, dtype=float), squares.value.shape)
    positive = expected > 0.0
    over = np.where(positive, expected, np.nan)

    def root(values: Array, by: Array) -> Array:
        return np.asarray(np.sqrt(np.maximum(values, 0.0) / by))

    return Band(*(root(values, by) for values, by in (
        (squares.value, over), (squares.each, over[:, None]), (squares.together, over[:, None]),
    )))  # fmt: skip


def find(ratio: Band, tolerance: float, samples: int, rates: Rates, remark: str = "") -> Finding:
    """Judge a ratio of sigmas over time against ``1 +- tolerance``; a remark is why nothing can be decided.

    The rates are those of its intervals.
    """
    known = ratio.known
    if remark or not known.any():
        return Finding(Honesty.UNDECIDED, remark=remark or "the filter has no covariance to compare with")
    value, low, high = ratio.value, ratio.together[:, 0], ratio.together[:, 1]
    above, below = known & (low > 1.0 + tolerance), known & (high < 1.0 - tolerance)
    if above.any():
        return _departure(Honesty.OPTIMISTIC, above, value, ratio)
    if below.any():
        return _departure(Honesty.PESSIMISTIC, below, -value, ratio)
    away = np.where(known, np.abs(np.where(known, value, 1.0) - 1.0), -1.0)
    worst = int(np.argmax(away))
    factor, interval = _at(ratio, worst)
    each = ratio.each[known]
    if np.all((each[:, 0] >= 1.0 - tolerance) & (each[:, 1] <= 1.0 + tolerance)):
        return Finding(Honesty.CONSISTENT, factor, interval, worst)
    needed = _samples_needed(ratio, tolerance, samples, rates)
    return Finding(Honesty.UNDECIDED, factor, interval, worst, samples_needed=needed)


def _departure(verdict: Honesty, certain: NDArray[np.bool_], rank: Array, ratio: Band) -> Finding:
    """Describe a departure that is certain at some epochs; the worst is that of the highest rank."""
    epochs = np.flatnonzero(certain)
    worst = int(epochs[np.argmax(rank[epochs])])
    return Finding(verdict, *_at(ratio, worst), worst, int(epochs[0]), int(epochs[-1]))


def _at(ratio: Band, epoch: int) -> tuple[float, tuple[float, float]]:
    low, high = ratio.together[epoch]
    return float(ratio.value[epoch]), (float(low), float(high))


def _samples_needed(ratio: Band, tolerance: float, samples: int, rates: Rates) -> int | None:
    """Return the samples that would decide with a probability of 90 %; see `samples_for_ratios`."""
    known = ratio.known & np.isfinite(ratio.together).all(axis=1)
    if not known.any():
        return None
    return samples_for_ratios(
        ratio.value[known], ratio.each[known], ratio.together[known], tolerance, samples, (rates.each, rates.together),
        rates.statements,
    )  # fmt: skip


def undecidable(samples: int, failed: int, weight: float) -> str:
    """Return why samples of a weight cannot decide anything, empty when they can."""
    if not samples:
        return "every sample failed" if failed else "there are no samples"
    if not weight:
        return "the samples are not independent, or their sources have heavy tails: there are no intervals"
    if samples * weight < FEWEST:
        return f"{samples} samples are too few for an interval; expected {math.ceil(FEWEST / weight)} or more"
    return ""


def too_many_failed(samples: int, failed: int) -> bool:
    """Return whether too many samples failed for a claim of consistency."""
    return failed > LARGEST_FAILED_SHARE * (samples + failed)
