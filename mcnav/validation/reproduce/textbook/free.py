"""Free navigation at rest: laws of growth on a flat earth, and the Schuler pendulum."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.validation.reproduce.textbook import closed_forms
from mcnav.validation.reproduce.textbook.modes import growth_rate, oscillations
from mcnav.validation.reproduce.textbook.navigators import FLAT, SPHERE, Case, Sigma, at_rest, on_each_axis, white
from mcnav.validation.reproduce.textbook.numbers import Number, six_digits

DEGREE: Final = np.pi / 180.0
HOUR: Final = 3600.0
MINUTE: Final = 60.0
FOOT: Final = 0.3048
NAUTICAL_MILE: Final = 1852.0
MICRO_G: Final = 1e-6 * STANDARD_GRAVITY

SAMPLES: Final = 1000
"""Samples of each navigation."""

LATITUDE: Final = 45.0
SHORT: Final = 600.0

BIAS: Final = 100.0 * MICRO_G
TILT: Final = 1e-4
VELOCITY: Final = 0.1
DRIFT: Final = 0.01 * DEGREE / HOUR
HEADING: Final = 1e-3
ACCELERATION: Final = 1.0
"""Northwards in ten minutes, m/s^2, where an azimuth error matters."""

ANGLE_WALK: Final = 0.1 * DEGREE / MINUTE
VELOCITY_WALK: Final = 0.03 / MINUTE
RATE_WALK: Final = 1.0 * DEGREE / HOUR / MINUTE
ACCELERATION_WALK: Final = 100.0 * MICRO_G / MINUTE
INSTABILITY: Final = DEGREE / HOUR
"""1 deg/h/sqrt(h), 100 ug/sqrt(h), and 1 deg/h with a correlation time of one hour."""

ONE_ERROR: Final = {
    "bias": ("accelerometer_bias_x", BIAS, "accelerometer 100 µg"),
    "tilt": ("tilt_east", TILT, "tilt 0.1 mrad"),
    "velocity": ("velocity_north", VELOCITY, "velocity 0.1 m/s"),
    "drift": ("gyro_bias_y", DRIFT, "gyro 0.01 deg/h"),
}
"""Source, size and words of each error of a single channel."""

FLAT_FORMULAS: Final = {"bias": "b t² / 2", "tilt": "g φ t² / 2", "velocity": "v t", "drift": "g ε t³ / 6"}
CURVED_FORMULAS: Final = {
    "bias": "b (1 − cos ωt) / ω²",
    "tilt": "R φ (1 − cos ωt)",
    "velocity": "v sin ωt / ω",
    "drift": "R ε (t − sin ωt / ω)",
}


def compared(
    place: tuple[str, str, str, str], printed: str, formula: str, sigma: Sigma, unit: float = 1.0, remark: str = ""
) -> Number:
    """Return a published sigma beside the computed ones.

    Parameters
    ----------
    place : tuple of str
        Chapter, quantity, unit, source.
    unit : float
        In SI.
    """
    low, high = (each / unit for each in sigma.interval)
    values = sigma.linear / unit, sigma.simulated / unit, (low, high), sigma.paired / unit
    return Number(*place, printed, formula, *values, remark)


def flat_numbers() -> list[Number]:
    """List the laws of growth in ten minutes on a flat earth."""
    chapter, numbers = "flat earth, 10 min", []
    for kind, (source, size, words) in ONE_ERROR.items():
        case = Case(at_rest(FLAT, LATITUDE, SHORT), {source: size}, SAMPLES)
        published = six_digits(closed_forms.growth(kind, size, STANDARD_GRAVITY, SHORT))
        place = (chapter, f"position for {words}", "m", "growth")
        numbers.append(compared(place, published, FLAT_FORMULAS[kind], case.sigma("position_north")))
    moving, distance = at_rest(FLAT, LATITUDE, SHORT, ACCELERATION), 0.5 * ACCELERATION * SHORT**2
    turned = HEADING * distance, DRIFT * ACCELERATION * SHORT**3 / 6.0
    for source, size, value, words, formula in (
        ("heading", HEADING, turned[0], "azimuth 1 mrad, 180 km from standstill", "ψ s"),
        ("gyro_bias_z", DRIFT, turned[1], "vertical gyro 0.01 deg/h, accelerating by 1 m/s²", "ε a t³ / 6"),
    ):
        place = (chapter, f"position across for {words}", "m", "growth")
        sigma = Case(moving, {source: size}, SAMPLES).sigma("position_east")
        numbers.append(compared(place, six_digits(value), formula, sigma))
    return numbers + _walks(chapter)


LEVEL: Final = ("position_north", "position_east")
SPEEDS: Final = ("velocity_north", "velocity_east", "velocity_down")
ANGLES: Final = ("tilt_north", "tilt_east", "heading")


def _walks(chapter: str) -> list[Number]:
    """List the growth from noise; the samples of all axes are pooled."""

    def noisy(imu: Imu, duration: float = SHORT) -> Case:
        return Case(at_rest(FLAT, LATITUDE, duration), {}, SAMPLES, imu)

    angle, velocity = noisy(white("gyro", ANGLE_WALK)), noisy(white("accelerometer", VELOCITY_WALK))
    rate = noisy(on_each_axis("gyro", rate_random_walk=RATE_WALK))
    acceleration = noisy(on_each_axis("accelerometer", rate_random_walk=ACCELERATION_WALK))
    unstable = on_each_axis("gyro", instability=INSTABILITY, correlation_time=HOUR)
    markov, longer = noisy(unstable), noisy(unstable, 6.0 * HOUR)
    walk = closed_forms.integrated_walk
    rate_at = six_digits(walk(RATE_WALK, 2, SHORT) / DEGREE), six_digits(STANDARD_GRAVITY * walk(RATE_WALK, 4, SHORT))
    faster = six_digits(walk(ACCELERATION_WALK, 2, SHORT)), six_digits(walk(ACCELERATION_WALK, 3, SHORT))
    rows: list[tuple[str, str, str, str, str, Sigma, float]] = [
        ("angle for 0.1 deg/√h", "deg", "checks", "0.040825", "N √t", angle.sigma(*ANGLES), DEGREE),
        ("position for 0.1 deg/√h", "m", "checks", "562.4837", "g N √(t⁵/20)", angle.sigma(*LEVEL), 1.0),
        ("velocity for 0.03 m/s/√h", "m/s", "checks", "0.012247", "N √t", velocity.sigma(*SPEEDS), 1.0),
        ("position for 0.03 m/s/√h", "m", "checks", "4.2426", "N √(t³/3)", velocity.sigma(*LEVEL), 1.0),
        ("angle for 1 deg/h/√h", "deg", "course", rate_at[0], "K √(t³/3)", rate.sigma(*ANGLES), DEGREE),
        ("position for 1 deg/h/√h", "m", "checks", rate_at[1], "g K √(t⁷/252)", rate.sigma(*LEVEL), 1.0),
        ("velocity for 100 µg/√h", "m/s", "course", faster[0], "K √(t³/3)", acceleration.sigma(*SPEEDS), 1.0),
        ("position for 100 µg/√h", "m", "course", faster[1], "K √(t⁵/20)", acceleration.sigma(*LEVEL), 1.0),
        ("angle for an instability of 1 deg/h, 1 h", "deg", "checks", "0.162163", "σ τ √(2(x − 1 + e⁻ˣ))",
         markov.sigma(*ANGLES), DEGREE),
        ("heading for it after 6 h", "deg", "checks", "3.16306", "σ τ √(2(x − 1 + e⁻ˣ))", longer.sigma("heading"),
         DEGREE),
    ]  # fmt: skip
    return [
        compared((chapter, quantity, unit, source), printed, formula, numbers, scale)
        for quantity, unit, source, printed, formula, numbers, scale in rows
    ]


def schuler_numbers() -> list[Number]:
    """List the numbers of one Schuler channel on a sphere that does not turn."""
    chapter, numbers = "Schuler pendulum", _periods("Schuler pendulum")
    rate = closed_forms.schuler_rate(STANDARD_GRAVITY, SPHERE.radius)
    for duration, after in ((SHORT, "10 min"), (HOUR, "1 h")):
        for kind, (source, size, words) in ONE_ERROR.items():
            case = Case(at_rest(SPHERE, LATITUDE, duration), {source: size}, SAMPLES)
            published = six_digits(abs(closed_forms.channel(kind, size, STANDARD_GRAVITY, rate, duration)))
            place = (chapter, f"position after {after} for {words}", "m", "growth")
            numbers.append(compared(place, published, CURVED_FORMULAS[kind], case.sigma("position_north")))
    return numbers + _toolbox(chapter)


def _periods(chapter: str) -> list[Number]:
    """List the period, for two sizes of the earth, and the growth of the vertical channel."""
    other = replace(SPHERE, radius=6371e3, gravitational_parameter=9.81 * 6371e3**2)

    def period(earth: Earth) -> tuple[float, float]:
        scenario = Case(at_rest(earth, LATITUDE, SHORT), {}, 2).scenario
        linear, simulated = (2.0 * np.pi / oscillation[0] / MINUTE for oscillation in oscillations(scenario))
        return linear, simulated

    linear, simulated = growth_rate(Case(at_rest(SPHERE, LATITUDE, SHORT), {}, 2).scenario)
    vertical = six_digits(1e3 * np.sqrt(2.0 * STANDARD_GRAVITY / SPHERE.radius))
    return [
        Number(chapter, "period", "min", "checks", "84.4530", "2π √(R/g)", *period(SPHERE)),
        Number(chapter, "period, R = 6371 km, g = 9.81 m/s²", "min", "tuning", "84.4", "2π √(R/g)", *period(other)),
        Number(chapter, "growth of the vertical channel", "10⁻³/s", "closed", vertical, "√(2g/R)", 1e3 * linear,
               1e3 * simulated),
    ]  # fmt: skip


def _toolbox(chapter: str) -> list[Number]:
    """List the numbers of the toolbox's page, of an accelerometer's bias of 100 µg."""
    period = 2.0 * np.pi / closed_forms.schuler_rate(STANDARD_GRAVITY, SPHERE.radius)
    bias = {"accelerometer_bias_x": BIAS}
    velocity = Case(at_rest(SPHERE, LATITUDE, 0.25 * period), bias, SAMPLES).sigma("velocity_north")
    position = Case(at_rest(SPHERE, LATITUDE, 0.5 * period), bias, SAMPLES).sigma("position_north")
    chain = "the 42 follow from the rounded 0.7 nautical miles; 2 b / ω² are 41.3 arcsec of latitude"
    rows = [
        ("largest velocity error per µg", "ft/s", "0.026", "b / ω", velocity, 100.0 * FOOT, ""),
        ("largest velocity error for 100 µg", "ft/s", "2.6", "b / ω", velocity, FOOT, ""),
        ("largest velocity error for 100 µg", "m/s", "0.8", "b / ω", velocity, 1.0, ""),
        ("largest position error per µg", "nmi", "0.007", "2 b / ω²", position, 100.0 * NAUTICAL_MILE, ""),
        ("largest position error for 100 µg", "nmi", "0.7", "2 b / ω²", position, NAUTICAL_MILE, ""),
        ("largest position error for 100 µg", "arcsec", "42", "2 b / ω²", position,
         SPHERE.radius * DEGREE / HOUR, chain),
    ]  # fmt: skip
    return [
        compared((chapter, quantity, unit, "toolbox"), printed, formula, numbers, scale, remark)
        for quantity, unit, printed, formula, numbers, scale, remark in rows
    ]
