"""States between the steps of an integrator, from position, velocity and acceleration at three nodes.

Nine conditions make a polynomial p of eighth degree. Between the first and the last of three nodes with a spacing of h,
at ``s`` spacings from the middle one,

    |x - p|   <= h^9 max|x^(9)| max|(s^3 - s)^3| / 9!   <= 1.6e-7 h^9 max|x^(9)|
    |x' - p'| <= h^8 max|x^(9)| 2 max|(s^3 - s)^2| / 8! <= 7.4e-6 h^8 max|x^(9)|.

The first is the remainder of Hermite's interpolation. For the second, x' - p' is zero twice at each node, and between
two nodes once more by Rolle's theorem: p' interpolates x' at these eight places, of which the last two add at most 2.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numpy.polynomial import polynomial

from mcnav.arrays.types import Array

POSITION_BOUND: Final = (4.0 / 27.0) ** 1.5 / 362_880.0
VELOCITY_BOUND: Final = 2.0 * (4.0 / 27.0) / 40_320.0
"""Largest error of position in units of ``h^9 max|x^(9)|``, and of velocity in units of ``h^8 max|x^(9)|``."""


@cache
def _basis() -> Array:
    """Compute the polynomials of eighth degree of which one of the nine conditions is one, the others zero.

    Coefficients by rows, from s^0; conditions by columns. They are multiples of 1/16: rounded to these they are exact,
    and so are the polynomials at the nodes.
    """
    powers = np.eye(9)
    derivatives = [polynomial.polyder(powers, order) for order in range(3)]
    conditions = np.array(
        [polynomial.polyval(node, derivative) for node in (-1.0, 0.0, 1.0) for derivative in derivatives]
    )
    return np.asarray(np.rint(np.linalg.inv(conditions) * 16.0) / 16.0)


def interpolation_weights(places: Array, spacing: float) -> Array:
    """Compute the weights of the nodes' states in position and velocity at some places, shape (m, 2, 9).

    The states are position, velocity and acceleration of each node in turn. At a node the weights are exactly one and
    zero.

    Parameters
    ----------
    places : ndarray, shape (m,)
        s: spacings from the middle node, from -1 to 1.
    spacing : float
        h: time between two nodes, s.
    """
    powers, basis = np.vander(places, 9, increasing=True), _basis()
    of_position = powers @ basis * np.tile([1.0, spacing, spacing * spacing], 3)
    of_velocity = powers[:, :8] @ polynomial.polyder(basis) * np.tile([1.0 / spacing, 1.0, spacing], 3)
    return np.stack([of_position, of_velocity], axis=1)
