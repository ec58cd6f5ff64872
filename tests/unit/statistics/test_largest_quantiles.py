"""Quantiles of many sizes searched for together, and the largest of them, against one after another."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.statistics.largest_quantiles import largest_quantiles
from mcnav.statistics.normal_size import size_quantile, size_quantiles


def vectors(count: int, dimension: int, offset: float) -> tuple[Array, Array]:
    """Means and covariances at random, sigmas that differ by up to a thousand, some axes without variance."""
    random = np.random.default_rng(100 * dimension + count)
    sigmas = 10.0 ** random.uniform(-3.0, 0.0, (count, dimension)) * random.choice([0.0, 1.0, 1.0], (count, dimension))
    axes = np.linalg.qr(random.standard_normal((count, dimension, dimension)))[0]
    covariances = np.einsum("nij,nj,nkj->nik", axes, sigmas**2, axes)
    return offset * random.standard_normal((count, dimension)), covariances


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_together_as_one_after_another(dimension: int, offset: float) -> None:
    """The same search: brackets end at 1e-13 of their first width, and sums of rows differ in the last digit."""
    means, covariances = vectors(40, dimension, offset)
    probabilities = np.resize([0.05, 0.5, 0.9973, 1.0 - 1e-7], 40)
    alone = [size_quantile(*law) for law in zip(means, covariances, probabilities.tolist(), strict=True)]
    np.testing.assert_allclose(size_quantiles(means, covariances, probabilities), alone, rtol=1e-11)
    for probability in (0.05, 0.9973):
        alone = [size_quantile(*law, probability) for law in zip(means, covariances, strict=True)]
        groups = np.reshape(alone, (4, 10))
        known = np.array([0.0, 0.0, 1e3, 0.0])
        largest, worst = largest_quantiles(
            means.reshape(4, 10, dimension), covariances.reshape(4, 10, dimension, dimension), probability, known
        )
        np.testing.assert_allclose(largest, np.maximum(groups.max(axis=1), known), rtol=1e-11)
        assert worst[[0, 1, 3]].tolist() == groups.argmax(axis=1)[[0, 1, 3]].tolist()


def test_vectors_without_finite_moments_have_no_quantile() -> None:
    means, covariances = np.zeros((2, 2, 1)), np.array([[[[np.nan]], [[4.0]]], [[[np.nan]], [[np.inf]]]])
    largest, worst = largest_quantiles(means, covariances, 0.6826894921, np.zeros(2))
    assert largest == pytest.approx([2.0, np.nan], rel=1e-9, nan_ok=True)
    assert worst[0] == 1
