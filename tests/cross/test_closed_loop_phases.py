"""Phases of closed loops against closed forms: a fall that is braked where the navigator indicates it."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch
from tests.cross.test_closed_loop import campaign, covariance


def landed(errors: Array) -> Array:
    """Altitude, rate and begin of braking after 100 s, of errors of altitude, rate, and of their estimates."""
    altitude, rate = 2_000.0 + errors[..., 0], -5.0 + errors[..., 1]
    indicated, indicated_rate = altitude + errors[..., 2], rate + errors[..., 3]
    begin = (indicated_rate + np.sqrt(indicated_rate**2 + 2.0 * 1.62 * (indicated - 900.0))) / 1.62
    at_begin = altitude + rate * begin - 0.81 * begin**2, rate - 1.62 * begin
    braked = 90.0 - begin
    after = at_begin[0] + at_begin[1] * braked + 0.45 * braked**2, at_begin[1] + 0.9 * braked
    return np.stack([after[0] + 0.5 * 10.0 * after[1], after[1], begin], axis=-1)


def test_a_braked_fall() -> None:
    """Covariance by derivatives of the closed form, whose steps are complex; the hold begins at 90 s for all."""
    described = campaign("Lander")
    names, matrix = covariance(described)
    rows = [names.index(name) for name in ("true_altitude", "true_rate", "brake_time")]
    partials = np.array([landed(1e-30j * each).imag / 1e-30 for each in np.eye(4)]).T
    expected = partials @ np.diag([20.0, 0.5, 10.0, 0.2]) ** 2 @ partials.T
    np.testing.assert_allclose(matrix[np.ix_(rows, rows)], expected, rtol=1e-9)
    assert described.scenario.plan.event_times["brake"] == pytest.approx(landed(np.zeros(4))[2], rel=1e-12)  # type: ignore[attr-defined]
    assert described.scenario.remarks == ()  # type: ignore[attr-defined]


def test_every_sample_brakes_at_its_own_instant() -> None:
    described = campaign("Lander")
    errors = described.errors.draw("random", 5, 40, 0, 40)
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(40), errors, 5), noise=False)
    names = [output.name for output in described.scenario.outputs]
    rows = [names.index(name) for name in ("true_altitude", "true_rate", "brake_time")]
    nominal = landed(np.zeros(4)) * np.array([1.0, 1.0, 0.0])
    np.testing.assert_allclose(result.values[:, rows], landed(errors) - nominal, rtol=1e-10, atol=1e-9)


def test_a_sample_that_does_not_reach_a_phase_fails() -> None:
    described = campaign("Lander")
    errors = np.zeros((2, 4))
    errors[1, 2] = 8_000.0  # indicated too high by eight kilometres
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(2), errors, 5), noise=False)
    assert {row: str(failure) for row, failure in result.failures.items()} == {1: "brake: meets no trigger by 80 s"}
