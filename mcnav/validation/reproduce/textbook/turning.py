"""Navigation at rest on the turning earth: modes, Foucault's rotation, errors after an hour, alignment.

An altimeter holds altitude and vertical velocity, as the published numbers are those of the horizontal channels alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.validation.reproduce.textbook import closed_forms
from mcnav.validation.reproduce.textbook.free import (
    BIAS,
    DEGREE,
    DRIFT,
    HEADING,
    HOUR,
    LATITUDE,
    MINUTE,
    SHORT,
    compared,
)
from mcnav.validation.reproduce.textbook.modes import growth_rate, oscillations, steady_drift
from mcnav.validation.reproduce.textbook.navigators import (
    TURNING,
    Case,
    at_rest,
    filter_of,
    held_altitude,
    sensor,
    white,
)
from mcnav.validation.reproduce.textbook.numbers import Number, six_digits

SAMPLES: Final = 400
ALIGNMENT: Final = 1200.0
"""Duration of an alignment, s."""

MODES: Final = {
    0.0: ("84.28307", "84.56660"),
    30.0: ("81.99147", "86.96101"),
    45.0: ("81.01501", "88.04050"),
    60.0: ("80.27635", "88.88240"),
}
"""Periods of the two Schuler modes by latitude, min."""

AFTER: Final = {
    "accelerometer north 100 µg": (
        "accelerometer_bias_x", BIAS, (("168.4601", "3.4425"), ("790.8193", "3.2502")),
    ),
    "gyro north 0.01 deg/h": ("gyro_bias_x", DRIFT, (("-0.3850", "16.6428"), ("-160.0467", "1344.2753"))),
    "gyro down 0.01 deg/h": ("gyro_bias_z", DRIFT, (("-0.1299", "-0.0024"), ("-89.5966", "-8.6427"))),
    "heading 1 mrad": ("heading", HEADING, (("-17.6982", "-0.4095"), ("-1420.6646", "-170.2144"))),
}  # fmt: skip
"""Source, size, and position errors north and east after ten minutes and an hour at 45 degrees, m."""

CITIES: Final = {"Saint Petersburg": (59.93, "28"), "New York": (40.71, "37"), "Phnom Penh": (11.55, "119")}
"""Latitude, deg, and hours in which a pendulum's plane turns once."""

ALIGNED: Final = {0.0: "0.6648", 45.0: "0.9402", 60.0: "1.3297"}
"""Heading errors of gyrocompassing with 0.01 deg/h by latitude, mrad."""

ALIGNMENT_WALK: Final = 0.003 * DEGREE / MINUTE
"""Angle random walk in an alignment, rad/sqrt(s)."""


def held(latitude: float, duration: float, earth: Earth = WGS84, **sigmas: float) -> Case:
    """Return a navigator at rest whose altitude an altimeter holds."""
    return Case(at_rest(earth, latitude, duration), sigmas, SAMPLES, aiding=held_altitude(duration))


def mode_numbers() -> list[Number]:
    """List periods of the modes, Foucault's rotation, and the drift that remains."""
    chapter, numbers = "turning earth", []
    for latitude, printed in MODES.items():
        linear, simulated = (2.0 * np.pi / oscillation for oscillation in oscillations(held(latitude, SHORT).scenario))
        for number, (kind, text) in enumerate(zip(("short", "long"), printed, strict=True)):
            quantity = f"{kind} Schuler mode at {latitude:.0f}° latitude"
            periods = linear[number] / MINUTE, simulated[number] / MINUTE
            numbers.append(Number(chapter, quantity, "min", "checks", text, "period", *periods))
        if latitude == LATITUDE:
            days = linear[-1] / HOUR, simulated[-1] / HOUR
            numbers.append(Number(chapter, "mode of the earth's rate", "h", "checks", "23.934472", "2π/Ω", *days))
    return [*numbers, *_foucault(chapter), *_drift(chapter), *_vertical(chapter)]


def _turn(latitude: float) -> tuple[float, float]:
    """Compute the time in which the plane of the oscillation turns once on a turning sphere, h."""
    linear, simulated = (
        4.0 * np.pi / (oscillation[0] - oscillation[1]) / HOUR
        for oscillation in oscillations(held(latitude, SHORT, TURNING).scenario)
    )
    return float(linear), float(simulated)


def _foucault(chapter: str) -> list[Number]:
    formula = "2π/(Ω sin φ)"
    numbers = [
        Number(chapter, f"plane of oscillation turns once, {city}", "h", "pendulum", printed, formula, *_turn(latitude))
        for city, (latitude, printed) in CITIES.items()
    ]
    published = six_digits(closed_forms.foucault_period(WGS84.rotation_rate, np.radians(LATITUDE)) / HOUR)
    remark = "the formula holds to the square of Ω/ω, which is 0.3 %; the modes of the sphere are exact"
    quantity = "plane of oscillation turns once, 45° latitude"
    linear, simulated = _turn(LATITUDE)
    last = Number(chapter, quantity, "h", "closed", published, formula, linear, simulated, remark=remark)
    return [*numbers, last]


def _drift(chapter: str) -> list[Number]:
    rate = steady_drift(held(LATITUDE, SHORT).scenario, "position_east", "gyro_bias_x") * DRIFT * HOUR
    remark = "the number has the equatorial radius; with the radius of curvature at 45° it is 557.53"
    quantity = "mean drift eastwards for gyro north 0.01 deg/h at 45° latitude"
    return [Number(chapter, quantity, "m/h", "checks", "556.60", "R ε cos² φ", rate, remark=remark)]


def _vertical(chapter: str) -> list[Number]:
    linear, simulated = growth_rate(Case(at_rest(WGS84, LATITUDE, SHORT), {}, 2).scenario)
    remark = "the number has gravity fall by 2g/a; that of the ellipsoid falls by g(1/M + 1/N) + 2Ω², 0.35 % more"
    rate, doubling = "growth of the vertical channel at 45° latitude", "the same, time in which it doubles"
    twice = float(np.log(2.0))
    return [
        Number(chapter, rate, "1/s", "checks", "1.751532e-3", "√(2g/a)", linear, simulated, remark=remark),
        Number(
            chapter, doubling, "s", "checks", "395.74", "ln 2/rate", twice / linear, twice / simulated, remark=remark
        ),
    ]


def error_numbers() -> list[Number]:
    """List the position errors after ten minutes and an hour at 45 degrees."""
    numbers = []
    for words, (source, size, rows) in AFTER.items():
        for duration, after, printed in ((SHORT, "10 min", rows[0]), (HOUR, "1 h", rows[1])):
            case = held(LATITUDE, duration, WGS84, **{source: size})
            for output, axis, text in zip(("position_north", "position_east"), ("north", "east"), printed, strict=True):
                sigma = case.sigma(output)
                place = "turning earth, at rest", f"{axis} after {after} for {words}", "m", "checks"
                linear, formula = size * case.partial(output, source), "exponential of two horizontal channels"
                paired = np.copysign(sigma.paired, linear)
                values = linear, sigma.simulated, sigma.interval, float(paired)
                numbers.append(Number(*place, text, formula, *values))
    return numbers


def alignment_numbers() -> list[Number]:
    """List gyrocompassing and leveling: updates of zero velocity by a filter that knows nothing of the bias."""
    chapter, numbers = "alignment", []
    for latitude, printed in ALIGNED.items():
        case = _aligned(latitude, 10.0, ALIGNMENT, 1e-4, Imu(), gyro_bias_y=DRIFT)
        place = (chapter, f"heading for gyro east 0.01 deg/h at {latitude:.0f}° latitude", "mrad", "checks")
        numbers.append(compared(place, printed, "ε/(Ω cos φ)", case.sigma("heading"), 1e-3))
    leveled = _aligned(LATITUDE, 10.0, ALIGNMENT, 1e-4, Imu(), accelerometer_bias_x=1e-3 * STANDARD_GRAVITY)
    place = (chapter, "tilt for accelerometer 1 mg", "mrad", "checks")
    numbers.append(compared(place, "1", "b/g", leveled.sigma("tilt_east"), 1e-3))
    walking = _aligned(LATITUDE, 1.0, 300.0, 1e-6, white("gyro", ALIGNMENT_WALK))
    remark = "the formula takes the mean rate of the tilt; the filter sees it by increments of velocity over 1 s"
    place = (chapter, "heading for 0.003 deg/√h in 300 s at 45° latitude", "mrad", "checks")
    return [*numbers, compared(place, "0.9771", "N/(√t Ω cos φ)", walking.sigma("heading"), 1e-3, remark)]


def _aligned(latitude: float, interval: float, duration: float, noise: float, imu: Imu, **sigmas: float) -> Case:
    """Return a navigator that is aligned at rest by a filter that believes in the processes of its instruments only."""
    sensors = (sensor("zero_velocity", interval, duration, {"velocity": noise}),)
    model = filter_of(sensors, imu, {"velocity": 0.1, "tilt": 1e-2, "heading": 1.0})
    return Case(at_rest(WGS84, latitude, duration), sigmas, SAMPLES, imu, (sensors, model))
