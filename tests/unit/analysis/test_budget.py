"""Error budgets: linear, by flights, Sobol indices, and the inverse question."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import openturns as ot
import pytest

from mcnav.analysis.budget import error_budget, largest_sigmas
from mcnav.contract.failure import Failure
from mcnav.contract.samples import SimulationResult
from mcnav.linear.corrections import Uncomputed
from mcnav.linear.partials import FAST, QUICK, REDUCTION, SimulationFailed
from mcnav.linear.simulated_budget import simulate_each_source_alone, simulated_budgets
from mcnav.linear.sobol import estimate_sobol_indices
from mcnav.runner.draws import PROBES
from mcnav.sampler.distributions import Fixed, Normal, Uniform
from mcnav.sampler.error_model import Correlation, ErrorModel

NAMES = ["a", "b", "c", "d"]
PARTIALS = np.array([[1.0, 2.0, 0.0, 3.0], [0.5, -1.0, 3.0, 0.0]])
ERRORS = ErrorModel(NAMES, {"a": Normal(1.0), "b": Uniform(1.0), "d": Fixed(2.0)})
CORRELATED = ErrorModel(NAMES, {"a": Normal(1.0), "b": Normal(0.5), "c": Normal(2.0)}, [Correlation(("a", "b"), 0.4)])


def _linear(errors: np.ndarray) -> SimulationResult:
    return SimulationResult(errors @ PARTIALS.T)


def _product(errors: np.ndarray) -> SimulationResult:
    return SimulationResult(np.column_stack([errors[:, 0] + errors[:, 0] * errors[:, 1], errors[:, 1]]))


@pytest.mark.parametrize("errors", [ERRORS, CORRELATED])
@pytest.mark.parametrize("design", ["random", "sobol"])
def test_flights_of_a_linear_system_give_the_linear_budget(errors: ErrorModel, design: str) -> None:
    """Exactly: the paired estimate has no sampling error then."""
    found = simulate_each_source_alone(lambda e: _linear(e), PARTIALS, errors, design, 1, 512)
    linear = error_budget(PARTIALS, errors.covariance)
    variances = np.diag(PARTIALS @ errors.covariance @ PARTIALS.T)
    np.testing.assert_allclose(found.alone.variance, linear.shares * variances[:, None], atol=1e-12)
    np.testing.assert_allclose(found.without.variance, (1.0 - linear.saved) * variances[:, None], atol=1e-12)
    assert np.max(found.alone.standard_error) < 1e-12


@pytest.mark.parametrize("samples", [512, 5])
def test_probes_are_the_first_draws_of_the_campaign(samples: int) -> None:
    """So that they are those of its own engine, and none is prepared again; a slow one says why it has no budget."""
    given = list[np.ndarray]()

    def prepare(probes: np.ndarray) -> Any:
        given.append(probes)
        return SimpleNamespace(chunk=QUICK - 1)

    found = simulated_budgets(prepare, ERRORS, PARTIALS, "random", 1, samples)
    assert np.array_equal(given, [ERRORS.draw("random", 1, samples, 0, samples)[:PROBES]])
    for each in (found.alone, found.sobol):
        assert isinstance(each, Uncomputed)
        assert "too slow" in each.failed


def test_a_quick_engine_that_is_not_fast_simulates_fewer_flights_beside_a_run() -> None:
    flights = dict[int, int]()
    for chunk in (FAST, FAST - 1):
        flights[chunk] = 0

        def simulate(batch: Any, noise: bool, chunk: int = chunk) -> SimulationResult:
            flights[chunk] += len(batch.errors)
            return _linear(batch.errors)

        engine = SimpleNamespace(chunk=chunk, simulate=simulate)
        found = simulated_budgets(lambda _, engine=engine: engine, ERRORS, PARTIALS, "random", 1, 10_000)
        assert not isinstance(found.sobol, Uncomputed)
    assert flights[FAST] == REDUCTION * flights[FAST - 1]


def test_interaction_shows_in_all_but_one() -> None:
    """y = a + a b: alone b does nothing; without it the variance of a b, sigma_a^2 sigma_b^2, goes."""
    partials = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    errors = ErrorModel(NAMES, {"a": Normal(1.0), "b": Normal(0.5), "c": Normal(1.0)})
    found = simulate_each_source_alone(_product, partials, errors, "random", 3, 2000)
    alone, without = found.alone.variance, found.without.variance
    assert alone[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert without[0, 1] == pytest.approx(1.0, rel=1e-12)
    assert abs(without[0, 2] - 1.25) < 5.0 * found.without.standard_error[0][2]


def test_saved_and_shares_differ_by_cross_terms() -> None:
    budget = error_budget(PARTIALS, CORRELATED.covariance)
    independent = error_budget(PARTIALS, np.diag(np.diag(CORRELATED.covariance)))
    np.testing.assert_allclose(independent.saved, independent.shares, atol=1e-15)
    np.testing.assert_allclose(budget.saved[:, 0] - budget.shares[:, 0], budget.cross_terms, atol=1e-15)


def test_a_variance_of_rounding_has_no_size() -> None:
    """Where outputs cancel, sums of covariances leave a negative variance of rounding."""
    budget = error_budget(np.eye(2), np.diag([4.0, 1.0]), [np.diag([1.0, -1e-30])])
    np.testing.assert_array_equal(budget.contributions[:, 2], [1.0, 0.0])


def test_sobol_indices_of_a_product() -> None:
    """y = a + a b with normal a, b: V = s_a^2 (1 + s_b^2); S_a = 1 / (1 + s_b^2), S_b = 0, total of a one."""
    errors = ErrorModel(NAMES, {"a": Normal(1.0), "b": Normal(0.5)})
    found = estimate_sobol_indices(_product, errors, 7)
    first, total = found.first_order, found.total
    assert first[0, :2] == pytest.approx([0.8, 0.0], abs=0.02)
    assert total[0, :2] == pytest.approx([1.0, 0.2], abs=0.02)
    assert first[1, :2] == pytest.approx([0.0, 1.0], abs=0.02)
    assert np.all(first[:, 2:] == 0.0)
    assert np.max(found.first_order_standard_error) < 0.01


def test_sobol_indices_against_openturns() -> None:
    """Independent implementation, the same function, within five of our standard errors and theirs."""
    errors = ErrorModel(NAMES, {"a": Normal(1.0), "b": Normal(0.5)})
    found = estimate_sobol_indices(_product, errors, 11)
    function = ot.SymbolicFunction(["a", "b"], ["a + a * b"])
    distribution = ot.JointDistribution([ot.Normal(0.0, 1.0), ot.Normal(0.0, 0.5)])
    ot.RandomGenerator.SetSeed(1)
    size = 20_000
    theirs = ot.SaltelliSensitivityAlgorithm(distribution, size, function)
    for ours, expected in (
        (found.first_order, theirs.getFirstOrderIndices()),
        (found.total, theirs.getTotalOrderIndices()),
    ):
        np.testing.assert_allclose(ours[0][:2], np.array(expected), atol=0.05)


@pytest.mark.parametrize(
    ("errors", "message"), [(CORRELATED, "depend on one"), (ErrorModel(NAMES, {}), "no source has a dispersion")]
)
def test_sobol_indices_that_do_not_exist(errors: ErrorModel, message: str) -> None:
    with pytest.raises(SimulationFailed, match=message):
        estimate_sobol_indices(_linear, errors, 1)


@pytest.mark.parametrize("study", [lambda f: simulate_each_source_alone(f, PARTIALS, ERRORS, "random", 1, 100),
                                   lambda f: estimate_sobol_indices(f, ERRORS, 1)])  # fmt: skip
def test_a_failed_flight_is_named(study: Callable[[Callable[[np.ndarray], SimulationResult]], object]) -> None:
    with pytest.raises(SimulationFailed, match="too low"):
        study(lambda errors: SimulationResult(np.full((len(errors), 2), np.nan), {0: Failure.of("too low")}))


def test_allocation_meets_the_limit_exactly() -> None:
    covariance = CORRELATED.covariance
    limit = 3.0
    found = largest_sigmas(PARTIALS[0], covariance, limit)
    for j in range(3):
        scale = np.ones(4)
        if not np.isfinite(found[j]):
            continue
        scale[j] = found[j] / np.sqrt(covariance[j, j])
        scaled = covariance * np.outer(scale, scale)
        assert PARTIALS[0] @ scaled @ PARTIALS[0] == pytest.approx(limit**2, rel=1e-12)
    assert found[2] == np.inf
    assert found[3] == pytest.approx(np.sqrt(limit**2 - PARTIALS[0] @ covariance @ PARTIALS[0]) / 3.0)


def test_allocation_that_cannot_be() -> None:
    """The others exceed the limit by themselves; also for a source on which nothing depends."""
    found = largest_sigmas(np.array([1.0, 1.0, 0.0]), np.diag([1.0, 4.0, 1.0]), 1.5)
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(np.sqrt(1.25))
    assert np.isnan(found[2])


def test_a_correlation_may_lower_the_variance() -> None:
    """Perfect anticorrelation: the source may be as large as takes the output through zero and out the other side."""
    found = largest_sigmas(np.array([1.0, 1.0]), np.array([[1.0, -1.0], [-1.0, 1.0]]), 2.0)
    assert found.tolist() == pytest.approx([3.0, 3.0])


def test_a_single_source_has_the_whole_variance() -> None:
    found = estimate_sobol_indices(_linear, ErrorModel(NAMES, {"b": Normal(1.0)}), 2)
    np.testing.assert_allclose(found.first_order[:, 1], 1.0, atol=0.02)
    assert found.total.shape == (2, 4)


def test_shares_of_correlated_sources_add_up_to_one() -> None:
    """Two sources that all but cancel: alone they would be 513 % of the variance each."""
    covariance = np.array([[1.0, -0.9025], [-0.9025, 1.0]])
    budget = error_budget(np.array([[1.0, 1.0]]), covariance, [np.array([[0.005]])])
    assert budget.shares.sum() > 9.0
    assert budget.crossed
    np.testing.assert_allclose(budget.attributed.sum(axis=1), 1.0, rtol=1e-12)
    # by hand: (P S)_j P_j = 0.0975 each, of 0.2
    np.testing.assert_allclose(budget.attributed, [[0.4875, 0.4875, 0.025]], rtol=1e-12)
    apart = error_budget(PARTIALS, np.diag([1.0, 4.0, 9.0, 0.25]))
    assert not apart.crossed
    np.testing.assert_allclose(apart.attributed, apart.shares, rtol=1e-12)
