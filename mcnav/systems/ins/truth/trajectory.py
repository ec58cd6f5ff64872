"""The truth: the motion of a vehicle over the earth as smooth functions of time.

Positions are a cubic spline in earth-fixed axes, so that the specific force is continuous; attitudes are a rotation
spline with a continuous angular acceleration. A vehicle at rest is at rest exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.truth.spline_states import Instants, Splines, SplineStates, intervals, states_of_splines

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline, PPoly
    from scipy.spatial.transform import Rotation, RotationSpline

Platform = Literal["strapdown", "inertial", "level"]
"""Carrier of the instruments: the body, a platform that keeps its inertial directions, or one that stays level."""


@dataclass(frozen=True)
class TruthStates:
    """Truth at some instants, n of them.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, in the trajectory's time.
    position, velocity : ndarray, shape (n, 3)
        Inertial axes, m and m/s.
    axes : ndarray, shape (n, 3, 3)
        From the instruments' axes to inertial ones.
    force, rate : ndarray, shape (n, 3)
        Specific force, m/s^2, and inertial angular rate, rad/s, in the instruments' axes.
    """

    time: Array
    position: Array
    velocity: Array
    axes: Array
    force: Array
    rate: Array


@dataclass(frozen=True)
class HeldAttitude:
    """An attitude that keeps its inertial directions over the turning earth.

    Attributes
    ----------
    rotation_rate : float
        Of the earth, rad/s.
    instant : float
        s, at which the attitude is ``rotation``, from body to earth-fixed axes.
    """

    rotation_rate: float
    instant: float
    rotation: Rotation

    def __call__(self, time: Array | float, order: int = 0) -> Any:
        """Compute the rotation from body to earth-fixed axes, or its rate in body axes, rad/s (order 1), or its change.

        The rate is constant in these axes (order 2).
        """
        from scipy.spatial.transform import Rotation

        angle = -self.rotation_rate * (np.asarray(time, dtype=float) - self.instant)
        turned = Rotation.from_rotvec(angle[..., None] * np.array([0.0, 0.0, 1.0])) * self.rotation
        if order > 1:
            return np.zeros((*angle.shape, 3))
        return turned if order == 0 else -self.rotation_rate * turned.as_matrix()[..., 2, :]


@dataclass(frozen=True)
class Truth:
    """The motion of a vehicle.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Instants of the trajectory's rows, rising, s. Between them all functions are smooth.
    position : CubicSpline
        Earth-fixed position, m.
    attitude : RotationSpline or HeldAttitude
        Rotation from body (forward, right, down) to earth-fixed axes.
    """

    earth: Earth
    times: Array
    position: CubicSpline
    attitude: RotationSpline | HeldAttitude

    @classmethod
    def through(
        cls, earth: Earth, times: Array, latitude: Array, longitude: Array, altitude: Array, angles: Array
    ) -> Truth:
        """Interpolate the rows of a trajectory; all angles in rad.

        Parameters
        ----------
        times, latitude, longitude, altitude : ndarray, shape (n,)
            At least four rows.
        angles : ndarray, shape (n, 3)
            Heading, pitch, roll: successive rotations about down, right, forward.
        """
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation, RotationSpline

        position = earth.from_geodetic(latitude, longitude, altitude)
        to_level = Rotation.from_euler("ZYX", angles)
        attitude = Rotation.from_matrix(local_axes(latitude, longitude)) * to_level
        return cls(earth, times, CubicSpline(times, position), RotationSpline(times, attitude))

    def held(self, instant: float) -> Truth:
        """Return the same motion with a body that keeps the inertial directions it has at an instant, s."""
        return replace(self, attitude=HeldAttitude(self.earth.rotation_rate, instant, self.attitude(instant)))

    def earth_fixed(self, time: Array) -> tuple[Array, Array]:
        """Compute earth-fixed positions, m, and velocities over the earth, m/s, each of shape (n, 3)."""
        return np.asarray(self.position(time)), np.asarray(self.position(time, 1))

    @cached_property
    def fastest(self) -> float:
        """Largest speed over the earth at the rows, m/s."""
        return float(np.linalg.norm(self.earth_fixed(self.times)[1], axis=1).max())

    def geodetic(self, time: Array) -> Array:
        """Compute latitude, longitude (rad) and altitude (m), shape (n, 3)."""
        return self.earth.to_geodetic(np.asarray(self.position(time)))

    def angles(self, time: Array) -> Array:
        """Compute heading, pitch and roll, rad, shape (n, 3)."""
        from scipy.spatial.transform import Rotation

        latitude, longitude, _ = self.geodetic(time).T
        to_level = Rotation.from_matrix(local_axes(latitude, longitude)).inv() * self.attitude(time)
        return np.asarray(to_level.as_euler("ZYX", suppress_warnings=True))  # a vertical body has a heading, too

    def states(self, time: Array, platform: Platform, start: float) -> TruthStates:
        """Compute the truth at some instants, shape (n,), with the instruments on a platform.

        Parameters
        ----------
        start : float
            Instant at which navigation starts, and at which an inertial platform has the body's directions.
        """
        time = np.atleast_1d(np.asarray(time, dtype=float))
        if platform == "strapdown" and self._attitude_spline is not None:
            return self._states_of_splines(time, *self._attitude_spline)
        earth = self.earth
        position, velocity = self.earth_fixed(time)
        to_inertial = earth.turned(time - self.times[0])
        spin = np.array([0.0, 0.0, earth.rotation_rate])
        carried = velocity + np.cross(spin, position)
        felt = self.position(time, 2) + np.cross(spin, velocity + carried) - earth.gravitation(position)
        if platform == "inertial":
            first = earth.turned(np.array(start - self.times[0])) @ self.attitude(start).as_matrix()
            axes, rate = np.broadcast_to(first, to_inertial.shape), np.zeros_like(position)
        else:
            if platform == "level":
                axes, rate = self._level(position, velocity)
            else:
                axes = self.attitude(time).as_matrix()
                rate = self.attitude(time, 1) + axes[:, 2] * earth.rotation_rate
            axes = to_inertial @ axes
        force = np.einsum("nji,nj->ni", axes, np.einsum("nij,nj->ni", to_inertial, felt))
        return TruthStates(
            time,
            np.einsum("nij,nj->ni", to_inertial, position),
            np.einsum("nij,nj->ni", to_inertial, carried),
            np.ascontiguousarray(axes),
            force,
            np.ascontiguousarray(rate),
        )

    @cached_property
    def _attitude_spline(self) -> tuple[PPoly, Array] | None:
        """Rotation vectors and matrices from body to earth-fixed axes at their knots; none where not all is splines."""
        from scipy.interpolate import PPoly
        from scipy.spatial.transform import RotationSpline

        if isinstance(self.position, PPoly) and isinstance(self.attitude, RotationSpline):
            return self.attitude.interpolator, np.ascontiguousarray(self.attitude.rotations.as_matrix())
        return None

    def _states_of_splines(self, time: Array, vectors: PPoly, turns: Array) -> TruthStates:
        """Compute the truth with the instruments on the body."""
        count, knots = len(time), self.position.x
        states = SplineStates(
            np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3)),
            np.empty((count, 3)),
        )  # fmt: skip
        splines = Splines(self.earth.constants, self.position.c, knots, vectors.c, vectors.x, turns)
        instants = Instants(time - self.times[0], time, intervals(knots, time), intervals(vectors.x, time))
        states_of_splines(splines, instants, states)
        return TruthStates(time, *states)

    def _level(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Compute the local axes, n to e, and their inertial rate in n."""
        latitude, longitude, altitude = self.earth.to_geodetic(position).T
        axes = local_axes(latitude, longitude)
        north, east, _ = np.einsum("nji,nj->in", axes, velocity)
        meridian, prime = self.earth.curvature_radii(latitude)
        turning = self.earth.rotation_rate + east / ((prime + altitude) * np.cos(latitude))
        rate = [turning * np.cos(latitude), -north / (meridian + altitude), -turning * np.sin(latitude)]
        return axes, np.stack(rate, axis=-1)
