"""NASA TN D-1772, Table I, p. 24."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE
from mcnav.systems.reentry.table_i import (
    START_AIRSPEED,
    START_ANGLES,
    TABLE_I,
    common_start,
    range_from_reentry,
    start_at_angle,
    start_state,
)
from mcnav.systems.reentry.truth import NoReentry, airspeed_and_angle, fly_truth
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.validation.reproduce.tn_d1772.printed import trajectories
from tests.conftest import TRAJECTORIES, reentry

SOLVED_FOR_RANGE = (4, 6)
FROM_PRINTED_START = tuple(number for number in TRAJECTORIES if number not in SOLVED_FOR_RANGE)

PRINTED_START_TIME = 63.51
"""Minutes from the start to reentry, eq. (18)."""

HALF_A_DIGIT = (5.0, 5.0 / EARTH_RADIUS, 5e-3, 5e-5 / EARTH_RADIUS)
"""Half a unit of the last digit with which eq. (18) prints altitude, range and their rates."""


def _range_and_minutes(number: int, start: np.ndarray, final_altitude: float) -> np.ndarray:
    flown = fly_truth(start, Vehicle(TABLE_I[number].lift_law), final_altitude)
    return np.array([range_from_reentry(flown), (flown.final_time - flown.reentry_time) / 60.0])


@pytest.mark.parametrize("number", FROM_PRINTED_START)
def test_final_range_and_time(number: int) -> None:
    """They agree as far as the printed digits of start point, final altitude and results let them.

    The report starts from more digits than eq. (18) prints, and a skip magnifies what was left off: 5 m of start
    altitude are 20 km of range on trajectory 5.
    """
    row = TABLE_I[number]
    computed = _range_and_minutes(number, common_start(), row.final_altitude)
    left_off = np.abs(_range_and_minutes(number, common_start(), row.final_altitude + 5.0) - computed)
    for component, half in enumerate(HALF_A_DIGIT):
        start = common_start()
        start[component] += half
        left_off += np.abs(_range_and_minutes(number, start, row.final_altitude) - computed)
    printed = trajectories()[number]
    expected = [float(printed["final_range_km"]) * 1e3, float(printed["final_time_after_reentry_min"])]
    assert np.all(np.abs(computed - expected) <= left_off + np.array([5e3, 0.005]))


@pytest.mark.parametrize("number", SOLVED_FOR_RANGE)
def test_trajectories_solved_for_their_range(number: int) -> None:
    """They meet it to 0.1 m (a root to 1e-13 deg, at 1e12 m/rad), and then the printed time as digits let them.

    Half a digit of the start's altitude and speed and of the final altitude each change the time, while the start angle
    takes up what they do to the range; and the range itself is printed to 10 km. The instant of reentry, from which
    the report counts, is itself off by what its start time of 63.51 min differs from ours (errata, item 13).
    """
    row, printed = TABLE_I[number], trajectories()[number]
    start = reentry(number).trajectory.state(0.0)
    computed = _range_and_minutes(number, start, row.final_altitude)
    assert computed[0] == pytest.approx(float(printed["final_range_km"]) * 1e3, abs=0.1)

    def change(speed: float = 0.0, angle: float = 0.0, altitude: float = 0.0, final: float = 0.0) -> np.ndarray:
        airspeed, flight_path = airspeed_and_angle(start)
        moved = start + np.array([altitude, 0.0, 0.0, 0.0])
        moved[2] = (airspeed + speed) * np.sin(flight_path + angle)
        moved[3] = EARTH_RATE + (airspeed + speed) * np.cos(flight_path + angle) / moved[0]
        return _range_and_minutes(number, moved, row.final_altitude + final) - computed

    step = 1e-9
    by_angle = change(angle=step) / step
    left_off = 0.005 + abs(by_angle[1] / by_angle[0]) * 5e3
    for effect in (change(speed=5e-3 / 50) * 50, change(altitude=5.0 / 50) * 50, change(final=5.0)):
        left_off += abs(effect[1] - by_angle[1] / by_angle[0] * effect[0])
    left_off += abs(PRINTED_START_TIME - reentry(number).trajectory.reentry_time / 60.0)
    assert computed[1] == pytest.approx(float(printed["final_time_after_reentry_min"]), abs=left_off)


@pytest.mark.parametrize(("number", "angle"), [(4, -77.4070), (6, -77.4067)])
def test_solved_start_angle(number: int, angle: float) -> None:
    """Errata, item 11: the start angles that give the printed ranges, to the last digit given there."""
    speed, found = airspeed_and_angle(reentry(number).trajectory.state(0.0))
    assert speed == pytest.approx(START_AIRSPEED, abs=1e-9)
    assert np.degrees(found) == pytest.approx(angle, abs=5e-5)


def solved_start_angle(number: int) -> float:
    """Solve for the start angle (deg) with which a trajectory has its printed final range, to 1e-13 deg."""
    row = TABLE_I[number]
    assert row.final_range is not None
    assert row.printed_angle is not None
    vehicle, printed_range = Vehicle(row.lift_law), row.final_range

    def overshoot(angle: float) -> float:
        try:
            truth = fly_truth(start_at_angle(np.radians(angle)), vehicle, row.final_altitude)
            return range_from_reentry(truth) - printed_range
        except NoReentry:  # skipped out of the atmosphere: farther than any range
            return 2.0 * np.pi * EARTH_RADIUS

    return float(brentq(overshoot, row.printed_angle - 0.002, row.printed_angle + 0.002, xtol=1e-13))


@pytest.mark.parametrize("number", TRAJECTORIES)
def test_stored_start_angles_are_those_solved_for(number: int) -> None:
    expected = common_start()
    if number in SOLVED_FOR_RANGE:
        assert solved_start_angle(number) == pytest.approx(START_ANGLES[number], abs=4e-13, rel=0.0)
        expected = start_at_angle(np.radians(START_ANGLES[number]))
    assert start_state(number) == tuple(expected)


def test_start_speed_and_angle() -> None:
    """Eq. (19), printed to 1e-5 km/s and 1e-4 deg."""
    speed, angle = airspeed_and_angle(common_start())
    assert speed == pytest.approx(4799.92, abs=0.005)
    assert np.degrees(angle) == pytest.approx(-77.4414, abs=5e-5)


@pytest.mark.parametrize("number", FROM_PRINTED_START)
def test_reentry_speed_and_angle(number: int) -> None:
    """The printed speed, and the angle that errata, item 13, computes in place of the printed -6.4795 deg."""
    trajectory = reentry(number).trajectory
    speed, angle = airspeed_and_angle(trajectory.state(trajectory.reentry_time))
    assert speed == pytest.approx(10_514.36, abs=0.05)
    assert np.degrees(angle) == pytest.approx(-6.493, abs=5e-4)
    assert trajectory.reentry_time / 60.0 == pytest.approx(63.30, abs=0.005)
