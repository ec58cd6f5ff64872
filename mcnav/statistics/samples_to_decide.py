"""Samples with which an undecided comparison is decided with a probability of 90 %, if the truth is as estimated.

A share p of samples lies beyond a limit, beyond which a share a is allowed. With n samples the number X beyond it is
binomial (n, p). One-sided exact bounds of a confidence c decide

    met if  X <= x,  the largest one with  P(Bin(n, a) <= x) <= 1 - c;
    not met if  X >= x,  the smallest one with  P(Bin(n, a) <= x - 1) >= c

(Clopper and Pearson, 1934; the bounds of quantiles by order statistics are the same statement). The critical x rises
by steps, and between two steps the probability of a decision falls, or rises, with n. The sizes here hold at the least
probability between two steps; from them on it is 90 % or more, to within 1 % where steps are uneven.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import scipy  # its special functions are imported when one is called

from mcnav.arrays.types import Array
from mcnav.statistics.power import USUAL_POWER

MOST: Final = 10**9
"""Largest number of samples that is given: four minutes of the fastest engine, days of most."""

HALVINGS: Final = 60
"""Bisections of the number of samples by a factor, to far less than one in a million."""


def samples_to_meet(shares: Sequence[float], allowed: float, confidence: float) -> int | None:
    """Return the samples with which all of several shares are found to lie below the allowed one.

    The shares may depend on one another: their probabilities of not being found so are added (Boole's inequality). None
    when more than `MOST` are needed, or a share does not lie below.

    >>> samples_to_meet([0.0], 0.05, 0.95), samples_to_meet([0.025], 0.05, 0.95), samples_to_meet([0.06], 0.05, 0.95)
    (59, 554, None)
    """
    if max(shares) >= allowed:
        return None

    def first(critical: int) -> int:
        """Return the smallest number of samples of which so many may lie beyond the limit."""
        return bisect_left(
            range(MOST), True, lo=critical + 1, key=lambda n: bool(_at_most(critical, n, allowed) <= 1.0 - confidence)
        )

    def decides(critical: int) -> bool:
        last = first(critical + 1) - 1
        return sum(1.0 - _at_most(critical, last, share) for share in shares) <= 1.0 - USUAL_POWER

    samples = first(_smallest(decides, allowed))
    return samples if samples < MOST else None


def samples_to_reject(shares: Sequence[float], allowed: float, confidence: float) -> int | None:
    """Return the samples with which at least one of several shares is found to exceed the allowed one.

    None when more than `MOST` are needed, or no share exceeds it.

    >>> samples_to_reject([0.1], 0.05, 0.95), samples_to_reject([1.0], 0.05, 0.95)
    (269, 1)
    """
    share = max(shares)
    if share <= allowed:
        return None

    def first(critical: int) -> int:
        """Return the smallest number of samples of which so many must lie beyond the limit, and not one less."""
        if critical < 2:
            return 1
        return bisect_left(range(MOST), True, lo=1, key=lambda n: bool(_at_most(critical - 2, n, allowed) < confidence))

    def decides(critical: int) -> bool:
        return 1.0 - _at_most(critical - 1, first(critical), share) >= USUAL_POWER

    samples = first(_smallest(decides, allowed))
    return samples if samples < MOST else None


def samples_for_ratio(
    ratio: float, interval: tuple[float, float], tolerance: float, count: int, confidence: float
) -> int | None:
    """Return the samples with which the interval of a ratio lies on one side of each limit ``1 +- tolerance``.

    The standard error is half the width of the two-sided interval of ``count`` samples over the normal quantile; it and
    the interval's ends shrink with the root of the number n. With f the root of count over n, s the error, and u and d
    the distances to the upper and the lower end, the probability of a decision within the tolerance is

        Phi((1 + tolerance - ratio - u f) / (s f)) + Phi((ratio - 1 + tolerance - d f) / (s f)) - 1,

    and beyond it that of one side. None when more than `MOST` are needed.

    >>> samples_for_ratio(1.0, (0.8, 1.2), 0.05, 1000, 0.95)
    54125
    """
    down, up = ratio - interval[0], interval[1] - ratio
    error = max(down, up) / float(scipy.special.ndtri(0.5 + 0.5 * confidence))
    upper, lower = 1.0 + tolerance - ratio, ratio - 1.0 + tolerance
    if not 0.0 < error < math.inf or upper == 0.0 or lower == 0.0:
        return None

    def power(number: float) -> float:
        shrunk = math.sqrt(count / number)
        if upper > 0.0 and lower > 0.0:
            clear = scipy.special.ndtr(np.array([upper - up * shrunk, lower - down * shrunk]) / (error * shrunk))
            return float(clear.sum() - 1.0)
        beyond = -upper - down * shrunk if upper < 0.0 else -lower - up * shrunk
        return float(scipy.special.ndtr(beyond / (error * shrunk)))

    if power(float(MOST)) < USUAL_POWER:
        return None
    low, high = math.log(max(count, 1)), math.log(MOST)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if power(math.exp(middle)) >= USUAL_POWER else (middle, high)
    return max(count + 1, math.ceil(math.exp(high) * (1.0 - 1e-12)))


def samples_for_ratios(
    ratios: Array, each: Array, together: Array, tolerance: float, count: int, confidences: tuple[float, float],
    statements: int,
) -> int | None:  # fmt: skip
    """Return the samples with which several ratios at m instants are found within ``1 +- tolerance``, or one beyond it.

    All are within when the interval of ``each`` is; one is beyond when its interval of all ``together`` is. Where that
    of all together holds one, the ratio is taken to be one, else to be as estimated. Standard errors fall with the root
    of the number n. With s that of ``count`` samples, e the distance to the nearer limit and z quantiles,

        n = count ((z_interval + z_power) s / e)^2,

    where z_power is exceeded with a probability of 10 % in one ratio beyond a limit, and in any of all the statements
    that are to be within theirs (Boole's inequality: correlated ones need fewer samples). None when more than `MOST`
    are needed.

    Parameters
    ----------
    ratios, each, together : ndarray, shapes (m,), (m, 2) and (m, 2)
    confidences : (float, float)
        Of the two sorts of intervals.

    Examples
    --------
    >>> wide = np.array([[0.9, 1.1]])
    >>> samples_for_ratios(np.ones(1), wide, wide, 0.05, 200, (0.95, 0.95), 1)
    2707
    """
    z_each, z_together = (float(scipy.special.ndtri(0.5 + 0.5 * confidence)) for confidence in confidences)
    error = 0.5 * (each[:, 1] - each[:, 0]) / z_each
    real = (together[:, 0] > 1.0) | (together[:, 1] < 1.0)
    away = np.where(real, np.abs(ratios - 1.0), 0.0)
    edge, beyond = np.abs(tolerance - away), away > tolerance
    if np.any(edge <= 0.0) or not np.isfinite(error).all():
        return None
    if beyond.any():
        reach = float(np.min(((z_together + scipy.special.ndtri(USUAL_POWER)) * error / edge)[beyond]))
    else:
        missed = (1.0 - USUAL_POWER) / max(statements, 1)
        power = np.where(real, scipy.special.ndtri(1.0 - missed), scipy.special.ndtri(1.0 - 0.5 * missed))
        reach = float(np.max((z_each + power) * error / edge))
    needed = count * reach**2
    return max(count + 1, math.ceil(needed)) if needed < MOST else None


def _at_most(number: int, samples: int, share: float) -> float:
    """Compute ``P(Bin(samples, share) <= number)``."""
    return 1.0 if number >= samples else float(scipy.special.betaincc(number + 1.0, samples - number, share))


def _smallest(decides: Callable[[int], bool], allowed: float) -> int:
    """Return the smallest critical number that decides, or one that takes more than `MOST` samples."""
    return bisect_left(range(math.ceil(2.0 * allowed * MOST) + 2), True, key=decides)
