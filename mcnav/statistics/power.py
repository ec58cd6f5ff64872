"""Power of a ratio's interval: the differences that a campaign of a size detects."""

from __future__ import annotations

import math
from typing import Final

import scipy  # its special functions are imported when one is called

USUAL_POWER: Final = 0.9
"""Probability of detecting a difference."""

SMALLEST_STEP: Final = 1.25
"""Smallest factor by which a larger sample is advised: intervals shrink by a tenth."""


def detectable_ratio(error: float, degrees_of_freedom: float, confidence: float) -> float:
    """Compute the smallest departure of a ratio from one that its interval detects with `USUAL_POWER`.

    With s the standard error of the ratio's logarithm, an interval ``ln(ratio) +- t s`` excludes zero with that power
    when the true logarithm is ``(t_confidence + t_power) s`` away; the upward departure, ``exp(...) - 1``, is the
    larger one and is returned.
    """
    if degrees_of_freedom < 1.0:
        return math.inf
    reach = float(scipy.special.stdtrit(degrees_of_freedom, [0.5 + 0.5 * confidence, USUAL_POWER]).sum()) * error
    return math.expm1(reach) if reach < 700.0 else math.inf


def samples_to_detect(departure: float, error: float, count: int, confidence: float) -> float:
    """Estimate the samples with which a departure of a ratio from one is detected with `USUAL_POWER`.

    The standard error from ``count`` samples is assumed to fall with their root; the quantiles are normal.
    """
    if departure <= 0.0:
        raise ValueError(f"departure must be positive; got {departure!r}")
    reach = float(scipy.special.ndtri(0.5 + 0.5 * confidence) + scipy.special.ndtri(USUAL_POWER)) * error
    return count * (reach / math.log1p(departure)) ** 2


def sensible_step(needed: float, count: int) -> int:
    """Round up the sample size to advise where about ``needed`` samples decide and ``count`` do not.

    The estimate is uncertain itself, and a few more samples hardly change an interval. The advice is at least
    `SMALLEST_STEP` times the present number ``count``, rounded up to two significant digits.

    >>> [sensible_step(needed, 1000) for needed in (1001, 1250, 1310, 15_333, 16_000)]
    [1300, 1300, 1400, 16000, 16000]
    """
    wanted = math.ceil(max(needed, SMALLEST_STEP * count))
    unit = int(10 ** max(len(str(wanted)) - 2, 0))
    return -(-wanted // unit) * unit
