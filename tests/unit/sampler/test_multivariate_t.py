"""Sources that share their tails, and rank correlations: reached as stated, whatever the design."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import stats

from mcnav.sampler.designs import DESIGNS
from mcnav.sampler.distributions import Distribution, Fixed, Normal, StudentT, Triangular, Uniform
from mcnav.sampler.error_model import Correlation, CorrelationError, ErrorModel, JointError
from mcnav.sampler.multivariate_t import MultivariateT, normal_of_rank, rank_correlation

FALSE_ALARM = 1e-6
"""Probability with which a right program fails one of the statistical assertions here; the seeds are fixed besides."""

BOUND = float(stats.norm.isf(FALSE_ALARM / 2.0))
NAMES = list("abcdef")
SOURCES: dict[str, Distribution] = {
    "a": Normal(2.0),
    "b": Normal(0.5),
    "c": Normal(3.0),
    "d": Uniform(1.0),
    "e": Normal(1.0),
    "f": Normal(1.0),
}
GROUPS = [MultivariateT(("a", "b", "c"), 9.0), MultivariateT(("e", "f"), 12.0)]
CORRELATED = [
    Correlation(("a", "b"), -0.6),
    Correlation(("b", "c"), 0.4, of_ranks=True),
    Correlation(("c", "d"), 0.5),
    Correlation(("d", "f"), 0.3, of_ranks=True),
    Correlation(("a", "e"), 0.4),
    Correlation(("c", "f"), -0.2, of_ranks=True),
]
MODEL = ErrorModel(NAMES, SOURCES, CORRELATED, GROUPS)


def _index(correlation: Correlation) -> tuple[int, int]:
    i, j = (NAMES.index(name) for name in correlation.between)
    return i, j


@pytest.mark.parametrize("design", DESIGNS)
def test_draws_have_the_start_covariance(design: str) -> None:
    """Each entry within the bound of the products' own standard error, which blocks only make smaller."""
    count = 65_536
    errors = MODEL.draw(design, 11, count, 0, count)
    assert errors.shape == (count, 6)
    for i in range(6):
        for j in range(i + 1):
            products = errors[:, i] * errors[:, j]
            error = products.std() / np.sqrt(count / 2.0)  # mirrored errors have one and the same product
            assert abs(products.mean() - MODEL.covariance[i, j]) < BOUND * error


def test_what_is_stated_is_in_the_covariance() -> None:
    sigma = MODEL.standard_deviations
    assert sigma.tolist() == [2.0, 0.5, 3.0, 1.0 / np.sqrt(3.0), 1.0, 1.0]
    for stated in CORRELATED:
        i, j = _index(stated)
        found = MODEL.covariance[i, j] / (sigma[i] * sigma[j])
        if stated.of_ranks:
            assert 0.0 < found / stated.coefficient < 1.06
        else:
            assert found == pytest.approx(stated.coefficient, rel=1e-12)


def test_rank_correlations_are_reached() -> None:
    """Spearman's coefficient of n draws has a standard error of at most 1.2 / sqrt(n), here by batches."""
    batches = MODEL.draw("random", 4, 200_000, 0, 200_000).reshape(100, 2000, 6)
    for stated in (each for each in CORRELATED if each.of_ranks):
        i, j = _index(stated)
        found = np.array([stats.spearmanr(batch[:, i], batch[:, j]).statistic for batch in batches])
        bias = 3.0 / 2000.0  # of Spearman's sample coefficient, of order 1 / n
        allowed = stats.t.isf(FALSE_ALARM / 2.0, 99) * found.std(ddof=1) / 10.0 + bias
        assert abs(found.mean() - stated.coefficient) < allowed


@pytest.mark.parametrize("wanted", [-0.95, -0.3, 0.6])
def test_rank_correlation_of_any_margins(wanted: float) -> None:
    """Pearson's that goes with it: of uniform margins Spearman's own value; of normal ones 2 sin(pi rho / 6)."""
    stated = [Correlation(("a", "b"), wanted, of_ranks=True)]
    uniform = ErrorModel(["a", "b"], {"a": Uniform(1.0), "b": Uniform(3.0)}, stated).covariance
    assert uniform[0, 1] == pytest.approx(wanted, rel=1e-8)
    normal = ErrorModel(["a", "b"], {"a": Normal(1.0), "b": Normal(1.0)}, stated).covariance
    assert normal[0, 1] == pytest.approx(2.0 * np.sin(np.pi * wanted / 6.0), rel=1e-14)
    other = ErrorModel(["a", "b"], {"a": Triangular(1.0), "b": StudentT(2.0, 5.0)}, stated)
    drawn = other.draw("sobol", 3, 65_536, 0, 65_536)
    assert stats.spearmanr(drawn[:, 0], drawn[:, 1]).statistic == pytest.approx(wanted, abs=2e-3)


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_ends_of_the_range(end: float) -> None:
    for group in (None, MultivariateT(("a", "b"), 3.0)):
        assert rank_correlation(end, group, group) == pytest.approx(end, abs=1e-9)
        model = ErrorModel(
            ["a", "b"],
            {"a": Normal(1.0), "b": Normal(2.0)},
            [Correlation(("a", "b"), end, of_ranks=True)],
            [group] if group else [],
        )
        drawn = model.draw("random", 1, 50, 0, 50)
        np.testing.assert_allclose(drawn[:, 1], 2.0 * end * drawn[:, 0], rtol=1e-12)


def test_many_degrees_of_freedom_are_the_normal_again() -> None:
    group = MultivariateT(("a", "b"), 1e7)
    assert group.coupling == pytest.approx(1.0, abs=1e-6)
    assert rank_correlation(0.5, group, group) == pytest.approx(rank_correlation(0.5), abs=1e-6)
    assert normal_of_rank(0.5, group, None) == pytest.approx(normal_of_rank(0.5), abs=1e-6)


@pytest.mark.parametrize("degrees", [2.5, 5.0, 40.0])
def test_the_scale(degrees: float) -> None:
    """Its mean against scipy's chi distribution; its values against scipy's chi-square quantiles."""
    group = MultivariateT(("a", "b"), degrees)
    expected = stats.chi(degrees).expect(lambda w: np.sqrt(degrees - 2.0) / w)
    assert group.coupling == pytest.approx(expected, rel=1e-7)
    normal = np.linspace(-6.0, 6.0, 25)
    quantile = np.where(
        normal < 0.0, stats.chi2(degrees).ppf(stats.norm.cdf(normal)), stats.chi2(degrees).isf(stats.norm.sf(normal))
    )
    np.testing.assert_allclose(group.scale(normal), np.sqrt((degrees - 2.0) / quantile), rtol=1e-9)


def test_each_member_is_students_t() -> None:
    """Kolmogorov-Smirnov; and their sizes come together, where normals of no correlation would have them apart."""
    model = ErrorModel(["a", "b"], {"a": Normal(2.0), "b": Normal(1.0)}, (), [MultivariateT(("a", "b"), 5.0)])
    drawn = model.draw("random", 8, 40_000, 0, 40_000)
    for column, sigma in zip(drawn.T, (2.0, 1.0), strict=True):
        assert stats.kstest(column, stats.t(5.0, scale=sigma * np.sqrt(3.0 / 5.0)).cdf).pvalue > FALSE_ALARM
    distance = np.sum((drawn / [2.0, 1.0]) ** 2, axis=1) / 2.0 * 5.0 / 3.0
    assert stats.kstest(distance, stats.f(2.0, 5.0).cdf).pvalue > FALSE_ALARM
    assert np.all(model.covariance == np.diag([4.0, 1.0]))
    assert not model.independent


@pytest.mark.parametrize("design", DESIGNS)
def test_a_sample_is_the_same_in_whatever_stretch_it_is_drawn(design: str) -> None:
    count = 3_000
    whole = MODEL.draw(design, 5, count, 0, count)
    for chunk in (7, 1000):
        pieces = [MODEL.draw(design, 5, count, begin, min(begin + chunk, count)) for begin in range(0, count, chunk)]
        assert np.array_equal(np.concatenate(pieces), whole)


def test_pairs_mirror_and_other_sources_stay_as_they_were() -> None:
    drawn = MODEL.draw("antithetic", 5, 1001, 0, 1001)
    np.testing.assert_array_equal(drawn[0:1000:2], -drawn[1:1001:2])
    alone = ErrorModel(["a", "b", "c"], {"a": Normal(1.0), "b": Normal(1.0), "c": Normal(1.0)})
    joined = ErrorModel(["a", "b", "c"], dict.fromkeys("abc", Normal(1.0)), (), [MultivariateT(("a", "b"), 5.0)])
    one, other = (model.draw("random", 5, 100, 0, 100) for model in (alone, joined))
    np.testing.assert_array_equal(one[:, 2], other[:, 2])
    np.testing.assert_allclose(one[:, 0] / one[:, 1], other[:, 0] / other[:, 1], rtol=1e-12)


def test_tails_are_told() -> None:
    assert (MODEL.heavy_tailed("random"), MODEL.long_tailed("random")) == ((), tuple("abcef"))
    assert MODEL.heavy_tailed("sobol") == tuple("abcef")
    assert not MODEL.normal
    assert ErrorModel(NAMES, SOURCES, (), [MultivariateT(("a", "b"), 5.0)]).heavy_tailed("random") == ("a", "b")
    copied = pickle.loads(pickle.dumps(MODEL))
    assert np.array_equal(copied.draw("random", 1, 9, 0, 9), MODEL.draw("random", 1, 9, 0, 9))


def test_impossible_ones_are_refused() -> None:
    with pytest.raises(ValueError, match="must exceed 2"):
        MultivariateT(("a", "b"), 2.0)
    with pytest.raises(JointError, match="d must be stated by its sigma alone"):
        ErrorModel(NAMES, SOURCES, (), [MultivariateT(("a", "d"), 5.0)])
    with pytest.raises(JointError, match="f must be stated by its sigma alone"):
        ErrorModel(NAMES, {**SOURCES, "f": Fixed(1.0)}, (), [MultivariateT(("f", "a"), 5.0)])
    with pytest.raises(JointError, match="f must be stated by its sigma alone"):
        ErrorModel(NAMES, {**SOURCES, "f": Normal(1.0, 2.0)}, (), [MultivariateT(("f", "a"), 5.0)])
    with pytest.raises(JointError, match="b is named twice"):
        ErrorModel(NAMES, SOURCES, (), [MultivariateT(("a", "b"), 5.0), MultivariateT(("b", "c"), 5.0)])
    with pytest.raises(CorrelationError, match=r"can be correlated up to 0\.9[0-9]+; got 0\.99"):
        ErrorModel(NAMES, SOURCES, [Correlation(("a", "e"), 0.99)], GROUPS)
    with pytest.raises(CorrelationError, match=r"rank-correlated up to 0\.9[0-9]+; got -0\.99"):
        ErrorModel(NAMES, SOURCES, [Correlation(("a", "d"), -0.99, of_ranks=True)], GROUPS)


def test_a_member_may_be_absent_in_size() -> None:
    model = ErrorModel(["a", "b"], {"a": Normal(1.0), "b": Normal(0.0)}, (), [MultivariateT(("a", "b"), 30.0)])
    assert np.all(model.draw("random", 1, 20, 0, 20)[:, 1] == 0.0)
    assert model.long_tailed("random") == ()
