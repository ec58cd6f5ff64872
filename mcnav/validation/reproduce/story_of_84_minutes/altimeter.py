"""Hovering with an altimeter, the remedy of Problem 4: how poor an altimeter suffices.

The vertical channel grows as exp(a t), a = sqrt(2) w. A Kalman filter that knows the accelerometer's bias to be
constant learns it; what then limits the height is the growth between readings. Readings of sigma s every D seconds
leave, once the filter is settled,

    after a reading:    s sqrt(1 - exp(-2 a D)),
    before the next:    s sqrt(exp(2 a D) - 1),

because ``1 / p+ = 1 / p- + 1 / s^2`` and ``p- = exp(2 a D) p+`` along the growing direction, while every other one dies
out. Before that, while the filter learns the bias, the height may err by more: `largest` follows the covariance. A
constant error of the altimeter is not seen: the height is wrong by all of it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from scipy.linalg import expm
from scipy.optimize import brentq

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.validation.reproduce.story_of_84_minutes.numbers import PERIOD, RADIUS, RATIO, ROUND

GROWTH: Final = float(np.sqrt(2.0) * 2.0 * np.pi / PERIOD)
"""Rate of the growing solution, 1/s."""

BIAS: Final = RATIO * ROUND.gravitational_parameter / RADIUS**2

INTERVALS: Final = (1.0, 10.0, 60.0, 600.0)
"""Seconds from one reading to the next."""

HEIGHTS: Final = (10.0, 100.0, 1_000.0)
"""Heights (m, one sigma) that are to be held."""

EXAMPLE: Final = 100.0
"""Sigma of one altimeter, m."""

LEAST: Final = 1e-3
"""Sigma of an altimeter as good as perfect, m."""


def settled_before(sigma: float, interval: float) -> float:
    """Return the height's sigma before a reading, once settled, m.

    >>> round(settled_before(1.0, 60.0), 3)
    0.484
    """
    return float(sigma * np.sqrt(np.expm1(2.0 * GROWTH * interval)))


def poorest(height: float, interval: float) -> float:
    """Return the altimeter's largest sigma that holds a height to one sigma at all times, once settled, m."""
    return height / settled_before(1.0, interval)


def transition(interval: float) -> Array:
    """Return the transition of height, climb and bias over an interval, shape (3, 3): z'' = 2 w^2 z + bias."""
    rates = np.array([[0.0, 1.0, 0.0], [GROWTH**2, 0.0, 1.0], [0.0, 0.0, 0.0]])
    return np.asarray(expm(rates * interval))


def filtered(sigma: float, interval: float) -> tuple[Array, Array]:
    """Run the Kalman filter for 84 minutes with a bias of 1e-4 g (one sigma).

    Height and climb are known at the start, as in Problem 4. Sigma of the height before readings and after them, m,
    shape (readings,) each.
    """
    turn = transition(interval)
    covariance = np.diag([0.0, 0.0, BIAS**2])
    before, after = [], []
    for _ in range(int(PERIOD / interval)):
        covariance = transform(turn, covariance)
        before.append(covariance[0, 0])
        column = covariance[:, 0]
        covariance = covariance - np.outer(column, column) / (before[-1] + sigma**2)
        after.append(covariance[0, 0])
    return np.sqrt(before), np.sqrt(after)


def largest(sigma: float, interval: float) -> float:
    """Return the height's largest sigma in 84 minutes, m."""
    return float(filtered(sigma, interval)[0].max())


def poorest_from_start(height: float, interval: float) -> float:
    """Return the altimeter's largest sigma that holds a height to one sigma during all 84 minutes, m.

    NaN where the bias exceeds the height before the first reading, so that no altimeter does.
    """
    if largest(LEAST, interval) > height:
        return float("nan")

    def excess(logarithm: float) -> float:
        return largest(float(np.exp(logarithm)), interval) - height

    bounds = np.log([LEAST, poorest(height, interval)])
    if excess(bounds[1]) <= 0.0:
        return float(np.exp(bounds[1]))
    return float(np.exp(brentq(excess, *bounds, xtol=1e-4)))


def altimeters() -> pd.DataFrame:
    """Tabulate by interval the poorest altimeters, and what one of 100 m leaves, m."""
    rows = []
    for interval in INTERVALS:
        before, after = filtered(EXAMPLE, interval)
        rows.append(
            {
                "interval [s]": interval,
                **{f"altimeter to hold {height:g} m, settled [m]": poorest(height, interval) for height in HEIGHTS},
                "altimeter to hold 100 m, from the start [m]": poorest_from_start(100.0, interval),
                "100 m altimeter, largest [m]": float(before.max()),
                "100 m altimeter, before the last reading [m]": float(before[-1]),
                "100 m altimeter, after the last reading [m]": float(after[-1]),
                "100 m altimeter, settled, before a reading [m]": settled_before(EXAMPLE, interval),
            }
        )
    return pd.DataFrame(rows)
