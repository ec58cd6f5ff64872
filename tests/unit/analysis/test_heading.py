"""Heading against the track over the ground: crabs, zeros, hovering, noise, vertical attitudes, the date line."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.heading import compare_with_track, heading_remark
from mcnav.arrays.types import Array
from mcnav.contract.history import History

TIMES = np.linspace(0.0, 600.0, 401)
CIRCLE = 2.0 * np.pi * TIMES / 120.0
"""Course of a vehicle that flies circles of two minutes, rad."""


def history(
    course: Array, heading: Array, speed: float = 100.0, longitude: float = 9.0, pitch: float = 2.0,
    roll: Array | float = 0.0,
) -> History:  # fmt: skip
    """Return a flight at 47 degrees north with a course and a heading, rad; on a sphere, by the trapezoidal rule."""
    step = np.diff(TIMES, prepend=0.0) * speed / 6.371e6
    north, east = np.cumsum(step * np.cos(course)), np.cumsum(step * np.sin(course))
    latitude = 47.0 + np.degrees(north)
    around = longitude + np.degrees(east) / np.cos(np.radians(47.0))
    return History({
        "time [s]": TIMES, "latitude [deg]": latitude, "longitude [deg]": (around + 180.0) % 360.0 - 180.0,
        "heading [deg]": np.degrees(heading), "pitch [deg]": np.full(len(TIMES), pitch),
        "roll [deg]": np.broadcast_to(roll, len(TIMES)),
    })  # fmt: skip


@pytest.mark.parametrize("crab", [0.0, 20.0, -30.0])
@pytest.mark.parametrize("longitude", [9.0, 179.99])
def test_a_crab_angle_is_no_remark(crab: float, longitude: float) -> None:
    found = history(CIRCLE, CIRCLE + np.radians(crab), longitude=longitude)
    assert heading_remark(found) == ""


def test_zeros_on_circles_are_off_the_track_for_three_quarters_of_the_time() -> None:
    found = compare_with_track(history(CIRCLE, np.zeros_like(CIRCLE)))
    assert found is not None
    # 270 of 360 degrees are more than 45 degrees from north; a step is 1.4 degrees of two minutes' circle
    assert found.apart == pytest.approx(0.75, abs=0.02)
    assert "is more than 45° off the track over the ground for 75 % of the motion" in heading_remark(
        history(CIRCLE, np.zeros_like(CIRCLE))
    )


def test_a_heading_that_does_not_turn_with_the_track() -> None:
    """From north to 80 degrees: the angle is below 45 degrees for more than half of the time."""
    course = np.radians(80.0) * TIMES / TIMES[-1]
    assert "does not turn, while the track over the ground turns by 80°" in heading_remark(
        history(course, np.full_like(course, np.radians(40.0)))
    )


def test_where_there_is_no_track_or_no_level_attitude_there_is_no_remark() -> None:
    none = np.zeros_like(CIRCLE)
    noise = np.random.default_rng(1).uniform(-np.pi, np.pi, len(TIMES))
    assert compare_with_track(history(none, none, speed=0.0)) is None
    assert compare_with_track(history(noise, none, speed=0.05)) is None  # a receiver at rest, with noise of centimetres
    assert compare_with_track(history(none, none + 2.0, pitch=85.0)) is None
    assert compare_with_track(History()) is None


@pytest.mark.parametrize("turns", [0.0, 360.0])
def test_a_lander_that_brakes_does_not_fly_along_its_axis(turns: float) -> None:
    """Rolled from 90 degrees to zero, beyond 60 for most of the time, with its axis across the motion."""
    none, east = np.zeros_like(CIRCLE), np.full_like(CIRCLE, 0.5 * np.pi)
    tilted = turns - 90.0 * (1.0 - (TIMES / TIMES[-1]) ** 3)
    assert heading_remark(history(east, none, roll=tilted)) == ""
    assert heading_remark(history(east, none, roll=turns + 0.5 * (tilted - turns))) != ""  # a bank of 45 degrees
