"""Noise at fine steps: its covariance does not depend on how time is divided."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.fine_noise import SERIES_BELOW, _gauss_markov, _random_walk, draw_noise
from mcnav.systems.ins.imu.instruments import Imu, Noise

STEPS = np.concatenate([np.linspace(0.0, 50.0, 201), np.linspace(50.5, 600.0, 1100)])
"""Boundaries of steps of two lengths, s."""

FALSE_ALARM = 1e-4
"""Probability that a correct sample variance lies outside its interval."""


def covariance(step: tuple[Array, Array, Array]) -> Array:
    """Compute the covariance of the noise of a step's end and of its mean, shape (S, 2, 2)."""
    first, second, third = step[2].T
    return np.stack(
        [np.stack([first**2, first * second], -1), np.stack([first * second, second**2 + third**2], -1)], -1
    )


def test_variance_of_the_mean_is_continuous_where_the_series_ends() -> None:
    """Either side loses 1e-12, and the variance of the mean changes by 1e-9 between."""
    below, above = (covariance(_gauss_markov(np.array([SERIES_BELOW * (1.0 + e)])))[0, 1, 1] for e in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=2e-9 + 2e-12)


@pytest.mark.parametrize("x", [0.0, 1e-6, 1e-3, 0.07, 0.3, 2.0, 40.0])
@pytest.mark.parametrize("process", [_gauss_markov, _random_walk])
def test_two_steps_are_one(process: object, x: float) -> None:
    """The end and the mean over a step have the same covariance when the step is two halves; 1e-12 is lost in each."""
    one, half = process(np.array([2.0 * x])), process(np.array([x]))  # type: ignore[operator]
    decay, share = half[0][0], half[1][0]
    within = covariance(half)[0]
    carry = np.array([[decay, 0.0], [0.5 * share, 0.5]])  # of the first half's end and mean
    last = np.array([[1.0, 0.0], [0.0, 0.5]])
    together = carry @ within @ carry.T + last @ within @ last.T
    assert one[0][0] == pytest.approx(decay**2, rel=1e-14, abs=1e-300)
    assert one[1][0] == pytest.approx(0.5 * share * (1.0 + decay), rel=1e-14)
    np.testing.assert_allclose(covariance(one)[0], together, rtol=1e-11, atol=1e-300)


def angles(noise: Noise, count: int) -> Array:
    """Integrate the gyros' noise of some samples over all steps, shape (count, 3)."""
    imu = Imu(gyro=noise)
    return np.array([np.diff(STEPS) @ draw_noise(imu, STEPS, 7, index)[0] for index in range(count)])


def gauss_markov_angle(sigma: float, time: float, correlation_time: float) -> float:
    x = time / correlation_time
    return float(sigma * correlation_time * np.sqrt(2.0 * (x - 1.0 + np.exp(-x))))


@pytest.mark.parametrize(
    ("noise", "expected"),
    [
        (Noise(random_walk=np.radians([0.1, 0.1, 0.1]) / 60.0), np.radians(0.040825)),
        (
            Noise(instability=np.radians([1.0, 1.0, 1.0]) / 3600.0, correlation_time=np.full(3, 3600.0)),
            np.radians(0.162163),
        ),
        (
            Noise(instability=np.full(3, 1e-3), correlation_time=np.full(3, 20.0)),
            gauss_markov_angle(1e-3, 600.0, 20.0),
        ),
        (Noise(instability=np.full(3, 1e-3), correlation_time=np.full(3, np.inf)), 0.6),
        (Noise(rate_random_walk=np.full(3, 1e-6)), 1e-6 * np.sqrt(600.0**3 / 3.0)),
    ],
    ids=["angle random walk", "instability of 1 h", "instability of 20 s", "constant", "rate random walk"],
)
def test_growth_over_600_s(noise: Noise, expected: float) -> None:
    """Sigmas of the integral, the printed ones to half a unit of their last digit, which is far below the interval."""
    found = angles(noise, 500)
    low, high = stats.chi2(found.size).ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2]) / found.size
    assert low <= np.mean(found**2) / expected**2 <= high


def test_processes_have_streams_of_their_own() -> None:
    """A process is the same with and without the others, to the rounding of their sum."""
    white, walk = Noise(random_walk=np.array([1.0, 0.0, 2.0])), Noise(rate_random_walk=np.array([0.0, 3.0, 0.1]))
    both = Noise(random_walk=white.random_walk, rate_random_walk=walk.rate_random_walk)
    apart = [draw_noise(Imu(white, walk), STEPS, 5, 11), draw_noise(Imu(walk, white), STEPS, 5, 11)]
    together = draw_noise(Imu(both, both), STEPS, 5, 11)
    for instrument in range(2):
        expected = apart[0][instrument] + apart[1][instrument]
        np.testing.assert_allclose(together[instrument], expected, rtol=1e-14)


def test_samples_seeds_instruments_and_axes_differ() -> None:
    noise = Noise(random_walk=np.ones(3))
    drawn = [draw_noise(Imu(noise, noise), STEPS, seed, index) for seed, index in [(1, 2), (1, 3), (2, 2), (2, 1)]]
    columns = np.concatenate([each for pair in drawn for each in pair], axis=1)
    correlations = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    # normal with variance 1 / n: 276 pairs
    limit = stats.norm.isf(FALSE_ALARM / 276 / 2) / np.sqrt(len(columns))
    assert np.max(np.abs(correlations)) <= limit


def test_draws_are_repeatable() -> None:
    noise = Noise(np.ones(3), np.ones(3), np.full(3, 10.0), np.ones(3))
    first, again = (draw_noise(Imu(noise, noise), STEPS, 2**63, 2**40) for _ in range(2))
    assert all(np.array_equal(one, other) for one, other in zip(first, again, strict=True))
