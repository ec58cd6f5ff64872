"""Tests and bounds on plain arrays: published values, identities, degenerate samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from mcnav.statistics import chi_square, mean_square, order_statistics, power, proportions, shape
from mcnav.statistics.covariance_tests import covariance_likelihood_ratio
from mcnav.statistics.estimates import Estimate, blocked_mean, blocked_means, summed_mean
from mcnav.statistics.hotelling import hotelling
from mcnav.statistics.hypothesis_test import HypothesisTest
from mcnav.statistics.mardia import mardia
from mcnav.statistics.order_statistics import RankedSizes
from mcnav.statistics.whitening import leaves_range, whitening

COVARIANCE = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 1.0]])
SINGULAR = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]])


def _normal(count: int, covariance: np.ndarray, seed: int = 1) -> np.ndarray:
    values, vectors = np.linalg.eigh(covariance)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.random.default_rng(seed).standard_normal((count, len(covariance))) @ factor.T


@pytest.mark.parametrize(
    ("quantile", "confidence", "exceedances", "samples"),
    [
        (0.99, 0.90, 0, 230),
        (0.9973, 0.90, 0, 852),
        (0.99865, 0.90, 0, 1705),
        (0.95, 0.95, 0, 59),  # Wilks, 1941
        (0.95, 0.95, 1, 93),
        (0.95, 0.95, 2, 124),
        (0.90, 0.95, 0, 29),
        (0.5, 0.5, 0, 1),
    ],
)
def test_published_sample_sizes(quantile: float, confidence: float, exceedances: int, samples: int) -> None:
    """No fewer samples do, and with so many the rank is the one that leaves just those exceedances."""
    assert order_statistics.upper_rank(samples, quantile, confidence) == samples - exceedances
    fewer = order_statistics.upper_rank(samples - 1, quantile, confidence)
    assert fewer is None or fewer > samples - 1 - exceedances


def test_ranks_are_the_smallest_that_hold() -> None:
    for count in (10, 100, 999, 20_000):
        for quantile in (0.05, 0.5, 0.9, 0.9973):
            rank = order_statistics.upper_rank(count, quantile, 0.95)
            if rank is None:
                assert stats.binom.cdf(count - 1, count, quantile) < 0.95
            else:
                assert stats.binom.cdf(rank - 1, count, quantile) >= 0.95
                assert stats.binom.cdf(rank - 2, count, quantile) < 0.95


def test_bounds_mirror_each_other() -> None:
    values = np.random.default_rng(5).standard_normal(500)
    ranked, mirrored = RankedSizes.of(values), RankedSizes.of(-values)
    lower, upper = ranked.bounds(0.9, 0.95)
    assert mirrored.bounds(1.0 - 0.9, 0.95) == (-upper, -lower)
    assert lower < np.quantile(values, 0.9) < upper
    assert ranked.estimate(0.9) == pytest.approx(np.quantile(values, 0.9), rel=1e-14)


def test_too_few_samples_bound_nothing() -> None:
    for values in (np.array([1.0]), np.array([])):
        assert RankedSizes.of(values).bounds(0.5, 0.95) == (0.0, np.inf)
    with pytest.raises(ValueError, match="quantile must lie between 0 and 1; got 1"):
        order_statistics.upper_rank(10, 1.0, 0.9)


def test_likelihood_ratio_of_the_covariance_itself_is_zero() -> None:
    found = covariance_likelihood_ratio(COVARIANCE, 50, COVARIANCE)
    assert found is not None
    assert (found.rank, found.degrees_of_freedom) == (3, (6.0,))
    assert found.statistic == pytest.approx(0.0, abs=1e-12)
    assert found.p_value == pytest.approx(1.0)


def test_likelihood_ratio_does_not_know_units() -> None:
    """Metres beside microradians, and combinations of them: the statistic is invariant."""
    sample = np.cov(_normal(80, COVARIANCE).T)
    change = np.array([[1e6, 0.0, 0.0], [0.0, 1e-6, 0.0], [3.0, 0.0, 1.0]])
    one = covariance_likelihood_ratio(sample, 80, COVARIANCE)
    other = covariance_likelihood_ratio(change @ sample @ change.T, 80, change @ COVARIANCE @ change.T)
    assert one is not None
    assert other is not None
    assert other.statistic == pytest.approx(one.statistic, rel=1e-6)


def test_likelihood_ratio_in_one_dimension_is_the_chi_square_tests() -> None:
    """A variance twice too large with 100 samples is as significant as by the exact chi-square of the variance."""
    found = covariance_likelihood_ratio(np.array([[2.0]]), 100, np.array([[1.0]]))
    assert found is not None
    exact = 2.0 * stats.chi2.sf(99 * 2.0, 99)
    assert 0.2 < found.p_value / exact < 5.0


def test_singular_covariances_are_tested_in_their_range() -> None:
    values = _normal(200, SINGULAR)
    found = covariance_likelihood_ratio(np.cov(values.T), 200, SINGULAR)
    assert found is not None
    assert (found.rank, found.degrees_of_freedom) == (1, (1.0,))
    assert found.p_value > 1e-6
    for axis in (1, 2):
        outside = values.copy()
        outside[:, axis] += 0.01 * np.random.default_rng(2).standard_normal(200)
        assert leaves_range(whitening(SINGULAR), SINGULAR, np.cov(outside.T))
        certain = covariance_likelihood_ratio(np.cov(outside.T), 200, SINGULAR)
        assert certain is not None
        assert (certain.statistic, certain.p_value) == (np.inf, 0.0)


def test_samples_without_dispersion_in_a_direction_are_certain() -> None:
    """Their determinant is zero, exactly or by rounding."""
    for sample in (np.diag([0.0, 1.0]), np.diag([1.0, 0.0]), np.full((2, 2), 0.1)):
        found = covariance_likelihood_ratio(sample, 10, np.eye(2))
        assert found is not None
        assert (found.statistic, found.p_value) == (np.inf, 0.0)


def _zero_mean(values: np.ndarray) -> HypothesisTest | None:
    return hotelling(len(values), values.mean(axis=0), np.atleast_2d(np.cov(values.T)))


def test_nothing_to_test() -> None:
    zero = np.zeros((2, 2))
    assert covariance_likelihood_ratio(zero, 10, zero) is None
    assert covariance_likelihood_ratio(np.eye(2), 2, np.eye(2)) is None
    assert hotelling(1, np.zeros(2), np.zeros((2, 2))) is None
    assert _zero_mean(_normal(3, COVARIANCE)) is None
    assert mardia(np.zeros((10, 2))) is None
    assert mardia(_normal(4, COVARIANCE)) is None
    assert chi_square.distribution_test(np.array([]), 4) is None


def test_hotelling_in_one_dimension_is_students_t() -> None:
    values = _normal(30, np.eye(1)) + 0.3
    found = _zero_mean(values)
    expected = stats.ttest_1samp(values[:, 0], 0.0)
    assert found is not None
    assert found.statistic == pytest.approx(expected.statistic**2, rel=1e-12)
    assert found.p_value == pytest.approx(expected.pvalue, rel=1e-10)


def test_hotelling_in_a_singular_range() -> None:
    values = _normal(100, SINGULAR)
    within = _zero_mean(values @ whitening(SINGULAR).matrix)
    own = _zero_mean(values)
    assert within is not None
    assert own is not None
    assert within.rank == own.rank == 1
    assert within.statistic == pytest.approx(own.statistic, rel=1e-9)
    off = _zero_mean(values + np.array([0.0, 0.0, 0.1]))
    assert off is not None
    assert (off.statistic, off.p_value) == (np.inf, 0.0)
    still = _zero_mean(np.zeros((20, 2)))
    assert still is not None
    assert still.p_value == 1.0


def test_mardia_does_not_know_units() -> None:
    values = _normal(300, COVARIANCE) ** 3
    change = np.array([[1e5, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1e-3]])
    one, other = mardia(values), mardia(values @ change.T)
    assert one is not None
    assert other is not None
    assert (other.skewness, other.kurtosis) == pytest.approx((one.skewness, one.kurtosis), rel=1e-5)
    assert one.skewness_test.p_value < 1e-10
    assert one.kurtosis_test.p_value < 1e-10


def test_mardia_in_one_dimension() -> None:
    values = np.random.default_rng(3).exponential(size=(500, 1))
    found = mardia(values)
    assert found is not None
    assert found.skewness == pytest.approx(stats.skew(values[:, 0]) ** 2, rel=1e-12)
    assert found.kurtosis == pytest.approx(stats.kurtosis(values[:, 0], fisher=False), rel=1e-12)


def test_kurtosis_of_few_normal_samples_has_the_stated_variance() -> None:
    """Of ten samples in two dimensions; the variance of 8,000 kurtoses, of excess 3, errs by 2.5 %: five times that."""
    generator = np.random.default_rng(12)
    found = [mardia(generator.standard_normal((10, 2))) for _ in range(8_000)]
    statistics = np.array([each.kurtosis_test.statistic for each in found if each is not None])
    assert len(statistics) == len(found)
    assert statistics.mean() == pytest.approx(0.0, abs=5.0 / np.sqrt(len(found)))
    assert statistics.var() == pytest.approx(1.0, abs=5.0 * 0.025)


def _shape(values: np.ndarray) -> tuple[Estimate, Estimate]:
    """Skewness and excess kurtosis of independent samples."""
    return shape.shape_of_sums(shape.power_sums(values, np.arange(len(values))), np.ones(len(values)))


def test_shape_of_a_constant_is_zero() -> None:
    for found in _shape(np.full(50, 3.0)):
        assert (found.value, found.standard_error, found.degrees_of_freedom) == (0.0, 0.0, 49.0)


def test_shape_has_the_normals_error_for_normal_samples() -> None:
    """The influence function's error is the textbook one, within its own scatter (a tenth at 20,000 samples)."""
    n = 20_000
    exact = (  # Fisher, 1930
        np.sqrt(6.0 * (n - 2) / ((n + 1.0) * (n + 3))),
        np.sqrt(24.0 * n * (n - 2.0) * (n - 3) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5))),
    )
    found = _shape(np.random.default_rng(3).standard_normal(n))
    for estimate, error in zip(found, exact, strict=True):
        assert estimate.standard_error == pytest.approx(error, rel=0.1)
        assert abs(estimate.value) < 5.0 * error


def test_intervals_of_mean_squares() -> None:
    """Bounds of mean NEES to the digits of the check values; intervals turn them around; shares are binomial."""
    assert mean_square.mean_square_bounds(15.0, np.array(1_500.0), 0.95) == pytest.approx([13.9456, 16.0923], abs=5e-5)
    assert mean_square.mean_square_bounds(9.0, np.array(450.0), 0.95) == pytest.approx([7.8624, 10.2134], abs=5e-5)
    low, high = mean_square.mean_square_bounds(1.0, np.array(300.0), 0.9)
    matched = np.sqrt(2.0 / 300.0)  # relative standard error of matched components; a smaller one changes nothing
    for error in (0.0, 0.5 * matched):
        found = mean_square.mean_square_intervals(
            np.array(4.0), np.array(4.0 * error), np.array(100), np.array(300), 0.9
        )
        assert found == pytest.approx([4.0 / high, 4.0 / low], rel=1e-12)
    wider = mean_square.mean_square_intervals(np.array(4.0), np.array(8.0 * matched), np.array(100), np.array(300), 0.9)
    assert wider[0] < 4.0 / high
    assert wider[1] > 4.0 / low
    few = mean_square.mean_square_intervals(np.array(4.0), np.array(1.0), np.array(19), np.array(57), 0.9)
    assert few.tolist() == [0.0, np.inf]
    assert mean_square.share_intervals(np.array(0.3), np.array(50), 0.95) == pytest.approx(
        proportions.probability_interval(15, 50, 0.95), rel=1e-12
    )
    count, probability = 400, 0.6827
    inside = mean_square.share_bounds(probability, count, 0.95)
    assert inside == pytest.approx(np.array(stats.binom(count, probability).interval(0.95)) / count, rel=1e-12)


def test_coverage_of_intervals_of_mean_squares() -> None:
    """2,000 sets of 50 sums of squares, matched and of variances 4, 1, 1: 95 % within 1.5 % and the binomial error."""
    generator, sets = np.random.default_rng(8), 2_000
    for variances in ([1.0, 1.0, 1.0], [4.0, 1.0, 1.0]):
        sums = generator.standard_normal((sets, 50, 3)) ** 2 @ np.array(variances)
        mean, error = sums.mean(axis=1), sums.std(axis=1, ddof=1) / np.sqrt(50)
        found = mean_square.mean_square_intervals(mean, error, np.array(50), np.array(150), 0.95)
        covered = np.mean((found[:, 0] <= sum(variances)) & (sum(variances) <= found[:, 1]))
        assert covered > 0.95 - 0.015 - 3.0 * np.sqrt(0.05 * 0.95 / sets)


def test_a_mean_of_nothing_is_unknown() -> None:
    found = summed_mean(np.zeros(3), np.zeros(3))
    assert np.isnan(found.value)
    assert (found.standard_error, found.degrees_of_freedom) == (np.inf, 0.0)


def test_power_of_a_ratio() -> None:
    """The textbook's two-sigma and a bit: at 95 % and 90 % power 3.24 standard errors; samples by the root law."""
    error = np.sqrt(0.5 / 10_000)
    found = power.detectable_ratio(error, 1e6, 0.95)
    assert np.log1p(found) == pytest.approx(3.2415 * error, rel=1e-4)
    assert power.samples_to_detect(found, error, 10_000, 0.95) == pytest.approx(10_000, rel=1e-4)
    assert power.detectable_ratio(np.inf, 5, 0.95) == power.detectable_ratio(error, 0.5, 0.95) == np.inf
    assert power.detectable_ratio(0.0, 5, 0.95) == 0.0
    with pytest.raises(ValueError, match="departure must be positive"):
        power.samples_to_detect(0.0, error, 100, 0.95)


def test_probability_bounds_at_their_ends() -> None:
    assert proportions.probability_interval(0, 10, 0.9) == (0.0, pytest.approx(1.0 - 0.05**0.1))
    assert proportions.probability_interval(10, 10, 0.9) == (pytest.approx(0.05**0.1), 1.0)
    assert proportions.probability_interval(0, 0, 0.9) == (0.0, 1.0)
    with pytest.raises(ValueError, match="got 3 of 2"):
        proportions.lower_probability(3, 2, 0.9)


def test_mean_of_chi_squares() -> None:
    low, high = chi_square.mean_interval(1000, 4, 0.95)
    assert stats.chi2.cdf(high * 1000, 4000) - stats.chi2.cdf(low * 1000, 4000) == pytest.approx(0.95)


def test_hall_undoes_his_transformation() -> None:
    """g(T) = T + a T^2 / 3 + a^2 T^3 / 27 + a / 6 at the ends of the interval is Student's quantile."""
    found = Estimate(2.0, 0.5, 40.0, 0.3)
    quantile = stats.t.isf(0.025, 40.0)
    for reach, expected in zip(found.reach_of_skewness(0.95), (quantile, -quantile), strict=True):
        t = np.sign(expected) * reach / 0.5
        assert t + 0.3 * t**2 / 3.0 + 0.09 * t**3 / 27.0 + 0.05 == pytest.approx(expected, rel=1e-12)


def test_intervals_widen_to_the_side_of_the_skewness() -> None:
    half = Estimate(2.0, 0.5, 40.0).half_width(0.95)
    for asymmetry, sides in ((0.0, (1.0, 1.0)), (0.3, (1.0, 1.37)), (-0.3, (1.37, 1.0))):
        found = Estimate(2.0, 0.5, 40.0, asymmetry)
        low, high = found.interval(0.95)
        assert ((2.0 - low) / half, (high - 2.0) / half) == pytest.approx(sides, abs=0.005)
        assert found.reach(0.95) == pytest.approx(max(2.0 - low, high - 2.0), rel=1e-14)
    assert Estimate(2.0, math.inf, 0.0).interval(0.95) == (-math.inf, math.inf)


def test_asymmetry_of_blocks() -> None:
    """The skewness of single samples over the root of their number; none without dispersion."""
    values = np.random.default_rng(4).gamma(2.0, size=500)
    found = blocked_mean(values, np.arange(500))
    assert found.asymmetry == pytest.approx(stats.skew(values) / np.sqrt(500.0), rel=1e-12)
    assert blocked_mean(np.ones(50), np.arange(50)).asymmetry == 0.0


@pytest.mark.parametrize("blocks", [np.arange(60), np.repeat(np.arange(6), 10), np.repeat([0, 1], [59, 1])])
@pytest.mark.parametrize("fewest", [2, 4])
def test_means_of_columns_are_those_of_each(blocks: np.ndarray, fewest: int) -> None:
    """To rounding: sums of 60 terms in another order."""
    values = np.random.default_rng(7).normal(3.0, 2.0, (60, 5))
    columns = blocked_means(values, blocks, fewest)
    single = [blocked_mean(column, blocks, fewest) for column in values.T]
    np.testing.assert_allclose(columns.values, [mean.value for mean in single], rtol=60 * np.finfo(float).eps)
    np.testing.assert_allclose(columns.standard_errors, [mean.standard_error for mean in single], rtol=1e-12)
    assert {mean.degrees_of_freedom for mean in single} == {columns.degrees_of_freedom}


def test_shape_of_dispersion_in_one_block_has_no_error() -> None:
    """Without that block there is no dispersion, so that the jackknife has no estimate."""
    values = np.zeros(50)
    values[7] = 1.0
    skewness, kurtosis = shape.shape_of_sums(shape.power_sums(values, np.arange(50)), np.ones(50))
    assert np.isfinite([skewness.value, kurtosis.value]).all()
    assert min(skewness.standard_error, kurtosis.standard_error) > 1e6  # infinite, but for rounding
