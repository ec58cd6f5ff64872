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

from mcnav._types import Array
from mcnav.constants import EARTH_RADIUS
from mcnav.contract.quantities import Output

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


FURTHER: Final[tuple[FurtherOutput, ...]] = ()
"""Outputs that a campaign may ask for, by name; they come after `DEVIATIONS`."""

OUTPUTS: Final = (*DEVIATIONS, *(each.output for each in FURTHER))
"""All outputs that a campaign can have."""


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
    errors = [each.function(indicated) - each.function(actual) for each in further]
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
    gradients = np.stack([each.gradient(indicated) / SCALE for each in further], axis=-2)
    return np.concatenate([partials, gradients @ partials], axis=-2)
