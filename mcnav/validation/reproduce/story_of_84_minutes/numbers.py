"""Printed numbers of "The Story of 84 Minutes" with closed forms, linear analysis and nonlinear simulation.

W. Bollay, "A Critical Meeting on the Development of Inertial Navigation", Stanford Engineering Case Library, 1966.

The linear analysis is `mcnav.systems.steady.linearized`, the simulation is the reference path of
`mcnav.systems.steady.navigator`; neither contains a pendulum equation. Both are computed for the document's model, a
navigator at rest, and the simulation also for its missile, which cruises at half a mile per second. The flat earth is
one with a radius 1e10 times larger.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.optimize import brentq

from mcnav.arrays.types import Array
from mcnav.systems.steady.ensemble import simulate_ensemble
from mcnav.systems.steady.linearized import linearize
from mcnav.systems.steady.navigator import simulate_indicated
from mcnav.systems.steady.truth import Earth, Error, SteadyFlight
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from mcnav.validation.reproduce.story_of_84_minutes.climb import climb_periods

FOOT: Final = 0.3048
MILE: Final = 5280.0 * FOOT
DEGREE: Final = np.pi / 180.0
MINUTE: Final = 60.0
HOUR: Final = 3600.0

RADIUS: Final = 3960.0 * MILE
GRAVITY: Final = 32.2 * FOOT
PERIOD: Final = 5060.0
"""84.4 minutes as rounded in the document, s; its radius and gravity give 5063.1 s, 84.385 minutes."""

TIME: Final = 2.0 * PERIOD
DISTANCE: Final = 5060.0 * MILE
SPEED: Final = DISTANCE / TIME

TILT: Final = 0.01 * DEGREE
VELOCITY: Final = 1.0 * FOOT
RATIO: Final = 1e-4
DRIFT: Final = 0.01 * DEGREE / HOUR

FLATTER: Final = 1e10
"""Radius of the flat earth over that of the earth; the remaining effect of curvature, (w t)^2 / 12, is 1e-9."""

ROUND: Final = Earth(RADIUS, (2.0 * np.pi / PERIOD) ** 2 * RADIUS**3)
"""Earth of the document, with the gravity (32.24 ft/s^2) that gives a period of exactly 5060 s."""

FLAT: Final = Earth.with_gravity(FLATTER * RADIUS, GRAVITY)

SLIDE_RULE: Final = 5e-3
"""Relative error of a chain of slide rule readings."""

STEPS: Final = 256


class Standing(StrEnum):
    """Agreement of a computed number with the printed one."""

    DIGITS = "agrees to the printed digits"
    SLIDE_RULE = "agrees to a slide rule's accuracy"
    MISPRINT = "is misprinted or miscalculated"


@dataclass(frozen=True)
class Number:
    """A printed number and its place in the document; computed values are in the printed unit.

    ``closed`` is the value of the document's formula, corrected. ``linear`` and ``flown`` are linear analysis and
    simulation of a navigator at rest, ``cruising`` is the simulation at half a mile per second. The remark explains the
    printed number, or a misprint where this is ``wrong``.
    """

    place: str
    quantity: str
    unit: str
    printed: str
    formula: str
    closed: float
    linear: float | None = None
    flown: float | None = None
    cruising: float | None = None
    remark: str = ""
    wrong: bool = False

    @property
    def value(self) -> float:
        """Printed number as a float."""
        return float(self.printed.replace(",", ""))

    @property
    def standing(self) -> Standing:
        """Agreement of the closed form with the printed number."""
        if self.wrong:
            return Standing.MISPRINT
        mantissa, _, exponent = self.printed.replace(",", "").partition("e")
        unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        if "." not in mantissa and not exponent:  # zeros at the end of a whole number are no digits
            unit = 10.0 ** (len(mantissa) - len(mantissa.rstrip("0"))) if self.value else 1.0
        difference = abs(self.closed - self.value)
        if difference <= 0.5 * unit * (1.0 + 1e-9):
            return Standing.DIGITS
        return Standing.SLIDE_RULE if difference <= SLIDE_RULE * abs(self.value) else Standing.MISPRINT


def at_rest(duration: float, earth: Earth = ROUND) -> SteadyFlight:
    """Return the document's model: a level platform at rest."""
    return SteadyFlight(0.0, 0.0, duration, slaved=True, level=True, earth=earth)


def cruising(duration: float, earth: Earth = ROUND, level: bool = True) -> SteadyFlight:
    """Return the missile of Problem 3, 2640 ft/s along a great circle."""
    return SteadyFlight(0.0, SPEED, duration, slaved=True, level=level, earth=earth)


def hovering(duration: float) -> SteadyFlight:
    """Return the helicopter of Problem 4, without an altimeter."""
    return SteadyFlight(0.0, 0.0, duration, slaved=False, level=False, earth=ROUND)


RANGE, CROSS, HEIGHT = 1, 2, 0

SIZES: Final = {
    Error.MISALIGNMENT: -TILT,
    Error.ROLL_MISALIGNMENT: -TILT,
    Error.AZIMUTH_MISALIGNMENT: TILT,
    Error.RANGE_RATE: VELOCITY,
    Error.CROSS_RANGE_RATE: VELOCITY,
    Error.BIAS_X: RATIO,
    Error.BIAS_Y: RATIO,
    Error.GYRO_DRIFT: -DRIFT,
    Error.ROLL_DRIFT: -DRIFT,
}
"""Errors of the document, signed so that each position error is positive; biases in units of gravity."""


def size_of(source: Error, earth: Earth) -> float:
    """Return the size of an error on an earth, SI."""
    in_gravity = source in (Error.BIAS_X, Error.BIAS_Y)
    return SIZES[source] * (earth.gravitational_parameter / earth.radius**2 if in_gravity else 1.0)


def with_one_error(source: Error, size: float) -> Array:
    """Return a vector of errors with a single one, shape (18,)."""
    errors = np.zeros(len(Error))
    errors[source] = size
    return errors


def simulated(flight: SteadyFlight, source: Error, output: int, size: float | None = None) -> float:
    """Simulate the navigation error due to one error, m.

    On the flat earth only deviations are simulated, because coordinates would lose them to rounding.
    """
    errors = with_one_error(source, size_of(source, flight.earth) if size is None else size)
    if flight.earth is FLAT:
        return float(simulate_ensemble(flight, errors[None, :], STEPS)[0][0, output])
    return float(simulate_indicated(flight, errors)[output])


def linear(flight: SteadyFlight, source: Error, output: int) -> float:
    """Compute the navigation error due to one error of the document's size by the variational equations, m."""
    return float(linearize(flight, np.array([flight.duration]))[0, output, source] * size_of(source, flight.earth))


def measured_period(flight: SteadyFlight, output: int = RANGE) -> float:
    """Simulate the period of an indicated position: the time after which its error returns to zero, s."""
    expected = schuler.schuler_period(flight.radius, flight.effective_gravity)
    source = Error.RANGE_RATE if output == RANGE else Error.CROSS_RANGE_RATE

    def error(duration: float) -> float:
        return simulated(replace(flight, duration=duration), source, output, 0.01)

    return float(brentq(error, 0.8 * expected, 1.2 * expected, xtol=1e-6))


Runs = tuple[float | None, float | None, float | None]


def _runs(source: Error, duration: float, unit: float, earth: Earth = ROUND, output: int = RANGE) -> Runs:
    """Compute an error by linear analysis at rest, simulation at rest, and simulation cruising."""
    rest, moving = at_rest(duration, earth), cruising(duration, earth)
    runs = linear(rest, source, output), simulated(rest, source, output), simulated(moving, source, output)
    return runs[0] / unit, runs[1] / unit, runs[2] / unit


def _cruising_only(source: Error, earth: Earth) -> Runs:
    """Compute an error that has no effect at rest."""
    return None, None, simulated(cruising(TIME, earth), source, CROSS) / FOOT


HALF: Final = 0.5 * PERIOD
QUARTER: Final = 0.25 * PERIOD


def tilt_numbers() -> list[Number]:
    """List the numbers of error (a), a tilted platform."""
    flat, end = schuler.tilt_flat(TILT, GRAVITY, TIME) / FOOT, (Error.MISALIGNMENT, TIME, FOOT)
    most = 2.0 * RADIUS * TILT
    roll = _runs(Error.ROLL_MISALIGNMENT, TIME, FOOT, FLAT, CROSS)
    half = _runs(Error.MISALIGNMENT, HALF, FOOT)
    quarter = _runs(Error.MISALIGNMENT, QUARTER, FOOT)
    summed = (
        "the summary calls R Δθ the maximum; 1 − cos ωt reaches 2, and the text has the correct 7,300 ft: the "
        "factor 2 is missing"
    )
    return [
        Number("(a) flat", "misalignment", "1e-4 rad", "1.74", "Δθ", TILT * 1e4, remark="0.01 deg is 1.745e-4 rad"),
        Number("(a) flat", "acceleration error", "ft/s²", "0.0056", "g Δθ", GRAVITY * TILT / FOOT),
        Number("(a) flat", "velocity error at 10,120 s", "ft/s", "57", "g Δθ t", GRAVITY * TILT * TIME / FOOT),
        Number("(a) flat", "coefficient of t²", "1e-4 ft/s²", "28", "g Δθ / 2", 0.5e4 * GRAVITY * TILT / FOOT),
        Number("(a) flat", "range error", "ft", "287,500", "g Δθ t² / 2", flat, *_runs(*end, FLAT)),
        Number("(a) flat", "cross-range error", "ft", "287,500", "g Δθ t² / 2", flat, *roll),
        Number("summary, flat", "range error by tilt", "ft", "288,000", "g Δθ t² / 2", flat, *_runs(*end, FLAT)),
        Number("(a) spherical", "amplitude of range error", "ft", "3,650", "R Δθ", 0.5 * most / FOOT, *quarter),
        Number("(a) spherical", "largest range error", "miles", "1.38", "2 R Δθ", most / MILE,
               *_runs(Error.MISALIGNMENT, HALF, MILE)),
        Number("(a) spherical", "largest range error", "ft", "7,300", "2 R Δθ", most / FOOT, *half),
        Number("(a) spherical", "range error at 10,120 s", "ft", "0", "R Δθ (1 − cos ωt)",
               schuler.tilt_spherical(TILT, RADIUS, 2.0 * np.pi / PERIOD, TIME) / FOOT, *_runs(*end),
               remark="the moving missile has a 0.5 % longer period and has not quite returned"),
        Number("(a) spherical", "amplitude of cross-range error", "ft", "3,650", "R Δθ", 0.5 * most / FOOT,
               *_runs(Error.ROLL_MISALIGNMENT, QUARTER, FOOT, ROUND, CROSS)),
        Number("summary, spherical", "largest range error by tilt", "ft", "3,650", "2 R Δθ", most / FOOT, *half,
               remark=summed, wrong=True),
    ]  # fmt: skip


def azimuth_numbers() -> list[Number]:
    """List the numbers of error (a) about the vertical, a wrong launch direction."""
    angle = DISTANCE / RADIUS
    flat = schuler.azimuth_flat(TILT, DISTANCE) / FOOT
    curved = schuler.azimuth_spherical(TILT, RADIUS, DISTANCE)
    on_flat = _cruising_only(Error.AZIMUTH_MISALIGNMENT, FLAT)
    on_round = _cruising_only(Error.AZIMUTH_MISALIGNMENT, ROUND)
    return [
        Number("(a) flat", "cross-range error by azimuth", "ft", "4,660", "range Δθ", flat, *on_flat),
        Number("summary, flat", "cross-range error by azimuth", "ft", "4,660", "range Δθ", flat, *on_flat),
        Number("(a) spherical", "angle flown", "rad", "1.28", "range / R", angle),
        Number("(a) spherical", "angle flown", "deg", "73.3", "range / R", angle / DEGREE,
               remark="1.28 rad, rounded, is 73.3 deg"),
        Number("(a) spherical", "its sine", "1", "0.957", "sin φ", float(np.sin(angle))),
        Number("(a) spherical", "cross-range error by azimuth", "miles", "0.662", "R sin φ Δθ", curved / MILE,
               None, None, (on_round[2] or 0.0) * FOOT / MILE),
        Number("(a) spherical", "cross-range error by azimuth", "ft", "3,500", "R sin φ Δθ", curved / FOOT,
               *on_round),
        Number("summary, spherical", "cross-range error by azimuth", "ft", "3,500", "R sin φ Δθ", curved / FOOT,
               *on_round),
    ]  # fmt: skip


def velocity_numbers() -> list[Number]:
    """List the numbers of error (b), the launch velocity."""
    flat, most = schuler.velocity_flat(VELOCITY, TIME) / FOOT, VELOCITY * PERIOD / (2.0 * np.pi) / FOOT
    on_flat = _runs(Error.RANGE_RATE, TIME, FOOT, FLAT)
    quarter = _runs(Error.RANGE_RATE, QUARTER, FOOT)
    end = schuler.velocity_spherical(VELOCITY, 2.0 * np.pi / PERIOD, TIME) / FOOT
    return [
        Number("(b) flat", "range error", "ft", "10,120", "ΔV t", flat, *on_flat),
        Number("(b) flat", "cross-range error", "ft", "10,120", "ΔV t", flat,
               *_runs(Error.CROSS_RANGE_RATE, TIME, FOOT, FLAT, CROSS)),
        Number("summary, flat", "range error by launch velocity", "ft", "10,120", "ΔV t", flat, *on_flat),
        Number("(b) spherical", "largest range error", "ft", "805", "ΔV / ω", most, *quarter),
        Number("(b) spherical", "range error at 10,120 s", "ft", "0", "(ΔV / ω) sin ωt", end,
               *_runs(Error.RANGE_RATE, TIME, FOOT)),
        Number("summary, spherical", "largest range error by launch velocity", "ft", "805", "ΔV / ω", most, *quarter,
               remark="the number is right; the formula beside it, ΔV sin ωt, lacks the factor 1 / ω"),
    ]  # fmt: skip


def bias_numbers() -> list[Number]:
    """List the numbers of error (c), the accelerometers."""
    flat, most = schuler.bias_flat(RATIO * GRAVITY, TIME) / FOOT, 2.0 * RATIO * RADIUS
    whole = RATIO * GRAVITY * TIME**2 / FOOT
    on_flat, half = _runs(Error.BIAS_X, TIME, FOOT, FLAT), _runs(Error.BIAS_X, HALF, FOOT)
    cause = (
        f"the factor 1/2 is missing: k g t² is {whole:,.0f} ft; the printed number is 3 % larger than that, "
        "which nothing in the text explains"
    )
    rounded = "0.792 miles are 4,182 ft; 0.79 miles are 4,171"
    end = schuler.bias_spherical(RATIO * GRAVITY, 2.0 * np.pi / PERIOD, TIME) / FOOT
    return [
        Number("(c) flat", "range error", "ft", "341,000", "k g t² / 2", flat, *on_flat, remark=cause, wrong=True),
        Number("summary, flat", "range error by accelerometer", "ft", "341,000", "k g t² / 2", flat, *on_flat,
               remark=cause, wrong=True),
        Number("(c) spherical", "largest range error", "miles", "0.792", "2 k R", most / MILE,
               *_runs(Error.BIAS_X, HALF, MILE)),
        Number("(c) spherical", "largest range error", "ft", "4,170", "2 k R", most / FOOT, *half, remark=rounded),
        Number("(c) spherical", "range error at 10,120 s", "ft", "0", "k R (1 − cos ωt)", end,
               *_runs(Error.BIAS_X, TIME, FOOT)),
        Number("summary, spherical", "largest range error by accelerometer", "ft", "4,170", "2 k R", most / FOOT, *half,
               remark=rounded),
    ]  # fmt: skip


def drift_numbers() -> list[Number]:
    """List the numbers of error (d), the gyros."""
    flat = schuler.drift_flat(DRIFT, GRAVITY, TIME) / FOOT
    end = schuler.drift_spherical(DRIFT, RADIUS, 2.0 * np.pi / PERIOD, TIME)
    on_flat, on_round = _runs(Error.GYRO_DRIFT, TIME, FOOT, FLAT), _runs(Error.GYRO_DRIFT, TIME, FOOT)
    cause = f"the factor 1/6 is missing: ε g t³ is {6.0 * flat:,.0f} ft"
    return [
        Number("(d) flat", "range error", "ft", "1.62e6", "ε g t³ / 6", flat, *on_flat, remark=cause, wrong=True),
        Number("(d) flat", "cross-range error", "ft", "1.62e6", "ε g t³ / 6", flat,
               *_runs(Error.ROLL_DRIFT, TIME, FOOT, FLAT, CROSS), remark=cause, wrong=True),
        Number("summary, flat", "range error by gyro drift", "ft", "1.62e6", "ε g t³ / 6", flat, *on_flat,
               remark=cause, wrong=True),
        Number("(d) spherical", "range error", "miles", "1.94", "R ε t", end / MILE,
               *_runs(Error.GYRO_DRIFT, TIME, MILE)),
        Number("(d) spherical", "range error", "ft", "10,250", "R ε t", end / FOOT, *on_round),
        Number("summary, spherical", "range error by gyro drift", "ft", "10,250", "R ε t", end / FOOT, *on_round),
        Number("(d) spherical", "reduction by the pendulum", "1", "100", "flat / spherical", flat * FOOT / end,
               remark="“more than 100” is 1.62·10⁶ / 10,250, and follows from the missing 1/6; it is 26", wrong=True),
        Number("(d) spherical", "largest platform angle", "deg", "0.028", "ε t", DRIFT * TIME / DEGREE),
        Number("(d) spherical", "largest platform angle", "arcmin", "1.68", "ε t", 60.0 * DRIFT * TIME / DEGREE,
               remark="0.028 deg, rounded, are 1.68 minutes of arc"),
    ]  # fmt: skip


def story_numbers() -> list[Number]:
    """Those of the briefing and its footnotes."""
    exact = Earth.with_gravity(RADIUS, GRAVITY)
    period = schuler.schuler_period(RADIUS, GRAVITY)
    still, moving = (measured_period(replace(each(1.0), earth=exact)) / MINUTE for each in (at_rest, cruising))
    climb = climb_periods(exact, 9.0 * GRAVITY, np.array([0.25]))[0] / MINUTE
    by_drift = 4000.0 * DRIFT * 1.4 * HOUR
    return [
        Number("briefing", "largest error for 1e-4 g", "miles", "0.8", "2 k R, R = 4000 miles", 2.0 * RATIO * 4000.0),
        Number("briefing", "largest error for 1e-4 g", "ft", "4000", "2 k R, R = 4000 miles",
               2.0 * RATIO * 4000.0 * 5280.0),
        Number("briefing", "drift of wartime gyros", "deg/h", "12", "3 deg in 15 min", 3.0 / 0.25),
        Number("briefing", "error for 0.01 deg/h after 84 min", "miles", "1", "R ε t, R = 4000 miles", by_drift),
        Number("briefing", "period of the pendulum", "min", "84.4", "2π √(R / g)", period / MINUTE, None, still,
               moving, remark="at half a mile per second it is longer by V² / (2 g r)"),
        Number("Problem 2", "period of the pendulum", "s", "5060", "2π √(R / g)", period, None, still * MINUTE,
               moving * MINUTE, remark="84.4 min are 5,064 s; the document rounds them to 5,060"),
        Number("Problem 3", "flying time", "s", "10,120", "2 T", 2.0 * period, remark="twice 5,060 s"),
        Number("Problem 3", "speed", "miles/s", "0.5", "distance / time", SPEED / MILE),
        Number("footnote a", "period of a climb at 9 g", "min", "28", "T / √9",
               schuler.schuler_period(RADIUS, 9.0 * GRAVITY) / MINUTE, None, climb,
               remark="simulated: the period at the start of the climb; it increases as the vehicle rises"),
    ]  # fmt: skip


def hover_numbers() -> list[Number]:
    """List the numbers of Problem 4."""
    rate = 2.0 * np.pi / PERIOD
    bias = RATIO * ROUND.gravitational_parameter / RADIUS**2
    closed = schuler.hover(bias, rate, PERIOD) / MILE
    by_linear = -linearize(hovering(PERIOD), np.array([PERIOD]))[0, HEIGHT, Error.BIAS_Z] * bias / MILE
    nonlinear = simulated(hovering(PERIOD), Error.BIAS_Z, HEIGHT, -bias) / MILE
    sinh = 0.5 * RATIO * 3960.0 * np.sinh(np.sqrt(2.0) * 2.0 * np.pi)
    remark = (
        f"the printed solution has sinh instead of cosh − 1, so that it does not start at rest. This alone gives "
        f"{sinh:.1f}; R = 4,000 miles, as in the briefing, gives {sinh * 4000.0 / 3960.0:.0f}. The equation above "
        "has −k g₀, but the text says that the vehicle accelerates upwards. In the simulation gravity decreases with "
        "the square of the radius, so that the vehicle rises less"
    )
    return [
        Number("Problem 4", "loss of gravity at a height of 2 miles, 1 part in", "1", "1000", "R / 2 h",
               4000.0 / 4.0),
        Number("Problem 4", "height after 84 min with 1e-4 g", "miles", "724", "(k R / 2) (cosh(√2 ωt) − 1)",
               closed, by_linear, nonlinear, remark=remark, wrong=True),
    ]  # fmt: skip


@lru_cache
def all_numbers() -> tuple[Number, ...]:
    """List all numbers in the order of the document."""
    parts: tuple[Callable[[], list[Number]], ...] = (
        story_numbers, tilt_numbers, azimuth_numbers, velocity_numbers, bias_numbers, drift_numbers, hover_numbers,
    )  # fmt: skip
    return tuple(number for part in parts for number in part())
