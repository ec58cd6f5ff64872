"""Description of a guided reentry: sources, outputs, guidance, and how a flight ends; all engines read it.

Truth, navigator and guidance of a sample are those of NASA TN D-1772; the equations are in ``NOTATION.md``, "Guided
reentry".
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Final, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.quantities import Output, Source
from mcnav.physics.constants import EARTH_RADIUS
from mcnav.systems.reentry.navigator import LOWEST_RADIUS
from mcnav.systems.reentry.outputs import FurtherOutput
from mcnav.systems.reentry.truth import LONGEST_FLIGHT, Trajectory
from mcnav.systems.reentry.vehicle import Vehicle

Whose = Literal["true", "indicated"]
"""Whose altitude, or altitude rate, is meant."""


class GuidedError(IntEnum):
    """Position of each source in an array of errors: those of `mcnav.systems.reentry.instruments.Error`, then these."""

    TRUE_ALTITUDE = 12
    TRUE_RANGE = 13
    TRUE_ALTITUDE_RATE = 14
    TRUE_RANGE_RATE = 15
    DENSITY = 16
    LIFT_TO_DRAG = 17
    DRAG = 18


TRUTH_SOURCES: Final = (
    Source("true_altitude", "m", "km", 1e3, later=True, of="truth"),
    Source("true_range", "m", "km", 1e3, later=True, of="truth"),
    Source("true_altitude_rate", "m/s", "m/s", 1.0, later=True, of="truth"),
    Source("true_range_rate", "m/s", "m/s", 1.0, later=True, of="truth"),
    Source("density", "1", "%", 0.05, later=True, of="truth"),
    Source("lift_to_drag", "1", "%", 0.03, later=True, of="truth"),
    Source("drag", "1", "%", 0.03, later=True, of="truth"),
)
"""Sources of a guided reentry after those of every reentry, in the order of `GuidedError`."""

TRUE_ALTITUDE: Final = Output("true_altitude", "m", "km", of="truth", departs=True)
"""Known beforehand where the true altitude ends the flight, and no output then."""

LARGEST_LINEAR_RANGE: Final = 0.1 * EARTH_RADIUS
"""Dispersion of the range, m, from which on a flight through the atmosphere is another one."""

TRUTH_OUTPUTS: Final = (
    Output("true_range", "m", "km", limit=LARGEST_LINEAR_RANGE, of="truth", departs=True),
    Output("true_altitude_rate", "m/s", "m/s", of="truth", departs=True),
    Output("true_range_rate", "m/s", "m/s", of="truth", departs=True),
    Output("final_time", "s", "s", of="time"),
    Output("peak_deceleration", "m/s^2", "g", of="truth"),
)
"""Outputs of a guided reentry after the navigation errors, and `TRUE_ALTITUDE` where it is one."""


class Ending(IntEnum):
    """End of a sample's flight."""

    ARRIVED = 0
    """The altitude that ends it has fallen through the final one."""

    ALOFT = 1
    """It has not come down after `LONGEST_FLIGHT` from the first point of the trajectory."""

    CENTRE = 2
    """The indicated position has come within `LOWEST_RADIUS` of the earth's centre."""

    GROUND = 3
    """The true altitude has fallen to zero, before the indicated one has fallen through the final one."""

    STARTS_BELOW = 4
    """The altitude that ends it is not above the final one at the start of navigation."""

    BROKEN = 5
    """The integration breaks down, or a state is not finite."""


@dataclass(frozen=True)
class FollowingLaw:
    """A lift law that follows the nominal flight: at a true or indicated state, before its limit,

    ``L/D = p_0(s) + p_1(s) r + p_2(s) r' + p_3(s) r_E theta'``, with ``s = theta`` the range angle of the same state.

    Each p is a polynomial between two knots, in powers of s less the knot before it: ``p_0`` holds the nominal L/D less
    the gains times the nominal state, the others are the gains. Before the first knot L/D is that of the first knot's
    polynomials at the first knot with gains of zero (`lift_before`); after the last knot the last polynomials are
    evaluated at the last knot.

    Attributes
    ----------
    knots : ndarray, shape (n + 1,)
        Rising range angles, rad.
    polynomials : ndarray, shape (n, 4, m)
        Of each interval: p_0 to p_3, by rising powers.
    limit : float
        Largest magnitude of L/D.
    lift_before : float
        L/D before the first knot, where there is next to no air.
    """

    knots: Array
    polynomials: Array
    limit: float
    lift_before: float = 0.0


@dataclass(frozen=True)
class Guidance:
    """Closure of the loop.

    Attributes
    ----------
    input : str
        Whose state the lift law is fed with.
    final : str
        Whose altitude ends the flight.
    navigator_start : str
        State that the navigator is told at the start of navigation, before its errors: its own true one, or the
        nominal one.
    law : FollowingLaw, optional
        The lift law; that of the vehicle unless given.
    """

    input: Whose = "indicated"
    final: Whose = "true"
    navigator_start: Literal["truth", "nominal"] = "truth"
    law: FollowingLaw | None = None


@dataclass(frozen=True)
class GuidedNavigation:
    """The nominal flight, the start of navigation and the guidance, as every engine uses them.

    Attributes
    ----------
    trajectory : Trajectory
        The nominal truth, flown by the vehicle's own lift law without errors.
    vehicle : Vehicle
    final_altitude : float
        m.
    switching_altitude : float, optional
        True altitude above which the accelerometers' outputs are taken as zero, m.
    start : float
        Start of navigation, s from the first point of the trajectory.
    theta_axes : float
        Range angle of the reference axes, rad.
    further : tuple of FurtherOutput
        Outputs after the navigation errors of the polar state.
    """

    trajectory: Trajectory
    vehicle: Vehicle
    final_altitude: float
    switching_altitude: float | None
    start: float
    theta_axes: float
    guidance: Guidance
    further: tuple[FurtherOutput, ...] = ()

    @cached_property
    def nominal_start(self) -> Array:
        """Nominal polar state at the start of navigation, shape (4,)."""
        return self.trajectory.departure(self.start)

    @cached_property
    def nominal_final(self) -> Array:
        """Nominal polar state at the nominal end, shape (4,)."""
        return self.trajectory.state(self.trajectory.final_time)

    @property
    def longest(self) -> float:
        """Time after which a flight is given up, s from the start of navigation."""
        return LONGEST_FLIGHT - self.start

    def failure(self, ending: Ending) -> Failure:
        """Say why a sample whose flight ends so has failed."""
        final, whose = f"{self.final_altitude / 1e3:.2f} km", self.guidance.final
        hours, centre = LONGEST_FLIGHT / 3600, LOWEST_RADIUS / 1e3
        messages = {
            Ending.ALOFT: f"it skips out: in {hours:.0f} h the {whose} altitude does not fall to {final}",
            Ending.CENTRE: f"the indicated position fell to {centre:.0f} km from the earth's centre",
            Ending.GROUND: f"the vehicle meets the ground before the indicated altitude has fallen to {final}",
            Ending.STARTS_BELOW: f"the {whose} altitude starts below the final altitude of {final}",
            Ending.BROKEN: "the integration broke down: a state is not finite, or its steps became too small",
        }
        return Failure(Reason.DIVERGED, messages[ending])


def start_states(navigation: GuidedNavigation, errors: Array) -> tuple[Array, Array]:
    """Add errors, shape (..., sources), to the nominal start: true and indicated polar states, shape (..., 4).

    Ranges and their rates are arc lengths at the nominal radius (NASA TN D-1772, eq. 10).
    """
    radius = navigation.nominal_start[0]
    arcs = np.array([1.0, radius, 1.0, radius])
    true = navigation.nominal_start + errors[..., GuidedError.TRUE_ALTITUDE : GuidedError.DENSITY] / arcs
    base = true if navigation.guidance.navigator_start == "truth" else navigation.nominal_start
    return true, base + errors[..., :4] / arcs
