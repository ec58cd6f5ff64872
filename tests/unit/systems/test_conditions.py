"""Conditions on noise, and generators whose normals are given."""

import numpy as np

from mcnav.systems.conditions import LEFT, Conditions
from mcnav.systems.user.sample_noise import GivenNoise, sample_noise


def rows(count, of, memory, seed=3):
    """Return N of a process that remembers: rows of neighbouring outcomes are nearly alike."""
    white = np.random.default_rng(seed).standard_normal((count, of))
    for k in range(1, count):
        white[k] = memory * white[k - 1] + np.sqrt(1.0 - memory**2) * white[k]
    return np.vstack([white, 1e-9 * white[:1], np.zeros((1, of))])


def test_directions_are_orthonormal_and_leave_little():
    for memory in (0.0, 0.99, 1.0):
        partials = rows(30, 200, memory)
        found = Conditions.on(partials)
        np.testing.assert_allclose(found.directions @ found.directions.T, np.eye(len(found.directions)), atol=1e-12)
        variance = np.sum(partials**2, axis=1)
        left = variance - np.sum(found.factor**2, axis=1)
        assert (left <= LEFT * variance * (1.0 + 1e-9)).all()
        np.testing.assert_allclose(found.factor, partials @ found.directions.T, atol=1e-12)
    assert len(Conditions.on(rows(30, 200, 0.0)).directions) == 30
    assert len(Conditions.on(rows(30, 200, 1.0)).directions) == 1


def test_conditions_are_met_and_leave_the_rest():
    found = Conditions.on(rows(5, 40, 0.5))
    generator = np.random.default_rng(2)
    normals, wanted = generator.standard_normal((7, 40)), 4.0 * generator.standard_normal((7, 5))
    met = found.met(normals, wanted)
    np.testing.assert_allclose(met @ found.directions.T, wanted, atol=1e-12)
    others = np.eye(40) - found.directions.T @ found.directions
    np.testing.assert_allclose(met @ others, normals @ others, atol=1e-12)


def test_given_normals_are_drawn_in_their_order_by_every_method():
    given = np.arange(1.0, 13.0)
    noise = GivenNoise(1, 2, given)
    out = np.empty(2)
    assert noise.standard_normal() == 1.0
    assert noise.normal(10.0, 2.0) == 14.0
    np.testing.assert_allclose(noise.normal([0.0, 1.0], [1.0, 2.0]), [3.0, 9.0])
    uniform = noise.random()
    assert noise.standard_normal(out=out) is out
    np.testing.assert_allclose(out, [5.0, 6.0])
    assert noise.standard_normal((1, 2), dtype=np.float32).dtype == np.float32
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    drawn = noise.multivariate_normal([0.0, 1.0], covariance, method="cholesky")
    np.testing.assert_allclose(drawn, [0.0, 1.0] + np.linalg.cholesky(covariance) @ [9.0, 10.0])
    assert noise.used == 10
    np.testing.assert_allclose(noise.standard_normal(4)[:2], [11.0, 12.0])
    assert uniform == sample_noise(1, 2).random()


def test_normals_that_are_not_given_are_drawn_or_zero():
    assert np.isfinite(GivenNoise(1, 2, np.zeros(0)).standard_normal(3)).all()
    np.testing.assert_array_equal(GivenNoise(1, 2, np.ones(1), 0.0).standard_normal(3), [1.0, 0.0, 0.0])
