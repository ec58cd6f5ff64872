"""Functions of one lane that LLVM can vectorise: no library calls, no branches, no cancellation."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.compiled.jit import inlined

TURNS_PER_RADIAN: Final = 0.5 / np.pi

SMALLEST_COMPONENT: Final = 0.3
"""A sample whose indicated position, resolved along the reference, falls below this share of the reference's radius has
left the kernel's validity: the shared grid is too coarse for its gravity, and its range angle could wrap."""


@inlined
def half_turn(angle: float) -> tuple[float, float]:
    """Compute sine and cosine of half an angle (up to a common sign), by Taylor series after reduction: 1e-15 absolute.

    ``sin(angle) = 2 s c`` and ``1 - cos(angle) = 2 s^2`` follow without cancellation.
    """
    half = np.pi * (angle * TURNS_PER_RADIAN - np.rint(angle * TURNS_PER_RADIAN))
    sine, cosine = _sine_and_cosine(half * half)
    return half * sine, cosine


@inlined
def half_turn_of_square(square: float) -> tuple[float, float]:
    """Compute the sine of half an angle over the angle, and the cosine of half, from the angle's square up to 9."""
    sine, cosine = _sine_and_cosine(0.25 * square)
    return 0.5 * sine, cosine


@inlined
def _sine_and_cosine(z: float) -> tuple[float, float]:
    """Sum the Taylor series of sin(x) / x and cos(x) in the square of x."""
    sine = 1 + z * (-1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * (1 / 362880 + z * (-1 / 39916800 + z * (
        1 / 6227020800 + z * (-1 / 1307674368000 + z * (1 / 355687428096000 + z * (-1 / 121645100408832000))))))))
    )  # fmt: skip
    cosine = 1 + z * (-1 / 2 + z * (1 / 24 + z * (-1 / 720 + z * (1 / 40320 + z * (-1 / 3628800 + z * (
        1 / 479001600 + z * (-1 / 87178291200 + z * (1 / 20922789888000 + z * (
            -1 / 6402373705728000 + z * (1 / 2432902008176640000))))))))))  # fmt: skip
    return sine, cosine


@inlined
def gravity_remainder(east: float, up: float) -> tuple[float, float]:
    """Compute the change of gravity beyond its linear part, east and up, in units of mu / r^2.

    For a deviation (east, up) as a share of the radius r,
    ``g(r + delta) - g(r) - G delta = (mu / r^2) [(3/2 d - H) up^ + (3/2 q - H) delta / r]`` with ``d = east^2 + up^2``,
    ``q = 2 up + d`` and ``H = (3/2) q - 1 + (1 + q)^(-3/2)``, the part of Battin's function beyond the linear one. In
    ``y = sqrt(1 + q)``, ``H = (y - 1)^2 (3/2 y^3 + 3 y^2 + 2 y + 1) / y^3`` and ``y - 1 = q / (1 + y)``.
    """
    radial, share = gravity_shares(up, east * east + up * up)
    return share * east, radial + share * up


@inlined
def gravity_shares(up: float, square: float) -> tuple[float, float]:
    """Compute the parts of `gravity_remainder` along the vertical and along the deviation, as a share of the radius.

    Parameters
    ----------
    square : float
        Of the deviation as a share of the radius.
    """
    q = 2.0 * up + square
    y = np.sqrt(np.abs(1.0 + q))
    further = 1.0 + y
    beyond = q * q * (1.0 + y * (2.0 + y * (3.0 + 1.5 * y))) / (further * further * (y * y * y))
    return 1.5 * square - beyond, 1.5 * q - beyond


@inlined
def angle_of_half(tangent: float) -> float:
    """Compute the angle whose half has a tangent of at most 1: 2 arctan(tangent), to 4e-16 of it.

    Halved once more, ``tan(a / 2) = tan(a) / (1 + sqrt(1 + tan^2(a)))``, the tangent is below 0.42 for the series.
    """
    quarter = tangent / (1.0 + np.sqrt(1.0 + tangent * tangent))
    z = quarter * quarter
    angle: float = 4.0 * quarter * (
        1 + z * (-1 / 3 + z * (1 / 5 + z * (-1 / 7 + z * (1 / 9 + z * (-1 / 11 + z * (1 / 13 + z * (
            -1 / 15 + z * (1 / 17 + z * (-1 / 19 + z * (1 / 21 + z * (-1 / 23 + z * (1 / 25 + z * (
            -1 / 27 + z * (1 / 29 + z * (-1 / 31 + z * (1 / 33 + z * (-1 / 35 + z * (1 / 37 + z * (
            -1 / 39 + z * (1 / 41))))))))))))))))))))
    )  # fmt: skip
    return angle
