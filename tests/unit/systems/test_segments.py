"""Flights of segments: each does what it says, on the ellipsoid, and without jumps of the force."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84, Earth, local_axes
from mcnav.systems.ins.truth.rows import TrajectoryRows, check_rows
from mcnav.systems.ins.truth.segments import (
    Climb,
    Hold,
    Segment,
    SegmentError,
    SpeedChange,
    Start,
    Straight,
    Turn,
    WayPoint,
    _great_circle,
    fly_segments,
)  # fmt: skip

SPHERE = Earth(6_371_000.0, 0.0, 3.986e14, 0.0)
DEG = np.pi / 180.0
CRUISE = Start(47.0 * DEG, 9.0 * DEG, 3_000.0, 80.0 * DEG, 150.0)
RATE = 10.0
EXACT = 1e-9
"""Relative error of the integration: (0.1 s / 5 s)^4 / 120 of a fast blend."""


def fly(*segments: Segment, start: Start = CRUISE, earth: Earth = WGS84, rate: float = RATE) -> TrajectoryRows:
    return fly_segments(start, segments, rate, earth)


def speeds(rows: TrajectoryRows) -> np.ndarray:
    assert rows.velocity is not None
    return np.linalg.norm(rows.velocity, axis=1)


def test_rest_is_at_rest_exactly() -> None:
    rows = fly(Hold(10.0), start=Start(0.8, 0.1, 500.0, 1.0))
    assert np.ptp(rows.latitude) == np.ptp(rows.longitude) == np.ptp(rows.altitude) == np.ptp(speeds(rows)) == 0.0
    assert rows.time[-1] == 10.0
    assert len(rows) == 101


def test_speed_changes_within_its_acceleration() -> None:
    rows = fly(SpeedChange(90.0, 2.0), start=Start(0.8, 0.1, 500.0, 1.0))
    assert speeds(rows)[-1] == pytest.approx(90.0, rel=EXACT)
    largest = np.max(np.diff(speeds(rows)) / np.diff(rows.time))
    # a chord of a tenth of a second is flatter than the steepest slope by the square of its share of the blend
    assert 2.0 * (1.0 - 1e-3) < largest <= 2.0


@pytest.mark.parametrize("height", [2_000.0, -1_500.0, 20.0])
def test_climbs_reach_their_height_within_their_acceleration(height: float) -> None:
    rows = fly(Climb(height, 6.0 * DEG, 3.0))
    # where pieces meet, the third derivative of the climb angle jumps by 60 gamma / T^3, here with T > 3 s
    assert rows.altitude[-1] - rows.altitude[0] == pytest.approx(height, abs=150.0 * 60.0 * 0.1 / 27.0 * 0.1**4 / 24.0)
    np.testing.assert_allclose(speeds(rows), 150.0, rtol=1e-14)
    assert np.max(np.abs(rows.angles[:, 1])) <= 6.0 * DEG * (1.0 + 1e-12)
    assert (np.max(np.abs(rows.angles[:, 1])) < 5.9 * DEG) == (abs(height) < 100.0)
    assert np.max(np.abs(np.diff(rows.angles[:, 1]))) * RATE * 150.0 <= 3.0
    assert rows.angles[-1, 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("angle", [90.0, -270.0, 1.0])
def test_turns_end_on_course(angle: float) -> None:
    """On a sphere of a million kilometres a geodesic keeps its course to 1e-5 rad while the turn lasts."""
    plain = Earth(1e9, 0.0, STANDARD_GRAVITY * 1e18, 0.0)
    rows = fly(Turn(angle * DEG, bank=25.0 * DEG), earth=plain)
    length = 150.0 * rows.time[-1]
    assert rows.angles[-1, 0] - rows.angles[0, 0] == pytest.approx(angle * DEG, abs=2.0 * length / 1e9)
    roll = np.abs(rows.angles[:, 2])
    assert np.max(roll) <= 25.0 * DEG * (1.0 + 1e-12)
    assert (np.max(roll) > 24.9 * DEG) == (abs(angle) > 45.0)
    assert np.max(np.diff(roll)) * RATE <= 5.0 * DEG
    assert np.sign(rows.angles[len(rows) // 2, 2]) == np.sign(angle)


def test_a_coordinated_turn_feels_no_lateral_force() -> None:
    """Without rotation only the curvature of the path over the sphere remains: V^2 tan(latitude) / R."""
    rows = fly(Turn(np.pi, rate=3.0 * DEG), earth=SPHERE)
    truth = rows.truth(SPHERE)
    middle = slice(len(rows) // 4, -len(rows) // 4)
    found = truth.states(rows.time[middle], "strapdown", 0.0)
    bank = rows.angles[len(rows) // 2, 2]
    gravity = 3.986e14 / (6_371_000.0 + 3_000.0) ** 2
    assert np.tan(bank) == pytest.approx(150.0 * 3.0 * DEG / gravity, rel=1e-12)
    curvature = 150.0**2 / 6_371_000.0 * (1.0 + np.tan(48.0 * DEG))
    assert np.max(np.abs(found.force[:, 1])) < curvature
    assert np.linalg.norm(found.force, axis=1) == pytest.approx(gravity / np.cos(bank), abs=curvature)
    # the yaw rate of the course on the body's down axis, and its part on the right axis
    np.testing.assert_allclose(found.rate[:, 2], 3.0 * DEG * np.cos(bank), rtol=0.0, atol=150.0 / 6_371_000.0)


def test_straight_is_a_great_circle_on_a_sphere() -> None:
    distance = 800e3
    rows = fly(Straight(distance), earth=SPHERE, rate=1.0)
    ends = SPHERE.from_geodetic(*(each[[0, -1]] for each in (rows.latitude, rows.longitude, rows.altitude)))
    unit = ends / np.linalg.norm(ends, axis=1)[:, None]
    assert np.arccos(unit[0] @ unit[1]) == pytest.approx(distance / (6_371_000.0 + 3_000.0), rel=EXACT)
    first, last = (SPHERE.from_geodetic(rows.latitude[k], rows.longitude[k], rows.altitude[k]) for k in (0, 1))
    normal = np.cross(first, last) / np.linalg.norm(np.cross(first, last))
    positions = SPHERE.from_geodetic(rows.latitude, rows.longitude, rows.altitude)
    # two rows 150 m apart, right to 1e-9 m of rounding, give the plane to 1e-11 rad
    assert np.max(np.abs(positions @ normal)) < 6.4e6 * 1e-9 / 150.0 * 10.0


@pytest.mark.parametrize("place", [(30.0, -40.0), (-20.0, 130.0), (47.0, 9.5)])
def test_bearing_and_distance_by_vectors(place: tuple[float, float]) -> None:
    """The search for a way point starts from them, and would find it from others as well."""
    latitude, longitude = np.radians(place)
    level = local_axes(CRUISE.latitude, CRUISE.longitude)  # columns north, east, down
    there = -local_axes(latitude, longitude)[:, 2]
    north, east, up = level[:, 0] @ there, level[:, 1] @ there, -level[:, 2] @ there
    expected = np.arctan2(east, north), 2.0 * np.arctan2(np.hypot(north, east), 1.0 + up)
    assert _great_circle(CRUISE, latitude, longitude, 1.0) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    ("start", "place", "rate"),
    [
        (CRUISE, (48.0, 11.0), 2.0), (CRUISE, (46.0, 5.0), 2.0), (CRUISE, (30.0, -40.0), 2.0),
        (CRUISE, (47.3, 8.9), 2.0), (CRUISE, (-20.0, 130.0), 0.1),
        (Start(0.0, 0.1, 3_000.0, 1.5, 150.0), (0.0, 9.0), 2.0),
    ],
)  # fmt: skip
def test_way_points_are_met(start: Start, place: tuple[float, float], rate: float) -> None:
    """Near and far, one beyond a quarter of the earth, one along the equator; by the shorter turn."""
    latitude, longitude = np.radians(place)
    rows = fly(WayPoint(latitude, longitude), start=start, rate=rate)
    target = WGS84.from_geodetic(latitude, longitude, CRUISE.altitude)
    end = WGS84.from_geodetic(rows.latitude[-1], rows.longitude[-1], rows.altitude[-1])
    # aimed to 1 mm; steps of 0.1 s in blends of 7.5 s leave (0.1 / 7.5)^4 / 120 of the course, and that of the way
    assert np.linalg.norm(end - target) < 1e-3 + (0.1 / 7.5) ** 4 / 120.0 * 5e6
    assert np.ptp(np.unwrap(rows.angles[:, 0])) < 1.5 * np.pi  # half a turn, and what the way to (30, -40) adds


def test_velocities_are_the_derivative_and_the_force_has_no_jumps() -> None:
    segments = [Hold(20.0), SpeedChange(80.0, 2.0), Climb(1_000.0), SpeedChange(150.0), Turn(90.0 * DEG), Straight(5e3)]
    rows = fly(*segments, start=Start(0.82, 0.16, 500.0, 1.4))
    check_rows(rows, WGS84)
    truth = rows.truth(WGS84)
    found = rows.disagreement(truth)
    assert found is not None
    # a tenth of a second: h^3 / 24 of a jerk that changes by 2 m/s^3 in seconds, ten times as much at the ends
    assert found.largest < 10.0 * 0.1**3 / 24.0 * 2.0
    force = truth.states(rows.time, "level", 0.0).force
    # the jerk is at most 5.8 a / T of blends with a = 2 m/s^2 and T >= 5 s, and here that of the bank, g phi' sec^2
    assert np.max(np.abs(np.diff(force, axis=0))) * RATE < STANDARD_GRAVITY * 5.0 * DEG / np.cos(20.0 * DEG) ** 2 + 2.4


@pytest.mark.parametrize("segment", [Straight(1e3), Climb(100.0), Turn(1.0), WayPoint(0.9, 0.2)])
def test_what_stands_still_cannot_fly(segment: Segment) -> None:
    with pytest.raises(SegmentError, match="stands still") as found:
        fly(Hold(10.0), segment, start=Start(0.8, 0.1))
    assert found.value.number == 2


def test_a_way_point_within_the_turn_cannot_be_met() -> None:
    abeam = WayPoint(CRUISE.latitude - 500.0 / 6.37e6, CRUISE.longitude)
    with pytest.raises(SegmentError, match="too near"):
        fly(abeam)
    with pytest.raises(SegmentError, match="too near"):
        fly(WayPoint(CRUISE.latitude, CRUISE.longitude))


def test_flights_have_limits() -> None:
    with pytest.raises(SegmentError, match="longer than 10 days"):
        fly(Hold(6e5), Hold(6e5))
    with pytest.raises(SegmentError, match="rows; expected from 4"):
        fly(Hold(0.1))
    with pytest.raises(SegmentError, match="rows; expected from 4"):
        fly(Hold(8e5))
