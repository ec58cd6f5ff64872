"""A detuned loop: the platform is cranked by a wrong gear ratio.

The distance meter turns the platform by ``phi = (1 + d) x_i / R`` for an indicated distance x_i, where tuning has
d = 0. Over a spherical earth the platform then stands at an angle to the vertical that the vehicle's own travel feeds.
For a vehicle at the distance x = V t, a bias a, and e = x_i - x the small-angle equation is

    e'' + w^2 (1 + d) e = a - w^2 d V t,                      w^2 = g_eff / R,
    e = a / W^2 (1 - cos W t) - V d / (1 + d) (t - sin(W t) / W),   W^2 = (1 + d) w^2.

At rest a wrong ratio only changes period and amplitude by some d. In flight the error grows with the distance, by
d / (1 + d) of it. `simulated` integrates the loop with the exact sine, and no pendulum is put in.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from scipy.integrate import DOP853, solve_ivp

from mcnav.arrays.types import Array
from mcnav.validation.reproduce.story_of_84_minutes.numbers import (
    MILE,
    MINUTE,
    PERIOD,
    RADIUS,
    RATIO,
    ROUND,
    SPEED,
    TIME,
)
from mcnav.validation.reproduce.story_of_84_minutes.schuler import effective_gravity

SHARES: Final = (0.0, 1e-3, 1e-2, 1e-1)
"""Errors of the gear ratio."""

GRAVITY: Final = ROUND.gravitational_parameter / RADIUS**2
"""That of the document's rounded period, m/s^2."""

BIAS: Final = RATIO * GRAVITY
POINTS: Final = 101


def closed_form(share: float, speed: float, bias: float, times: Array) -> Array:
    """Compute the distance error of a loop whose gear ratio is wrong by a share, m, shape (n,)."""
    rate = np.sqrt((1.0 + share) * effective_gravity(GRAVITY, speed, RADIUS) / RADIUS)
    by_bias = 2.0 * bias / rate**2 * np.sin(0.5 * rate * times) ** 2
    by_travel = speed * share / (1.0 + share) * (times - np.sin(rate * times) / rate)
    return np.asarray(by_bias - by_travel)


def simulated(share: float, speed: float, bias: float, times: Array) -> Array:
    """Integrate the distance meter on its platform; the distance error at the times, m, shape (n,).

    The vehicle stands at the angle V t / R, the platform at (1 + d) x_i / R, and the force is g_eff along the vertical.
    """
    felt = effective_gravity(GRAVITY, speed, RADIUS)

    def rates(time: float, state: Array) -> list[float]:
        lean = (speed * time - (1.0 + share) * state[0]) / RADIUS
        return [state[1], felt * np.sin(lean) + bias]

    solution = solve_ivp(
        rates, (0.0, float(times[-1])), [0.0, speed], method=DOP853, rtol=1e-11, atol=1e-6, t_eval=times
    )
    return np.asarray(solution.y[0] - speed * times)


def detuning() -> pd.DataFrame:
    """Tabulate the largest errors over two periods, with the Story's accelerometer error, by gear ratio, miles."""
    times = np.linspace(0.0, TIME, POINTS)
    rows = []
    for share in SHARES:
        resting, moving = (simulated(share, speed, BIAS, times) for speed in (0.0, SPEED))
        formula = closed_form(share, SPEED, BIAS, times)
        rows.append(
            {
                "gear ratio wrong by [%]": 100.0 * share,
                "period [min]": PERIOD / np.sqrt(1.0 + share) / MINUTE,
                "at rest, largest [mi]": float(np.abs(resting).max()) / MILE,
                "cruising, at the end [mi]": float(moving[-1]) / MILE,
                "cruising, at the end, closed form [mi]": float(formula[-1]) / MILE,
            }
        )
    return pd.DataFrame(rows)


def detuned_curves() -> pd.DataFrame:
    """Tabulate the simulated error of the cruising missile over time by gear ratio, miles."""
    times = np.linspace(0.0, TIME, POINTS)
    columns = {f"wrong by {100.0 * share:g} % [mi]": simulated(share, SPEED, BIAS, times) / MILE for share in SHARES}
    return pd.DataFrame({"time [min]": times / MINUTE, **columns})
