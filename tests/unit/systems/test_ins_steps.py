"""Steps of the navigator: intervals in which the truth is smooth, the readings they hold, and where they end."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.quadrature import intervals_of
from mcnav.systems.ins.reference.collocation import STATE, WENT_ON, advance
from mcnav.systems.ins.reference.normal_field import field_constants
from tests.flights import rest


def test_intervals_are_as_few_as_their_length_allows() -> None:
    """Rows of the truth, each 900 s, and all times are boundaries."""
    times, longest = np.array([10.0, 100.3, 2000.0]), 7.0
    bounds = intervals_of(rest(), times, longest)
    knots = np.array([10.0, 100.3, 900.0, 1800.0, 2000.0])
    assert set(knots) <= set(bounds)
    assert len(bounds) - 1 == np.sum(np.ceil(np.diff(knots) / longest))
    assert 0.0 < np.min(np.diff(bounds)) <= np.max(np.diff(bounds)) <= longest


def test_intervals_that_divide_a_gap_do_not_split_for_rounding() -> None:
    assert len(intervals_of(rest(), np.array([0.0, 0.3]), 0.1)) == 4


def test_the_shortest_reading_is_of_instruments_that_have_quantization() -> None:
    assert Imu().shortest_reading == np.inf
    one = Noise(quantization=np.array([0.0, 1e-6, 0.0]), quantization_interval=np.array([0.01, 0.04, 0.02]))
    assert Imu(gyro=one).shortest_reading == Imu(accelerometer=one).shortest_reading == 0.04


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_navigation_ends_below_the_lowest_distance_from_the_center(axis: int, sign: float) -> None:
    """A step of a microsecond at 1 km/s upwards rises 1 mm, of which falling takes 5e-12 m."""
    distance = 0.9 * WGS84.radius
    state = np.zeros(STATE)
    state[0], state[4 + axis], state[7 + axis] = 1.0, sign * 1e3, sign * distance
    reached = []
    for lowest in (distance + 0.5e-3, distance + 1.5e-3):
        outcome, _ = advance(
            field_constants(WGS84), WGS84.rotation_rate, lowest, np.array([1e-6]), np.zeros((1, 3, 6)), state,
            np.empty((1, STATE)),
        )  # fmt: skip
        reached.append(outcome == WENT_ON)
    assert reached == [True, False]
