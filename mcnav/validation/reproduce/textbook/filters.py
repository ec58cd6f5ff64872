"""Filters with known steady states: matched ones, mismatched ones, and one with neglected and considered errors.

Every axis of a vehicle at rest in empty space is a channel of its own: position and velocity are a track with white
acceleration; attitude, measured by a star tracker, is a random walk. Samples of the three axes are pooled.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.statistics.mean_square import mean_square_bounds
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.validation.reproduce.textbook import closed_forms
from mcnav.validation.reproduce.textbook.free import ANGLES, HOUR, MICRO_G, MINUTE, SPEEDS, compared
from mcnav.validation.reproduce.textbook.navigators import (
    EMPTY_SPACE,
    Case,
    Sigma,
    at_rest,
    filter_of,
    on_each_axis,
    sensor,
    white,
)
from mcnav.validation.reproduce.textbook.numbers import Number, six_digits

SAMPLES: Final = 300
POSITIONS: Final = ("position_north", "position_east", "position_down")
START: Final = {"position": 3.0, "velocity": 1.0, "tilt": 1e-9, "heading": 1e-9}
FIX: Final = 2.0
"""Sigma of a position fix, m."""

QUIET: Final = 0.03 / MINUTE
MILLI_G: Final = 1000.0 * MICRO_G

ANGLE: Final = 1e-6
"""Unit of the scalar filter's angles, rad."""

HEIGHTS: Final = (48.54, 47.11, 55.01, 55.15, 49.89, 40.85, 46.72, 50.05, 51.27, 49.95)
HEIGHT_ESTIMATES: Final = ("49.69", "48.47", "50.57", "51.68", "51.33", "49.62", "49.21", "49.31", "49.53", "49.57")
FIRST_HEIGHT: Final = 60.0
HEIGHT_SIGMA: Final = 15.0
ALTIMETER: Final = 5.0
"""Measurements and estimates of a building's height, m; first guess, its sigma, and that of a measurement."""

TEMPERATURES: Final = (49.95, 49.967, 50.1, 50.106, 49.992, 49.819, 49.933, 50.007, 50.023, 49.99)
TEMPERATURE_ESTIMATES: Final = (
    "49.95", "49.959", "50.007", "50.032", "50.023", "49.987", "49.978", "49.983", "49.988", "49.988",
)  # fmt: skip
FIRST_TEMPERATURE: Final = 10.0
TEMPERATURE_SIGMA: Final = 100.0
THERMOMETER: Final = 0.1
TEMPERATURE_WALK: Final = 0.01
"""The same of a liquid in a tank, °C, which walks at random."""


def _track(
    duration: float,
    imu: Imu,
    believed: Imu | None = None,
    estimates: tuple[str, ...] = (),
    considers: tuple[str, ...] = (),
    velocity: float | None = None,
) -> Case:
    """Return a track with fixes each second, of position or of velocity as well."""
    noise: dict[str, float] = {"position": FIX} if velocity is None else {"position": FIX, "velocity": velocity}
    sensors = (sensor("fix", 1.0, duration, noise),)
    model = filter_of(sensors, imu if believed is None else believed, START, estimates, considers)
    return Case(at_rest(EMPTY_SPACE, 45.0, duration), START, SAMPLES, imu, (sensors, model))


def matched_numbers() -> list[Number]:
    """List steady states of filters that believe the truth."""
    chapter, numbers = "matched filter", []
    for density, words, printed, duration in (
        (1.0, "q = 1, r = 2 m", ("1.590075", "1.258635"), MINUTE),
        (QUIET, "q = 0.03 m/s/√h, r = 2 m", ("0.297406", "0.004716"), 1000.0),
    ):
        case = _track(duration, white("accelerometer", density))
        for outputs, quantity, unit, text in zip(
            (POSITIONS, SPEEDS), ("position", "velocity"), ("m", "m/s"), printed, strict=True
        ):
            place = (chapter, f"{quantity}, {words}", unit, "checks")
            numbers.append(compared(place, text, "Riccati equation", case.sigma(*outputs)))
    bias = on_each_axis("accelerometer", random_walk=QUIET, instability=MILLI_G, correlation_time=HOUR)
    for velocity, words, steady in (
        (None, "bias estimated", ("0.608786", "0.036577", "149.42")),
        (0.1, "bias estimated, velocity measured to 0.1 m/s", ("0.427875", "0.023352", "123.23")),
    ):
        case = _track(600.0, bias, estimates=("accelerometer_bias",), velocity=velocity)
        for quantity, unit, text, result in (
            ("position", "m", steady[0], case.sigma(*POSITIONS)),
            ("velocity", "m/s", steady[1], case.sigma(*SPEEDS)),
        ):
            numbers.append(
                compared((chapter, f"{quantity}, {words}", unit, "checks"), text, "Riccati equation", result)
            )
        place = (chapter, f"bias of 1 mg, {words}", "µg", "checks")
        numbers.append(Number(*place, steady[2], "Riccati equation", float(case.own_states[0]) / MICRO_G))
    return numbers


def mismatched_numbers() -> list[Number]:
    """List filters that believe something wrong: what they say, and what is true."""
    return [*_neglected("mismatched filter"), *_scalar("mismatched filter")]


def _neglected(chapter: str) -> list[Number]:
    """List the filter without the accelerometer's bias, and the one that considers it."""
    truth = on_each_axis("accelerometer", random_walk=QUIET, instability=MILLI_G, correlation_time=HOUR)
    blind = _track(600.0, truth, white("accelerometer", 0.01)).sigma(*POSITIONS)
    aware = _track(600.0, truth, considers=("accelerometer_bias",)).sigma(*POSITIONS)
    rows: list[tuple[str, str, float, Sigma | None]] = [
        ("position by a filter without the bias: it says", "0.616969", blind.own, None),
        ("position by a filter without the bias: true", "1.939450", blind.linear, blind),
        ("position, bias considered (Schmidt): it says", "0.865602", aware.own, None),
        ("position, bias considered (Schmidt): true", "0.865602", aware.linear, aware),
    ]
    formula = "closed-loop covariance"
    return [
        Number(chapter, words, "m", "checks", printed, formula, value)
        if numbers is None
        else compared((chapter, words, "m", "checks"), printed, formula, numbers)
        for words, printed, value, numbers in rows
    ]


def _walk(duration: float, walk: float, believed: float) -> Case:
    """Return an attitude that walks at random with a variance each second, star fixes of variance 4."""
    sensors = (sensor("stars", 1.0, duration, {"attitude": 2.0 * ANGLE}),)
    truth, other = (white("gyro", np.sqrt(each) * ANGLE) for each in (walk, believed))
    start = {"position": 1e-6, "velocity": 1e-9, "tilt": ANGLE, "heading": ANGLE}
    aiding = sensors, filter_of(sensors, other, start)
    return Case(at_rest(EMPTY_SPACE, 45.0, duration), start, SAMPLES, truth, aiding)


def _scalar(chapter: str) -> list[Number]:
    """List the random walk with q = 1 and r = 4, by a filter that believes in q = 1/4, and by the optimal one."""
    wrong, right = _walk(200.0, 1.0, 0.25), _walk(200.0, 1.0, 1.0)
    sigma, best = wrong.sigma(*ANGLES), right.sigma(*ANGLES)
    own, true = (sigma.own / ANGLE) ** 2, (sigma.linear / ANGLE) ** 2
    innovation = (true + 1.0 + 4.0) / (own + 0.25 + 4.0)
    nees, nis = wrong.mean_square("attitude"), wrong.mean_square("stars")
    optimum = (best.own / ANGLE) ** 2
    return [
        Number(chapter, "gain of the random walk", "1", "checks", "0.2206955546", "own variance/r", own / 4.0),
        Number(chapter, "its variance, it says", "1", "checks", "0.8827822185", "p r/(p + r)", own),
        _variance(chapter, "its variance, true", "2.0427120591", "((1 − K)² q + K² r)/(1 − (1 − K)²)", sigma),
        Number(chapter, "its NEES", "1", "checks", "2.313948", "true/own variance", true / own, nees.simulated,
               nees.interval),
        Number(chapter, "its NIS", "1", "checks", "1.372104", "true/own innovation", innovation, nis.simulated,
               nis.interval),
        Number(chapter, "gain of the optimal filter", "1", "checks", "0.3903882032", "variance/r", optimum / 4.0),
        _variance(chapter, "variance of the optimal filter", "1.5615528128", "p r/(p + r)", best),
    ]  # fmt: skip


def _variance(chapter: str, quantity: str, printed: str, formula: str, sigma: Sigma) -> Number:
    """Return a published variance beside the computed ones, in squares of `ANGLE`."""
    linear, simulated, paired, low, high = (
        (each / ANGLE) ** 2 for each in (sigma.linear, sigma.simulated, sigma.paired, *sigma.interval)
    )
    return Number(chapter, quantity, "1", "checks", printed, formula, linear, simulated, (low, high), paired)


def tutorial_numbers() -> list[Number]:
    """List the estimates of a tutorial, with the gains of this filter and the tutorial's measurements.

    A gain is the filter's variance after the update over that of the measurement.
    """
    sensors = (sensor("fix", 1.0, 10.0, {"position": ALTIMETER}),)
    start = START | {"position": HEIGHT_SIGMA, "velocity": 1e-9}
    model = filter_of(sensors, Imu(), start)
    building = Case(at_rest(EMPTY_SPACE, 45.0, 10.0), start, SAMPLES, aiding=(sensors, model))
    heights = _estimates(building, POSITIONS[0], ALTIMETER, FIRST_HEIGHT, HEIGHTS)
    closed = six_digits(closed_forms.repeated_fixes(HEIGHT_SIGMA, ALTIMETER, 10))
    chapter, numbers = "tutorial", _estimated("building", "m", HEIGHT_ESTIMATES, heights, "")
    place = (chapter, "building, sigma after ten fixes", "m", "closed")
    numbers.append(compared(place, closed, "1/√(1/s² + n/r²)", building.sigma(*POSITIONS)))
    stars = (sensor("stars", 1.0, 10.0, {"attitude": THERMOMETER * ANGLE}),)
    walk, unknown = white("gyro", TEMPERATURE_WALK * ANGLE), TEMPERATURE_SIGMA * ANGLE
    first = {"position": 1e-6, "velocity": 1e-9, "tilt": unknown, "heading": unknown}
    tank = Case(at_rest(EMPTY_SPACE, 45.0, 10.0), first, SAMPLES, walk, (stars, filter_of(stars, walk, first)))
    degrees = _estimates(tank, ANGLES[0], THERMOMETER * ANGLE, FIRST_TEMPERATURE, TEMPERATURES)
    remark = "one unit of the last digit: the tutorial rounds its variances on the way"
    return numbers + _estimated("liquid", "°C", TEMPERATURE_ESTIMATES, degrees, remark)


def _estimates(case: Case, output: str, noise: float, first: float, measured: tuple[float, ...]) -> list[float]:
    """Estimate a constant from measurements with the gains of a case's filter."""
    variances = case.variances_after_updates(output)
    estimate, estimates = first, []
    for variance, measurement in zip(variances, measured, strict=True):
        estimate += variance / noise**2 * (measurement - estimate)
        estimates.append(float(estimate))
    return estimates


def _estimated(what: str, unit: str, printed: tuple[str, ...], computed: list[float], remark: str) -> list[Number]:
    numbers = [
        Number("tutorial", f"{what}, estimate {count}", unit, "tutorial", text, "x + K (z − x)", value)
        for count, (text, value) in enumerate(zip(printed, computed, strict=True), 1)
    ]
    return [number if number.linear_agrees else number.explained(remark) for number in numbers]


def bound_numbers() -> list[Number]:
    """List the bounds of mean NEES of consistent filters."""
    numbers = []
    for size, runs, printed in ((15, 100, ("13.9456", "16.0923")), (9, 50, ("7.8624", "10.2134"))):
        bounds = mean_square_bounds(float(size), np.array(float(size * runs)), 0.95)
        for words, text, value in zip(("lower", "upper"), printed, bounds.tolist(), strict=True):
            quantity = f"{words} 95 % bound of mean NEES, {size} states, {runs} runs"
            numbers.append(Number("consistency", quantity, "1", "checks", text, "χ² of n d / n", value))
    return numbers
