"""Tests of all outputs together: exact systems, known differences, designs that a test does not hold for."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.multivariate import FEWEST_PAIRS, MultivariateTests
from mcnav.sampler.designs import SamplingDesign

PARTIALS = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 3.0]])
SIGMA = np.array([1.0, 0.5, 2.0])
MODEL = Model(PARTIALS, np.zeros(2), np.zeros(3), np.diag(SIGMA**2))


def _errors(count: int, seed: int = 8) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, 3)) * SIGMA


def _joint(errors: np.ndarray, outcomes: np.ndarray, design: SamplingDesign | None = None) -> MultivariateTests:
    found = compare(MODEL, errors, outcomes, Criterion(), design).joint
    assert found is not None
    return found


def test_a_linear_system_has_no_paired_difference_at_all() -> None:
    errors = _errors(1000)
    found = _joint(errors, errors @ PARTIALS.T)
    for test in (found.covariance_paired, found.bias_paired):
        assert test is not None
        assert (test.statistic, test.p_value) == (0.0, 1.0)
    for test in (found.covariance, found.bias, found.nees):
        assert test is not None
        assert test.p_value > 1e-4
    (pair,) = found.correlations
    assert pair.difference.value == pytest.approx(0.0, abs=1e-13)
    assert pair.linear == pytest.approx(0.0, abs=1e-15)


def test_larger_flights_are_certainly_different() -> None:
    """Five per cent with 4000 samples: certain by the plain test, and by the paired one beyond all doubt."""
    errors = _errors(4000)
    found = _joint(errors, 1.05 * errors @ PARTIALS.T + np.array([0.2, 0.0]))
    assert found.covariance is not None
    assert found.covariance_paired is not None
    assert found.bias_paired is not None
    assert found.covariance_paired.p_value < found.covariance.p_value < 0.01
    assert found.bias_paired.p_value < 1e-10


def test_correlation_difference_of_a_known_system() -> None:
    """Flights with a different correlation and the same sigmas: y = z + a turn; the interval holds the known value."""
    errors = _errors(20_000)
    other = PARTIALS.copy()
    other[0] = [-1.0, 2.0, 0.0]
    found = _joint(errors, errors @ other.T)
    (pair,) = found.correlations
    covariance = other @ MODEL.covariance @ other.T
    truth = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]) - pair.linear
    assert abs(pair.difference.value - truth) < pair.difference.half_width(1.0 - 1e-6)
    assert pair.difference.standard_error < 0.02


def test_designs_in_blocks_have_paired_tests_only() -> None:
    errors = _errors(2000)
    outcomes = errors @ PARTIALS.T + 0.01 * errors[:, :1] ** 2
    found = _joint(errors, outcomes, SamplingDesign(100, 16))
    assert (found.covariance, found.bias, found.nees, found.normality, found.contained) == (None, None, None, None, ())
    assert found.bias_paired is not None
    assert found.bias_paired.degrees_of_freedom == (1.0, 19.0)  # both outputs move alike


def test_too_few_samples_claim_nothing() -> None:
    errors = _errors(20)
    found = _joint(errors, errors @ PARTIALS.T)
    assert (found.covariance, found.covariance_paired, found.bias_paired, found.normality) == (None, None, None, None)
    assert found.skewness[0].standard_error == np.inf


def test_a_constant_output() -> None:
    model = Model(np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.0]]), np.zeros(2), np.zeros(3), MODEL.covariance)
    errors = _errors(500)
    joint = compare(model, errors, errors @ model.partials.T, Criterion()).joint
    assert joint is not None
    assert joint.correlations == ()
    assert joint.covariance is not None
    assert joint.covariance.rank == 1
    assert (joint.skewness[1].value, joint.excess_kurtosis[1].value) == (0.0, 0.0)


def test_detectable_ratio_falls_with_the_root_of_the_samples() -> None:
    found = []
    for count in (1000, 16_000):
        errors = _errors(count)
        outcomes = errors @ PARTIALS.T
        found.append(compare(MODEL, errors, outcomes, Criterion()).outputs[0].detectable_plain)
    assert found[0] / found[1] == pytest.approx(4.0, rel=0.15)
    assert found[0] > 0.05


def test_few_pairs_do_not_test_the_covariance() -> None:
    errors = _errors(FEWEST_PAIRS)
    paired = np.concatenate([np.stack([each, -each]) for each in errors])
    outcomes = paired @ PARTIALS.T + 0.01 * paired[:, :1] ** 2
    pairs = SamplingDesign(2, 1_000)
    assert _joint(paired, outcomes, pairs).covariance_paired is not None
    fewer = _joint(paired[:-2], outcomes[:-2], pairs)
    assert fewer.covariance_paired is None
    assert fewer.bias_paired is not None
