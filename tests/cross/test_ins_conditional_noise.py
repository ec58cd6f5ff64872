"""Samples whose noise is given what it adds to linear errors, against the linear covariance and the samples' twins."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy import stats

from mcnav.contract.samples import Batch
from mcnav.systems.ins.aided import AidedEngine
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.ensemble.free import simulate_given
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.scenario import EnsembleEngine, Ins, Navigation
from tests.aided import make_filter
from tests.cross.test_ins_aided import DEG_PER_HOUR, END, KINDS, NEGLECTED, SIGMAS, START, draw, gnss, scenario
from tests.flights import flight

ROUNDING = 1e-9
"""Share of a sigma: 1e-16 in each of some hundred thousand products."""

GRIDS = 1e-6
"""Share of a variance by which that of the engine's steps may differ from that between the epochs."""

DRIFTING = Imu(
    Noise(
        np.full(3, 6e-7), np.full(3, 0.05 * DEG_PER_HOUR), np.full(3, 300.0), np.full(3, 1e-8),
    ),
    Noise(np.full(3, 2e-4), np.full(3, 3e-4), np.full(3, 200.0)),
)  # fmt: skip
"""Biases of processes and a random walk of them beside the white noise."""


@lru_cache
def aided() -> tuple[Ins, AidedEngine]:
    """An antenna on a lever arm that jitters, an altimeter with a correlated error, and drifting biases."""
    receiver, altimeter = scenario(("gnss", "altimeter")).navigation.sensors
    sensors = (replace(receiver, jitter=2e-3), altimeter)
    model = make_filter(sensors, DRIFTING, SIGMAS, (*KINDS, "altimeter_bias"))
    of = Ins(Navigation(flight(1.0), "strapdown", START, END, DRIFTING, sensors, model))
    made = of.engine("ensemble", draw(8, SIGMAS, 1, of))
    assert isinstance(made, AidedEngine)
    assert gnss().lever_arm.any()
    assert len(made.tables.ensemble.sizes) == 9
    assert made.tables.correlated.any()
    return of, made


@lru_cache
def free() -> tuple[Ins, EnsembleEngine]:
    of = Ins(Navigation(flight(1.0), "strapdown", START, END, DRIFTING))
    made = of.engine("ensemble", draw(8, SIGMAS, 1, of))
    assert isinstance(made, EnsembleEngine)
    return of, made


@pytest.mark.parametrize("flown", [aided, free])
def test_all_noise_has_the_linear_covariance(flown):
    """By the recursion backwards over what is drawn, and by that of the covariance of each process."""
    of, made = flown()
    expected = sum(each[-1] for each in of.linear_over_time(2).processes.values())
    sigma = np.sqrt(np.diag(expected))
    rows = made.noise.rows(tuple(range(9)))
    covariance = np.einsum("iz,jz->ij", rows, rows)
    np.testing.assert_allclose(covariance / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=GRIDS)


@pytest.mark.parametrize("flown", [aided, free])
def test_noise_at_an_epoch_has_the_linear_covariance_and_what_it_is_told(flown):
    """Of two epochs, whose conditions are met in the histories of samples without errors, to second order."""
    of, made = flown()
    assert made.epochs is not None
    epochs, outputs = (17, 40), (0, 5)
    system = of.linear_over_time(len(made.epochs.times))
    np.testing.assert_allclose(system.times, made.epochs.times, rtol=1e-9)
    samples = made.conditional_noise((0, 5, 0, 5), (17, 17, 40, 40))
    for k, epoch in enumerate(epochs):
        expected = sum(each[epoch] for each in system.processes.values())[np.ix_(outputs, outputs)]
        sigma = np.sqrt(np.diag(expected))
        factor = samples.factor[2 * k : 2 * k + 2] / sigma[:, None]
        np.testing.assert_allclose(factor @ factor.T, expected / np.outer(sigma, sigma), atol=GRIDS + 2e-4)
    wanted = np.random.default_rng(1).standard_normal((8, samples.factor.shape[1]))
    errors = np.zeros((8, len(of.sources)))
    history = samples.simulate(Batch(np.arange(8), errors, 7), wanted).history[:, epochs][:, :, outputs]
    told = (wanted @ samples.factor.T).reshape(8, 2, 2)
    np.testing.assert_allclose(history / sigma, told / sigma, atol=0.05)


@pytest.mark.parametrize("flown", [aided, free])
def test_twins_have_the_linear_errors_that_are_given(flown):
    of, made = flown()
    outputs, count = (2, 3, 8), 16
    errors = draw(count, SIGMAS | NEGLECTED, 3, of)
    samples = made.conditional_noise(outputs)
    sigma = np.sqrt(np.sum(samples.factor**2, axis=1))
    wanted = 4.0 * np.random.default_rng(1).standard_normal((count, samples.factor.shape[1]))
    result = samples.simulate(Batch(np.arange(count), errors, 7), wanted)
    by_errors = result.linear_values[:, outputs] - wanted @ samples.factor.T
    without = samples.simulate(Batch(np.arange(count), errors, 7), 0.0 * wanted).linear_values[:, outputs]
    scale = np.abs(result.linear_values[:, outputs]).max(axis=0) + sigma
    np.testing.assert_allclose(by_errors / scale, without / scale, rtol=0.0, atol=ROUNDING)
    np.testing.assert_array_equal(
        samples.simulate(Batch(np.arange(4, 6), errors[4:6], 7), wanted[4:6]).values, result.values[4:6]
    )


@pytest.mark.parametrize("flown", [aided, free])
def test_variates_add_their_partials_to_the_linear_errors(flown):
    """Of samples without errors: the compiled recursion forwards has what the partials add up to."""
    _, made = flown()
    index = np.arange(8)
    normals = made.noise.draw(3, index)
    variates = made.noise.parted(normals)
    given, nothing = made.noise.given(variates), np.zeros((8, 39))
    if isinstance(made, AidedEngine):
        nothing = np.zeros((8, len(aided()[0].sources)))
        linear = simulate_aided(made.tables, nothing, 0, index, made.own, given).linear
    else:
        linear = simulate_given(made.tables, nothing, given.added).linear
    rows = made.noise.rows(tuple(range(9)))
    expected, sigma = np.einsum("nz,oz->no", normals, rows), np.sqrt(np.sum(rows**2, axis=1))
    np.testing.assert_allclose(linear / sigma, expected / sigma, rtol=0.0, atol=ROUNDING)


def test_noise_that_is_not_given_is_as_random_as_under_the_condition():
    """Chi-squared of the other outputs' linear errors, given one, at a false-alarm rate of 1e-4."""
    _, made = free()
    outputs, count = (0,), 200
    noise = made.noise
    met = made.conditional_noise(outputs).conditions.met(noise.draw(11, np.arange(count)), np.zeros((count, 1)))
    rows = noise.rows(tuple(range(9)))
    linear, total = np.einsum("nz,oz->no", met, rows), np.einsum("iz,jz->ij", rows, rows)
    left = (total - np.outer(total[0], total[0]) / total[0, 0])[1:, 1:]
    square = float(np.einsum("ni,ij,nj->", linear[:, 1:], np.linalg.inv(left), linear[:, 1:]))
    low, high = stats.chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 8 * count)
    assert low < square < high
