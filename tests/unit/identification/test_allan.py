"""Allan deviation, resolution, several records, and the test of a trend."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.stats import binom

from mcnav import identify_noise
from mcnav.arrays.types import Array
from mcnav.identification.allan import LAGS, _freedom, allan_deviation, model_variance
from mcnav.identification.estimates import Estimate, relative_covariance
from mcnav.identification.fit import AxisFit, fit
from mcnav.identification.lattice import resolution
from mcnav.identification.likelihood import maximize
from mcnav.identification.processes import GAUSS_MARKOV, QUANTIZATION, RATE_RANDOM_WALK, WHITE, Grid, Model
from mcnav.identification.several import common_noise, repeatability
from mcnav.identification.spectrum import in_bands, transform
from mcnav.identification.statements import statements
from mcnav.identification.trend import ramp_coefficients, trend_p_value
from tests.calibration.static_records import TrueNoise, simulate_record

FALSE_ALARM = 1e-4
WALKING = Model((WHITE, RATE_RANDOM_WALK))


@pytest.mark.parametrize(
    ("model", "logs"),
    [
        (Model((WHITE,)), [0.3]),
        (Model((WHITE, RATE_RANDOM_WALK)), [0.3, -3.0]),
        (Model((WHITE, QUANTIZATION)), [0.3, 1.0]),
        (Model((WHITE, GAUSS_MARKOV)), [-2.0, 0.5, np.log(20.0)]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("size", [1, 8, 40])
def test_variances_of_models_are_those_of_their_spectra(model: Model, logs: list[float], size: int) -> None:
    """Half the variance of differences of neighbouring means, as an integral over the spectrum of a long record.

    What lies beyond both ends of the record is missing from a Gauss-Markov process, a share of 4 T/n = 4e-4 at low
    frequencies.
    """
    count = 200_000
    grid = Grid(1.0, count, np.arange(0.5, count))
    squared = 4.0 * np.sin(size * grid.half) ** 4 / (size * np.sin(grid.half)) ** 2
    integral = 0.5 * np.mean(squared * model.variances(grid, np.array(logs))[0])
    assert model_variance(model, np.array(logs), float(size)) == pytest.approx(integral, rel=3e-4)


def test_degrees_of_freedom_are_those_of_simulated_records() -> None:
    """Variance of the estimate over records: within the chi-square interval of 2,000, but for `FALSE_ALARM`."""
    rng, count, size = np.random.default_rng(3), 200, 20
    readings = rng.standard_normal((2_000, count))
    angles = np.cumsum(np.pad(readings, ((0, 0), (1, 0))), axis=1)
    differences = angles[:, 2 * size :] - 2.0 * angles[:, size:-size] + angles[:, : -2 * size]
    estimates = 0.5 * np.mean(differences**2, axis=1) / size**2
    measured = 2.0 * estimates.mean() ** 2 / estimates.var()
    # the positions that are looked at, an eighth of a cluster apart, lose some per cent
    assert _freedom(Model((WHITE,)), np.array([0.0]), 1.0, count, size) == pytest.approx(measured, rel=0.15)
    assert count < LAGS


def test_intervals_of_the_allan_deviation_hold_the_truth() -> None:
    true, hits, trials = TrueNoise(1.0, rate_random_walk=0.02), np.zeros(3), 60
    for seed in range(trials):
        readings = simulate_record(np.random.default_rng(seed), 5_000, 1.0, true)
        best = maximize(WALKING, in_bands(transform(readings, 1.0)), np.log([1.0, 0.02]))
        shown = allan_deviation(readings, 1.0, WALKING, best.logs, np.eye(2) * 1e-4)
        for place, time in enumerate((1.0, 10.0, 100.0)):
            k = int(np.argmin(np.abs(shown.times - time)))
            exact = np.sqrt(model_variance(WALKING, np.log([1.0, 0.02]), shown.times[k]))
            hits[place] += shown.low[k] <= exact <= shown.high[k]
    assert hits.min() >= binom.ppf(FALSE_ALARM, trials, 0.95)


def test_the_band_of_the_model_is_that_of_one_parameter() -> None:
    """Of white noise alone the band is the interval of N at all cluster times."""
    readings = np.random.default_rng(1).standard_normal(20_000)
    chosen = fit(transform(readings, 1.0)).chosen
    assert chosen.model == Model((WHITE,))
    shown = allan_deviation(readings, 1.0, chosen.model, chosen.best.logs, relative_covariance(chosen))
    (estimate,) = chosen.estimates()
    np.testing.assert_allclose(shown.model * np.sqrt(shown.times), estimate.value, rtol=1e-12)
    np.testing.assert_allclose(shown.model_high * np.sqrt(shown.times), estimate.high, rtol=1e-4)


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("step", [1e-6, 0.1, 3.3e-5])
def test_the_step_of_rounded_readings_is_found(step: float, single: bool) -> None:
    readings = step * np.round(3.0 * np.random.default_rng(2).standard_normal(5_000))
    stored = readings.astype(np.float32).astype(float) if single else readings
    assert resolution(stored) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("stored", [np.float32, np.float64])
def test_readings_that_hardly_repeat_have_no_step(stored: type) -> None:
    assert resolution(np.random.default_rng(2).standard_normal(5_000).astype(stored).astype(float)) is None


def records(noises: list[TrueNoise], counts: list[int]) -> list[Array]:
    return [simulate_record(np.random.default_rng(k), n, 1.0, one)
            for k, (one, n) in enumerate(zip(noises, counts, strict=True))]  # fmt: skip


def walking(fitted: AxisFit) -> Estimate:
    """Return the size of the random walk, where it is the only slow process."""
    (candidate,) = (each for each in fitted.candidates if each.model == WALKING)
    return candidate.estimates()[1]


def test_records_of_one_instrument_agree_and_tell_more_together() -> None:
    true = TrueNoise(1.0, rate_random_walk=0.002)
    fits = [identify_noise(each, 1.0).fitted for each in records([true] * 3, [20_000, 12_000, 15_000])]
    common = common_noise(fits)
    assert common.p_value > 0.01
    walk = walking(common.fitted)
    assert walk.low < 0.002 < walk.high
    assert all(walk.relative_sd < walking(alone).relative_sd for alone in fits)


def test_records_of_other_noise_do_not_agree() -> None:
    fits = [identify_noise(each, 1.0).fitted for each in records([TrueNoise(1.0), TrueNoise(1.1)], [20_000, 20_000])]
    assert common_noise(fits).p_value < 1e-6


def test_repeatability_is_a_standard_deviation_with_its_interval() -> None:
    """Of three means 1, 2, 3: 1, with sqrt(2/7.3778) and sqrt(2/0.050636) times it."""
    spread = repeatability(np.array([1.0, 2.0, 3.0]))
    assert (spread.value, spread.low, spread.high) == pytest.approx((1.0, 0.52066, 6.2847), rel=1e-4)


def test_what_is_not_in_the_model_has_a_bound() -> None:
    noise = identify_noise(np.random.default_rng(5).standard_normal(20_000), 1.0)
    stated = {each.name: each for each in statements(noise.fitted)}
    assert stated["random_walk"].value is not None
    for name in ("rate_random_walk", "quantization"):
        assert stated[name].value is None
        assert 0.0 < stated[name].high < 1.0
        assert stated[name].duration_wanted is not None
    assert stated["instability"].high == np.inf


def test_the_transform_of_a_ramp_is_known() -> None:
    ramp = np.arange(50.0) * 0.1
    np.testing.assert_allclose(ramp_coefficients(50, 0.1, 49), dct(ramp, type=2, norm="ortho")[1:], atol=1e-12)


def test_a_trend_is_rejected_as_often_as_stated_where_few_ordinates_are_left() -> None:
    """White noise with a walk that shows in two or three ordinates: by chi-square 9 to 13 of a hundred were."""
    true, trials, rejected = TrueNoise(1.0, rate_random_walk=0.0015), 40, 0
    for seed in range(trials):
        record = transform(simulate_record(np.random.default_rng(seed), 4_000, 1.0, true), 1.0)
        bands = in_bands(record)
        best = maximize(WALKING, bands, np.log([1.0, 0.0015]))
        rejected += trend_p_value(WALKING, bands, best, record)[0] < 0.05
    assert rejected <= binom.ppf(1.0 - FALSE_ALARM, trials, 0.05)
