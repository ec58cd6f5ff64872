"""Error models: start covariance, correlations that are reached, draws that depend on seed and index alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from mcnav.sampler.copula import hermite_coefficients, normal_correlation, semidefinite_factor
from mcnav.sampler.designs import DESIGNS, block_length, standard_normals
from mcnav.sampler.distributions import (
    Distribution,
    Fixed,
    Normal,
    StudentT,
    Triangular,
    TruncatedNormal,
    Uniform,
    tail_weight,
)
from mcnav.sampler.error_model import Correlation, CorrelationError, ErrorModel
from mcnav.sampler.multivariate_t import MultivariateT

ALL: dict[str, Distribution] = {
    "a": Normal(2.0),
    "b": Uniform(1.0),
    "c": TruncatedNormal(1.0, 1.5),
    "d": Triangular(3.0),
    "e": StudentT(1.0, 5.0),
    "f": Fixed(0.25),
}
CORRELATED = [Correlation(("a", "b"), -0.6), Correlation(("b", "e"), 0.5), Correlation(("d", "c"), 0.9)]
FALSE_ALARM = 1e-6
"""Probability with which a right program fails one of the statistical assertions here; the seeds are fixed besides."""


def test_start_covariance() -> None:
    model = ErrorModel(list("abcdef"), ALL, CORRELATED)
    sigma = np.array([ALL[name].standard_deviation for name in "abcdef"])
    assert model.mean.tolist() == [0.0] * 5 + [0.25]
    np.testing.assert_array_equal(np.diag(model.covariance), sigma**2)
    assert model.covariance[0, 1] == pytest.approx(-0.6 * 2.0 / np.sqrt(3.0))
    assert np.all(model.covariance[5] == 0.0)


@pytest.mark.parametrize("design", DESIGNS)
def test_draws_have_the_start_covariance(design: str) -> None:
    """Each entry within the false-alarm bound of its own standard error, from the spread of independent blocks."""
    model, count = ErrorModel(list("abcdef"), ALL, CORRELATED), 65_536
    errors = model.draw(design, 11, count, 0, count)
    assert np.all(errors[:, 5] == 0.25)
    centred = errors[:, :5]
    bound = stats.norm.isf(FALSE_ALARM / 2.0)
    for i in range(5):
        for j in range(i + 1):
            products = centred[:, i] * centred[:, j]
            error = products.std() / np.sqrt(count)
            assert abs(products.mean() - model.covariance[i, j]) < bound * error


@pytest.mark.parametrize("design", DESIGNS)
def test_a_sample_is_the_same_in_whatever_stretch_it_is_drawn(design: str) -> None:
    model, count = ErrorModel(list("abcdef"), ALL, CORRELATED), 3_000
    whole = model.draw(design, 5, count, 0, count)
    for chunk in (1, 7, 1000, 1024):
        begins = range(0, 300 if chunk == 1 else count, chunk)
        pieces = [model.draw(design, 5, count, begin, min(begin + chunk, count)) for begin in begins]
        drawn = np.concatenate(pieces)
        assert np.array_equal(drawn, whole[: len(drawn)])


def test_more_samples_leave_the_first_as_they_were() -> None:
    """For random and antithetic draws always; for the replicated ones while the block length stays."""
    for design, more in (("random", 10_000), ("antithetic", 10_000), ("latin-hypercube", 500), ("sobol", 500)):
        few = standard_normals(design, 3, 300, 0, 300, 4)
        assert np.array_equal(standard_normals(design, 3, more, 0, 300, 4), few)


def test_different_seeds_differ() -> None:
    for design in DESIGNS:
        one, other = (standard_normals(design, seed, 64, 0, 64, 3) for seed in (1, 2))
        assert not np.any(one == other)


@pytest.mark.parametrize("design", DESIGNS)
def test_draws_are_normal(design: str) -> None:
    """Kolmogorov-Smirnov in each dimension: exact for random draws, and conservative for the evener designs."""
    drawn = standard_normals(design, 9, 16_384, 0, 16_384, 3)
    for column in drawn.T:
        assert stats.kstest(column, "norm").pvalue > FALSE_ALARM


def test_antithetic_pairs_mirror() -> None:
    drawn = standard_normals("antithetic", 4, 11, 0, 11, 3)
    np.testing.assert_array_equal(drawn[0:10:2], -drawn[1:11:2])


def test_each_hypercube_fills_its_strata() -> None:
    count = 1_024
    length = block_length("latin-hypercube", count)
    drawn = stats.norm.cdf(standard_normals("latin-hypercube", 4, count, 0, count, 3))
    for block in drawn.reshape(-1, length, 3):
        strata = np.sort(np.floor(block * length).astype(int), axis=0)
        assert np.array_equal(strata, np.tile(np.arange(length)[:, None], 3))


@pytest.mark.parametrize("name", "abcde")
def test_hermite_coefficients_carry_the_whole_variance(name: str) -> None:
    """Parseval: they square up to one, and even ones vanish by symmetry. The triangle's kink costs 1e-7."""
    coefficients = hermite_coefficients(ALL[name])
    assert np.sum(coefficients**2) == pytest.approx(1.0, abs=2e-7)
    assert np.abs(coefficients[::2]).max() < 1e-10


def test_copula_of_uniforms_is_the_textbooks() -> None:
    """Uniform margins: corr = (6 / pi) arcsin(rho_z / 2) (Kruskal, 1958)."""
    for wanted in (-0.9, -0.3, 0.2, 0.95):
        found = normal_correlation(Uniform(1.0), Uniform(2.0), wanted)
        assert found == pytest.approx(2.0 * np.sin(np.pi * wanted / 6.0), abs=1e-9)


def test_a_correlation_out_of_reach_is_refused() -> None:
    with pytest.raises(CorrelationError, match=r"correlated up to 0\.\d+; got 0\.9999"):
        ErrorModel(["a", "b"], {"a": Normal(1.0), "b": StudentT(1.0, 2.5)}, [Correlation(("a", "b"), 0.9999)])


@pytest.mark.parametrize("kind", [Uniform, Triangular, lambda size: StudentT(size, 5.0), Normal])
def test_perfect_correlation_between_like_distributions(kind: Callable[[float], Distribution]) -> None:
    model = ErrorModel(["a", "b"], {"a": kind(1.0), "b": kind(0.5)}, [Correlation(("a", "b"), -1.0)])
    errors = model.draw("random", 1, 50, 0, 50)
    np.testing.assert_allclose(errors[:, 1], -0.5 * errors[:, 0], rtol=1e-12)


def test_tails_too_heavy_to_correlate_are_refused() -> None:
    with pytest.raises(CorrelationError, match="tails too heavy to be correlated"):
        ErrorModel(["a", "b"], {"a": Normal(1.0), "b": StudentT(1.0, 2.01)}, [Correlation(("a", "b"), 0.1)])


def test_perfect_correlation_can_be_drawn() -> None:
    model = ErrorModel(["a", "b"], {"a": Normal(1.0), "b": Normal(3.0)}, [Correlation(("a", "b"), -1.0)])
    errors = model.draw("random", 1, 100, 0, 100)
    np.testing.assert_allclose(errors[:, 1], -3.0 * errors[:, 0], rtol=1e-14)


def test_impossible_correlations_are_refused() -> None:
    names = ["a", "b", "c"]
    pairs = [Correlation(("a", "b"), 0.9), Correlation(("a", "c"), 0.9), Correlation(("b", "c"), -0.9)]
    with pytest.raises(CorrelationError, match=r"not a correlation matrix: its smallest eigenvalue is -0\.8"):
        ErrorModel(names, dict.fromkeys(names, Normal(1.0)), pairs)


def test_semidefinite_factor() -> None:
    matrix = np.array([[1.0, 1.0, 0.3], [1.0, 1.0, 0.3], [0.3, 0.3, 1.0]])
    factor = semidefinite_factor(matrix)
    np.testing.assert_allclose(factor @ factor.T, matrix, atol=1e-15)
    assert np.array_equal(factor, np.tril(factor))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Normal(-1.0), "must not be negative"),
        (lambda: Normal(1.0, np.inf), "mean must be finite"),
        (lambda: Uniform(0.0), "must be positive"),
        (lambda: StudentT(1.0, 2.0), "must exceed 2"),
        (lambda: TruncatedNormal(1.0, 1e-9), "at least 0.001 sigma"),
        (lambda: Fixed(float("nan")), "must be finite"),
    ],
)
def test_impossible_distributions_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(("degrees", "weight"), [(10.0, 70.0), (14.0, 29.1667), (20.0, 20.0)])
def test_tail_weight_of_students_t(degrees: float, weight: float) -> None:
    """35/3 (v - 2) (v - 4) / ((v - 6) (v - 8))."""
    assert tail_weight(StudentT(3.0, degrees)) == pytest.approx(weight, rel=1e-2)


def test_tails_are_told_apart() -> None:
    sources = {"a": Normal(1.0), "b": Uniform(1.0), "c": StudentT(1.0, 8.0), "d": StudentT(1.0, 10.0), "e": Fixed(1.0)}
    model = ErrorModel(list("abcdef"), sources)
    assert (model.heavy_tailed("random"), model.long_tailed("random"), model.normal) == (("c",), ("d",), False)
    assert (model.heavy_tailed("sobol"), model.long_tailed("sobol")) == (("c", "d"), ())
    assert ErrorModel(["a", "e"], {"a": Normal(1.0), "e": Fixed(1.0)}).normal


@pytest.mark.parametrize("design", DESIGNS)
def test_a_later_source_leaves_the_draws_of_campaigns_without_it(design: str) -> None:
    """Bit for bit, with a group that shares its tails; present, it is drawn last."""
    stated: dict[str, Distribution] = {"a": Normal(1.0), "c": Normal(2.0)}
    group = [MultivariateT(("a", "c"), 30.0)]
    before = ErrorModel(["a", "c"], stated, (), group).draw(design, 1, 500, 0, 500)
    absent = ErrorModel(["a", "b", "c"], stated, (), group, ["b"]).draw(design, 1, 500, 0, 500)
    present = ErrorModel(["a", "b", "c"], stated | {"b": Normal(1.0)}, (), group, ["b"]).draw(design, 1, 500, 0, 500)
    assert np.array_equal(absent[:, [0, 2]], before)
    assert np.all(absent[:, 1] == 0.0)
    assert abs(present[:, 1].std() - 1.0) < 0.2
    assert abs(np.corrcoef(present.T)[[0, 2], 1]).max() < 0.2
