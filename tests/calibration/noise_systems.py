"""Synthetic systems with process noise: two outputs of three constant sources and two processes, all of unit variance.

With x the sources and w the noise of a sample, ``z = P x + w`` is its linear outcome, with ``P S P^T`` and the noise's
covariance Q in the linear model.

`noise, linear`
    ``y = z``: plain estimates have sampling noise, paired ones none.
`noise, disguised`
    ``y_1 = a (x_1 + w_1) + c (w_2^2 - 1)`` and ``y_2 = b (x_2 + w_2) + c x_3 w_1``, with a and b such that both
    variances are those of z: the paired estimate must not find a difference.
`noise, quadratic`
    ``y_1 = z_1 + c w_2^2`` and ``y_2 = z_2 + c x_2 w_1``: tests coverage.
`noise, at the tolerance`
    ``y = (1 + tolerance) z``: the sigmas neither agree nor differ.
`noise, response wrong`
    ``y = z``, and a linear model whose response to noise is 5 % too large: tests power.
`noise, covariance wrong`
    ``y = z``, and a linear model that states a Q whose sigmas are 5 % too large, while z is right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from tests.calibration.cells import LEVEL
from tests.calibration.systems import CORRUPTION, CURVATURE, PARTIALS, Truth

CRITERION: Final = Criterion(tolerance=0.05, confidence=1.0 - 3.0 * (1.0 - LEVEL))
"""Joint confidence that gives each of three statements (two outputs and the matrix) `LEVEL`."""

APART: Final = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Partial derivatives of the disguised system."""


@dataclass(frozen=True)
class NoisySystem:
    """A simulated system with noise, and the linear model to test.

    ``simulate`` is a function of source values, shape (n, 3), and noise, shape (n, 2); it returns simulated and linear
    outcomes, each of shape (n, 2).
    """

    simulate: Callable[[Array, Array], tuple[Array, Array]]
    model: Model
    truth: Truth


def _model(partials: Array, noise: float = 1.0) -> Model:
    return Model(partials, np.zeros(2), np.zeros(3), np.eye(3), {"walk": noise**2 * np.eye(2)})


def _linear(gain: float = 1.0, response: float = 1.0) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Simulate ``gain z``, with linear outcomes of another response to noise."""

    def simulate(sources: Array, noise: Array) -> tuple[Array, Array]:
        own = sources @ PARTIALS.T
        return gain * (own + noise), own + response * noise

    return simulate


def _disguised(sources: Array, noise: Array) -> tuple[Array, Array]:
    linear = sources @ APART.T + noise
    first = np.sqrt(1.0 - CURVATURE**2) * linear[:, 0] + CURVATURE * (noise[:, 1] ** 2 - 1.0)
    second = np.sqrt(1.0 - 0.5 * CURVATURE**2) * linear[:, 1] + CURVATURE * sources[:, 2] * noise[:, 0]
    return np.column_stack([first, second]), linear


def curved(curvature: float) -> NoisySystem:
    """Return the quadratic system of a curvature.

    Its moments are those of ``w^2``: variance two and third central moment eight.
    """

    def simulate(sources: Array, noise: Array) -> tuple[Array, Array]:
        linear = sources @ PARTIALS.T + noise
        bent = np.column_stack([noise[:, 1] ** 2, sources[:, 1] * noise[:, 0]])
        return linear + curvature * bent, linear

    covariance = OUTCOME + curvature**2 * np.diag([2.0, 1.0])
    skewness = 8.0 * curvature**3 / covariance[0, 0] ** 1.5
    return NoisySystem(simulate, _model(PARTIALS), Truth(np.array([curvature, 0.0]), covariance, skewness))


OUTCOME: Final = PARTIALS @ PARTIALS.T + np.eye(2)
"""Covariance of z."""

_EXACT: Final = Truth(np.zeros(2), OUTCOME, 0.0)
_LARGER: Final = 1.0 + CRITERION.tolerance

NOISY_SYSTEMS: Final = {
    "noise, linear": NoisySystem(_linear(), _model(PARTIALS), _EXACT),
    "noise, disguised": NoisySystem(_disguised, _model(APART), Truth(np.zeros(2), 2.0 * np.eye(2), None)),
    "noise, quadratic": curved(CURVATURE),
    "noise, at the tolerance": NoisySystem(
        _linear(_LARGER), _model(PARTIALS), Truth(np.zeros(2), _LARGER**2 * OUTCOME, None)
    ),
    "noise, response wrong": NoisySystem(_linear(response=CORRUPTION), _model(PARTIALS, CORRUPTION), _EXACT),
    "noise, covariance wrong": NoisySystem(_linear(), _model(PARTIALS, CORRUPTION), _EXACT),
}
