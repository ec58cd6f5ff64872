"""The ensemble engine of the three-dimensional navigator: against the reference engine, and against linear covariance.

The engines share no equation: the ensemble carries deviations in inertial axes over shared tables, the reference
integrates the indicated state in earth-fixed axes at the instruments' rate, with another formula for gravity.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.engine import Engine
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.runner.chunks import simulate_batch
from mcnav.systems.ins.ensemble.free import simulate_given, tabulate
from mcnav.systems.ins.imu.fine_noise import draw_noise
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.imu.linear_noise import respond_from_rest
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.reference.mechanization import Mechanization, longest_step
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.truth.trajectory import Platform
from tests.flights import flight

DEG_PER_HOUR = np.radians(1.0) / 3600.0
MICRO_G = 9.80665e-6

SIZES = {
    "position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 3e-4, "gyro_bias": 0.01 * DEG_PER_HOUR,
    "gyro_scale": 2e-5, "gyro_misalignment": 2e-5, "gyro_g": 1e-3 * DEG_PER_HOUR / 9.80665,
    "accelerometer_bias": 50.0 * MICRO_G, "accelerometer_scale": 1e-4, "accelerometer_misalignment": 1e-4,
    "accelerometer_non": 1e-6,
}  # fmt: skip
SIGMAS = np.array([next(size for kind, size in SIZES.items() if name.startswith(kind)) for name in CONSTANTS])

WALK = Imu(Noise(random_walk=np.full(3, 0.002 * np.radians(1.0) / 60.0)), Noise(random_walk=np.full(3, 0.0118 / 60.0)))
FULL = Imu(
    Noise(
        WALK.gyro.random_walk, np.full(3, 0.003 * DEG_PER_HOUR), np.full(3, 3600.0), np.full(3, 1e-11),
        np.full(3, 5e-6), np.full(3, 0.1),
    ),
    Noise(
        WALK.accelerometer.random_walk, np.full(3, 5.0 * MICRO_G), np.full(3, 600.0), np.full(3, 1e-8),
        np.full(3, 1e-3), np.full(3, 0.1),
    ),
)  # fmt: skip
COUNTED = Imu(
    Noise(quantization=np.full(3, 2e-7), quantization_interval=np.full(3, 0.02)),
    Noise(quantization=np.full(3, 1e-3), quantization_interval=np.full(3, 0.05)),
)
"""Nothing but quantization: its coning, which the ensemble leaves out, is Q sqrt(n) / 2 of the sigma in n readings."""

DRAWS = 67
"""On each platform: 201 in all."""


def navigation(platform: Platform = "strapdown", imu: Imu | None = None, end: float = 1500.0) -> Navigation:
    return Navigation(flight(1.0), platform, 300.0, end, imu or Imu())


@lru_cache
def engine(platform: Platform = "strapdown", noisy: bool = False) -> Engine:
    made = Ins(navigation(platform, FULL if noisy else None)).engine("ensemble", draws(64))
    return made


def draws(count: int) -> Array:
    return np.random.default_rng(20261122).standard_normal((count, len(CONSTANTS))) * SIGMAS


@pytest.mark.parametrize("platform", ["strapdown", "inertial", "level"])
def test_engines_agree_on_constant_errors(platform: Platform) -> None:
    """Through climb and turn, to 1e-5 of each output's linear sigma at every epoch; the steps are refined to 3e-6."""
    errors = draws(DRAWS)
    scenario = Ins(navigation(platform))
    own = engine(platform).simulate(Batch(np.arange(DRAWS), errors, 0)).history
    reference = scenario.engine("reference", errors)
    other = reference.simulate(Batch(np.arange(DRAWS), errors, 0)).history
    assert own is not None
    assert other is not None
    partials = scenario.linear_over_time(61).partials
    sigma = np.sqrt(np.einsum("mij,j->mi", partials**2, SIGMAS**2))
    assert (np.abs(own - other)[:, 1:] / sigma[1:]).max() < 1e-5


SPHERE = {"radius": "6378140 m", "gravitational_parameter": "3.986135e14 m^3/s^2", "rotation_rate": "0 rad/s"}
START = {"latitude": "60 deg", "longitude": "20 deg", "altitude": "3 km", "speed": "150 m/s"}
TRAJECTORIES: dict[str, dict[str, Any]] = {
    "reentry": {"trajectory": {"reentry": 4}, "platform": "inertial", "earth": SPHERE},
    "turns": {
        "trajectory": {
            "rate": "2 Hz",
            "start": START,
            "segments": [{"turn": "180 deg"}, {"climb": "2 km"}, {"turn": "-270 deg", "bank": "40 deg"}],
        }
    },
    "boost": {
        "trajectory": {
            "boost": {
                **{"latitude": "28.5 deg", "longitude": "-80.5 deg", "azimuth": "90 deg", "coast": "60 s"},
                "stages": [
                    {"acceleration": "13 m/s^2", "last": "35 m/s^2", "burn": "120 s"},
                    {"acceleration": "12 m/s^2", "last": "30 m/s^2", "burn": "150 s", "pause": "3 s"},
                ],
            }
        }
    },
}


@pytest.mark.parametrize("kind", TRAJECTORIES)
def test_engines_agree_on_other_trajectories(kind: str) -> None:
    """A reentry with an inertial platform, steep turns, a boost: to 1e-5 of each linear sigma at every epoch."""
    scenario = parse_campaign({"scenario": {"type": "ins", **TRAJECTORIES[kind]}, "errors": {}}, "a.toml", "a").scenario
    assert isinstance(scenario, Ins)
    errors = draws(DRAWS)
    made = [scenario.engine(name, errors[:64]) for name in scenario.engines]
    histories = [each.simulate(Batch(np.arange(DRAWS), errors, 0)).history for each in made]
    own, other = (history for history in histories if history is not None)
    sigma = np.sqrt(np.einsum("mij,j->mi", scenario.linear_over_time(61).partials ** 2, SIGMAS**2))
    assert (np.abs(own - other)[:, 1:] / sigma[1:]).max() < 1e-5


@pytest.mark.parametrize("imu", [WALK, COUNTED], ids=["random walks", "quantization"])
def test_engines_agree_on_the_same_noise(imu: Imu) -> None:
    """Fed with one sequence of fine noise, to 1e-4 of each output's linear sigma.

    Each step of the ensemble takes what the fine noise within it adds to the linear system from rest.
    """
    where = navigation(imu=imu, end=900.0)
    times = np.linspace(where.start, where.end, 241)
    fine = Mechanization(where.truth, where.platform, where.start, where.end, np.array([where.end]), longest_step(imu))
    tables = tabulate(
        where.truth, where.platform, Responses(where.truth, where.platform, times, imu), imu, np.array([240])
    )
    errors = draws(6)
    added, reference = [], []
    for row in range(len(errors)):
        gyro, accelerometer = draw_noise(imu, fine.step_times, 5, row)
        each = respond_from_rest(where.truth, where.platform, fine.step_times, times, gyro, accelerometer)
        added.append(np.pad(each, [(0, 0), (0, len(tables.sizes))]))  # no biases
        reference.append(fine.simulate(errors[row], gyro, accelerometer)[-1])
    found = simulate_given(tables, errors, np.array(added))
    linear = where.linear
    covariance = sum(linear.processes.values())[-1]  # type: ignore[index]
    sigma = np.sqrt(np.diag(covariance))
    assert (np.abs(found.values[:, 0] - np.array(reference)) / sigma).max() < 1e-4


def test_no_errors_give_exactly_zero() -> None:
    found = engine().simulate(Batch(np.arange(9), np.zeros((9, len(CONSTANTS))), 0))
    assert found.history is not None
    assert not found.history.any()
    assert found.linear_values is not None
    assert not found.linear_values.any()


def test_a_sample_has_the_same_bits_wherever_it_stands() -> None:
    """Alone, in another order, or beside others: values, linear values and histories."""
    errors, index = draws(37), np.arange(1_000, 1_037)
    whole = engine(noisy=True).simulate(Batch(index, errors, 3))
    order = np.random.default_rng(1).permutation(37)
    shuffled = engine(noisy=True).simulate(Batch(index[order], errors[order], 3))
    alone = engine(noisy=True).simulate(Batch(index[11:12], errors[11:12], 3))
    for name in ("values", "linear_values", "history"):
        np.testing.assert_array_equal(getattr(shuffled, name), getattr(whole, name)[order])
        np.testing.assert_array_equal(getattr(alone, name)[0], getattr(whole, name)[11])
    other = engine(noisy=True).simulate(Batch(index, errors, 4))
    assert not np.any(other.values == whole.values)


def test_samples_follow_the_linear_covariance() -> None:
    """Errors a thousand times smaller are linear: NEES of 2,000 samples at four epochs, at a false-alarm rate of 1e-4.

    The linear values of the same draws differ from the nonlinear ones by their second order alone.
    """
    scale, count = 1e-3, 2_000
    tiny = Imu(
        *(
            Noise(
                scale * each.random_walk,
                scale * each.instability,
                each.correlation_time,
                scale * each.rate_random_walk,
                scale * each.quantization,
                each.quantization_interval,
            )
            for each in (FULL.gyro, FULL.accelerometer)
        )
    )
    scenario = Ins(navigation(imu=tiny))
    errors = scale * np.random.default_rng(7).standard_normal((count, len(CONSTANTS))) * SIGMAS
    made = scenario.engine("ensemble", errors[:64])
    found = made.simulate(Batch(np.arange(count), errors, 11))
    assert found.history is not None
    known = scenario.linear_over_time(61)
    for epoch in (15, 30, 45, 60):
        spread = known.partials[epoch] * (scale * SIGMAS)
        covariance = spread @ spread.T + sum(each[epoch] for each in known.processes.values())
        sigma = np.sqrt(np.diag(covariance))
        whole = np.linalg.solve(covariance / np.outer(sigma, sigma), (found.history[:, epoch] / sigma).T).T
        nees = np.einsum("ni,ni->n", found.history[:, epoch] / sigma, whole)
        low, high = stats.chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 9 * count) / count
        assert low < nees.mean() < high
    final = known.partials[-1] * (scale * SIGMAS)
    sigma = np.sqrt(np.diag(final @ final.T + sum(each[-1] for each in known.processes.values())))
    assert found.linear_values is not None
    assert (np.abs(found.values - found.linear_values) / sigma).max() < 2e-3


def test_engines_agree_in_covariance_from_noise_of_their_own() -> None:
    """Each variance of 300 reference samples lies within the chi-square interval of the linear one, at 1e-4 each.

    Constant errors are zero, so that the noise alone is compared, and the two engines draw it independently.
    """
    count = 300
    scenario = Ins(navigation(imu=FULL, end=600.0))
    reference = scenario.engine("reference", np.zeros((2, len(CONSTANTS))))
    found = reference.simulate(Batch(np.arange(count), np.zeros((count, len(CONSTANTS))), 2))
    expected = np.diag(sum(each[-1] for each in scenario.linear_over_time(61).processes.values()))  # type: ignore[arg-type]
    low, high = stats.chi2.ppf([0.5e-4, 1.0 - 0.5e-4], count) / count
    for ratio in (found.values**2).mean(axis=0) / expected:
        assert low < ratio < high
    assert found.linear_values is not None
    gap = np.abs(found.values - found.linear_values).max(axis=0) / np.sqrt(expected)
    assert gap.max() < 1e-3  # second order of the noise; and the midpoint rule of the linear response


def test_a_sample_beyond_validity_fails_with_a_reason() -> None:
    errors = np.zeros((2, len(CONSTANTS)))
    errors[1, CONSTANTS.index("gyro_bias_x")] = 0.2
    found = engine().simulate(Batch(np.arange(2), errors, 0))
    assert sorted(found.failures) == [1]
    assert "reference engine" in str(found.failures[1])
    assert np.isnan(found.values[1]).all()
    assert np.isfinite(found.values[0]).all()


def test_samples_simulated_alone_keep_their_noise() -> None:
    """What an engine raises fails only the sample that causes it; the others have what they have together."""

    class Fragile:
        """The ensemble engine, which sample 3 breaks."""

        parallel, chunk, accuracy, epochs = "threads", 8, "", engine(noisy=True).epochs
        noisy, filter = True, None

        def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
            if 3 in batch.index:
                raise RuntimeError("broken")
            return engine(noisy=True).simulate(batch)

    batch = Batch(np.arange(8), draws(8), 3)
    whole, found = engine(noisy=True).simulate(batch), simulate_batch(Fragile(), None, 9, batch)
    assert list(found.failures) == [3]
    kept = [row for row in range(8) if row != 3]
    for name in ("values", "linear_values", "history"):
        np.testing.assert_array_equal(getattr(found, name)[kept], getattr(whole, name)[kept])
        assert np.isnan(getattr(found, name)[3]).all()
