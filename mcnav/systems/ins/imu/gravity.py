"""Gravity disturbance: what true gravity has besides the model that navigators and filters use.

True gravity is the model's plus ``d = (-g xi, -g eta, +anomaly)`` along north, east and down of the moment, g being the
local gravity with its centrifugal part. The deflections of the vertical xi and eta and the anomaly are independent
first-order Gauss-Markov processes of the distance that the vehicle has travelled: over a path of length s over the
earth, ``exp(-s / L)`` of a value is left, and a variance of ``sigma^2 (1 - exp(-2 s / L))`` is added. They are
stationary from the start of navigation, and keep their values where the vehicle stands.

A vehicle that flies a given trajectory has a specific force without d, which its accelerometers miss: d acts as an
error ``-C^T d`` of their readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

DEFLECTION: Final = "gravity_deflection"
ANOMALY: Final = "gravity_anomaly"

CAUSES: Final = (DEFLECTION, ANOMALY)
"""Names of what a budget has in a row, and of what a filter estimates or considers."""

DISTURBANCES: Final = (f"{DEFLECTION}_north", f"{DEFLECTION}_east", ANOMALY)
"""Names of the processes: xi and eta, rad, and the anomaly, m/s^2."""


@dataclass(frozen=True)
class GravityDisturbance:
    """Sizes of the gravity disturbance.

    Attributes
    ----------
    deflection : float
        Sigma of each of xi and eta, rad; zero for none.
    deflection_length : float
        Their correlation length, m.
    anomaly : float
        Sigma of the anomaly, m/s^2; zero for none.
    anomaly_length : float
        m.
    """

    deflection: float = 0.0
    deflection_length: float = np.inf
    anomaly: float = 0.0
    anomaly_length: float = np.inf

    @property
    def sizes(self) -> dict[str, float]:
        """Sigmas that are not zero, by cause."""
        return {name: size for name, size in zip(CAUSES, (self.deflection, self.anomaly), strict=True) if size > 0.0}

    @property
    def lengths(self) -> Array:
        """Correlation lengths of the three processes, shape (3,), m; of shape (0,) where none has a size."""
        lengths = [self.deflection_length, self.deflection_length, self.anomaly_length]
        return np.array(lengths if self.sizes else [], dtype=float)

    def sigma(self, name: str) -> float:
        """Return the sigma of a process, SI."""
        return self.sizes.get(cause_of(name), 0.0)

    def length(self, name: str) -> float:
        """Return the correlation length of a process, m."""
        return self.anomaly_length if name == ANOMALY else self.deflection_length


def cause_of(name: str) -> str:
    """Return the cause that a process belongs to: of the two deflections it is the same; others are their own.

    >>> cause_of("gravity_deflection_east"), cause_of("gyro_angle_random_walk_x")
    ('gravity_deflection', 'gyro_angle_random_walk_x')
    """
    return DEFLECTION if name in DISTURBANCES[:2] else name


def add_by_cause(processes: Mapping[str, Array]) -> dict[str, Array]:
    """Add up what processes of the same cause contribute, independent as they are."""
    total: dict[str, Array] = {}
    for name, values in processes.items():
        cause = cause_of(name)
        total[cause] = total[cause] + values if cause in total else values
    return total
