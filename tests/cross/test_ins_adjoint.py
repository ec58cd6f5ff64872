"""The linear system run backwards from the last epoch, against the one run forwards."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.ensemble.adjoint import Adjoint, adjoint_of_closed
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.imu.instruments import CONSTANTS, GYRO
from mcnav.systems.ins.linear.response_blocks import BLOCK
from tests.cross.test_ins_aided import NEGLECTED, SIGMAS, draw, engine, scenario

ROUNDING = 1e-11
"""Share of the largest contribution: 1e-16 in each of some hundred updates and steps, which gains make larger."""

ALL = ("gnss", "altimeter", "stars", "doppler", "compass")


def without_noise(sensors: tuple[str, ...]) -> GivenNoise:
    tables = engine(sensors=sensors).tables
    return GivenNoise(np.zeros((1, *tables.ensemble.factors.shape[:2])), np.zeros((1, *tables.white.shape)))


@pytest.mark.parametrize("own", [True, False])
def test_noise_that_is_not_given_is_zero(own: bool) -> None:
    """To the bit, for samples with errors of the start, the instruments and the sensors."""
    tables, errors = engine(sensors=ALL).tables, draw(1, {**SIGMAS, **NEGLECTED}, 1, scenario(ALL))
    zeros, nothing = (
        simulate_aided(tables, errors, 0, np.arange(1), own, given) for given in (without_noise(ALL), GivenNoise())
    )
    assert np.abs(zeros.values).max() > 0.0
    for name in ("values", "linear", "records"):
        np.testing.assert_array_equal(getattr(nothing, name), getattr(zeros, name), err_msg=name)


def partials(adjoint: Adjoint, inputs: Array, start_map: Array, constants: Array, swings: Array) -> Array:
    """Add up the responses to constant errors: of the start, the instruments and the sensors, shape (9, sources).

    Errors of the gyros add to the innovations of an antenna's velocity as well.
    """
    of_start = adjoint.start[:, :9] @ start_map
    of_instruments = np.einsum("koi,kqi->oq", adjoint.steps, inputs)
    of_instruments[:, : swings.shape[2]] += np.einsum("uoc,ucq->oq", adjoint.updates, swings)
    return np.hstack([of_start, of_instruments, np.einsum("uoc,ucq->oq", adjoint.updates, constants)])


@pytest.mark.parametrize("sensors", [("gnss",), ALL])
def test_partials_of_a_closed_loop(sensors: tuple[str, ...]) -> None:
    """To the constant errors, those of sensors included, as the closed loop propagates them forwards."""
    tables, of = engine(sensors=sensors).tables, scenario(sensors)
    shared, measured = tables.ensemble, tables.loop.measurements
    # a constant error of a sensor adds to the innovation what a measurement's error takes from it
    found = partials(
        tables.adjoint, shared.inputs(np.arange(30)), shared.start_map, -measured.constants, -measured.swings
    )
    expected = of.linear_over_time(2).partials[-1]
    assert found.shape == expected.shape
    sizes = draw(1, {**SIGMAS, **NEGLECTED}, 1, of)[0] != 0.0
    scale = np.abs(expected).max(axis=0)
    assert np.all(scale[sizes] > 0.0)
    np.testing.assert_allclose(found / np.where(scale > 0.0, scale, 1.0), expected / np.where(scale > 0.0, scale, 1.0),
                               rtol=0.0, atol=ROUNDING)  # fmt: skip


@pytest.mark.parametrize("block", [1, 7])
def test_blocks_have_the_bits_of_the_whole(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of steps and updates, to the last epoch and to one before it, which begins a block or is within one."""
    tables = engine(sensors=ALL).tables
    loop, gains, maps = tables.loop, tables.shared.gains, tables.ensemble.output_maps
    times = (len(loop.times) - 1, 28, 24)
    whole = [adjoint_of_closed(loop, gains, last, maps[-1]) for last in times]
    assert len(loop.times) - 1 < BLOCK
    monkeypatch.setattr("mcnav.systems.ins.ensemble.adjoint.BLOCK", block)
    for last, expected in zip(times, whole, strict=True):
        found = adjoint_of_closed(loop, gains, last, maps[-1])
        for name in ("start", "steps", "updates"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def test_partials_of_a_free_navigator() -> None:
    """As the covariance propagates them forwards: with the gyros' errors alone, which reach all outputs."""
    tables = engine().tables
    shared = tables.ensemble
    inputs = shared.inputs(np.arange(30))
    found = partials(shared.adjoint, inputs, shared.start_map, np.zeros((0, 0, 0)), np.zeros((0, 0, 0)))
    y = np.zeros((9, len(CONSTANTS)))
    y[:, :9] = shared.start_map
    for k in range(len(shared.durations)):
        following = y.copy()
        following[3:] = shared.motion[k] @ y
        following[:, 9:] += inputs[k].T
        y = following
    expected = shared.output_maps[-1] @ y
    scale = np.abs(expected[:, : 9 + len(GYRO)]).max(axis=0)
    assert np.all(scale > 0.0)
    np.testing.assert_allclose(found[:, : 9 + len(GYRO)] / scale, expected[:, : 9 + len(GYRO)] / scale,
                               rtol=0.0, atol=ROUNDING)  # fmt: skip


@pytest.mark.parametrize("sensors", [("gnss",), ALL])
def test_linear_errors_of_samples_are_partials_times_errors(sensors: tuple[str, ...]) -> None:
    """Whether a state models a constant, which is propagated less its estimate, or not."""
    tables, of = engine(sensors=sensors).tables, scenario(sensors)
    assert len(tables.exact) == 6
    errors = draw(1, {**SIGMAS, **NEGLECTED}, 7, of)
    found = simulate_aided(tables, errors, 1, np.zeros(1, int), False, without_noise(sensors)).linear[0]
    each = of.linear_over_time(2).partials[-1] * errors[0]
    np.testing.assert_allclose(found, each.sum(axis=1), rtol=0.0, atol=ROUNDING * np.abs(each).max())
