"""Distributions of scipy.stats and of tables, as sources of errors."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import stats

from mcnav.sampler.copula import hermite_coefficients
from mcnav.sampler.distributions import Normal, StudentT, tail_weight
from mcnav.sampler.error_model import Correlation, CorrelationError, ErrorModel
from mcnav.sampler.scipy_and_tables import (
    EmpiricalDistribution,
    ScipyDistribution,
    continuous_distributions,
    shape_names,
)

VALUES = np.random.default_rng(1).gamma(3.0, size=400)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (ScipyDistribution("laplace", (), 0.0, 2.0), stats.laplace(scale=2.0)),
        (ScipyDistribution("gamma", (("a", 3.0),), -1.0, 0.5), stats.gamma(3.0, -1.0, 0.5)),
        (ScipyDistribution("beta", (("a", 2.0), ("b", 5.0))), stats.beta(2.0, 5.0)),
        (ScipyDistribution("t", (("df", 5.0),)), stats.t(5.0)),
    ],
)
def test_scipy_distributions(ours: ScipyDistribution, theirs: stats.rv_continuous) -> None:
    normal = np.linspace(-7.0, 7.0, 57)
    expected = np.where(normal < 0.0, theirs.ppf(stats.norm.cdf(normal)), theirs.isf(stats.norm.sf(normal)))
    np.testing.assert_allclose(ours.transform(normal), expected, rtol=1e-12)
    assert (ours.mean, ours.standard_deviation) == pytest.approx((theirs.mean(), theirs.std()), rel=1e-9)
    assert pickle.loads(pickle.dumps(ours)) == ours
    assert hash(ours) == hash(pickle.loads(pickle.dumps(ours)))


def test_a_normal_by_its_scipy_name_is_the_normal() -> None:
    one = ErrorModel(["a"], {"a": Normal(2.0)}).draw("random", 1, 50, 0, 50)
    other = ErrorModel(["a"], {"a": ScipyDistribution("norm", (), 0.0, 2.0)}).draw("random", 1, 50, 0, 50)
    np.testing.assert_allclose(one, other, rtol=1e-10)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ScipyDistribution("poisson"), "no continuous distribution 'poisson'"),
        (lambda: ScipyDistribution("__import__"), "no continuous distribution"),
        (lambda: ScipyDistribution("cauchy"), "no finite mean and variance"),
        (lambda: ScipyDistribution("t", (("df", 2.0),)), "no finite mean and variance"),
        (lambda: ScipyDistribution("gamma", (("a", -1.0),)), "no finite mean and variance"),
        (lambda: ScipyDistribution("laplace", (), 0.0, 0.0), "scale must be positive"),
        (lambda: EmpiricalDistribution(np.array([1.0, 1.0])), "two different values"),
        (lambda: EmpiricalDistribution(np.array([1.0, np.nan])), "not finite"),
    ],
)
def test_impossible_ones_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


def test_shapes() -> None:
    assert shape_names("gamma") == ("a",)
    assert len(continuous_distributions()) > 90


def test_draws_of_a_table_are_its_values() -> None:
    table = EmpiricalDistribution(VALUES)
    drawn = ErrorModel(["a"], {"a": table}).draw("random", 3, 40_000, 0, 40_000)[:, 0]
    assert set(drawn) == set(VALUES)
    assert (table.mean, table.standard_deviation) == pytest.approx((VALUES.mean(), VALUES.std()))
    counts = np.array([np.count_nonzero(drawn == value) for value in VALUES])
    assert stats.chisquare(counts).pvalue > 1e-6
    assert EmpiricalDistribution(VALUES[::-1]) == table
    assert table.transform(np.array([-40.0, 40.0])).tolist() == [VALUES.min(), VALUES.max()]


@pytest.mark.parametrize("coefficient", [-0.7, 0.5, 0.9])
def test_correlations_are_reached(coefficient: float) -> None:
    """Between a skewed distribution and a table of skewed values; within six standard errors."""
    one, other = ScipyDistribution("gamma", (("a", 2.0),)), EmpiricalDistribution(VALUES)
    model = ErrorModel(["a", "b"], {"a": one, "b": other}, [Correlation(("a", "b"), coefficient)])
    count = 100_000
    drawn = (model.draw("random", 2, count, 0, count) - model.mean) / model.standard_deviations
    products = drawn[:, 0] * drawn[:, 1]
    assert abs(products.mean() - coefficient) < 6.0 * products.std() / np.sqrt(count) + 2e-3


def test_reach_of_skewed_distributions_is_lopsided() -> None:
    """Two exponentials: all the way up, but down to 1 - pi^2/6 only."""
    pair = {"a": ScipyDistribution("expon"), "b": ScipyDistribution("expon")}
    with pytest.raises(CorrelationError, match=r"from -0\.6449 to 1\.0000; got -0\.7"):
        ErrorModel(["a", "b"], pair, [Correlation(("a", "b"), -0.7)])
    assert np.sum(hermite_coefficients(pair["a"]) ** 2) == pytest.approx(1.0)
    together = ErrorModel(["a", "b"], pair, [Correlation(("a", "b"), 1.0)]).draw("random", 1, 9, 0, 9)
    np.testing.assert_allclose(together[:, 0], together[:, 1], rtol=1e-9)


def test_tails_are_weighed() -> None:
    assert tail_weight(ScipyDistribution("t", (("df", 10.0),))) == pytest.approx(
        tail_weight(StudentT(1.0, 10.0)), rel=1e-6
    )
    model = ErrorModel(
        ["a", "b"], {"a": ScipyDistribution("lognorm", (("s", 1.0),)), "b": EmpiricalDistribution(VALUES)}
    )
    assert model.heavy_tailed("random") == ("a",)
