"""What noise alone makes of comparisons of two records of one motion."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import stats

FALSE_ALARM: Final = 1e-4
"""Probability with which noise alone makes a check of files speak."""


def is_clear(as_named: float, least: float, freedom: float, tried: int) -> bool:
    """Return whether squares that are left, as files are named, exceed the least of others by more than noise does.

    With d between two predictions and noise of variance v, the squares differ by 2 d.e - d.d in favour of the wrong
    one: they exceed x v with a probability of at most that of a normal number beyond the root of x, whatever d is. With
    the variance estimated, and as many others as are tried (Bonferroni), x is a point of F with 1 and ``freedom``
    degrees of freedom.

    >>> is_clear(1.4, 1.0, 100.0, 1), is_clear(1.4, 1.0, 100.0, 10_000_000), is_clear(1.0, 1.0, 100.0, 1)
    (True, False, False)
    """
    if freedom < 1.0 or least <= 0.0:
        return bool(freedom >= 1.0 and as_named > least)
    return bool((as_named - least) * freedom > least * stats.f.isf(FALSE_ALARM / tried, 1.0, freedom))


def slope_through_zero(values: np.ndarray, others: np.ndarray) -> tuple[float, float]:
    """Return the slope of others over values, both of shape (n,), and what noise alone may make of it.

    >>> slope, noise = slope_through_zero(np.arange(100.0), 2.0 * np.arange(100.0))
    >>> slope, noise
    (2.0, 0.0)
    """
    squares = float(values @ values)
    slope = float(values @ others) / squares
    error = float(np.sqrt(np.sum((others - slope * values) ** 2) / (len(values) - 1) / squares))
    return slope, error * float(stats.t.isf(0.5 * FALSE_ALARM, len(values) - 1))
