"""Combinations of outputs: what linear analysis holds fixed, and a mean error told from the dispersion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.analysis.combinations import null_combinations
from mcnav.analysis.comparison import Comparison, Criterion, compare, compare_reduced, reduce_stored, reduce_summary
from mcnav.analysis.ellipsoid import Cause, Ellipsoid
from mcnav.analysis.model import Model
from mcnav.analysis.verdict import Verdict
from mcnav.linear.block_sums import BlockSums, Normalization, column_count
from mcnav.sampler.designs import SamplingDesign

SAMPLES = 4_000
Outcomes = Callable[[np.ndarray], list[np.ndarray]]


def compared(partials: list[list[float]], outcomes: Outcomes, mean: float = 0.0) -> tuple[Comparison, Ellipsoid]:
    """Compare outcomes of independent unit errors with a linear model."""
    matrix = np.array(partials)
    sources = matrix.shape[1]
    errors = np.random.default_rng(5).standard_normal((SAMPLES, sources)) + mean
    model = Model(matrix, np.zeros(len(matrix)), np.full(sources, mean), np.eye(sources))
    found = compare(model, errors, np.column_stack(outcomes(errors.T)), Criterion())
    assert found.ellipsoid is not None
    return found, found.ellipsoid


def test_dispersion_in_the_null_space_differs() -> None:
    """y2 - 2 y = 0.05 a^2 has no linear sigma; its own is 0.05 sqrt(2), the sample's known to 4 sqrt(3.5 / n)."""
    found, joint = compared([[1.0], [2.0]], lambda e: [e[0], 2.0 * e[0] + 0.05 * e[0] ** 2])
    assert found.verdict == Verdict.AGREES
    assert joint.judgement.verdict == Verdict.AGREES
    assert (joint.verdict, joint.cause) == (Verdict.DIFFERS, Cause.UNPREDICTED)
    (fixed,) = joint.unpredicted
    np.testing.assert_allclose(fixed.weights, [-2.0, 1.0], rtol=1e-12)
    assert (fixed.lead, fixed.sigma_linear) == (1, 0.0)
    assert fixed.sigma_paired == pytest.approx(0.05 * np.sqrt(2.0), rel=4.0 * np.sqrt(3.5 / SAMPLES))
    assert fixed.offset == pytest.approx(0.05, rel=4.0 * np.sqrt(2.0 / SAMPLES))


def test_an_output_that_linear_analysis_holds_fixed_differs_jointly() -> None:
    _, joint = compared([[1.0, 0.0], [0.0, 0.0]], lambda e: [e[0], e[0] * e[1]])
    assert (joint.verdict, joint.cause) == (Verdict.DIFFERS, Cause.UNPREDICTED)
    assert [each.lead for each in joint.unpredicted] == [1]


@pytest.mark.parametrize("factor", [1.0, 1e-3, 1e6])
@pytest.mark.parametrize("mean", [0.0, 1e3])
def test_rounding_in_the_null_space_is_none(factor: float, mean: float) -> None:
    """Three outputs of one error, none an exact multiple in binary: what is left of their differences is rounding."""
    _, joint = compared([[0.1], [0.7 * factor], [1.1]], lambda e: [0.1 * e[0], 0.7 * factor * e[0], 1.1 * e[0]], mean)
    assert (joint.verdict, joint.unpredicted) == (Verdict.AGREES, ())


@pytest.mark.parametrize(("size", "verdict"), [(1e-5, Verdict.AGREES), (2e-5, Verdict.DIFFERS)])
def test_a_sigma_too_small_for_the_rank_is_compared_all_the_same(size: float, verdict: Verdict) -> None:
    """y2 - 2 y has a linear sigma of 1e-5, 5e-6 of that of y2: the covariance's rank does not count it."""
    _, joint = compared([[1.0, 0.0], [2.0, 1e-5]], lambda e: [e[0], 2.0 * e[0] + size * e[1]])
    assert joint.dimension == 1
    assert joint.verdict == verdict
    for fixed in joint.unpredicted:
        assert fixed.sigma_linear == pytest.approx(1e-5, rel=1e-9)
        assert fixed.sigma_paired == pytest.approx(size, rel=1e-2)


def test_a_summary_sees_the_null_space_as_samples_do() -> None:
    """Moments suffice; sums of blocks of 20 samples are known to root(20 eps) of their terms."""
    partials = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    model = Model(partials, np.zeros(3), np.zeros(2), np.eye(2))
    errors = np.random.default_rng(6).standard_normal((SAMPLES, 2))
    for bend in (0.0, 1e-4, 0.05):
        outcomes = errors @ partials.T
        outcomes[:, 1] += bend * errors[:, 0] ** 2
        stored = reduce_stored(model, errors, outcomes, np.arange(SAMPLES))
        summary = reduce_summary(model, *block_sums(model, errors, outcomes), SAMPLES, stored.stored)
        found = [compare_reduced(model, each, Criterion(), SamplingDesign()).ellipsoid for each in (stored, summary)]
        assert [each.verdict for each in found if each] == [Verdict.DIFFERS if bend else Verdict.AGREES] * 2
        sizes = [each.unpredicted[0].sigma_paired for each in found if each and each.unpredicted]
        if sizes:
            np.testing.assert_allclose(sizes, sizes[0], rtol=1e-4)


def block_sums(model: Model, errors: np.ndarray, outcomes: np.ndarray) -> tuple[Normalization, BlockSums]:
    """Sum samples in blocks of twenty."""
    frame = Normalization.of(
        model.partials, model.mean, model.outcome_mean, model.outcome_covariance, len(outcomes), 50
    )
    y, z = outcomes / frame.scale, errors @ model.partials.T / frame.scale
    first, second = np.triu_indices(len(model.partials))
    columns = [np.ones((len(y), 1)), y, z, y[:, first] * y[:, second], z[:, first] * z[:, second], y**3, y**4]
    blocks = np.hstack(columns).reshape(-1, 20, column_count(y.shape[1])).sum(axis=1)
    nothing = np.zeros_like(model.covariance)
    sources = np.zeros(len(model.covariance))
    return frame, BlockSums(0, blocks, sources, errors.T @ errors, np.zeros(3), sources, nothing)


def test_a_mean_error_is_told_from_the_dispersion() -> None:
    """y = a + 0.02 sum b^2 of 100 errors: a mean of 2 sigma, a sigma of sqrt(1 + 0.08), NEES 5.08 and 1.08.

    The bound is four standard errors of the mean of n samples of b^2, each with a variance of two.
    """
    found, joint = compared([[1.0, *np.zeros(100)]], lambda e: [e[0] + 0.02 * (e[1:] ** 2).sum(axis=0)])
    assert joint.cause == Cause.MEAN
    assert joint.mean_error == pytest.approx(2.0, abs=4.0 * np.sqrt(0.08 / SAMPLES))
    assert joint.nees_about_mean == pytest.approx(1.08, abs=0.05)
    assert joint.dispersion is not None
    assert joint.dispersion.ratio == pytest.approx(found.outputs[0].paired.ratio, rel=1e-9)
    _, linear = compared([[1.0, 0.0], [0.0, 1.0]], lambda e: [e[0] + 2.0, e[1]])
    assert linear.cause == Cause.MEAN
    assert linear.dispersion is not None
    assert linear.dispersion.verdict == Verdict.AGREES
    assert linear.shifted is not None
    assert (linear.shifted.lead, linear.shifted.offset) == (0, pytest.approx(2.0, rel=1e-12))


def test_both_nees_add_up() -> None:
    """NEES about the linear mean is that about the sample mean, and the squared mean error, of paired samples."""
    _, joint = compared([[1.0, 0.5], [0.0, 1.0]], lambda e: [e[0] + 0.5 * e[1] + 0.3 * e[1] ** 2, 1.2 * e[1]])
    both = joint.nees_about_mean + joint.mean_error**2
    assert joint.nees_paired.value == pytest.approx(both, abs=4.0 * joint.nees_paired.standard_error)


def test_null_combinations_span_the_null_space() -> None:
    """Each is orthogonal to the range, and has a one for its own dependent output alone."""
    generator = np.random.default_rng(9)
    factor = generator.standard_normal((6, 4)) @ generator.standard_normal((4, 7))
    basis, dependent = null_combinations(factor, 4)
    np.testing.assert_allclose(basis @ factor, 0.0, atol=1e-13 * np.abs(factor).max() * 6)
    np.testing.assert_array_equal(basis[:, dependent], np.eye(2))
