"""Error budgets of a textbook for systems of 10, 1 and 0.1 nautical miles per hour, and the rates they have at rest.

Grewal and Andrews (2014) analyse them by linear covariance: all errors of the instruments are first-order Gauss-Markov
processes. The rate is the slope of a straight line fitted to the CEP of three hours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.validation.reproduce.textbook.free import DEGREE, HOUR, NAUTICAL_MILE
from mcnav.validation.reproduce.textbook.navigators import Case, at_rest, held_altitude
from mcnav.validation.reproduce.textbook.numbers import CONFIDENCE, Number

LATITUDE: Final = 39.7931
"""Latitude of the book's test track, deg."""

DURATION: Final = 3.0 * HOUR
SAMPLES: Final = 200
TO_CEP: Final = 1.2 / NAUTICAL_MILE
"""CEP in nautical miles over the root mean square of the horizontal error in m, as the book's program has it."""

START: Final = {"position": 2.0, "velocity": 0.1, "tilt": 1e-5, "heading": 1e-5}
"""Sigmas at the start, m, m/s and rad."""


@dataclass(frozen=True)
class Budget:
    """Sizes of the errors of a system.

    Attributes
    ----------
    rate : str
        Nominal CEP rate, nautical miles per hour.
    velocity_walk, angle_walk : float
        Random walks, m/s/sqrt(s) and rad/sqrt(s).
    correlation_time : float
        Of the biases, s.
    accelerometer, gyro : float
        Sigmas of the biases, m/s^2 and rad/s.
    """

    rate: str
    velocity_walk: float
    angle_walk: float
    correlation_time: float
    accelerometer: float
    gyro: float

    @property
    def imu(self) -> Imu:
        """Processes of the instruments."""
        gyro, accelerometer = (
            Noise(np.full(3, walk), np.full(3, sigma), np.full(3, self.correlation_time))
            for walk, sigma in ((self.angle_walk, self.gyro), (self.velocity_walk, self.accelerometer))
        )
        return Imu(gyro, accelerometer)


BUDGETS: Final = (
    Budget("10", 1e-4, 0.01 * DEGREE / HOUR, 1800.0, 9.8e-4, 0.19 * DEGREE / HOUR),
    Budget("1", 1e-4, 0.01 * DEGREE / HOUR, 600.0, 9.8e-5, 0.03 * DEGREE / HOUR),
    Budget("0.1", 1e-5, 1e-4 * DEGREE / HOUR, 15.0, 9.8e-5, 0.01 * DEGREE / HOUR),
)

REMARK: Final = (
    "nominal, of a vehicle on a figure-of-eight track of 100 km with errors of scale factors; here at rest without them"
)


def slope_weights(times: Array) -> Array:
    """Return the weights of values at some times, shape (m,), in the slope of the line fitted to them.

    >>> slope_weights(np.array([0.0, 1.0, 2.0])).tolist()
    [-0.5, 0.0, 0.5]
    """
    centred = times - times.mean()
    return np.asarray(centred / (centred**2).sum())


def budget_numbers() -> list[Number]:
    """List the CEP rates of the three systems."""
    return [_rate(budget) for budget in BUDGETS]


def _rate(budget: Budget) -> Number:
    """Fit the CEP rate of a system, linear and of samples.

    The rate of samples is a function of mean squares m_t; its standard error is that of the mean of
    ``sum w_t (x_t^2 - m_t) / (2 sqrt(m_t))`` over the samples x.
    """
    truth = at_rest(WGS84, LATITUDE, DURATION)
    case = Case(truth, START, SAMPLES, budget.imu, held_altitude(DURATION))
    linear, squares = case.horizontal_variance(), case.horizontal_squares()
    weights = TO_CEP * slope_weights(case.epochs / HOUR)
    mean = squares.mean(axis=0)
    rate, simulated = (float(weights @ np.sqrt(each)) for each in (linear, mean))
    influence = (squares - mean) @ (weights / (2.0 * np.sqrt(mean)))
    half = float(special.ndtri(0.5 + 0.5 * CONFIDENCE) * influence.std(ddof=1) / np.sqrt(SAMPLES))
    number = Number(
        "error budgets", f"CEP rate of the system of {budget.rate} nmi/h", "nmi/h", "budgets", budget.rate,
        "slope of 1.2 rms over 3 h", rate, simulated, (simulated - half, simulated + half),
    )  # fmt: skip
    return number if number.linear_agrees and number.simulated_agrees else number.explained(REMARK)
