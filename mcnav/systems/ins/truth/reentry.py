"""A reentry of NASA TN D-1772 laid on a globe.

The planar motion (r, theta) becomes a motion in a plane through the earth's centre that keeps its inertial directions:
the position is ``r (o cos theta + d sin theta)`` with o the direction of the place where the range angle is zero, and d
that of flight there. On the TN's sphere without rotation, laid on the equator, the inertial positions are therefore the
planar ones, and so is the specific force.

The vehicle is level and heads along the plane of motion. The velocity over a rotating earth would be a poor heading:
high above the earth it points west, until the vehicle has come down.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.truth.quintic import earth_fixed_quintic, row_times
from mcnav.systems.ins.truth.trajectory import Truth
from mcnav.systems.reentry.truth import Phase, Trajectory, truth_rates


@dataclass(frozen=True)
class Plane:
    """A plane of motion.

    Attributes
    ----------
    origin, onward : ndarray, shape (3,)
        Unit vectors in inertial axes: to the place where the range angle is zero, and the direction of flight there.
    """

    origin: Array
    onward: Array

    @classmethod
    def at(cls, latitude: float, longitude: float, azimuth: float) -> Plane:
        """Lay the plane through a place (rad, of a sphere) in the direction of an azimuth."""
        north, east, down = local_axes(np.array(latitude), np.array(longitude)).T
        return cls(-down, np.cos(azimuth) * north + np.sin(azimuth) * east)

    def lay(self, planar: NDArray[np.complex128]) -> Array:
        """Map planar vectors, complex numbers of shape (...), to inertial axes, shape (..., 3)."""
        return np.asarray(planar.real[..., None] * self.origin + planar.imag[..., None] * self.onward)


def reentry_truth(trajectory: Trajectory, earth: Earth, plane: Plane) -> Truth:
    """Lay a planar trajectory on a globe.

    Positions are quintic between rows; at every row position, velocity and acceleration are those of the equations of
    motion. Rows include the boundaries of all phases, where the derivative of the force may jump, and are so dense that
    the force between them is right to `mcnav.systems.ins.truth.quintic.FORCE_ERROR`.
    """
    from scipy.spatial.transform import Rotation, RotationSpline

    rows = [trajectory.phases[0].start]
    for phase in trajectory.phases:
        rows += row_times(partial(_motion_in, phase), phase.start, phase.end)
    times = np.array(rows)
    planar = np.array([_motion_in(trajectory.phase_at(time), time) for time in rows])
    quintic = earth_fixed_quintic(earth, times, plane.lay(planar))
    to_inertial = earth.turned(times - times[0])
    places = earth.to_geodetic(quintic(times))
    axes = local_axes(places[:, 0], places[:, 1])
    ahead = np.einsum("nji,nj->ni", to_inertial, plane.lay(1j * planar[:, 0]))
    north, east, _ = np.einsum("nji,nj->in", axes, ahead)
    level = Rotation.from_matrix(axes) * Rotation.from_euler("z", np.arctan2(east, north)[:, None])
    return Truth(earth, times, quintic, RotationSpline(times, level))


def _motion_in(phase: Phase, time: float) -> NDArray[np.complex128]:
    """Compute position, velocity and acceleration in the plane as complex numbers, real along the origin of range."""
    state = np.asarray(phase.solution(time), dtype=float)
    radius, angle, radius_rate, angle_rate = state
    _, _, radius_second, angle_second = truth_rates(time, state, phase.coefficients)
    inward = radius_second - radius * angle_rate**2
    across = radius * angle_second + 2.0 * radius_rate * angle_rate
    moved = np.array([radius, radius_rate + 1j * radius * angle_rate, inward + 1j * across])
    return np.asarray(moved * np.exp(1j * angle))
