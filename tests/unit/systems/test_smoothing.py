"""Positions with few decimals: the spline keeps within the last one, and its force is that of the flight."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.truth.rows import TrajectoryRows
from mcnav.systems.ins.truth.smoothing import FIRST_KNOTS, last_decimal, least_squares, spline_within
from mcnav.systems.ins.truth.trajectory import Truth

RATE = 50.0
DECIMALS = 8
UNIT = 10.0**-DECIMALS
"""Last decimal of angles, deg."""

QUANTUM = np.radians(UNIT) * 6.4e6
"""The same over the ground, m."""


def weaving(decimals: int | None, sharp: bool = False) -> TrajectoryRows:
    """A flight at 100 m/s that weaves with an acceleration of 1 m/s^2; where sharp, it turns once within a row."""
    time = np.round(np.arange(0.0, 60.0, 1.0 / RATE), 9)
    omega = 2.0 * np.pi / 30.0
    latitude = 47.0 + np.degrees(1.0 / omega**2 * np.sin(omega * time) / 6.4e6)
    longitude = 9.0 + np.degrees(100.0 * time / 4.4e6)
    if sharp:
        latitude = latitude + np.degrees(np.maximum(time - 33.0, 0.0) * 2.0 / 6.4e6)
    altitude = np.full_like(time, 1_000.0)
    resolution = (0.0, 0.0, 0.0)
    if decimals is not None:
        latitude, longitude = np.round(latitude, decimals), np.round(longitude, decimals)
        resolution = (np.radians(10.0**-decimals), np.radians(10.0**-decimals), 0.0)
    angles = np.tile([np.pi / 2.0, 0.0, 0.0], (len(time), 1))
    position = np.radians(latitude), np.radians(longitude), altitude
    return TrajectoryRows(time, *position, angles, None, resolution)


def force(truth: Truth, times: np.ndarray) -> np.ndarray:
    return truth.states(times, "level", 0.0).force


@pytest.mark.parametrize(("decimals", "scale"), [(0, 3.0), (2, 1.0), (7, 0.1), (12, 1e-3)])
def test_last_decimals(decimals: int, scale: float) -> None:
    values = np.round(np.random.default_rng(decimals).normal(50.0, 40.0 * scale, 5_000), decimals)
    assert last_decimal(values) == pytest.approx(10.0**-decimals, rel=1e-12)


def test_values_that_are_not_rounded() -> None:
    values = np.random.default_rng(1).normal(50.0, 1.0, 5_000)
    assert last_decimal(values) == 0.0
    assert last_decimal(np.full(100, 1_000.0)) == 0.0
    assert last_decimal(np.array([1.0, 2.0]) * 1e-13) == 0.0
    values = np.round(values, 3)
    values[4_001] += 1e-6
    assert last_decimal(values) == pytest.approx(1e-6)


def test_exact_positions_are_interpolated() -> None:
    rows = weaving(None)
    assert rows.departure(rows.truth(WGS84)) < 1e-8  # rounding of 6.4e6 m


def test_rounded_positions_give_the_force_of_the_flight() -> None:
    exact, rounded = weaving(None), weaving(DECIMALS)
    times = exact.time[50:-50]  # the ends of a spline are known from one side only
    expected = force(exact.truth(WGS84), times)
    smooth = rounded.truth(WGS84)
    plain = Truth.through(WGS84, rounded.time, rounded.latitude, rounded.longitude, rounded.altitude, rounded.angles)
    # uniform rounding, seen by a second derivative: six times its sigma times the squared rate
    noise = 6.0 * QUANTUM / np.sqrt(12.0) * RATE**2
    assert np.max(np.abs(force(plain, times) - expected)) > noise
    # knots are 64 rows or some halvings apart, and each averages the rows between
    assert np.sqrt(np.mean((force(smooth, times) - expected) ** 2)) < noise / 64.0
    assert rounded.departure(smooth) < np.sqrt(2.0) * QUANTUM
    ground = np.linalg.norm(smooth.earth_fixed(times)[0] - exact.truth(WGS84).earth_fixed(times)[0], axis=1)
    assert np.max(ground) < np.sqrt(2.0) * QUANTUM


def test_a_sharp_turn_stays_sharp() -> None:
    """Knots gather where the flight bends: there, too, no row is missed by more than its last decimal."""
    rows = weaving(DECIMALS, sharp=True)
    truth = rows.truth(WGS84)
    assert rows.departure(truth) < np.sqrt(2.0) * QUANTUM
    found = np.abs(force(truth, rows.time)[:, 0])
    assert 32.5 < rows.time[int(np.argmax(found))] < 33.5
    assert np.max(found) > 0.5 * STANDARD_GRAVITY


@pytest.mark.parametrize("row", [0, -1, 777])
def test_knots_gather_at_a_row_that_departs_alone(row: int) -> None:
    """Further away than the first distance of knots there are no others than at first."""
    time = 0.02 * np.arange(1_001)
    position = np.zeros((1_001, 3))
    position[row, 1] = 10.0
    spline = spline_within(time, position, np.tile(np.eye(3), (1_001, 1, 1)), np.ones(3))
    assert spline is not None
    assert np.abs(spline(time) - position).max() <= 1.0
    knots = np.append(np.arange(0, 1_000, FIRST_KNOTS), 1_000)
    found = np.rint(spline.x / 0.02).astype(int)
    away = np.abs(np.arange(1_001) - row % 1_001) > FIRST_KNOTS
    assert found[away[found]].tolist() == knots[away[knots]].tolist()


def test_least_squares_are_those_of_scipy() -> None:
    """By its factorization of all rows; and to the rounding of positions, 1e-9 m, where rows lie on a parabola."""
    time = 0.01 * np.arange(3_001)
    knots = time[np.union1d(np.arange(0, 3_000, 13), 3_000)]
    parabola = np.stack([4e6 + 200.0 * time, 5e6 + 3.0 * time**2, 3e6 - time], axis=1)
    rows = parabola + 0.01 * np.random.default_rng(4).standard_normal(parabola.shape)
    breaks = np.concatenate([knots[:1].repeat(4), knots[1:-1], knots[-1:].repeat(4)])
    spline, fitted = least_squares(time, rows, knots)
    expected = make_lsq_spline(time, rows, breaks, 3, method="qr")
    ulp = np.spacing(6e6)
    np.testing.assert_allclose(fitted, expected(time), rtol=0.0, atol=20.0 * ulp)
    np.testing.assert_allclose(spline(time), fitted, rtol=0.0, atol=4.0 * ulp)
    np.testing.assert_allclose(least_squares(time, parabola, knots)[1], parabola, rtol=0.0, atol=4.0 * ulp)
