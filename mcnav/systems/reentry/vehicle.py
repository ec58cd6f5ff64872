"""The vehicle: drag and lift per unit mass, and the two lift laws of NASA TN D-1772."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.compiled.jit import compiled
from mcnav.physics.constants import BALLISTIC_COEFFICIENT, EARTH_RATE


@dataclass(frozen=True)
class ConstantLift:
    """The same lift-to-drag ratio throughout (the odd trajectories of Table I)."""

    lift_to_drag: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.lift_to_drag):
            raise ValueError(f"lift_to_drag must be finite; got {self.lift_to_drag}")


@dataclass(frozen=True)
class VariableLift:
    """L/D = -gain * altitude rate, held within +-limit (the even trajectories of Table I).

    Attributes
    ----------
    gain : float
        s/m; the report's k = 3.281 s/km.
    limit : float
        Largest magnitude of L/D; the report's 0.5.
    """

    gain: float = 3.281e-3
    limit: float = 0.5

    def __post_init__(self) -> None:
        if not (np.isfinite(self.gain) and self.gain > 0.0):
            raise ValueError(f"gain must be positive; got {self.gain}")
        if not (np.isfinite(self.limit) and self.limit > 0.0):
            raise ValueError(f"limit must be positive; got {self.limit}")

    @property
    def limiting_rate(self) -> float:
        """Magnitude of the altitude rate at which the limit is reached, m/s."""
        return self.limit / self.gain


LiftLaw = ConstantLift | VariableLift


@dataclass(frozen=True)
class Vehicle:
    """Aerodynamics of a vehicle: ballistic coefficient C_D A / m (m^2/kg) and lift law."""

    lift_law: LiftLaw
    ballistic_coefficient: float = BALLISTIC_COEFFICIENT

    def __post_init__(self) -> None:
        if not (np.isfinite(self.ballistic_coefficient) and self.ballistic_coefficient >= 0.0):
            raise ValueError(f"ballistic coefficient must not be negative; got {self.ballistic_coefficient}")


@compiled
def aerodynamic_force(
    radius: float, radius_rate: float, angle_rate: float, air_density: float, ballistic: float, lift_to_drag: float
) -> tuple[float, float]:
    """Compute the horizontal and vertical specific force of the air, m/s^2 (NASA TN D-1772, eqs. 2-4).

    With V_A the speed relative to the rotating air and gamma_A its flight-path angle, D = rho V_A^2 (C_D A/m) / 2,
    ``f_x = -D (cos gamma_A + (L/D) sin gamma_A)`` and ``f_z = D (sin gamma_A - (L/D) cos gamma_A)``, positive down.
    """
    eastward = radius * (angle_rate - EARTH_RATE)
    airspeed = np.sqrt(radius_rate * radius_rate + eastward * eastward)
    half = 0.5 * air_density * ballistic * airspeed  # D cos(gamma) = half * eastward: no angle need be formed
    return -half * (eastward + lift_to_drag * radius_rate), half * (radius_rate - lift_to_drag * eastward)
