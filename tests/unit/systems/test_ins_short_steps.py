"""Short steps of deviations: by their own scheme and by the general one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.ensemble.steps import (
    LARGEST_TURN,
    SHORT,
    SMALLEST_RADIUS,
    Deviations,
    StepTables,
    advance,
    advance_short,
    deviations_of,
    parts_of_deviations,
    start,
)
from mcnav.systems.ins.reference.normal_field import field_constants, normal_gravitation_at
from tests.cross.test_ins_aided import engine, scenario

STEP = 100
TURN, VELOCITY, AWAY = 0.02, 1.0, 2_000.0
"""Turn of the sample, rad, and deviations of velocity, m/s, and position, m."""

RESPONSE = np.repeat([1e-5, 1e-3, 1e-3], 3)
"""To the errors of the instruments in the step, rad, m/s, m."""


def tables() -> StepTables:
    """Return the tables of a flight with steps of a second."""
    made = engine().tables
    return made.ensemble.steps(np.zeros(0, dtype=np.int64), made.adjoint)


def samples() -> Deviations:
    """Return samples whose deviations are far larger than a filter leaves them."""
    rng = np.random.default_rng(3)
    made = deviations_of(0, 0)
    lanes = made.turn.shape[1]
    made.turn[:] = np.roll(Rotation.from_rotvec(TURN * rng.standard_normal((lanes, 3))).as_quat(), 1, axis=1).T
    made.moved[:] = np.repeat([VELOCITY, AWAY], 3)[:, None] * rng.standard_normal((6, lanes))
    made.response[:] = RESPONSE[:, None] * rng.standard_normal((9, lanes))
    made.sound[:] = 1.0
    return made


def stepped(short: bool) -> Deviations:
    shared, made = tables(), samples()
    if short:
        advance_short(STEP, shared, made, parts_of_deviations(made), True)
    else:
        start(STEP, shared, made)
        advance(STEP, shared, made)
    assert np.all(made.sound == 1.0)
    return made


def largest(rows: Array) -> float:
    return float(np.linalg.norm(rows, axis=0).max())


def test_a_short_step_is_that_of_the_general_scheme() -> None:
    """Velocities differ by what gravity makes, within the step, of an uneven growth of the velocity and of its own.

    Positions differ besides by the part of the specific force's second integral that is not half of the first, and by
    products of the errors within the step.
    """
    shared, before = tables(), samples()
    found, expected = stepped(short=True), stepped(short=False)
    h = shared.durations[STEP]
    assert h <= SHORT
    np.testing.assert_array_equal(found.turn, expected.turn)
    force, twice = shared.thrust[STEP, :3], shared.thrust[STEP, 3:]
    gradient = float(np.linalg.norm(shared.gradients[2 * STEP + 1], 2))
    velocity, away = largest(before.moved[:3]), largest(before.moved[3:])
    growth = largest(found.moved[:3] - before.moved[:3])
    # what the velocity grows by is not even where the force is not, and gravity's gradient changes with the place
    uneven = float(np.linalg.norm(twice - 0.5 * h * force)) / (0.5 * h * float(np.linalg.norm(force)))
    rate = 3.0 * h * float(np.linalg.norm(np.gradient(shared.places, h / 2.0, axis=0)[2 * STEP])) / 6.3e6
    pulled = gradient * h * away
    left = gradient * h**2 * (uneven * growth + pulled + rate * velocity + rate**2 * away / h) / 6.0
    # Simpson's rule against the middle: gravity's remainder grows with the square of the distance
    remainder = 3.0 * gradient * away**2 / np.linalg.norm(shared.places[2 * STEP])
    left += remainder * h * (h * (velocity + growth) / away) ** 2
    rounding = 1e-15 * (away + h * float(np.linalg.norm(shared.fields[2 * STEP])))
    difference = np.abs(found.moved - expected.moved)
    assert difference[:3].max() <= left + rounding
    left += gradient * h**2 * (velocity + growth) / 12.0
    # the part of R - I that is not linear in the turn is half of its square
    turned = 2.0 * np.linalg.norm(before.turn[1:], axis=0).max()
    rotation, added = largest(before.response[:3]), largest(before.response[3:6])
    products = rotation * (rotation * float(np.linalg.norm(force)) + added)
    further = turned**2 * float(np.linalg.norm(twice - 0.5 * h * force)) + h * products
    assert difference[3:].max() <= h * left + further + rounding
    # the bound is far below what the step adds
    assert left < 1e-3 * growth


@pytest.mark.parametrize("short", [True, False])
def test_samples_near_the_earths_centre_are_not_sound(short: bool) -> None:
    """Nearer than half of the radius, in whichever direction."""
    shared, made = tables(), samples()
    directions = np.random.default_rng(4).standard_normal(made.here.shape)
    shares = np.resize([0.45, 0.55], made.here.shape[1])
    away = shares * shared.constants[0] * directions / np.linalg.norm(directions, axis=0)
    made.moved[3:] = away - shared.places[2 * STEP][:, None]
    made.moved[:3] = -np.gradient(shared.places, shared.durations[STEP] / 2.0, axis=0)[2 * STEP][:, None]
    if short:
        advance_short(STEP, shared, made, parts_of_deviations(made), True)
    else:
        start(STEP, shared, made)
        advance(STEP, shared, made)
    np.testing.assert_array_equal(made.sound[0], np.where(shares > SMALLEST_RADIUS, 1.0, 0.0))


@pytest.mark.parametrize("short", [True, False])
def test_large_turns_within_a_step(short: bool) -> None:
    """Up to the largest that is sound, by series of which the first term left out is 2e-16."""
    made = samples()
    angles = np.linspace(0.0, 0.99 * LARGEST_TURN, made.turn.shape[1])
    axes = np.random.default_rng(5).standard_normal((3, len(angles)))
    made.response[:3] = angles * axes / np.linalg.norm(axes, axis=0)
    before = Rotation.from_quat(np.roll(made.turn, -1, axis=0).T)
    expected = before * Rotation.from_rotvec(made.response[:3].T)
    if short:
        advance_short(STEP, tables(), made, parts_of_deviations(made), True)
    else:
        start(STEP, tables(), made)
        advance(STEP, tables(), made)
    found = Rotation.from_quat(np.roll(made.turn, -1, axis=0).T)
    assert (found * expected.inv()).magnitude().max() < 1e-15
    np.testing.assert_allclose(np.linalg.norm(made.turn, axis=0), 1.0, rtol=0.0, atol=1e-15)


def test_gravity_in_the_middle_of_a_long_step_is_that_of_its_place() -> None:
    """Velocities at both ends bend the path: by an eighth of the step times their difference, 2 m of some 2,000.

    What gravity's remainder, 1e-5 m/s^2, bends it by besides is 1e-5 m, and changes the remainder by 3e-14 m/s^2 at
    most; rounding of gravitation is some twenty times its last digit.
    """
    navigation, k = scenario().navigation, 0
    shared = navigation.tables(1).steps(np.zeros(0, dtype=np.int64), engine().tables.adjoint)
    made = samples()
    h, before = shared.durations[k], made.moved.copy()
    start(k, shared, made)
    advance(k, shared, made)
    bent = 0.125 * h * (before[:3] - made.moved[:3])
    place, field = shared.places[2 * k + 1], field_constants(WGS84)
    away = 0.5 * (before[3:] + made.moved[3:]) + bent
    change = normal_gravitation_at(field, place + away.T) - normal_gravitation_at(field, place[None])
    expected = change.T - shared.gradients[2 * k + 1] @ away
    assert h > SHORT
    assert np.abs(bent).max() > 2.0
    assert np.abs(expected).max() < 2e-5
    np.testing.assert_allclose(made.middle, expected, rtol=0.0, atol=3e-14 + 20 * np.finfo(float).eps * 9.83)
