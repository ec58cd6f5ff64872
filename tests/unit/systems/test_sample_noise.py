"""Generators of samples' noise: the same for the same key, and scaled about the mean."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mcnav.systems.user.sample_noise import CHECKED, SAMPLES, ProbedNoise, ScaledNoise, sample_noise

Draw = Callable[[np.random.Generator], np.ndarray]
DRAWS: dict[str, tuple[Draw, float]] = {
    "standard_normal": (lambda noise: noise.standard_normal(5), 0.0),
    "one normal": (lambda noise: np.array([noise.standard_normal()]), 0.0),
    "normal": (lambda noise: noise.normal(2.0, [1.0, 3.0]), 2.0),
    "multivariate_normal": (lambda noise: noise.multivariate_normal([1.0, 1.0], [[2.0, 1.0], [1.0, 2.0]], 3), 1.0),
    "random": (lambda noise: noise.random((2, 2)), 0.5),
    "uniform": (lambda noise: noise.uniform(-1.0, 2.0, 4), 0.5),
    "into an array": (lambda noise: noise.standard_normal(out=np.ones(3)), 0.0),
}
"""Ways to draw, and the mean of what they draw."""


@pytest.mark.parametrize("case", DRAWS)
def test_variates_are_scaled_about_their_mean(case: str) -> None:
    draw, mean = DRAWS[case]
    whole = draw(sample_noise(3, 5))
    assert np.all(draw(ScaledNoise(3, 5, 0.0)) == mean)
    np.testing.assert_allclose(draw(ScaledNoise(3, 5, 0.25)), mean + 0.25 * (whole - mean), rtol=1e-15, atol=1e-15)
    up, down = (draw(ScaledNoise(3, 5, scale)) for scale in (0.01, -0.01))
    np.testing.assert_allclose((up - down) / 0.02, whole - mean, atol=1e-13)  # rounding of the mean, over the scale


def test_a_scaled_generator_advances_as_a_plain_one() -> None:
    plain, scaled = sample_noise(1, 2), ScaledNoise(1, 2, 0.5)
    for draw, mean in DRAWS.values():
        np.testing.assert_allclose(draw(scaled) - mean, 0.5 * (draw(plain) - mean), atol=1e-15)


COVARIANCES = {
    "standard_normal": np.eye(5),
    "one normal": np.eye(1),
    "normal": np.diag([1.0, 9.0]),
    "multivariate_normal": np.kron(np.eye(3), [[2.0, 1.0], [1.0, 2.0]]),
    "random": np.eye(4) / 12.0,
    "uniform": np.eye(4) * 9.0 / 12.0,
    "into an array": np.eye(3),
}


@pytest.mark.parametrize("case", DRAWS)
def test_variates_deviate_as_they_are_told(case: str) -> None:
    """What each of them adds makes the covariance of what is drawn; there are as many as numbers here."""
    draw, mean = DRAWS[case]
    noise = ProbedNoise(np.zeros(0))
    assert np.all(draw(noise) == mean)
    assert noise.used == len(COVARIANCES[case])
    added = np.array([draw(ProbedNoise(each)).ravel() - mean for each in np.eye(noise.used)])
    np.testing.assert_allclose(added.T @ added, COVARIANCES[case], atol=1e-14)


def test_what_has_no_scale_is_refused() -> None:
    for name in ("poisson", "integers", "choice", "exponential", "permutation", "bytes", "spawn"):
        with pytest.raises(TypeError, match=f"noise.{name} has no linear response"):
            getattr(ScaledNoise(1, 2, 0.5), name)(3)
    assert isinstance(ScaledNoise(1, 2, 0.5), np.random.Generator)


def test_seed_index_and_stream_are_the_key() -> None:
    """Large seeds and indices, too; the largest of campaigns are 2^63 - 1 and 10^12."""
    keys = [(1, 2, SAMPLES), (2, 1, SAMPLES), (1, 3, SAMPLES), (1, 2, CHECKED), (2**63 - 1, 10**12, SAMPLES)]
    drawn = [tuple(sample_noise(*key).standard_normal(4)) for key in keys]
    assert len(set(drawn)) == len(keys)
    assert drawn == [tuple(sample_noise(*key).standard_normal(4)) for key in keys]
