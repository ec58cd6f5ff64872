"""Comparison and verdicts: identities, and every degenerate case."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.budget import error_budget
from mcnav.analysis.comparison import Comparison, Criterion, compare, correlations
from mcnav.analysis.model import Model
from mcnav.analysis.verdict import Verdict, judge
from mcnav.linear.covariance import propagated_covariance
from mcnav.statistics.estimates import blocked_mean

PARTIALS = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 3.0]])
SIGMA = np.array([1.0, 0.5, 2.0])


def _model(partials: np.ndarray = PARTIALS, sigma: np.ndarray = SIGMA) -> Model:
    return Model(partials, np.zeros(len(partials)), np.zeros(len(sigma)), np.diag(sigma**2))


def _errors(count: int, sigma: np.ndarray = SIGMA) -> np.ndarray:
    return np.random.default_rng(8).standard_normal((count, len(sigma))) * sigma


def _compared(model: Model, errors: np.ndarray, outcomes: np.ndarray) -> Comparison:
    return compare(model, errors, outcomes, Criterion())


def test_a_linear_system_agrees_exactly() -> None:
    """Flown and linear errors are one, so that the paired estimate is P S P^T itself and its interval a point."""
    errors = _errors(200)
    found = _compared(_model(), errors, errors @ PARTIALS.T)
    assert found.verdict == Verdict.AGREES
    np.testing.assert_allclose(found.covariance_paired, found.covariance_linear, rtol=1e-12, atol=1e-13)
    for output in found.outputs:
        assert output.paired.ratio == pytest.approx(1.0, abs=1e-12)
        assert abs(output.bias.value) < 1e-12
    assert found.ellipsoid is not None
    assert found.ellipsoid.nees_paired.value == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(found.ellipsoid.direction_ratios, 1.0, rtol=1e-9)


def test_scaled_flights_have_that_ratio() -> None:
    """Flights that are all 10 % larger: ratio 1.1 in every direction, NEES 1.21 times its expectation."""
    errors = _errors(4000)
    found = _compared(_model(), errors, 1.1 * errors @ PARTIALS.T)
    assert found.verdict == Verdict.DIFFERS
    assert found.ellipsoid is not None
    assert found.ellipsoid.judgement.verdict == Verdict.DIFFERS
    for output in found.outputs:
        low, high = output.paired.interval or (0.0, 0.0)
        assert low < 1.1 < high


def test_failed_samples_are_left_out_and_counted() -> None:
    errors = _errors(500)
    outcomes = errors @ PARTIALS.T
    outcomes[::10] = np.nan
    found = _compared(_model(), errors, outcomes)
    kept = np.isfinite(outcomes).all(axis=1)
    assert (found.samples, found.failed) == (450, 50)
    np.testing.assert_allclose(found.covariance_sample, np.cov(outcomes[kept].T), rtol=1e-12)
    assert np.isfinite(found.covariance_paired).all()


@pytest.mark.parametrize("left", [0, 1])
def test_too_few_samples_are_a_statement(left: int) -> None:
    errors = _errors(20)
    outcomes = np.full((20, 2), np.nan)
    outcomes[:left] = 1.0
    found = _compared(_model(), errors, outcomes)
    assert found.verdict == Verdict.UNDECIDED
    assert found.outputs == ()
    assert found.failed == 20 - left


def test_no_errors_at_all() -> None:
    found = _compared(_model(sigma=np.zeros(3)), np.zeros((10, 3)), np.zeros((10, 2)))
    assert found.verdict == Verdict.UNDECIDED
    assert found.ellipsoid is None
    assert [output.paired.ratio for output in found.outputs] == [None, None]


def test_a_constant_output_and_a_singular_covariance() -> None:
    """An output no source reaches, and two that always move together: the ellipsoid has the rank that is left."""
    partials = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    errors = _errors(300)
    found = _compared(_model(partials), errors, errors @ partials.T)
    assert found.verdict == Verdict.AGREES
    assert found.ellipsoid is not None
    assert found.ellipsoid.dimension == 1
    assert found.ellipsoid.nees_paired.value == pytest.approx(1.0, rel=1e-9)
    assert np.isnan(correlations(found.covariance_linear)[2]).all()


def test_dispersion_where_linear_analysis_has_none_differs() -> None:
    partials = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    errors = _errors(300)
    outcomes = errors @ partials.T
    outcomes[:, 1] = errors[:, 0] ** 2
    found = _compared(_model(partials), errors, outcomes)
    assert found.outputs[1].paired.verdict == Verdict.DIFFERS


def test_cancelling_sources_leave_rounding_not_dispersion() -> None:
    """Perfectly anticorrelated errors that cancel in an output: what is left of its sigma is rounding, and so none."""
    covariance = np.array([[1.0, -0.1], [-0.1, 0.01]])
    partials = np.array([[1.0, 10.0], [1.0, 0.0]])
    model = Model(partials, np.zeros(2), np.zeros(2), covariance)
    first = np.random.default_rng(4).standard_normal(300)
    errors = np.column_stack([first, -0.1 * first])
    found = _compared(model, errors, errors @ partials.T)
    assert found.verdict == Verdict.AGREES
    assert found.outputs[0].paired.ratio is None
    assert found.outputs[1].paired.ratio == pytest.approx(1.0, rel=1e-12)


def test_two_samples_decide_nothing() -> None:
    """Their squares about their own mean are equal, which must not pass for certainty."""
    errors = _errors(2)
    found = _compared(_model(), errors, 1.3 * errors @ PARTIALS.T)
    assert found.verdict == Verdict.UNDECIDED
    assert found.outputs[0].paired.interval == (0.0, pytest.approx(np.inf))


def test_many_failures_take_agreement_away() -> None:
    """A third of the samples failed, the largest errors among them: the rest may agree, and that says nothing."""
    errors = _errors(2000)
    outcomes = errors @ PARTIALS.T
    outcomes[np.abs(outcomes[:, 0]) > 1.4] = np.nan
    assert _compared(_model(), errors, outcomes).verdict == Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("interval", "verdict"),
    [
        ((0.96, 1.04), Verdict.AGREES),
        ((0.95, 1.05), Verdict.AGREES),
        ((0.94, 1.02), Verdict.UNDECIDED),
        ((1.06, 1.09), Verdict.DIFFERS),
        ((0.80, 0.94), Verdict.DIFFERS),
        ((0.80, 1.20), Verdict.UNDECIDED),
    ],
)
def test_verdicts(interval: tuple[float, float], verdict: Verdict) -> None:
    found = judge(0.5 * sum(interval), interval, 0.05, 1000)
    assert found.verdict == verdict
    assert found.certain == (not interval[0] <= 1.0 <= interval[1])
    assert (found.samples_needed is not None) == (verdict == Verdict.UNDECIDED)


def test_samples_needed_by_the_root_law() -> None:
    """Half width 0.2, 1.96 errors, at 0.05 from both edges: 90 % clear both if half width and 1.64 errors fit."""
    error = 0.2 / stats.norm.ppf(0.975)
    expected = 1000 * ((0.2 + stats.norm.ppf(0.95) * error) / 0.05) ** 2
    assert judge(1.0, (0.8, 1.2), 0.05, 1000, 0.95).samples_needed == pytest.approx(expected, rel=1e-3)


def test_budget_shares_and_cross_terms_sum_to_one() -> None:
    covariance = np.diag(SIGMA**2)
    covariance[0, 1] = covariance[1, 0] = 0.4 * SIGMA[0] * SIGMA[1]
    budget = error_budget(PARTIALS, covariance)
    np.testing.assert_allclose(budget.shares.sum(axis=1) + budget.cross_terms, 1.0)
    assert budget.cross_terms[0] > 0.0 > budget.cross_terms[1]
    np.testing.assert_allclose(budget.contributions, PARTIALS * SIGMA)


def test_propagated_covariance_names_shapes_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match=r"same sources; got shapes \(2, 3\) and \(4, 4\)"):
        propagated_covariance(PARTIALS, np.eye(4))


def test_blocks_of_equal_values_have_no_false_precision() -> None:
    """Ten copies of each value are worth one: the error is that of the distinct values."""
    values = np.random.default_rng(2).standard_normal(40)
    once = blocked_mean(values, np.arange(40))
    copied = blocked_mean(np.repeat(values, 10), np.repeat(np.arange(40), 10))
    assert copied.standard_error == pytest.approx(once.standard_error, rel=1e-12)
    assert copied.degrees_of_freedom == once.degrees_of_freedom
