"""Do the intervals cover as often as they say? Measured, with fixed seeds, on a system whose truth is known.

A system ``y = x_1 + c (x_2^2 - 1)`` with independent normal errors has the variance ``1 + 2 c^2`` exactly; linear
analysis says 1. Each campaign is one trial, and the number of intervals that miss is binomial. Intervals from finitely
many blocks are asymptotic: `SLACK` is how far from nominal they may be at the smallest campaigns that decide anything,
and the bounds add what the trials' own scatter allows at a false-alarm rate of one in a thousand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.contract.engine import without_noise
from mcnav.sampler.designs import DESIGNS, SamplingDesign, standard_normals
from mcnav.statistics.correlation import fisher_interval
from mcnav.statistics.estimates import summed_mean

CURVATURE = 0.2
TRUE_RATIO = np.sqrt(1.0 + 2.0 * CURVATURE**2)
SMALLEST = {"random": 100, "antithetic": 2_000, "latin-hypercube": 256, "sobol": 256}
"""Samples at which each design just has the fewest blocks that decide."""

TRIALS = 600
FALSE_ALARM = 1e-3
SLACK = 0.02
LINEAR = Model(np.array([[1.0, 0.0]]), np.zeros(1), np.zeros(2), np.eye(2))


@pytest.mark.parametrize("design", DESIGNS)
def test_coverage_where_verdicts_begin(design: str) -> None:
    """At 90 % for both statements together (one output and the matrix) each interval holds at 95 %."""
    count = SMALLEST[design]
    laid = SamplingDesign.of(design, count)
    assert laid.blocks(np.arange(count))[-1] + 1 == laid.fewest_blocks
    missed = {"paired": 0, "plain": 0}
    for trial in range(TRIALS):
        errors = standard_normals(design, trial, count, 0, count, 2)
        outcomes = errors[:, :1] + CURVATURE * (errors[:, 1:] ** 2 - 1.0)
        output = compare(LINEAR, errors, outcomes, Criterion(0.05, 0.90), laid).outputs[0]
        for name, judged in (("paired", output.paired), ("plain", output.plain)):
            low, high = judged.interval or (0.0, 0.0)
            missed[name] += not low <= TRUE_RATIO <= high
    for name, misses in missed.items():
        assert stats.binom.sf(misses - 1, TRIALS, 0.05 + SLACK) > FALSE_ALARM, (name, misses)
        assert stats.binom.cdf(misses, TRIALS, 0.05 - SLACK) > FALSE_ALARM, (name, misses)


def test_the_paired_estimate_is_far_sharper_on_trajectory_4() -> None:
    """At the report's errors and a thousand samples its interval is less than a tenth of the plain one."""
    from tests.conftest import campaign

    run = campaign(4, samples=1000)
    errors = run.errors.draw("random", 1, 1000, 0, 1000)
    outcomes = without_noise(run.scenario.engine("ensemble", errors[:64]))(errors).values
    linear = run.scenario.linear().end
    model = Model(linear.partials, linear.nominal, run.errors.mean, run.errors.covariance)
    for output in compare(model, errors, outcomes, Criterion()).outputs:
        assert output.paired.interval is not None
        assert output.plain.interval is not None
        assert np.ptp(output.paired.interval) < 0.1 * np.ptp(output.plain.interval)


@pytest.mark.parametrize(("multiple", "expected"), [(1.0, 4.01), (3.0, 4.12), (10.0, 5.36)])
def test_nees_of_trajectory_1(multiple: float, expected: float) -> None:
    """Known values from a million samples; within three of this run's standard errors and half a printed digit."""
    from tests.conftest import campaign

    count = 40_000
    run = campaign(1, multiple, samples=count)
    errors = run.errors.draw("random", 2, count, 0, count)
    outcomes = without_noise(run.scenario.engine("ensemble", errors[:64]))(errors).values
    linear = run.scenario.linear().end
    model = Model(linear.partials, linear.nominal, run.errors.mean, run.errors.covariance)
    found = compare(model, errors, outcomes, Criterion()).ellipsoid
    assert found is not None
    assert found.nees_paired.value == pytest.approx(expected, abs=3.0 * found.nees_paired.standard_error + 0.005)


def test_skewness_of_trajectory_7() -> None:
    """At ten times the report's errors range rate is skewed by about 1.57; within five standard errors of that."""
    from tests.conftest import campaign

    count = 40_000
    run = campaign(7, 10.0, samples=count)
    errors = run.errors.draw("random", 3, count, 0, count)
    outcomes = without_noise(run.scenario.engine("ensemble", errors[:64]))(errors).values
    linear = run.scenario.linear().end
    model = Model(linear.partials, linear.nominal, run.errors.mean, run.errors.covariance)
    found = compare(model, errors, outcomes, Criterion()).joint
    assert found is not None
    assert found.skewness[3].value == pytest.approx(1.57, abs=5.0 * found.skewness[3].standard_error + 0.005)
    assert found.normality is not None
    assert found.normality.skewness_test.p_value < 1e-10


@pytest.mark.parametrize(("degrees", "rate"), [(None, 0.056), (5.0, 0.071)])
def test_intervals_of_correlations_miss_as_rarely_as_stated(degrees: float | None, rate: float) -> None:
    """Of 200 samples, normal or with heavy tails; `fisher_interval` states the rates, to 0.3 %."""
    rng, records, count, correlation = np.random.default_rng(8), 800, 200, 0.9
    misses = 0
    for _ in range(records):
        one, other = rng.standard_normal((2, count))
        other = correlation * one + np.sqrt(1.0 - correlation**2) * other
        if degrees is not None:
            wide = np.sqrt(degrees / rng.chisquare(degrees, count))
            one, other = one * wide, other * wide
        u, v = stats.zscore(one), stats.zscore(other)
        value = float(np.mean(u * v))
        influence = summed_mean(u * v - 0.5 * value * (u * u + v * v), np.ones(count))
        low, high = fisher_interval(replace(influence, value=value), 0.95)
        misses += not low <= correlation <= high
    assert stats.binom.sf(misses - 1, records, rate) > FALSE_ALARM
    assert stats.binom.cdf(misses, records, 0.041) > FALSE_ALARM
