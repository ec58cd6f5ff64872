"""What a campaign of a size could have seen: the power of a ratio's interval."""

from __future__ import annotations

import math
from typing import Final

from scipy import special

USUAL_POWER: Final = 0.9
"""Probability with which a difference is to be found."""

SMALLEST_STEP: Final = 1.25
"""Factor by which a sample grows at least when more samples are advised: intervals shrink by a tenth."""


def detectable_ratio(error: float, degrees_of_freedom: float, confidence: float, power: float = USUAL_POWER) -> float:
    """Smallest departure of a ratio from one whose interval excludes one with a probability.

    An interval ``ln(ratio) +- t s`` excludes zero with the power wanted when the true logarithm is
    ``(t_confidence + t_power) s`` away; the departure upwards, ``exp(...) - 1``, is the larger of the two and is given.

    Parameters
    ----------
    error : float
        Standard error s of the ratio's logarithm.
    degrees_of_freedom : float
        Of Student's t.
    confidence : float
        Of the two-sided interval.
    """
    if not math.isfinite(error) or degrees_of_freedom < 1.0:
        return math.inf
    reach = (_t(degrees_of_freedom, 0.5 + 0.5 * confidence) + _t(degrees_of_freedom, power)) * error
    return math.expm1(reach) if reach < 700.0 else math.inf


def samples_to_detect(
    departure: float, error: float, count: int, confidence: float, power: float = USUAL_POWER
) -> float:
    """Samples with which a departure of a ratio from one would be found with a probability.

    The standard error found with ``count`` samples is taken to fall with their root; the quantiles are normal ones.
    """
    if departure <= 0.0:
        raise ValueError(f"departure must be positive; got {departure!r}")
    reach = float(special.ndtri(0.5 + 0.5 * confidence) + special.ndtri(power)) * error
    return count * (reach / math.log1p(departure)) ** 2


def sensible_step(needed: float, count: int) -> int:
    """Sample size to advise where about ``needed`` samples would do and ``count`` are not enough.

    The estimate of what is needed is uncertain itself, and a few samples more leave every interval as it is. The advice
    is at least `SMALLEST_STEP` times the present number, rounded up to two significant digits.

    Parameters
    ----------
    needed : float
        Estimated sample size that decides.
    count : int
        Present sample size, at least 1.

    Examples
    --------
    >>> [sensible_step(needed, 1000) for needed in (1001, 1250, 1310, 15_333, 16_000)]
    [1300, 1300, 1400, 16000, 16000]
    """
    wanted = math.ceil(max(needed, SMALLEST_STEP * count))
    unit = int(10 ** max(len(str(wanted)) - 2, 0))
    return -(-wanted // unit) * unit


def variance_ratio_error(count: int, kurtosis: float = 3.0) -> float:
    """Standard error of ``ln(sigma ratio)`` from independent samples: ``sqrt((kurtosis - 1) / (4 n))``.

    >>> round(variance_ratio_error(20_000), 4)
    0.005
    """
    return math.sqrt(max(kurtosis - 1.0, 0.0) / (4.0 * count))


def _t(degrees_of_freedom: float, probability: float) -> float:
    return float(special.stdtrit(degrees_of_freedom, probability))
