"""Modes of a navigator at rest: of its linear transition matrix, and of the simulated responses to small errors."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import without_noise
from mcnav.systems.ins.imu.instruments import OUTPUTS
from mcnav.systems.ins.scenario import Ins

HORIZONTAL: Final = [number for number, name in enumerate(OUTPUTS) if not name.endswith("down")]
VERTICAL: Final = [number for number, name in enumerate(OUTPUTS) if name.endswith("down")]

SMALL: Final = np.repeat([10.0, 0.01, 1e-5], 3)
"""Errors that are flown, m, m/s and rad; what they leave of third order is 1e-11 of a response."""


def transitions(scenario: Ins) -> tuple[Array, Array]:
    """Return the final errors over the initial ones, shape (9, 9), linear and simulated, in units of `SMALL`."""
    linear = scenario.linear().end.partials[:, : len(OUTPUTS)]
    errors = np.zeros((2 * len(SMALL), len(scenario.sources)))
    errors[: len(SMALL), : len(SMALL)] = np.diag(SMALL)
    errors[len(SMALL) :] = -errors[: len(SMALL)]
    flown = without_noise(scenario.engine(scenario.engines[0], errors))(errors).values
    simulated = (flown[: len(SMALL)] - flown[len(SMALL) :]).T / 2.0
    return linear * SMALL / SMALL[:, None], simulated / SMALL[:, None]


def _duration(scenario: Ins) -> float:
    return scenario.navigation.end - scenario.navigation.start


def oscillations(scenario: Ins) -> tuple[Array, Array]:
    """Return the rates of the modes of the horizontal channels, falling, rad/s, linear and simulated."""

    def rates(transition: Array) -> Array:
        values = np.linalg.eigvals(transition[np.ix_(HORIZONTAL, HORIZONTAL)]).astype(complex)
        angles = np.sort(np.angle(values))[::-1]
        return np.asarray(angles[: len(HORIZONTAL) // 2] / _duration(scenario))

    linear, simulated = (rates(transition) for transition in transitions(scenario))
    return linear, simulated


def growth_rate(scenario: Ins) -> tuple[float, float]:
    """Return the rate at which errors of the vertical channel grow, 1/s, linear and simulated."""
    linear, simulated = (
        float(np.log(np.abs(np.linalg.eigvals(transition[np.ix_(VERTICAL, VERTICAL)])).max()) / _duration(scenario))
        for transition in transitions(scenario)
    )
    return linear, simulated


def steady_drift(scenario: Ins, output: str, source: str) -> float:
    """Return the mean rate of an output that grows steadily from a constant source of unit size, linear, SI.

    The output alone has the eigenvalue one; the rate is what its left eigenvector gains in a navigation.
    """
    model, names = scenario.linear().end, [source.name for source in scenario.sources]
    transition, _ = transitions(scenario)
    values, vectors = np.linalg.eig(transition[np.ix_(HORIZONTAL, HORIZONTAL)].T)
    left = np.real(vectors[:, np.argmin(np.abs(values - 1.0))])
    place = HORIZONTAL.index(OUTPUTS.index(output))
    gained = model.partials[HORIZONTAL, names.index(source)] / SMALL[HORIZONTAL]
    return float(left @ gained / left[place] * SMALL[OUTPUTS.index(output)] / _duration(scenario))
