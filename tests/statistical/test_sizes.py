"""Do the tests reject true hypotheses as often as they say, and do the bounds hold? Measured, with fixed seeds.

Each count of rejections is binomial; the bounds are what that allows at a false-alarm rate of one in a thousand,
widened by the stated slack where a test's distribution is asymptotic.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.statistics import order_statistics, proportions
from mcnav.statistics.chi_square import distribution_test
from mcnav.statistics.covariance_tests import covariance_likelihood_ratio
from mcnav.statistics.hotelling import hotelling
from mcnav.statistics.mardia import mardia
from mcnav.statistics.order_statistics import RankedSizes
from mcnav.statistics.whitening import whitening

TRIALS, FALSE_ALARM, LEVEL = 2_000, 1e-3, 0.05
FACTOR = np.array([[1.0, 0.0, 0.0, 0.0], [0.99, 0.1, 0.0, 0.0], [0.0, 0.5, 1.0, 0.0], [0.2, 0.1, 0.3, 0.5]])
COVARIANCE = FACTOR @ FACTOR.T


def _within(hits: int, probability: float, slack: float = 0.0) -> bool:
    """Whether so many hits are likely when their probability is within the slack of the stated one."""
    high = stats.binom.sf(hits - 1, TRIALS, probability + slack)
    low = stats.binom.cdf(hits, TRIALS, probability - slack)
    return bool(high > FALSE_ALARM and low > FALSE_ALARM)


@pytest.mark.parametrize("count", [12, 300])
def test_whole_matrix_tests_keep_their_size(count: int) -> None:
    """Bartlett's correction holds the likelihood ratio at its level with 12 samples; plain it rejects too often."""
    generator = np.random.default_rng(11)
    rejected = dict.fromkeys(("covariance", "mean", "nees", "skewness", "kurtosis"), 0)
    uncorrected = 0
    for _ in range(TRIALS):
        values = generator.standard_normal((count, 4)) @ FACTOR.T
        sample = np.cov(values.T)
        likelihood = covariance_likelihood_ratio(sample, count, COVARIANCE)
        normality = mardia(values)
        given = whitening(COVARIANCE)
        found = {
            "covariance": likelihood,
            "mean": hotelling(count, values.mean(axis=0), sample),
            "nees": distribution_test(np.sum((values @ given.matrix) ** 2, axis=1), 4),
            "skewness": normality.skewness_test if normality else None,
            "kurtosis": normality.kurtosis_test if normality else None,
        }
        for name, test in found.items():
            assert test is not None
            rejected[name] += test.p_value < LEVEL
        assert likelihood is not None
        correction = 1.0 - 43.0 / (6.0 * (count - 1.0) * 5.0)
        uncorrected += stats.chi2.sf(likelihood.statistic / correction, 10) < LEVEL
    for name, slack in (("covariance", 0.0), ("mean", 0.0), ("nees", 0.005), ("skewness", 0.025), ("kurtosis", 0.015)):
        assert _within(rejected[name], LEVEL, slack), (name, rejected[name])
    if count == 12:
        assert not _within(uncorrected, LEVEL), uncorrected


@pytest.mark.parametrize("quantile", [0.5, 0.9, 0.99])
def test_bounds_of_a_quantile_hold_for_any_distribution(quantile: float) -> None:
    """At least as often as stated, and no more often than the next rank would make them."""
    generator = np.random.default_rng(12)
    count, confidence = 400, 0.9
    truth = stats.lognorm(1.0).ppf(quantile)
    missed = sum(
        RankedSizes.of(np.exp(generator.standard_normal(count))).bounds(quantile, confidence)[1] < truth
        for _ in range(TRIALS)
    )
    rank = order_statistics.upper_rank(count, quantile, confidence)
    assert _within(missed, float(stats.binom.sf((rank or 0) - 1, count, quantile)))
    assert stats.binom.sf(missed - 1, TRIALS, 1.0 - confidence) > FALSE_ALARM


def test_probability_bounds_are_never_less_sure_than_stated() -> None:
    for probability in (0.003, 0.3, 0.97):
        counts = np.random.default_rng(13).binomial(300, probability, TRIALS)
        missed = sum(proportions.upper_probability(int(hits), 300, 0.95) < probability for hits in counts)
        assert stats.binom.sf(missed - 1, TRIALS, 0.05) > FALSE_ALARM
