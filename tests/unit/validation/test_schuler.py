"""The closed forms of The Story of 84 Minutes: their equations, their flat limits, and the climb."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.systems.steady.truth import Earth
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from mcnav.validation.reproduce.story_of_84_minutes.climb import climb_periods

RADIUS, GRAVITY = 6.4e6, 9.8
RATE = schuler.schuler_rate(RADIUS, GRAVITY)
TIMES = np.linspace(0.0, 2.0 * schuler.schuler_period(RADIUS, GRAVITY), 4001)
STEP = TIMES[1] - TIMES[0]

SPHERICAL = {
    "tilt": (lambda t: schuler.tilt_spherical(2e-4, RADIUS, RATE, t), lambda t: GRAVITY * 2e-4 + 0.0 * t, 0.0),
    "velocity": (lambda t: schuler.velocity_spherical(0.3, RATE, t), lambda t: 0.0 * t, 0.3),
    "bias": (lambda t: schuler.bias_spherical(1e-3, RATE, t), lambda t: 1e-3 + 0.0 * t, 0.0),
    "drift": (lambda t: schuler.drift_spherical(5e-8, RADIUS, RATE, t), lambda t: GRAVITY * 5e-8 * t, 0.0),
}
"""Each with the right-hand side of its equation x'' + w^2 x = f and its initial velocity."""


@pytest.mark.parametrize("name", SPHERICAL)
def test_the_pendulums_equation(name: str) -> None:
    """Second differences have an error of (w h)^2 / 12 of the second derivative."""
    form, force, velocity = SPHERICAL[name]
    x = form(TIMES)
    second = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / STEP**2
    wanted = force(TIMES[1:-1]) - RATE**2 * x[1:-1]
    scale = np.abs(second).max()
    assert np.abs(second - wanted).max() < (RATE * STEP) ** 2 / 12.0 * scale + 1e-15 * np.abs(x).max() / STEP**2 * 4
    assert x[0] == 0.0
    assert (x[1] - x[0]) / STEP == pytest.approx(velocity, abs=RATE * STEP * np.abs(x).max() * RATE)


@pytest.mark.parametrize(
    ("flat", "spherical"),
    [
        (lambda t: schuler.tilt_flat(2e-4, GRAVITY, t), SPHERICAL["tilt"][0]),
        (lambda t: schuler.velocity_flat(0.3, t), SPHERICAL["velocity"][0]),
        (lambda t: schuler.bias_flat(1e-3, t), SPHERICAL["bias"][0]),
        (lambda t: schuler.drift_flat(5e-8, GRAVITY, t), SPHERICAL["drift"][0]),
    ],
)
def test_for_short_times_the_earth_is_flat(flat: Callable[[float], float], spherical: Callable[[float], float]) -> None:
    """To (w t)^2 / 6, the largest of the next terms' shares."""
    time = 60.0
    assert spherical(time) == pytest.approx(flat(time), rel=(RATE * time) ** 2 / 6.0)


def test_azimuth() -> None:
    assert schuler.azimuth_spherical(1e-3, RADIUS, 1e3) == pytest.approx(schuler.azimuth_flat(1e-3, 1e3), rel=1e-8)
    quarter = 0.5 * np.pi * RADIUS
    assert schuler.azimuth_spherical(1e-3, RADIUS, quarter) == pytest.approx(RADIUS * 1e-3)


def test_hovering_starts_at_rest_and_diverges() -> None:
    """z'' - 2 w^2 z = a: z = a t^2 / 2 at first, times e^(sqrt(2) w t) at last."""
    assert schuler.hover(1e-3, RATE, 1.0) == pytest.approx(0.5e-3, rel=RATE**2)
    long = 20.0 / RATE
    grown = schuler.hover(1e-3, RATE, long + 1.0 / RATE) / schuler.hover(1e-3, RATE, long)
    assert grown == pytest.approx(np.exp(np.sqrt(2.0)), rel=1e-10)


def test_a_climb_with_nine_times_gravity_begins_with_a_third_of_the_period() -> None:
    """28 minutes (footnote a). The radius has grown by 4 g t^2 / R when it is measured, a quarter of a second late."""
    earth = Earth.with_gravity(RADIUS, GRAVITY)
    (period,) = climb_periods(earth, 9.0 * GRAVITY, np.array([0.25]))
    assert period == pytest.approx(schuler.schuler_period(RADIUS, GRAVITY) / 3.0, rel=1e-5)
    assert round(period / 60.0) == 28


def test_a_weightless_hover_keeps_its_period() -> None:
    """Thrust equal to weight: the vehicle stands, and the pendulum is Schuler's own."""
    earth = Earth.with_gravity(RADIUS, GRAVITY)
    periods = climb_periods(earth, GRAVITY, np.array([10.0, 500.0]))
    np.testing.assert_allclose(periods, schuler.schuler_period(RADIUS, GRAVITY), rtol=1e-5)
