"""Outputs of a reentry: errors of the polar state, and of functions of it.

Engines and linear analysis compute the errors of the polar state alone. What else a campaign may ask for is a row of
`FURTHER`: a function g of the polar state, whose error ``g(indicated) - g(actual)`` and whose partial derivatives
``dg/dx P`` follow from those of the state. A campaign that asks for none keeps its outputs whatever rows are added.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE

DEVIATIONS: Final = (
    Output("altitude", "m", "km"),
    Output("range", "m", "km"),
    Output("altitude_rate", "m/s", "m/s"),
    Output("range_rate", "m/s", "m/s"),
)
"""Navigation errors of NASA TN D-1772: those of the polar state, ranges as arc lengths at the earth's radius."""

SCALE: Final = np.array([1.0, EARTH_RADIUS, 1.0, EARTH_RADIUS])
"""Factors that turn errors of the polar state into `DEVIATIONS`: m and m/s."""


@dataclass(frozen=True)
class FurtherOutput:
    """An output that is the error of a function of the polar state.

    Attributes
    ----------
    function, gradient : callable
        The function of polar states (r, theta, r_dot, theta_dot), shape (..., 4), in m, rad, m/s, rad/s: its values in
        the output's unit, shape (...), and its derivatives by the four, shape (..., 4). Functions of a module, which
        processes can be sent.
    """

    output: Output
    function: Callable[[Array], Array]
    gradient: Callable[[Array], Array]


def _relative_to_air(states: Array) -> tuple[Array, Array]:
    """Compute the velocity relative to the air that turns with the earth, up and eastward, each of shape (...), m/s."""
    return states[..., 2], states[..., 0] * (states[..., 3] - EARTH_RATE)


def _gradient_of_air_velocity(states: Array) -> tuple[Array, Array]:
    """Differentiate `_relative_to_air` by the polar state, each of shape (..., 4)."""
    up, eastward = np.zeros_like(states), np.zeros_like(states)
    up[..., 2] = 1.0
    eastward[..., 0], eastward[..., 3] = states[..., 3] - EARTH_RATE, states[..., 0]
    return up, eastward


def _airspeed(states: Array) -> Array:
    return np.asarray(np.hypot(*_relative_to_air(states)))


def _airspeed_gradient(states: Array) -> Array:
    (u, e), (du, de) = _relative_to_air(states), _gradient_of_air_velocity(states)
    return (u[..., None] * du + e[..., None] * de) / _airspeed(states)[..., None]


def _path_angle(states: Array) -> Array:
    return np.asarray(np.arctan2(*_relative_to_air(states)))


def _path_angle_gradient(states: Array) -> Array:
    (u, e), (du, de) = _relative_to_air(states), _gradient_of_air_velocity(states)
    return (e[..., None] * du - u[..., None] * de) / _airspeed(states)[..., None] ** 2


FURTHER: Final = (
    FurtherOutput(Output("airspeed", "m/s", "m/s"), _airspeed, _airspeed_gradient),
    FurtherOutput(Output("flight_path_angle", "rad", "deg"), _path_angle, _path_angle_gradient),
)
"""Outputs that a campaign may ask for, by name; they come after `DEVIATIONS`. Speed relative to the air and its angle
above the horizon: NASA TN D-1772, eq. (4)."""


def append_errors(further: tuple[FurtherOutput, ...], deviations: Array, actual: Array) -> Array:
    """Append further outputs to errors of the polar state, shape (..., 4): shape (..., 4 + k), SI.

    Parameters
    ----------
    actual : ndarray
        Actual polar states, of a shape that broadcasts with the errors.
    """
    if not further:
        return deviations
    indicated = actual + deviations / SCALE
    errors = [further_output.function(indicated) - further_output.function(actual) for further_output in further]
    return np.concatenate([deviations, np.stack(errors, axis=-1)], axis=-1)


def append_partials(further: tuple[FurtherOutput, ...], partials: Array, indicated: Array) -> Array:
    """Append the rows of further outputs to partial derivatives, shape (..., 4, sources): shape (..., 4 + k, sources).

    Parameters
    ----------
    indicated : ndarray
        Polar states that a system without errors indicates, of a shape that broadcasts with (..., 4).
    """
    if not further:
        return partials
    gradients = np.stack([further_output.gradient(indicated) / SCALE for further_output in further], axis=-2)
    return np.concatenate([partials, gradients @ partials], axis=-2)
