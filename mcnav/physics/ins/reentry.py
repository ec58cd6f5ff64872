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
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.physics.ins.earth import Earth, local_axes
from mcnav.physics.ins.truth import Truth
from mcnav.physics.reentry.truth import Phase, Trajectory, truth_rates

LONGEST_STEP: Final = 16.0
"""Longest step between rows, s."""

FORCE_ERROR: Final = 8e-6
"""Error of the specific force between rows, m/s^2, above which a step is halved: 0.8 millionths of gravity.

Steps of one to two seconds reach it on all seven trajectories. In shorter ones the interpolation error of the
integrated velocity, 1e-7 m/s, becomes an error of the force that grows as they shrink.
"""

MOST_HALVINGS: Final = 5


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
    the force between them is right to `FORCE_ERROR`.
    """
    from scipy.interpolate import BPoly, PPoly
    from scipy.spatial.transform import Rotation, RotationSpline

    times = _row_times(trajectory)
    position, velocity, acceleration = (
        plane.lay(values) for values in np.array([_planar_motion(trajectory, float(time)) for time in times]).T
    )
    spin = np.array([0.0, 0.0, earth.rotation_rate])
    relative = velocity - np.cross(spin, position)
    felt = acceleration - np.cross(spin, velocity + relative)
    to_inertial = earth.turned(times - times[0])
    derivatives = np.einsum("nji,nkj->nki", to_inertial, np.stack([position, relative, felt], axis=1))
    places = earth.to_geodetic(derivatives[:, 0])
    axes = local_axes(places[:, 0], places[:, 1])
    angles = np.array([float(trajectory.state(float(time))[1]) for time in times])
    ahead = np.einsum("nji,nj->ni", to_inertial, plane.lay(np.exp(1j * (angles + np.pi / 2.0))))
    north, east, _ = np.einsum("nji,nj->in", axes, ahead)
    level = Rotation.from_matrix(axes) * Rotation.from_euler("z", np.arctan2(east, north)[:, None])
    quintic = PPoly.from_bernstein_basis(BPoly.from_derivatives(times, derivatives))
    return Truth(earth, times, quintic, RotationSpline(times, level))


def _row_times(trajectory: Trajectory) -> Array:
    """Choose the instants of the rows: equal steps in each phase, halved where the force between them is not right."""
    found = [trajectory.phases[0].start]
    for phase in trajectory.phases:
        count = int(np.ceil((phase.end - phase.start) / LONGEST_STEP))
        ends = np.linspace(phase.start, phase.end, count + 1)
        for begin, end in pairwise(ends):
            found += _refined(phase, float(begin), float(end), MOST_HALVINGS)
    return np.array(found)


def _refined(phase: Phase, begin: float, end: float, halvings: int) -> list[float]:
    """Return the ends of the steps between two instants of a phase."""
    if not halvings or _quintic_error(phase, begin, end) < FORCE_ERROR:
        return [end]
    middle = 0.5 * (begin + end)
    return [*_refined(phase, begin, middle, halvings - 1), *_refined(phase, middle, end, halvings - 1)]


def _quintic_error(phase: Phase, begin: float, end: float) -> float:
    """Compare the acceleration of the quintic between two rows with the equations of motion at three instants."""
    from scipy.interpolate import BPoly

    rows = np.array([_motion_in(phase, begin), _motion_in(phase, end)])
    between = np.linspace(begin, end, 5)[1:-1]
    quintic = BPoly.from_derivatives([begin, end], rows)
    actual = np.array([_motion_in(phase, float(time))[2] for time in between])
    return float(np.max(np.abs(quintic(between, 2) - actual)))


def _planar_motion(trajectory: Trajectory, time: float) -> NDArray[np.complex128]:
    return _motion_in(trajectory.phase_at(time), time)


def _motion_in(phase: Phase, time: float) -> NDArray[np.complex128]:
    """Compute position, velocity and acceleration in the plane as complex numbers, real along the origin of range."""
    state = np.asarray(phase.solution(time), dtype=float)
    radius, angle, radius_rate, angle_rate = state
    _, _, radius_second, angle_second = truth_rates(time, state, phase.coefficients)
    inward = radius_second - radius * angle_rate**2
    across = radius * angle_second + 2.0 * radius_rate * angle_rate
    moved = np.array([radius, radius_rate + 1j * radius * angle_rate, inward + 1j * across])
    return np.asarray(moved * np.exp(1j * angle))
