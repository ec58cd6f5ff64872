"""Lags of the clocks of two records of one motion: the search for the one at which they agree, and its name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from mcnav.judgement.chance import is_clear

LAGS: Final = np.arange(-40.0, 40.0 + 0.1, 0.25)
"""Lags of the clocks that are tried, s."""

LEAST_LAG: Final = 0.7
"""Lag from which clocks are refused, s; a smaller one is a delay, which the filter's innovations tell better."""

TIMES_WORSE: Final = 4.0
"""Ratio of what is left of squares from which a lag, or another reading of the files, is the better one."""

EXPLAINED: Final = 0.3
"""Share of the squares of one record's motion that may be left where it is that of the other."""

LEAP: Final = 18.0
"""Seconds by which GPS time is ahead of UTC since 2017."""


def clear_lag(left: Callable[[float], tuple[float, int]], rows: int, freedom: float, moved: float) -> float | None:
    """Return the lag at which two records are clearly those of one motion; none where that is near zero, or not clear.

    Parameters
    ----------
    left : callable
        From a lag, s, to the mean square that is left between the records, and the number of rows that it is of.
    rows : int
        Of the record; half of them must be left at a lag.
    freedom : float
        Degrees of freedom of what is left.
    moved : float
        Mean square of the motion.
    """
    at_zero, count = left(0.0)
    fits = {float(lag): left(float(lag)) for lag in LAGS}
    enough = {lag: square for lag, (square, number) in fits.items() if number >= 0.5 * rows}
    if not enough or not count:
        return None
    best = min(enough, key=lambda lag: enough[lag])
    fine = {float(lag): left(float(lag))[0] for lag in best + np.linspace(-0.25, 0.25, 11)}
    lag = min(fine, key=lambda shift: fine[shift])
    clear = is_clear(at_zero, fine[lag], freedom, len(LAGS) + len(fine))
    if abs(lag) < LEAST_LAG or at_zero < TIMES_WORSE * fine[lag] or not clear or fine[lag] > EXPLAINED * moved:
        return None
    return lag


def describe_lag(lag: float, against: str, agreeing: str) -> str:
    """Say how late or early stamps are, and why that may be.

    >>> describe_lag(-1.0, "the gyros", "the turns")
    'its stamps are 1 s early against the gyros: a whole second; the turns of both agree at that shift'
    """
    side = "late" if lag > 0.0 else "early"
    whole = abs(lag - round(lag)) < 0.2
    if abs(abs(lag) - LEAP) < 0.4:
        why = "the leap seconds between GPS time and UTC"
    else:
        why = "a whole second" if whole and round(abs(lag)) == 1 else "whole seconds" if whole else "other clocks"
    return f"its stamps are {abs(lag):.3g} s {side} against {against}: {why}; {agreeing} of both agree at that shift"
