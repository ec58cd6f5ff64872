"""The stated covariance of noise against linear outcomes: false alarms, and what is found."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.linear_samples import NoiseDoubt, doubt_noise
from mcnav.analysis.model import Model

COVARIANCE = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 0.0]])
"""Of two outputs with noise; the third has none."""

COUNT = 20_000


def _model(covariance: np.ndarray = COVARIANCE) -> Model:
    partials = np.array([[1.0, 0.0], [2.0, 1.0], [0.0, 3.0]])
    shares = {"one": 0.25 * covariance, "other": 0.75 * covariance}
    return Model(partials, np.array([1.0, 2.0, 3.0]), np.zeros(2), np.eye(2), shares)


def _found(model: Model, limit: float, seed: int, noise: np.ndarray = COVARIANCE) -> NoiseDoubt | None:
    generator = np.random.default_rng(seed)
    errors = generator.standard_normal((COUNT, 2))
    linear = generator.multivariate_normal(np.zeros(3), noise, COUNT) + model.nominal + errors @ model.partials.T
    return doubt_noise(model, errors, linear, limit)


def test_the_right_covariance_is_not_doubted() -> None:
    """At a limit of zero a hundred seeds raise no alarm, of a probability of 1e-6 each."""
    assert not any(_found(_model(), 0.0, seed) for seed in range(100))


@pytest.mark.parametrize(("share", "output"), [(0.05, 0), (-0.05, 1)])
def test_a_sigma_that_is_five_per_cent_off_is_found(share: float, output: int) -> None:
    """The measured sigma is 0.5 % uncertain; beyond a limit of 1 % and 5.3 of these there are 1.4 % left."""
    scale = np.eye(3)
    scale[output, output] = 1.0 + share
    doubt = _found(_model(scale @ COVARIANCE @ scale), 0.01, 1)
    assert doubt is not None
    assert doubt.disagreement == pytest.approx(0.05, abs=0.05**2 + 5.0 * 0.005)


def test_what_is_within_the_limit_is_not_doubted() -> None:
    assert _found(_model(1.02**2 * COVARIANCE), 0.05, 1) is None


def test_a_wrong_correlation_is_found() -> None:
    """Sigmas of single outputs are right: sums and differences of two tell."""
    assert _found(_model(np.diag([4.0, 9.0, 0.0])), 0.01, 1) is not None
    assert _found(_model(), 0.01, 1, np.diag([4.0, 9.0, 0.0])) is not None


def test_noise_where_none_is_stated_is_found() -> None:
    doubt = _found(_model(), 0.01, 1, COVARIANCE + np.diag([0.0, 0.0, 1e-6]))
    assert doubt == NoiseDoubt(2, np.inf)
    model = _model(np.zeros((3, 3)))
    assert _found(model, 0.01, 1, np.zeros((3, 3))) is None
    assert doubt_noise(model, np.zeros((0, 2)), np.zeros((0, 3)), 0.01) is None
