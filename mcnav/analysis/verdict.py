"""Three verdicts on a sigma ratio: agrees, differs, undecided."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from mcnav.statistics.samples_to_decide import samples_for_ratio


class Verdict(StrEnum):
    """Position of a sigma ratio's interval with respect to the tolerance."""

    AGREES = "agrees"
    DIFFERS = "differs"
    UNDECIDED = "undecided"


ROUNDING: Final = 1e-12
"""Difference of a ratio from one that may be rounding: 4,500 times that of a double."""

NUMERICAL: Final = 1e-9
"""Difference of a ratio from one that derivatives by differences, and steps of integration, may leave: it is shown as
zero, and nothing is said of it."""

LARGEST_FAILED_SHARE: Final = 1e-3
"""Largest share of failed samples with which agreement is claimed."""


@dataclass(frozen=True)
class Judgement:
    """Verdict and its basis: Monte Carlo sigma over linear sigma, none when the linear one is zero, and its interval.

    It is ``certain`` when the interval excludes 1: a difference can be certain and still lie within the tolerance.
    ``samples_needed`` would decide an undecided case with a probability of 90 % if the true ratio were the estimated
    one; none where that is too close to a limit of the tolerance, or has no interval. ``negligible`` is agreement that
    holds because the difference is within the floor (`mcnav.analysis.floor`).
    """

    verdict: Verdict
    ratio: float | None
    interval: tuple[float, float] | None
    certain: bool = False
    samples_needed: int | None = None
    negligible: bool = False


def judge(
    ratio: float, interval: tuple[float, float], tolerance: float, samples: int, confidence: float = 0.95
) -> Judgement:
    """Judge an interval of a sigma ratio, of a confidence, against ``1 +- tolerance``.

    The samples that decide an undecided case are those of `samples_for_ratio`.

    >>> judge(1.001, (0.999, 1.003), 0.05, 1000).verdict.value
    'agrees'
    """
    low, high = interval
    certain = not low - ROUNDING <= 1.0 <= high + ROUNDING
    if low >= 1.0 - tolerance and high <= 1.0 + tolerance:
        return Judgement(Verdict.AGREES, ratio, interval, certain)
    if low > 1.0 + tolerance or high < 1.0 - tolerance:
        return Judgement(Verdict.DIFFERS, ratio, interval, certain)
    needed = samples_for_ratio(ratio, interval, tolerance, samples, confidence)
    return Judgement(Verdict.UNDECIDED, ratio, interval, certain, needed)


def combine_verdicts(verdicts: list[Verdict]) -> Verdict:
    """Combine verdicts: one that differs outweighs one undecided, which outweighs agreement."""
    for verdict in (Verdict.DIFFERS, Verdict.UNDECIDED):
        if verdict in verdicts:
            return verdict
    return Verdict.AGREES
