"""Closed forms of textbooks: laws of growth on a flat earth, one Schuler channel, Foucault's rotation, averages."""

from __future__ import annotations

import math


def schuler_rate(gravity: float, radius: float) -> float:
    """Compute sqrt(g / R), rad/s."""
    return math.sqrt(gravity / radius)


def channel(source: str, size: float, gravity: float, rate: float, time: float) -> float:
    """Compute the position error, m, of one horizontal channel at rest from one error of a size, SI.

    With w the Schuler rate and R = g / w²: an accelerometer's bias b gives b / w² (1 - cos wt), a tilt R times it
    times (1 - cos wt), a velocity error v sin(wt) / w, a gyro's drift R times it times (t - sin(wt) / w).
    """
    radius, angle = gravity / rate**2, rate * time
    versed = 2.0 * math.sin(0.5 * angle) ** 2
    responses = {
        "bias": versed / rate**2,
        "tilt": radius * versed,
        "velocity": math.sin(angle) / rate,
        "drift": radius * (time - math.sin(angle) / rate),
    }
    return size * responses[source]


def growth(source: str, size: float, gravity: float, time: float) -> float:
    """Compute the position error, m, on a flat earth from one error of a size, SI.

    An accelerometer's bias b gives b t² / 2, a tilt g times it times t² / 2, a velocity error v t, a gyro's drift g
    times it times t³ / 6.
    """
    responses = {
        "bias": 0.5 * time**2,
        "tilt": 0.5 * gravity * time**2,
        "velocity": time,
        "drift": gravity * time**3 / 6.0,
    }
    return size * responses[source]


def integrated_walk(density: float, integrations: int, time: float) -> float:
    """Compute the sigma of white noise integrated several times: N t^(n - 1/2) / ((n - 1)! sqrt(2 n - 1)).

    >>> round(integrated_walk(1.0, 2, 3.0), 12) == 3.0  # sqrt(t³ / 3)
    True
    """
    power = math.pow(time, integrations - 0.5)
    return density * power / (math.factorial(integrations - 1) * math.sqrt(2 * integrations - 1))


def integrated_markov(sigma: float, correlation_time: float, time: float) -> float:
    """Compute the sigma of the integral of a stationary Gauss-Markov process: sigma tau sqrt(2 (x - 1 + e^-x))."""
    x = time / correlation_time
    return sigma * correlation_time * math.sqrt(2.0 * (x + math.expm1(-x)))


def foucault_period(rotation_rate: float, latitude: float) -> float:
    """Compute the time in which the plane of a pendulum turns once, s: 2 pi / (Omega sin phi)."""
    return 2.0 * math.pi / (rotation_rate * math.sin(latitude))


def repeated_fixes(start: float, fix: float, count: int) -> float:
    """Compute the sigma of a constant after several fixes: 1 / sqrt(1 / s² + n / r²)."""
    return 1.0 / math.sqrt(1.0 / start**2 + count / fix**2)
