"""Data of the plots: closed forms and simulations over time, periods, hovering."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd

from mcnav.arrays.types import Array
from mcnav.systems.steady.ensemble import simulate_ensemble
from mcnav.systems.steady.linearized import linearize
from mcnav.systems.steady.truth import Earth, Error, SteadyFlight
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from mcnav.validation.reproduce.story_of_84_minutes.climb import climb_periods
from mcnav.validation.reproduce.story_of_84_minutes.numbers import (
    CROSS,
    DRIFT,
    FOOT,
    GRAVITY,
    HEIGHT,
    MILE,
    MINUTE,
    PERIOD,
    RADIUS,
    RANGE,
    RATIO,
    ROUND,
    SPEED,
    STEPS,
    TILT,
    TIME,
    VELOCITY,
    at_rest,
    cruising,
    hovering,
    measured_period,
    size_of,
    with_one_error,
)

POINTS: Final = 101
RATE: Final = 2.0 * np.pi / PERIOD

PLOTTED: Final = {
    "tilt": (Error.MISALIGNMENT, RANGE),
    "launch velocity": (Error.RANGE_RATE, RANGE),
    "accelerometer": (Error.BIAS_X, RANGE),
    "gyro drift": (Error.GYRO_DRIFT, RANGE),
    "azimuth": (Error.AZIMUTH_MISALIGNMENT, CROSS),
    "roll tilt": (Error.ROLL_MISALIGNMENT, CROSS),
}
"""Error source and affected output of each plot of Problems 1 to 3."""


def _closed(times: Array) -> dict[str, tuple[Array, Array]]:
    """Evaluate the flat and spherical closed forms of all plots, m."""
    bias, flat_bias = RATIO * RATE**2 * RADIUS, RATIO * GRAVITY
    tilt = schuler.tilt_flat(TILT, GRAVITY, times), schuler.tilt_spherical(TILT, RADIUS, RATE, times)
    distance = SPEED * times
    return {
        "tilt": tilt,
        "launch velocity": (
            schuler.velocity_flat(VELOCITY, times), schuler.velocity_spherical(VELOCITY, RATE, times),
        ),
        "accelerometer": (schuler.bias_flat(flat_bias, times), schuler.bias_spherical(bias, RATE, times)),
        "gyro drift": (
            schuler.drift_flat(DRIFT, GRAVITY, times), schuler.drift_spherical(DRIFT, RADIUS, RATE, times),
        ),
        "azimuth": (TILT * distance, TILT * RADIUS * np.sin(distance / RADIUS)),
        "roll tilt": tilt,
    }  # fmt: skip


def _simulated(flight: SteadyFlight, times: Array) -> Array:
    """Simulate the navigation errors of all plots, shape (n, errors), m."""
    errors = np.array([with_one_error(source, size_of(source, flight.earth)) for source, _ in PLOTTED.values()])
    outputs = [output for _, output in PLOTTED.values()]
    simulated = np.zeros((len(times), len(errors)))
    for row, time in enumerate(times):
        if time > 0.0:
            values, _ = simulate_ensemble(replace(flight, duration=float(time)), errors, STEPS // 4)
            simulated[row] = values[np.arange(len(errors)), outputs]
    return simulated


def curves() -> pd.DataFrame:
    """Tabulate position errors over two periods by error and time, ft."""
    times = np.linspace(0.0, TIME, POINTS)
    closed = _closed(times)
    ways = {
        "flown at rest": at_rest(TIME),
        "flown cruising, level platform": cruising(TIME),
        "flown cruising, inertial platform": cruising(TIME, level=False),
    }
    flights = {name: _simulated(flight, times) for name, flight in ways.items()}
    by_linear = linearize(cruising(TIME), times)
    tables = []
    for column, (name, (source, output)) in enumerate(PLOTTED.items()):
        flat, spherical = closed[name]
        table = {
            "error": name,
            "time [min]": times / MINUTE,
            "flat earth [ft]": flat / FOOT,
            "spherical earth [ft]": spherical / FOOT,
            "linear, cruising, level platform [ft]": by_linear[:, output, source] * size_of(source, ROUND) / FOOT,
        }
        tables.append(
            pd.DataFrame(table | {f"{way} [ft]": result[:, column] / FOOT for way, result in flights.items()})
        )
    return pd.concat(tables, ignore_index=True)


def periods() -> pd.DataFrame:
    """Tabulate simulated periods along the track and 2 pi sqrt(r / g_eff) by speed, min."""
    earth = Earth.with_gravity(RADIUS, GRAVITY)
    orbital = float(np.sqrt(GRAVITY * RADIUS))
    rows = []
    for speed in (0.0, SPEED, *(share * orbital for share in (0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98))):
        flight = SteadyFlight(0.0, speed, 1.0, slaved=True, level=True, earth=earth)
        expected = schuler.schuler_period(RADIUS, schuler.effective_gravity(GRAVITY, speed, RADIUS))
        measured = measured_period(flight)
        rows.append(
            {
                "speed [ft/s]": speed / FOOT,
                "V^2 / g r": speed**2 / (GRAVITY * RADIUS),
                "period along the track, flown [min]": measured / MINUTE,
                "2 pi sqrt(r / g_eff) [min]": expected / MINUTE,
                "difference, share": measured / expected - 1.0,
            }
        )
    return pd.DataFrame(rows)


def across() -> tuple[float, float]:
    """Return the simulated period across the track of the cruising missile, and 2 pi sqrt(r / g), min."""
    earth = Earth.with_gravity(RADIUS, GRAVITY)
    flight = SteadyFlight(0.0, SPEED, 1.0, slaved=True, level=True, earth=earth)
    return measured_period(flight, CROSS) / MINUTE, schuler.schuler_period(RADIUS, GRAVITY) / MINUTE


def climb() -> pd.DataFrame:
    """Tabulate the momentary period along a vertical climb at 9 g, min."""
    times = np.concatenate([[0.25], np.arange(10.0, 181.0, 10.0)])
    result = climb_periods(Earth.with_gravity(RADIUS, GRAVITY), 9.0 * GRAVITY, times)
    return pd.DataFrame({"time [s]": times, "period [min]": result / MINUTE})


def hover_growth() -> pd.DataFrame:
    """Tabulate height errors of the hovering vehicle over time, for accelerometer errors of both signs, miles."""
    gravity = ROUND.gravitational_parameter / RADIUS**2
    times = np.linspace(0.0, PERIOD, 43)
    table = {
        "time [min]": times / MINUTE,
        "closed form, 1e-4 g [mi]": schuler.hover(RATIO * gravity, RATE, times) / MILE,
    }
    partials = linearize(hovering(PERIOD), times)[:, HEIGHT, Error.BIAS_Z]
    table["linear, 1e-4 g [mi]"] = -partials * RATIO * gravity / MILE
    for ratio in (1e-4, -1e-4):
        errors = with_one_error(Error.BIAS_Z, -ratio * gravity)[None, :]
        flown = [
            simulate_ensemble(hovering(float(time)), errors, STEPS)[0][0, HEIGHT] if time else 0.0 for time in times
        ]
        table[f"flown, {ratio:+.0e} g [mi]"] = np.array(flown) / MILE
    return pd.DataFrame(table)


def hover_departure() -> pd.DataFrame:
    """Tabulate simulated over linear height after 84 minutes by accelerometer error of either sign."""
    gravity = ROUND.gravitational_parameter / RADIUS**2
    ratios = np.logspace(-7.0, -3.4, 19)
    table = {"error [g]": ratios}
    for sign, name in ((1.0, "pushed up"), (-1.0, "pushed down")):
        errors = np.zeros((len(ratios), len(Error)))
        errors[:, Error.BIAS_Z] = -sign * ratios * gravity
        values, valid = simulate_ensemble(hovering(PERIOD), errors, STEPS)
        share = values[:, HEIGHT] / (sign * ratios * schuler.hover(gravity, RATE, PERIOD))
        table[f"{name}, flown / linear"] = np.where(valid, share, np.nan)
    return pd.DataFrame(table)
