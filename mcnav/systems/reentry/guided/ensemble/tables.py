"""Tables that all samples of a guided reentry share, as compiled code is given them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.guided.description import GuidedNavigation
from mcnav.systems.reentry.truth import altitude_bands
from mcnav.systems.reentry.vehicle import ConstantLift, VariableLift

CONSTANT: Final = 0
PROPORTIONAL: Final = 1
FOLLOWING: Final = 2
"""Kinds of lift laws: a constant ratio; in proportion to an altitude rate; `FollowingLaw`."""

POWERS: Final = 8
"""Coefficients of the first polynomial of a `FollowingLaw`."""

GAIN_POWERS: Final = 4
"""Coefficients of the others, its gains."""


class Tables(NamedTuple):
    """Attributes of the flight, the atmosphere and the guidance.

    Attributes
    ----------
    bottoms, tops : ndarray, shape (b,)
        Radii between which each band of the atmosphere lies, m: one layer, accelerometers on or off.
    layers : ndarray, shape (b, 4)
        Base (m), temperature (K), lapse (K/m) and density (kg/m^3) of its layer.
    on : ndarray, shape (b,)
        One where the accelerometers' outputs are used, else zero.
    ballistic : float
        C_D A / m, m^2/kg.
    law : int
        `CONSTANT`, `PROPORTIONAL` or `FOLLOWING`.
    lift, gain, limit : float
        L/D, constant or before the first knot; L/D per altitude rate, s/m; largest L/D.
    knots, polynomials : ndarray, shapes (n + 1,) and (n, 4, POWERS)
        As those of a `FollowingLaw`, range angles counted from the reference axes.
    input_indicated, final_indicated : bool
    final_radius, longest : float
        m; s from the start of navigation.
    """

    bottoms: Array
    tops: Array
    layers: Array
    on: Array
    ballistic: float
    law: int
    lift: float
    gain: float
    limit: float
    knots: Array
    polynomials: Array
    input_indicated: bool
    final_indicated: bool
    final_radius: float
    longest: float


def tables_of(navigation: GuidedNavigation) -> Tables:
    """Tabulate a guided reentry."""
    bands = altitude_bands(navigation.switching_altitude)
    layers = [(each.layer.base, each.layer.temperature, each.layer.lapse, each.layer.density) for each in bands]
    guidance, vehicle = navigation.guidance, navigation.vehicle
    law, lift, gain, limit = CONSTANT, 0.0, 0.0, np.inf
    knots, polynomials = np.zeros(1), np.zeros((0, 4, POWERS))
    if guidance.law is not None:
        law, lift, limit = FOLLOWING, guidance.law.lift_before, guidance.law.limit
        knots = guidance.law.knots - navigation.theta_axes
        polynomials = np.zeros((len(knots) - 1, 4, POWERS))
        polynomials[:, :, : guidance.law.polynomials.shape[2]] = guidance.law.polynomials
    elif isinstance(vehicle.lift_law, VariableLift):
        law, gain, limit = PROPORTIONAL, -vehicle.lift_law.gain, vehicle.lift_law.limit
    elif isinstance(vehicle.lift_law, ConstantLift):
        lift = vehicle.lift_law.lift_to_drag
    return Tables(
        np.array([each.bottom for each in bands]), np.array([each.top for each in bands]), np.array(layers),
        np.array([each.accelerometers_on for each in bands], dtype=float), vehicle.ballistic_coefficient,
        law, lift, gain, limit, knots, polynomials, guidance.input == "indicated", guidance.final == "indicated",
        EARTH_RADIUS + navigation.final_altitude, navigation.longest,
    )  # fmt: skip


Flags = NDArray[np.int64]
"""Whole numbers of the lanes."""
