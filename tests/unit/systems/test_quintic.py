"""Quintic splines: polynomials of degree five to rounding, and velocities that meet in dense rows far away."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.systems.ins.truth.quintic import FORCE_ERROR, quintic_spline, row_times

EARTH = 6.4e6
EPS = np.finfo(float).eps


def test_polynomials_of_degree_five_are_exact() -> None:
    """Between uneven rows, with any further axes: to 40 roundings of the largest term."""
    powers = np.random.default_rng(1).standard_normal((2, 3, 6))
    times = np.array([0.0, 0.3, 1.7, 2.0])
    derived = [powers, *(np.array([[np.polyder(row, m) for row in rows] for rows in powers]) for m in (1, 2))]
    motions = np.stack([_evaluate(each, times) for each in derived], axis=1)
    between = np.linspace(0.0, 2.0, 41)
    expected = _evaluate(powers, between)
    largest = _evaluate(np.abs(powers), np.array([2.0])).max()
    np.testing.assert_allclose(quintic_spline(times, motions)(between), expected, rtol=0.0, atol=40.0 * EPS * largest)


def _evaluate(powers: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.array([[[np.polyval(row, time) for row in rows] for rows in powers] for time in times])


def test_velocities_meet_on_the_earth() -> None:
    """Positions are rounded to 1e-9 m, rows are 1/16 s apart, and velocities meet to 20 of their own roundings."""
    times = np.arange(0.0, 10.0, 0.0625)
    angle = 1e-3 * times
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ahead = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    motions = np.stack([EARTH * around, 1e-3 * EARTH * ahead, -1e-6 * EARTH * around], axis=1)
    spline = quintic_spline(times, motions)
    widths = np.diff(times)[:, None]
    ends = sum((5 - k) * spline.c[k] * widths ** (4 - k) for k in range(5))
    gap = np.abs(ends[:-1] - spline.c[4, 1:]).max()
    assert gap < 20.0 * EPS * 1e-3 * EARTH


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_step_is_halved_where_the_acceleration_is_missed(share: float) -> None:
    """At rest but for one instant, a quarter, half or three quarters of the step from its begin."""

    def motion(time: float) -> np.ndarray:
        return np.array([[0.0], [0.0], [2.0 * FORCE_ERROR * (time == share)]])

    assert row_times(motion, 1.0, 2.0) == [2.0]
    assert 0.5 in row_times(motion, 0.0, 1.0)
