"""The size of a normal vector against closed forms, another quadrature, and samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav._types import Array
from mcnav.statistics.circular_error import normal_probability_within
from mcnav.statistics.normal_size import NormalSize

# The burn of nasa/condor's rendezvous: mean, and a covariance with the same sigmas.
BURN = np.array([1.45222327, 0.0, 0.30311604])


def turned(variances: Array, seed: int) -> Array:
    """A covariance with these variances along random axes."""
    axes = np.linalg.qr(np.random.default_rng(seed).standard_normal((len(variances), len(variances))))[0]
    return np.asarray(axes @ np.diag(variances) @ axes.T)


@pytest.mark.parametrize("dimension", [2, 3, 5])
@pytest.mark.parametrize("noncentrality", [1e-6, 1.0, 2_000.0, 1e6])
def test_equal_sigmas_are_noncentral_chi_square(dimension: int, noncentrality: float) -> None:
    mean = np.zeros(dimension)
    mean[-1] = np.sqrt(noncentrality)
    law = NormalSize.of(mean, np.eye(dimension))
    middle, spread = dimension + noncentrality, np.sqrt(2.0 * (dimension + 2.0 * noncentrality))
    for multiple in (-3.0, -0.5, 0.0, 1.0, 4.0):
        square = max(middle + multiple * spread, 0.02 * middle)
        expected = stats.ncx2.cdf(square, dimension, noncentrality)
        assert law.probability(float(np.sqrt(square))) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_ellipses_agree_with_an_integral_over_chords(seed: int) -> None:
    random = np.random.default_rng(seed)
    covariance, mean = turned(10.0 ** random.uniform(-2.0, 0.0, 2), seed), random.standard_normal(2)
    law = NormalSize.of(mean, covariance)
    for probability in (1e-3, 0.5, 0.9973):
        size = law.quantile(probability)
        assert law.probability(size) == pytest.approx(probability, abs=1e-11)
        assert normal_probability_within(size, mean, covariance) == pytest.approx(probability, abs=1e-11)


@pytest.mark.parametrize("mean", [BURN, 0.0 * BURN, np.array([0.01, 0.0, 0.0])])
def test_mean_agrees_with_gauss_hermite_and_quantiles_with_samples(mean: Array) -> None:
    """Shares of 200,000 samples, within 3.9 standard errors."""
    covariance = turned(np.array([0.0336119, 0.04329116, 0.09082802]) ** 2, 4)
    law, lower = NormalSize.of(mean, covariance), np.linalg.cholesky(covariance)
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights /= weights.sum()
    points = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1) @ lower.T + mean
    product = weights[:, None, None] * weights[:, None] * weights
    tolerance = 1e-12 if mean is BURN else 1e-3  # a kink at zero
    assert law.mean == pytest.approx(float(np.sum(product * np.linalg.norm(points, axis=-1))), rel=tolerance)
    sizes = np.linalg.norm(mean + np.random.default_rng(7).standard_normal((200_000, 3)) @ lower.T, axis=1)
    assert sizes.mean() == pytest.approx(law.mean, abs=3.9 * sizes.std() / np.sqrt(len(sizes)))
    for probability in (0.5, 0.9973):
        share = np.mean(sizes <= law.quantile(probability))
        assert share == pytest.approx(probability, abs=3.9 * np.sqrt(probability * (1 - probability) / len(sizes)))


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_singular_covariances(rank: int) -> None:
    """Axes without dispersion add their square; with none left the size is certain."""
    variances = np.where(np.arange(3) < rank, 0.04, 0.0)
    law = NormalSize.of(np.array([0.3, 0.4, 1.2]), np.diag(variances))
    sizes = np.linalg.norm(
        [0.3, 0.4, 1.2] + np.random.default_rng(3).standard_normal((100_000, 3)) * np.sqrt(variances), axis=1
    )
    for probability in (0.05, 0.5, 0.9973):
        size = law.quantile(probability)
        if rank == 0:
            assert size == pytest.approx(1.3, rel=1e-12)
        else:
            spread = 3.9 * np.sqrt(probability * (1 - probability) / len(sizes))
            assert np.mean(sizes <= size) == pytest.approx(probability, abs=spread)


def test_small_variances_beside_a_large_one() -> None:
    """One axis of a hundred millionth of the other's variance: that of a single axis, shifted."""
    law = NormalSize.of(np.array([1.0, 2.0]), np.diag([1.0, 1e-8]))
    alone = NormalSize.of(np.array([1.0, 2.0]), np.diag([1.0, 0.0]))
    for size in (2.05, 2.5, 4.0):
        assert law.probability(size) == pytest.approx(alone.probability(size), abs=1e-6)
    assert law.probability(1.99) < 1e-12
