"""How much the pendulum reduces position errors: flat over spherical earth, by error source and flight time.

The Story's headline is a reduction "to less than 1/100". Its summary divides the flat-earth error at the end of the
flight by the largest error over a spherical earth; so does this table, for every flight time. All sources together are
their root sum of squares at the end, and as the largest so far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from mcnav.validation.reproduce.story_of_84_minutes.numbers import (
    DISTANCE,
    DRIFT,
    FOOT,
    GRAVITY,
    MINUTE,
    PERIOD,
    RADIUS,
    RATIO,
    SPEED,
    TILT,
    TIME,
    VELOCITY,
)

RATE: Final = 2.0 * np.pi / PERIOD
MINUTES: Final = (3.0, 10.0, 21.1, 42.2, 84.3, 126.5, TIME / MINUTE)
"""Flight times of the table: a boost, ten minutes, then quarters of the period up to two periods."""

GRID: Final = 4_000
"""Points up to the longest time, among which the largest errors so far are looked for."""

ALL_NOW: Final = "all, at the end"
ALL_LARGEST: Final = "all, largest so far"
CLAIMED: Final = 100.0


def flat_errors(times: Array) -> dict[str, Array]:
    """Compute along-track errors over a flat earth by source, m, shape (n,) each."""
    return {
        "tilt": schuler.tilt_flat(TILT, GRAVITY, times),
        "launch velocity": schuler.velocity_flat(VELOCITY, times),
        "accelerometer": schuler.bias_flat(RATIO * GRAVITY, times),
        "gyro drift": schuler.drift_flat(DRIFT, GRAVITY, times),
    }


def spherical_errors(times: Array) -> dict[str, Array]:
    """Compute along-track errors over a spherical earth by source, m, shape (n,) each."""
    return {
        "tilt": schuler.tilt_spherical(TILT, RADIUS, RATE, times),
        "launch velocity": schuler.velocity_spherical(VELOCITY, RATE, times),
        "accelerometer": schuler.bias_spherical(RATIO * RATE**2 * RADIUS, RATE, times),
        "gyro drift": schuler.drift_spherical(DRIFT, RADIUS, RATE, times),
    }


def _together(errors: dict[str, Array]) -> Array:
    return np.asarray(np.sqrt(sum(values**2 for values in errors.values())))


def reductions(times: Array) -> dict[str, Array]:
    """Divide flat by spherical errors at times in ascending order from zero, s; shape (n - 1,) each, without the first.

    Single sources: the flat error at the time over the largest spherical one up to then. All sources: root sums of
    squares, at the time and with the largest so far.
    """
    flat, spherical = flat_errors(times), spherical_errors(times)
    ratios = {name: flat[name][1:] / np.maximum.accumulate(np.abs(spherical[name]))[1:] for name in flat}
    whole, whole_spherical = _together(flat)[1:], _together(spherical)
    ratios[ALL_NOW] = whole / whole_spherical[1:]
    ratios[ALL_LARGEST] = whole / np.maximum.accumulate(whole_spherical)[1:]
    return ratios


def reduction_curves() -> pd.DataFrame:
    """Tabulate the reductions against flight time, with azimuth: range over R sin(range / R) at the Story's speed."""
    times = np.linspace(0.0, TIME, GRID + 1)
    angle = SPEED * times[1:] / RADIUS
    columns = {f"{name} [1]": ratio for name, ratio in reductions(times).items()}
    return pd.DataFrame({"flight time [min]": times[1:] / MINUTE, **columns, "azimuth [1]": angle / np.sin(angle)})


@dataclass(frozen=True)
class Printed:
    """A row of the Story's summary: printed errors, ft, and the right ones, ft."""

    source: str
    flat: float
    spherical: float
    right_flat: float
    right_spherical: float
    misprinted: str = ""

    @property
    def ratio(self) -> float:
        """Reduction by the printed numbers."""
        return self.flat / self.spherical

    @property
    def right(self) -> float:
        """Reduction by the document's own formulas."""
        return self.right_flat / self.right_spherical


def printed_reductions() -> list[Printed]:
    """List the rows of the summary with the ratios of their numbers, and which of these are misprinted."""
    end = np.array([TIME])
    times = np.linspace(0.0, TIME, GRID + 1)
    flat = {name: float(values[0]) / FOOT for name, values in flat_errors(end).items()}
    largest = {name: float(np.abs(values).max()) / FOOT for name, values in spherical_errors(times).items()}
    azimuth = (
        schuler.azimuth_flat(TILT, DISTANCE) / FOOT,
        schuler.azimuth_spherical(TILT, RADIUS, DISTANCE) / FOOT,
    )

    def row(name: str, flat_printed: float, spherical_printed: float, misprinted: str = "") -> Printed:
        return Printed(name, flat_printed, spherical_printed, flat[name], largest[name], misprinted)

    return [
        row("tilt", 288_000.0, 3_650.0, "spherical: the factor 2 is missing"),
        row("launch velocity", 10_120.0, 805.0),
        row("accelerometer", 341_000.0, 4_170.0, "flat: the factor 1/2 is missing"),
        row("gyro drift", 1.62e6, 10_250.0, "flat: the factor 1/6 is missing"),
        Printed("azimuth", 4_660.0, 3_500.0, *azimuth),
    ]


def at_minutes(frame: pd.DataFrame, minutes: float) -> pd.Series:
    """Return the row of `reduction_curves` nearest to a flight time."""
    return frame.iloc[int((frame["flight time [min]"] - minutes).abs().to_numpy().argmin())]
