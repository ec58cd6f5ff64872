"""A reentry of NASA TN D-1772 on a globe: the planar motion, turned and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, GRAVITATIONAL_PARAMETER, STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.truth.reentry import Plane, reentry_truth
from mcnav.systems.ins.truth.rows import check_rows, rows_from
from mcnav.systems.reentry.table_i import TABLE_I, start_state
from mcnav.systems.reentry.truth import Trajectory, fly_truth
from mcnav.systems.reentry.vehicle import Vehicle

SPHERE = Earth(EARTH_RADIUS, 0.0, GRAVITATIONAL_PARAMETER, 0.0)
EAST = Plane.at(0.0, 0.0, np.pi / 2.0)
INTEGRATED = 1e-4
"""Error of the integrated positions between the integrator's steps, m; the largest of its own is 4e-5."""


def planar(number: int) -> Trajectory:
    row = TABLE_I[number]
    return fly_truth(np.array(start_state(number)), Vehicle(row.lift_law), row.final_altitude)


def between_rows(trajectory: Trajectory) -> Array:
    return np.linspace(0.0, trajectory.final_time, 4_001)[:-1]


@pytest.mark.parametrize("number", [1, 4, 7])
def test_on_the_equator_of_its_own_sphere_the_motion_is_the_planar_one(number: int) -> None:
    trajectory = planar(number)
    truth = reentry_truth(trajectory, SPHERE, EAST)
    times = between_rows(trajectory)
    states = truth.states(times, "level", 0.0)
    radius, angle, radius_rate, angle_rate = trajectory.states(times).T
    out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    expected = np.vstack([radius * out, np.zeros_like(radius)]).T
    np.testing.assert_allclose(states.position, expected, rtol=0.0, atol=INTEGRATED)
    expected = np.vstack([radius_rate * out + radius * angle_rate * along, np.zeros_like(radius)]).T
    np.testing.assert_allclose(states.velocity, expected, rtol=0.0, atol=INTEGRATED)
    forward, down = trajectory.forces(times).T
    expected = np.vstack([np.zeros_like(forward), forward, down]).T
    np.testing.assert_allclose(states.force, expected, rtol=0.0, atol=1e-6 * STANDARD_GRAVITY)


def test_rows_include_the_boundaries_of_phases() -> None:
    trajectory = planar(4)
    times = reentry_truth(trajectory, SPHERE, EAST).times
    assert np.all(np.diff(times) > 0.0)
    assert {phase.end for phase in trajectory.phases} <= set(times)


def test_at_its_rows_the_vehicle_is_level_and_heads_along_the_plane() -> None:
    truth = reentry_truth(planar(4), SPHERE, EAST)
    rows = rows_from(truth, truth.times)
    # eps times a few products of rotations
    np.testing.assert_allclose(rows.angles, [[np.pi / 2.0, 0.0, 0.0]] * len(rows), rtol=0.0, atol=1e-14)
    assert np.max(np.abs(rows.latitude)) < 1e-15


@pytest.mark.parametrize(("latitude", "longitude", "azimuth"), [(0.5, -1.4, 1.1), (-0.7, 2.0, -2.5)])
def test_elsewhere_it_is_the_same_flight_turned(latitude: float, longitude: float, azimuth: float) -> None:
    trajectory = planar(4)
    times = between_rows(trajectory)[::10]
    there = reentry_truth(trajectory, SPHERE, Plane.at(latitude, longitude, azimuth)).states(times, "strapdown", 0.0)
    here = reentry_truth(trajectory, SPHERE, EAST).states(times, "strapdown", 0.0)
    np.testing.assert_allclose(there.force, here.force, rtol=0.0, atol=1e-6 * STANDARD_GRAVITY)
    np.testing.assert_allclose(there.rate, here.rate, rtol=0.0, atol=1e-12)
    turn = np.linalg.lstsq(here.position[:, :2], there.position, rcond=None)[0]
    np.testing.assert_allclose(turn @ turn.T, np.eye(2), rtol=0.0, atol=1e-11)  # 1e-4 m over 25,000 km


def test_where_the_range_angle_is_zero_it_passes_the_place_at_the_azimuth() -> None:
    trajectory = planar(4)
    latitude, longitude, azimuth = 0.5, -1.4, 1.1
    truth = reentry_truth(trajectory, SPHERE, Plane.at(latitude, longitude, azimuth))
    from scipy.optimize import brentq

    passed = brentq(lambda time: trajectory.state(time)[1], 0.0, trajectory.final_time, xtol=1e-12)
    rows = rows_from(truth, np.array([passed]))
    # radians: 1e-4 m of position over the earth's radius
    assert rows.latitude[0] == pytest.approx(latitude, abs=INTEGRATED / EARTH_RADIUS)
    assert rows.longitude[0] == pytest.approx(longitude, abs=INTEGRATED / EARTH_RADIUS / np.cos(latitude))
    assert rows.velocity is not None
    assert np.arctan2(rows.velocity[0, 1], rows.velocity[0, 0]) == pytest.approx(azimuth, abs=1e-9)


def test_on_a_turning_earth_the_inertial_motion_stays() -> None:
    """Rotation is not a force: the earth turns below, and the gravitation of the sphere does not change."""
    trajectory = planar(4)
    times = between_rows(trajectory)[::10]
    turning = Earth(EARTH_RADIUS, 0.0, GRAVITATIONAL_PARAMETER, EARTH_RATE)
    found = reentry_truth(trajectory, turning, EAST).states(times, "level", 0.0)
    expected = reentry_truth(trajectory, SPHERE, EAST).states(times, "level", 0.0)
    np.testing.assert_allclose(found.position, expected.position, rtol=0.0, atol=2.0 * INTEGRATED)
    np.testing.assert_allclose(found.force, expected.force, rtol=0.0, atol=2e-6 * STANDARD_GRAVITY)


def test_its_rows_pass_the_checks_of_a_file_but_for_their_uneven_steps() -> None:
    truth = reentry_truth(planar(1), WGS84, Plane.at(0.5, 0.1, 1.0))
    check_rows(rows_from(truth, np.arange(0.0, truth.times[-1], 0.5)), WGS84)
