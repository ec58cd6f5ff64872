"""Our tests and bounds against scipy's and OpenTURNS' where they have them."""

from __future__ import annotations

import numpy as np
import openturns as ot
import pytest
from scipy import stats

from mcnav.statistics import chi_square, order_statistics, proportions, shape


def test_probability_intervals_against_scipy() -> None:
    for hits, count in ((0, 7), (3, 7), (980, 1000), (1000, 1000)):
        expected = stats.binomtest(hits, count).proportion_ci(0.9, method="exact")
        assert proportions.probability_interval(hits, count, 0.9) == pytest.approx(tuple(expected), rel=1e-10)


def test_quantile_intervals_against_scipy() -> None:
    values = np.random.default_rng(1).standard_normal(400)
    for quantile in (0.1, 0.5, 0.9):
        expected = stats.quantile_test(values, p=quantile).confidence_interval(0.95)
        assert order_statistics.RankedSizes.of(values).bounds(quantile, 0.975) == (expected.low, expected.high)


def test_sample_sizes_against_openturns() -> None:
    """Wilks' method."""
    for quantile, confidence, exceedances in ((0.95, 0.95, 0), (0.99, 0.90, 0), (0.9973, 0.90, 1), (0.95, 0.99, 3)):
        expected = ot.Wilks.ComputeSampleSize(quantile, confidence, exceedances)
        assert order_statistics.upper_rank(expected, quantile, confidence) == expected - exceedances
        fewer = order_statistics.upper_rank(expected - 1, quantile, confidence)
        assert fewer is None or fewer > expected - 1 - exceedances


def test_kolmogorov_smirnov_against_scipy() -> None:
    values = np.random.default_rng(3).chisquare(4, 300) * 1.1
    found = chi_square.distribution_test(values, 4)
    expected = stats.kstest(values, "chi2", args=(4,))
    assert found is not None
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-9)
    assert found.p_value == pytest.approx(chi_square.kolmogorov_p_value(expected.statistic, 300), rel=1e-9)


@pytest.mark.parametrize("count", [100, 1_000, 10_000])
def test_kolmogorov_p_value_against_the_exact_one(count: int) -> None:
    for exact in (0.9, 0.5, 0.1, 0.01):
        found = chi_square.kolmogorov_p_value(stats.kstwo.isf(exact, count), count)
        assert found == pytest.approx(exact, rel=1.0 / count)


def test_shape_against_scipy() -> None:
    values = np.random.default_rng(4).exponential(size=900)
    skewness, kurtosis = shape.shape_of_sums(shape.power_sums(values, np.arange(900)), np.ones(900))
    assert skewness.value == pytest.approx(stats.skew(values), rel=1e-12)
    assert kurtosis.value == pytest.approx(stats.kurtosis(values), rel=1e-12)


def test_error_of_the_skewness_is_the_jackknifes() -> None:
    values = np.random.default_rng(4).chisquare(20, size=1500)
    left_out = np.array([stats.skew(np.delete(values, i)) for i in range(1500)])
    jackknife = np.sqrt(1499 / 1500 * np.sum((left_out - left_out.mean()) ** 2))
    skewness, _ = shape.shape_of_sums(shape.power_sums(values, np.arange(1500)), np.ones(1500))
    assert skewness.standard_error == pytest.approx(jackknife, rel=1e-9)
