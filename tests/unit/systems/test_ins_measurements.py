"""Innovations of aiding sensors: their responses against differences, and none without errors."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.compiled.vectors import LANES, load, room, store
from mcnav.systems.ins.ensemble.filters import SIX, filter_updates
from mcnav.systems.ins.ensemble.innovations import INNOVATION, INNOVATIONS, places_of
from mcnav.systems.ins.ensemble.own_responses import DelayTables, OffsetTables
from mcnav.systems.ins.ensemble.steps import deviations_of
from mcnav.systems.ins.ensemble.updates import (
    RateTables,
    UpdateTables,
    along_truth,
    estimates_of,
    innovate,
)
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, choose_by_kind
from mcnav.systems.ins.sensors.measurements import Measurements, measure
from mcnav.systems.ins.sensors.registry import KINDS
from tests.aided import make_sensor
from tests.flights import flight

SENSORS = (
    make_sensor("gnss", np.array([700.0]), {"position": 3.0, "velocity": 0.1}, lever_arm=(2.0, 0.3, -1.0)),
    make_sensor("altimeter", np.array([700.0]), {"altitude": 5.0}),
    make_sensor("stars", np.array([700.0]), {"attitude": 2e-5}),
    make_sensor("doppler", np.array([700.0]), {"body_velocity": 0.2}),
    make_sensor("compass", np.array([700.0]), {"heading": 0.02}),
)


def tabulated(sensors: tuple[Sensor, ...] = SENSORS) -> Measurements:
    return measure(flight(1.0), "strapdown", 300.0, sensors)


def update_tables(found: Measurements) -> UpdateTables:
    """Return the tables of updates whose measurements have no errors, of a filter without other states."""
    updates, most = found.components.shape
    none, whole = np.zeros((updates, most)), np.full((updates, most, 2), [0, 9])
    no_rates, no_numbers = np.zeros((updates, 3, 0)), np.zeros(0, dtype=np.int64)
    never, no_states = np.zeros(updates, dtype=np.bool_), np.full((updates, 2), -1)
    return UpdateTables(
        found.sensors, found.sizes, found.components, places_of(found), found.directions, found.parameters,
        found.constants[:, :, :0], found.places, none, none, none, np.zeros(updates),
        np.zeros((updates, most, 0)), np.zeros((updates, 9, most)), np.zeros((updates, most, most)),
        np.zeros((updates, 9, most)), never,
        np.zeros(0, dtype=np.int64), np.full((updates, most), -1),
        filter_updates(found.rows, np.zeros((updates, most, 0)), whole, none, never, never, no_states),
        RateTables(found.swinging, found.swung, found.levers, no_rates, no_rates, no_rates, no_numbers, no_numbers),
        never, none,
        OffsetTables(
            np.full((updates, 3), -1), np.full((updates, 3), -1), never, np.zeros((updates, 3, 3)),
            np.zeros((updates, most, 3)),
        ),
        DelayTables(never, no_states, np.zeros((0, most, 9)), np.zeros((0, most)), np.zeros((0, 3)), np.zeros(updates)),
    )  # fmt: skip


def innovations_and_rows(found: Measurements, turn: Array, velocity: Array, away: Array) -> tuple[Array, Array]:
    """Compute all innovations of a navigator whose deviations are given, and their responses to errors."""
    tables, constants = update_tables(found), flight(1.0).earth.constants
    samples = deviations_of(0, 0)
    samples.turn[:] = np.roll(Rotation.from_rotvec(turn).as_quat(), 1)[:, None]
    samples.moved[:3], samples.moved[3:] = velocity[:, None], away[:, None]
    values, responses = [], []
    for u, m in enumerate(found.sizes):
        own, rows = estimates_of(0, 0, 0, len(SENSORS)), room(SIX, 9)
        innovate(u, m, constants, tables, samples, rows, own)
        np.testing.assert_array_equal(own.innovation, np.repeat(own.innovation[:, :1], LANES, axis=1))
        values.append(own.innovation[:m, 0])
        responses.append(rows[:m, :, 0])
    return np.concatenate(values), np.concatenate(responses)


CHOSEN = choose_by_kind(INNOVATIONS)


@numba.njit(error_model="numpy", fastmath={"contract"})
def both_ways(
    found: tuple[Array, Array, Array], tables: MeasurementTables, moved: Array, rooms: tuple[Array, Array, Array],
    out: Array,
) -> None:  # fmt: skip
    """Compute innovations by their addresses, and by their kinds as where numba has no addresses."""
    places, kinds, sizes = found
    turn, turned, three = rooms
    x, y, z, vx, vy, vz = load(moved, 0), load(moved, 1), load(moved, 2), load(moved, 3), load(moved, 4), load(moved, 5)
    errors = NavigatorErrors(x, y, z, vx, vy, vz, turn, turned, three, three, three, three, three)
    rows, number = out[:0], 0
    for u in range(len(sizes)):
        for c in range(sizes[u]):
            store(out, (number, 0), INNOVATION(places[u, c], x, u, c, tables, errors, rows, False))
            store(out, (number, 1), CHOSEN(kinds[u, c], x, u, c, tables, errors, rows, False))
            number += 1


def test_innovations_called_by_address_have_the_bits_of_those_chosen_by_kind() -> None:
    found = tabulated()
    tables = MeasurementTables(
        found.directions, found.parameters, found.places, found.levers, found.swinging, flight(1.0).earth.constants
    )
    random = np.random.default_rng(5)
    turn, turned, three, moved, out = room(4), room(9), room(3), room(6), room(int(found.sizes.sum()), 2)
    rotations = Rotation.from_rotvec(0.01 * random.standard_normal((LANES, 3)))
    turn[:] = np.roll(rotations.as_quat(), 1, axis=1).T
    turned[:] = (rotations.as_matrix() - np.eye(3)).reshape(LANES, 9).T
    moved[:], three[:] = random.standard_normal((6, LANES)), random.standard_normal((3, LANES))
    places, rooms = places_of(found), (turn, turned, three)
    both_ways((places, found.kinds, found.sizes), tables, moved, rooms, out)
    assert np.isfinite(out).all()
    np.testing.assert_array_equal(out[:, 0], out[:, 1])
    none = replace(found, kinds=found.kinds + len(INNOVATIONS))  # kinds without an innovation are no number either way
    both_ways((places, none.kinds, none.sizes), tables, moved, rooms, out)
    assert np.isnan(out[:, 1]).all()
    with pytest.raises(IndexError):
        places_of(none)


def test_responses_are_those_along_the_truth_where_they_do_not_depend_on_the_attitude() -> None:
    """Of position and velocity without a lever arm, whatever the turn; those of all others differ by the turn."""
    plain = make_sensor("plain", np.array([700.0]), {"position": 3.0, "velocity": 0.1})
    found = tabulated((*SENSORS, plain))
    same = along_truth(found)
    np.testing.assert_array_equal(same, [False] * len(SENSORS) + [True])
    rows = innovations_and_rows(found, np.array([0.01, -0.02, 0.015]), np.zeros(3), np.zeros(3))[1]
    table = np.concatenate([found.rows[u, : found.sizes[u]] for u in range(len(found.sizes))])
    equal = np.repeat(same, found.sizes)
    np.testing.assert_array_equal(rows[equal], table[equal])


@pytest.mark.parametrize("turn", [np.zeros(3), np.array([0.01, -0.02, 0.015])])
def test_rows_are_the_derivatives_of_the_innovations(turn: Array) -> None:
    """Central differences with steps of 1e-4 rad, 1 m/s and 100 m about the attitude of the navigator.

    Their error is the third derivative's, (1e-4)^2 / 6 of a row for an angle and (100 m / 6.4e6 m)^2 for an altitude.
    With a turn, the row of a rotation vector is that along the indicated axes, which differs by half the turn, and that
    of a heading is the row along the truth.
    """
    found, base = tabulated(), Rotation.from_rotvec(turn)
    rows = innovations_and_rows(found, turn, np.zeros(3), np.zeros(3))[1]
    steps = np.concatenate([np.full(3, 1e-4), np.full(3, 1.0), np.full(3, 100.0)])
    numerical = np.empty_like(rows)
    for j, step in enumerate(steps):
        change = np.zeros(9)
        change[j] = step
        sides = [
            innovations_and_rows(found, (Rotation.from_rotvec(each[:3]) * base).as_rotvec(), each[3:6], each[6:])[0]
            for each in (change, -change)
        ]
        numerical[:, j] = (sides[0] - sides[1]) / (2.0 * step)
    kinds = np.concatenate([found.kinds[u, : found.sizes[u]] for u in range(len(found.times))])
    size = np.linalg.norm(turn)
    allowed = 5e-9 + np.where(np.isin(kinds, [KINDS["attitude"], KINDS["heading"]]), size, 0.0)
    for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
        scale = np.abs(rows[:, part]).max(axis=1)
        assert np.all(np.abs(numerical[:, part] - rows[:, part]).max(axis=1) <= allowed * scale + 1e-15)


def test_no_errors_give_no_innovations_and_the_rows_along_the_truth() -> None:
    """To rounding, 1e-16 of the largest response: a navigator's speed of 300 m/s."""
    found = tabulated()
    values, rows = innovations_and_rows(found, np.zeros(3), np.zeros(3), np.zeros(3))
    assert not values.any()
    along = np.concatenate([found.rows[u, : found.sizes[u]] for u in range(len(found.times))])
    np.testing.assert_allclose(rows, along, rtol=1e-13, atol=1e-13)


def test_updates_are_in_order_of_time_and_of_the_sensors() -> None:
    sensors = (
        make_sensor("late", np.array([600.0, 700.0]), {"altitude": 1.0}),
        make_sensor("early", np.array([500.0, 700.0]), {"heading": 0.01}),
    )
    found = tabulated(sensors)
    assert found.times.tolist() == [500.0, 600.0, 700.0, 700.0]
    assert found.sensors.tolist() == [1, 0, 0, 1]
    assert found.components[:, 0].tolist() == [1, 0, 0, 1]


def test_scale_factors_and_lever_arms_act_on_what_is_measured() -> None:
    found = tabulated()
    names = aiding_constants(SENSORS)
    truth = flight(1.0)
    altitude = truth.geodetic(np.array([700.0]))[0, 2]
    assert found.constants[1, 0, names.index("altimeter_scale_factor")] == pytest.approx(-altitude, rel=1e-12)
    speed = np.linalg.norm(truth.earth_fixed(np.array([700.0]))[1])
    scaled = [found.constants[3, c, names.index(f"doppler_scale_factor_{axis}")] for c, axis in enumerate("xyz")]
    assert np.linalg.norm(scaled) == pytest.approx(speed, rel=1e-12)
    arm = [names.index(f"gnss_lever_arm_{axis}") for axis in "xyz"]
    lever = np.array([2.0, 0.3, -1.0])
    # the position's innovation by an error of the arm is that of the arm itself turned: directions are the same
    shown = found.constants[0, :3][:, arm] @ lever
    assert np.linalg.norm(shown) == pytest.approx(np.linalg.norm(lever), rel=1e-12)
