"""Truth and navigator in polar coordinates, NASA TN D-1772, eqs. (1)-(9): for numpy, numba, JAX and heyoka.

Written once, so that peers differ in how they integrate and in nothing else. Units are those of
`tests.benchmarks.case`. The eight constants of a stretch: base of the atmosphere's layer; ``a``, ``b`` and ``c`` of its
density ``D exp(-a H - c log(1 + b H))`` at a height H above that base (isothermal layers have b = c = 0, the others
a = 0, so that no branch is needed); D times the ballistic coefficient; L/D as constant and as slope against the
altitude rate; 1 or 0 for accelerometers that are on or off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from tests.benchmarks.case import LENGTH, SPEED, TIME

EARTH_RATE: Final = 7.29211e-5 * TIME
GEOPOTENTIAL_RADIUS: Final = 6_356_766.0 / LENGTH
HYDROSTATIC_GRADIENT: Final = 9.80665 * 28.966 / 8314.39
"""K/m, of the ARDC 1959 atmosphere."""


def stretch_constants(coefficients: Any, accelerometers_on: bool) -> np.ndarray:
    """The constants of a stretch, shape (8,), from those of a `mcnav.systems.reentry.truth.Phase`."""
    base, temperature, lapse, density, ballistic, lift, lift_per_rate = coefficients
    if lapse == 0.0:
        law = (HYDROSTATIC_GRADIENT / temperature * LENGTH, 0.0, 0.0)
    else:
        law = (0.0, lapse / temperature * LENGTH, 1.0 + HYDROSTATIC_GRADIENT / lapse)
    drag = density * ballistic * LENGTH
    return np.array([base / LENGTH, *law, drag, lift, lift_per_rate * SPEED, float(accelerometers_on)])


def joint_rates(library: Any) -> Callable[..., tuple[tuple[Any, ...], tuple[Any, ...]]]:
    """Rates of actual and indicated state, by the functions of a library.

    The function returned takes time, actual state (4), indicated state (4), constants of the stretch (8) and equipment
    errors (6: misalignment, drift, biases, scale factors); each component may be a number, an array or an expression.
    """
    sin, cos, exp, log, sqrt = library.sin, library.cos, library.exp, library.log, library.sqrt

    def rates(time, actual, indicated, phase, errors):  # type: ignore[no-untyped-def]
        radius, angle, radius_rate, angle_rate = actual
        base, rate, gradient, power, drag, lift, lift_per_rate, on = phase
        misalignment, drift, bias_x, bias_z, scale_x, scale_z = errors

        altitude = radius - 1.0
        height = GEOPOTENTIAL_RADIUS * altitude / (GEOPOTENTIAL_RADIUS + altitude) - base
        eastward = radius * (angle_rate - EARTH_RATE)
        airspeed = sqrt(radius_rate * radius_rate + eastward * eastward)
        half = 0.5 * drag * exp(-rate * height - power * log(1.0 + gradient * height)) * airspeed
        lift_to_drag = lift + lift_per_rate * radius_rate
        force_x = -half * (eastward + lift_to_drag * radius_rate)
        force_z = half * (radius_rate - lift_to_drag * eastward)

        turn = misalignment + drift * time - angle
        cosine, sine = cos(turn), sin(turn)
        measured_x = on * (force_x * cosine + force_z * sine + bias_x) * (1.0 + scale_x)
        measured_z = on * (force_z * cosine - force_x * sine + bias_z) * (1.0 + scale_z)

        radius_i, angle_i, radius_rate_i, angle_rate_i = indicated
        cosine, sine = cos(angle_i), sin(angle_i)
        force_xi = measured_x * cosine + measured_z * sine
        force_zi = measured_z * cosine - measured_x * sine
        return (
            (
                radius_rate,
                angle_rate,
                radius * angle_rate * angle_rate - force_z - 1.0 / (radius * radius),
                (force_x - 2.0 * radius_rate * angle_rate) / radius,
            ),
            (
                radius_rate_i,
                angle_rate_i,
                radius_i * angle_rate_i * angle_rate_i - force_zi - 1.0 / (radius_i * radius_i),
                (force_xi - 2.0 * radius_rate_i * angle_rate_i) / radius_i,
            ),
        )

    return rates
