"""The truth: identities of the equations of motion, phases and events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER, REENTRY_ALTITUDE
from mcnav.systems.reentry.atmosphere import LAYER_BOUNDARIES
from mcnav.systems.reentry.scenario import Reentry
from mcnav.systems.reentry.table_i import common_start
from mcnav.systems.reentry.truth import NoReentry, Trajectory, fly_truth, truth_force
from mcnav.systems.reentry.vehicle import ConstantLift, VariableLift, Vehicle, aerodynamic_force

STEP_ERROR = 1e-12 * 300
"""DOP853's tolerance times the steps of the longest trajectory."""


def _altitude(trajectory: Trajectory, time: float) -> float:
    return float(trajectory.state(time)[0]) - EARTH_RADIUS


def test_energy_and_angular_momentum_without_air() -> None:
    """A vehicle without drag is on a Kepler ellipse: both are constant to the integrator's error."""
    trajectory = fly_truth(common_start(), Vehicle(ConstantLift(0.0), 0.0), 200_000.0)
    states = trajectory.states(np.linspace(0.0, trajectory.final_time, 50))
    radius, _, radius_rate, angle_rate = states.T
    momentum = radius**2 * angle_rate
    energy = 0.5 * (radius_rate**2 + (radius * angle_rate) ** 2) - GRAVITATIONAL_PARAMETER / radius
    assert np.ptp(momentum) <= STEP_ERROR * momentum[0]
    assert np.ptp(energy) <= STEP_ERROR * np.max(0.5 * radius_rate**2 + GRAVITATIONAL_PARAMETER / radius)


def test_events_are_found_to_the_integrators_accuracy(scenario: Reentry) -> None:
    """At 8 km/s the time of an event is known to 1e-7 s if its altitude is right to a millimetre."""
    trajectory = scenario.trajectory
    assert _altitude(trajectory, trajectory.reentry_time) == pytest.approx(REENTRY_ALTITUDE, abs=1e-3)
    assert trajectory.state(trajectory.reentry_time)[2] < 0.0
    rates = [trajectory.state(time)[2] for time in (trajectory.final_time, trajectory.final_time - 1.0)]
    assert max(rates) < 0.0


def test_phases_meet_without_gaps_at_the_kinks(scenario: Reentry) -> None:
    """Each ends on a layer boundary, at the lift law's limit or where it turns, and the next begins there."""
    phases = scenario.trajectory.phases
    assert phases[0].start == 0.0
    corner = VariableLift().limiting_rate
    for before, after in pairwise(phases):
        assert before.end == after.start
        state = before.solution(before.end)
        np.testing.assert_allclose(state, after.solution(after.start), rtol=1e-11, atol=1e-9)
        to_layer = np.abs(state[0] - EARTH_RADIUS - np.array(LAYER_BOUNDARIES)).min()
        assert to_layer < 1e-4 or abs(abs(state[2]) - corner) < 1e-6 or abs(state[2]) < 1e-6


def test_force_is_continuous_across_phases(scenario: Reentry) -> None:
    phases = scenario.trajectory.phases
    for before, after in pairwise(phases):
        state = before.solution(before.end)
        forces = [truth_force(state, phase.coefficients) for phase in (before, after)]
        np.testing.assert_allclose(forces[0], forces[1], rtol=1e-8, atol=1e-14)


def test_every_phase_stays_in_its_layer(scenario: Reentry) -> None:
    for phase in scenario.trajectory.phases:
        times = np.linspace(phase.start, phase.end, 41)
        altitudes = phase.solution(times)[0] - EARTH_RADIUS
        bottoms = [0.0, *LAYER_BOUNDARIES, np.inf]
        inside = [bool(np.all((altitudes > low - 1e-3) & (altitudes < high + 1e-3)))
                  for low, high in zip([-1e3, *LAYER_BOUNDARIES], bottoms[1:], strict=True)]  # fmt: skip
        assert any(inside)


def test_a_shallow_dip_ends_the_flight() -> None:
    """Trajectory 3 dips to 59.1376 km at 3887 s, within one integrator step; it is there again 770 s later."""
    dipping = fly_truth(common_start(), Vehicle(ConstantLift(0.22)), 59_137.7)
    passing = fly_truth(common_start(), Vehicle(ConstantLift(0.22)), 59_137.5)
    assert dipping.final_time == pytest.approx(3887.3, abs=0.5)
    assert passing.final_time > 4600.0
    assert _altitude(dipping, dipping.final_time) == pytest.approx(59_137.7, abs=1e-3)


def test_altitude_is_monotone_within_a_phase(scenario: Reentry) -> None:
    for phase in scenario.trajectory.phases:
        radii = phase.solution(np.linspace(phase.start, phase.end, 50))[0]
        assert np.all(np.diff(radii) >= -1e-6) or np.all(np.diff(radii) <= 1e-6)


def test_refining_the_tolerance_converges() -> None:
    """Trajectory 7 skips round the earth and magnifies every error; its end still converges below a kilometre."""
    vehicle = Vehicle(ConstantLift(0.27))
    ends = [fly_truth(common_start(), vehicle, 26_220.0, None, tolerance) for tolerance in (1e-10, 1e-11, 1e-12)]
    angles = [EARTH_RADIUS * flown.state(flown.final_time)[1] for flown in ends]
    assert abs(angles[2] - angles[1]) < 0.2 * abs(angles[1] - angles[0])
    assert abs(angles[2] - angles[1]) < 1e3


def test_drag_opposes_and_lift_is_normal_to_the_air_speed() -> None:
    """NASA TN D-1772, eqs. (2)-(4): with L/D = 0 the force is against the air speed, and lift adds nothing along it."""
    radius, radius_rate, angle_rate, density, ballistic = EARTH_RADIUS + 6e4, -300.0, 1.1e-3, 3e-4, 4.1e-3
    eastward = radius * (angle_rate - 7.29211e-5)
    velocity = np.array([eastward, -radius_rate])  # horizontal and down
    drag = np.array(aerodynamic_force(radius, radius_rate, angle_rate, density, ballistic, 0.0))
    whole = np.array(aerodynamic_force(radius, radius_rate, angle_rate, density, ballistic, 0.4))
    size = 0.5 * density * ballistic * float(velocity @ velocity)
    np.testing.assert_allclose(drag, -size * velocity / np.linalg.norm(velocity), rtol=1e-14)
    lift = whole - drag
    assert abs(lift @ velocity) <= 1e-13 * np.linalg.norm(lift) * np.linalg.norm(velocity)
    assert np.linalg.norm(lift) == pytest.approx(0.4 * size, rel=1e-13)
    assert lift[1] < 0.0  # positive lift is up, and f_z is positive down


def test_a_start_below_the_final_altitude_is_refused() -> None:
    start = common_start()
    start[0] = EARTH_RADIUS + 10_000.0
    with pytest.raises(NoReentry, match=r"starts at 10\.00 km"):
        fly_truth(start, Vehicle(ConstantLift(0.1)), 20_000.0)


def test_a_flight_that_leaves_is_given_up() -> None:
    start = common_start()
    start[2] = 12_000.0
    with pytest.raises(NoReentry, match=r"never comes down to 30\.00 km"):
        fly_truth(start, Vehicle(ConstantLift(0.1)), 30_000.0)


def test_range_angles_are_not_wrapped() -> None:
    """Trajectory 7 flies three quarters of the way round: its range angle passes pi and stays there."""
    from tests.conftest import reentry

    trajectory = reentry(7).trajectory
    angles = trajectory.states(np.linspace(0.0, trajectory.final_time, 400))[:, 1]
    assert angles[-1] > np.pi
    assert np.all(np.diff(angles) > 0.0)
