"""Second-order propagation on systems whose moments are known, and the split of the difference."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.variance_breakdown import Predicted, predicted_from, split_difference
from mcnav.contract.engine import without_noise
from mcnav.contract.failure import Failure
from mcnav.contract.samples import SimulationResult
from mcnav.linear.higher_order import principal_directions, second_order
from mcnav.linear.partials import SimulationFailed
from tests.conftest import campaign

SIGMA = np.array([2.0, 0.5, 0.0])
COVARIANCE = np.array([[4.0, 0.3, 0.0], [0.3, 0.25, 0.0], [0.0, 0.0, 0.0]])
GRADIENT = np.array([1.0, -3.0, 7.0])
HESSIAN = np.array([[0.3, 0.1, 1.0], [0.1, -0.4, 0.0], [1.0, 0.0, 2.0]])


def _quadratic(errors: np.ndarray) -> SimulationResult:
    curved = errors @ GRADIENT + 0.5 * np.einsum("ni,ij,nj->n", errors, HESSIAN, errors)
    return SimulationResult(np.column_stack([curved, errors[:, 0]]))


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
def test_a_quadratic_is_exact(step: float) -> None:
    """Mean 1/2 tr(HS), covariance 1/2 tr(HSHS) and third moment 3 gSHSg + tr (HS)^3, whatever the step."""
    found = second_order(_quadratic, np.zeros(3), COVARIANCE, step)
    product = HESSIAN @ COVARIANCE
    assert found.mean_shift == pytest.approx([0.5 * np.trace(product), 0.0], abs=1e-10)
    np.testing.assert_allclose(
        found.quadratic, [[0.5 * np.trace(product @ product), 0.0], [0.0, 0.0]], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(found.third_order, np.zeros((2, 2)), atol=1e-9)
    third = 3.0 * GRADIENT @ COVARIANCE @ product @ GRADIENT + np.trace(product @ product @ product)
    variance = GRADIENT @ COVARIANCE @ GRADIENT + 0.5 * np.trace(product @ product)
    assert found.skewness == pytest.approx([third / variance**1.5, 0.0], rel=1e-9, abs=1e-9)


def test_a_cubic_has_its_third_order_term() -> None:
    """y = x + a x^3 + b x w^2, normal: the variance to fourth order is 1 + 2 (3 a + b)."""

    def cubic(errors: np.ndarray) -> SimulationResult:
        x, w = errors.T
        return SimulationResult((x + 0.01 * x**3 + 0.02 * x * w**2)[:, None])

    found = second_order(cubic, np.zeros(2), np.eye(2))
    assert found.third_order[0, 0] == pytest.approx(2.0 * (0.03 + 0.02), rel=1e-9)
    assert found.quadratic[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_about_a_mean_and_with_correlations() -> None:
    """A shifted centre changes the gradient, not the Hessian; correlated axes give the same as independent ones."""
    mean = np.array([1.0, 2.0, -1.0])
    found = second_order(_quadratic, mean, COVARIANCE)
    gradient = GRADIENT + HESSIAN @ mean
    np.testing.assert_allclose(np.sum(found.gradients[0] ** 2), gradient @ COVARIANCE @ gradient, rtol=1e-9)
    np.testing.assert_allclose(found.quadratic, second_order(_quadratic, np.zeros(3), COVARIANCE).quadratic, atol=1e-9)


@pytest.mark.parametrize("correlation", [0.0, 0.6, 1.0])
def test_directions_make_up_the_covariance(correlation: float) -> None:
    covariance = np.diag([4.0, 9.0, 0.0])
    covariance[0, 1] = covariance[1, 0] = 6.0 * correlation
    directions = principal_directions(covariance)
    assert directions.shape[1] == (1 if correlation == 1.0 else 2)
    np.testing.assert_allclose(directions @ directions.T, covariance, atol=1e-12)


def test_no_errors_at_all() -> None:
    found = second_order(_quadratic, np.zeros(3), np.zeros((3, 3)))
    assert found.hessians.shape == (2, 0, 0)
    assert found.mean_shift.tolist() == [0.0, 0.0]
    assert found.skewness.tolist() == [0.0, 0.0]


def test_a_failed_flight_is_named() -> None:
    def failing(errors: np.ndarray) -> SimulationResult:
        return SimulationResult(np.full((len(errors), 1), np.nan), {3: Failure.of("too low")})

    with pytest.raises(SimulationFailed, match="flight 4 of 13"):
        second_order(failing, np.zeros(2), np.eye(2))


@pytest.mark.parametrize(("trajectory", "multiple"), [(1, 10.0), (5, 3.0)])
def test_it_predicts_what_is_flown(trajectory: int, multiple: float) -> None:
    """Variances within five standard errors and a tenth of the correction (higher orders); bias within 2 %."""
    count = 40_000
    run = campaign(trajectory, multiple, samples=count)
    errors = run.errors.draw("random", 1, count, 0, count)
    prepared = run.scenario.engine("ensemble", errors[:64])
    linear = run.scenario.linear().end
    model = Model(linear.partials, linear.nominal, run.errors.mean, run.errors.covariance)
    found = second_order(without_noise(prepared), run.errors.mean, run.errors.covariance)
    comparison = compare(model, errors, without_noise(prepared)(errors).values, Criterion())
    correction = np.diag(found.quadratic + found.third_order)
    for i, output in enumerate(comparison.outputs):
        difference = output.paired_variance.value - output.sigma_linear**2
        allowed = 5.0 * output.paired_variance.standard_error + 0.1 * abs(correction[i])
        assert abs(difference - correction[i]) < allowed, (i, difference, correction[i])
        assert abs(output.bias.value - found.mean_shift[i]) < 5.0 * output.bias.standard_error + 0.02 * abs(
            found.mean_shift[i]
        )


def test_the_split_adds_up() -> None:
    """Exactly, whatever the terms; and the sampling terms are what the paired estimate leaves out of the plain one."""
    model = Model(np.array([[1.0, -3.0, 7.0], [1.0, 0.0, 0.0]]), np.zeros(2), np.zeros(3), np.diag([4.0, 0.25, 0.0]))
    errors = np.random.default_rng(2).standard_normal((500, 3)) * SIGMA
    comparison = compare(model, errors, _quadratic(errors).values, Criterion())
    corrections = second_order(_quadratic, np.zeros(3), model.covariance)
    predicted = Predicted(1.001 * model.partials, corrections.quadratic, corrections.third_order, np.full((2, 2), 9.0))
    found = split_difference(model, np.cov(errors.T), comparison, predicted)
    assert found is not None
    np.testing.assert_allclose(sum(found.terms.values()), found.total, rtol=1e-12, atol=1e-12)
    plain = np.diag(comparison.covariance_sample) - np.diag(comparison.covariance_paired)
    sampling = found.terms["sampled_sigmas"] + found.terms["sampled_correlations"]
    np.testing.assert_allclose(sampling, plain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.terms["partials"], 0.002001 * np.diag(comparison.covariance_linear), rtol=1e-9)
    left = found.paired - found.terms["second_order"]
    assert abs(left[0]) < 5.0 * found.standard_error[0]
    assert found.terms["rest"][1] == pytest.approx(-0.002001 * 4.0, rel=1e-6)


def test_what_was_not_computed_is_part_of_the_rest() -> None:
    described = {"sources": [0, 1, 2], "unscented": {"failed": "no"}}
    model = Model(np.array([[1.0, 0.0, 0.0]]), np.zeros(1), np.zeros(3), np.diag(SIGMA**2))
    errors = np.random.default_rng(2).standard_normal((200, 3)) * SIGMA
    comparison = compare(model, errors, 1.1 * errors[:, :1], Criterion())
    found = split_difference(model, np.cov(errors.T), comparison, predicted_from(described, 1))
    assert found is not None
    assert np.isnan([found.terms["second_order"][0], found.terms["partials"][0], found.unscented[0]]).all()
    assert found.terms["rest"][0] == pytest.approx(found.paired[0], rel=1e-9)


def test_nothing_compared_has_no_causes() -> None:
    model = Model(np.ones((1, 1)), np.zeros(1), np.zeros(1), np.eye(1))
    comparison = compare(model, np.zeros((1, 1)), np.zeros((1, 1)), Criterion())
    assert split_difference(model, np.zeros((1, 1)), comparison, predicted_from({"sources": [0]}, 1)) is None
