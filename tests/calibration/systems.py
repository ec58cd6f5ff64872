"""Synthetic systems with two outputs and three independent sources of unit variance, their moments in closed form.

`linear`
    The simulation is the linear model: all differences are sampling noise.
`disguised`
    ``y_1 = a x_1 + c (x_3^2 - 1)`` and ``y_2 = b x_2 + c x_1 x_3``, with a and b such that both variances are exactly
    one: the system is nonlinear, with the mean and covariance of the linear model. The paired estimate must not find a
    difference.
`quadratic`
    ``y_1 = x_1 + c x_2^2`` and ``y_2 = x_1 / 2 + x_3 + c x_1 x_2``: tests coverage.
`corrupted`
    A linear simulation, compared with a linear model whose first column is 5 % too large: tests power.
`dependent`
    ``y_1 = x_1`` and ``y_2 = 2 x_1``: of ``y_2 - 2 y_1`` the linear model has no dispersion, nor has the simulation.
`bent`
    The same with ``y_2 = 2 x_1 + d (x_1^2 - 1)``: the combination is dispersed, by less than a thousandth of ``y_2``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.model import Model
from mcnav.arrays.types import Array

CURVATURE: Final = 0.2
CORRUPTION: Final = 1.05
PARTIALS: Final = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 1.0]])
BEND: Final = 0.2
FAINT: Final = 1e-3


@dataclass(frozen=True)
class Truth:
    """Exact mean and covariance of the two outputs, and skewness of the first where it exists and is tested."""

    mean: Array
    covariance: Array
    skewness: float | None


@dataclass(frozen=True)
class SyntheticSystem:
    """A simulated system, the linear model to test, and the exact moments.

    The simulation is a function of source values, shape (n, 3), and their fourth moment; it returns outputs, shape
    (n, 2). The truth is a function of the fourth and sixth moments of a source.
    """

    simulate: Callable[[Array, float], Array]
    model: Model
    truth: Callable[[float, float], Truth]


def _model(partials: Array) -> Model:
    return Model(partials, np.zeros(2), np.zeros(3), np.eye(3))


def _disguised(sources: Array, fourth: float) -> Array:
    bent = BEND * (sources[:, 2] ** 2 - 1.0)
    first = np.sqrt(1.0 - BEND**2 * (fourth - 1.0)) * sources[:, 0] + bent
    second = np.sqrt(1.0 - BEND**2) * sources[:, 1] + BEND * sources[:, 0] * sources[:, 2]
    return np.column_stack([first, second])


def _curved(sources: Array, fourth: float) -> Array:
    first = sources[:, 0] + CURVATURE * sources[:, 1] ** 2
    second = 0.5 * sources[:, 0] + sources[:, 2] + CURVATURE * sources[:, 0] * sources[:, 1]
    return np.column_stack([first, second])


def _curved_truth(fourth: float, sixth: float) -> Truth:
    covariance = PARTIALS @ PARTIALS.T + np.diag([CURVATURE**2 * (fourth - 1.0), CURVATURE**2])
    third = CURVATURE**3 * (sixth - 3.0 * fourth + 2.0)
    skewness = third / covariance[0, 0] ** 1.5 if np.isfinite(sixth) else None
    return Truth(np.array([CURVATURE, 0.0]), covariance, skewness)


def _linear(sources: Array, fourth: float) -> Array:
    return np.asarray(sources @ PARTIALS.T)


def _dependent(bend: float) -> Callable[[Array, float], Array]:
    def simulate(sources: Array, fourth: float) -> Array:
        first = sources[:, 0]
        return np.column_stack([first, 2.0 * first + bend * (first**2 - 1.0)])

    return simulate


def _bent_truth(fourth: float, sixth: float) -> Truth:
    return Truth(np.zeros(2), _TWINS @ _TWINS.T + np.diag([0.0, FAINT**2 * (fourth - 1.0)]), None)


def _same(covariance: Array) -> Callable[[float, float], Truth]:
    return lambda fourth, sixth: Truth(np.zeros(2), covariance, None)


_TWINS: Final = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
_PLAIN: Final = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

SYSTEMS: Final = {
    "linear": SyntheticSystem(_linear, _model(PARTIALS), _same(PARTIALS @ PARTIALS.T)),
    "disguised": SyntheticSystem(_disguised, _model(_PLAIN), _same(np.eye(2))),
    "quadratic": SyntheticSystem(_curved, _model(PARTIALS), _curved_truth),
    "corrupted": SyntheticSystem(
        _linear, _model(PARTIALS * np.array([CORRUPTION, 1.0, 1.0])), _same(PARTIALS @ PARTIALS.T)
    ),
    "dependent": SyntheticSystem(_dependent(0.0), _model(_TWINS), _same(_TWINS @ _TWINS.T)),
    "bent": SyntheticSystem(_dependent(FAINT), _model(_TWINS), _bent_truth),
}
