"""Measurements of aiding sensors along the truth: their geometry, and the innovations of a navigator that has errors.

The innovation of a component is what the navigator predicts less what is measured. With the direction d of the
component, R the rotation from true to indicated axes, v and x the deviations of velocity and position, W the earth's
rate, all in inertial axes, it is without the measurement's own errors::

    position        d . [x + (R - I) L]                   L the lever arm
    velocity        d . [v - W x x + (R - I) (w x L)]     w the body's rate over the earth
    altitude        h(r + x) - h(r)
    attitude        d . psi                               psi the rotation vector of R
    body velocity   R d . (u + v - W x x) - d . u         u the velocity over the earth
    heading         of R C less that of C

and its response to errors is the derivative of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.aiding import SCALED, Quantity, Sensor, aiding_constants
from mcnav.physics.ins.earth import local_axes
from mcnav.physics.ins.truth import Platform, Truth
from mcnav.physics.jit import compiled, uncontracted

POSITION, VELOCITY, ALTITUDE, ATTITUDE, BODY_VELOCITY, HEADING = range(6)

KINDS: Final[dict[Quantity, int]] = {
    "position": POSITION,
    "velocity": VELOCITY,
    "altitude": ALTITUDE,
    "attitude": ATTITUDE,
    "body_velocity": BODY_VELOCITY,
    "heading": HEADING,
}


@dataclass(frozen=True)
class Measurements:
    """All updates in order, U of them; each has at most M components. G components are those of all sensors.

    Attributes
    ----------
    times : ndarray, shape (U,)
    sensors : ndarray of int, shape (U,)
        Number of the sensor.
    sizes : ndarray of int, shape (U,)
        Components of the update.
    components : ndarray of int, shape (U, M)
        Number of each component among those of all sensors.
    kinds : ndarray of int, shape (U, M)
        As `KINDS` has them.
    directions, arms : ndarray, shape (U, M, 3)
        The direction d, and what a kind needs besides: L, w x L, u; for a heading the responses to psi and to x.
    constants : ndarray, shape (U, M, A)
        Responses of the innovations to the constant errors of `aiding_constants`.
    places : ndarray, shape (U, 3)
        True positions.
    rows : ndarray, shape (U, M, 9)
        Responses of the innovations to psi, v, x along the truth.
    forward : ndarray, shape (U, 3, 3)
        North, east and the body's forward axis.
    """

    times: Array
    sensors: IndexArray
    sizes: IndexArray
    components: IndexArray
    kinds: IndexArray
    directions: Array
    arms: Array
    constants: Array
    places: Array
    rows: Array
    forward: Array


def measure(truth: Truth, platform: Platform, start: float, sensors: Sequence[Sensor]) -> Measurements:
    """Tabulate the measurements of sensors: in order of time, and of the sensors at one instant."""
    names = {name: number for number, name in enumerate(aiding_constants(tuple(sensors)))}
    most = max((len(sensor.components) for sensor in sensors), default=0)
    counts = [len(sensor.times) for sensor in sensors]
    times = np.concatenate([np.zeros(0), *(sensor.times for sensor in sensors)])
    numbers = np.repeat(np.arange(len(sensors)), counts)
    total = len(times)
    sizes, components = np.zeros(total, dtype=np.int64), np.zeros((total, most), dtype=np.int64)
    kinds = np.zeros((total, most), dtype=np.int64)
    directions, arms, forward = np.zeros((total, most, 3)), np.zeros((total, most, 3)), np.zeros((total, 3, 3))
    constants, places = np.zeros((total, most, len(names))), np.zeros((total, 3))
    offset = 0
    for number, sensor in enumerate(sensors):
        rows = np.flatnonzero(numbers == number)
        sizes[rows] = len(sensor.components)
        if len(rows):
            around = _Surroundings.at(truth, platform, start, sensor)
            places[rows], forward[rows] = around.position, around.forward
            for column, component in enumerate(sensor.components):
                kinds[rows, column] = KINDS[component.quantity]
                components[rows, column] = offset + column
                direction, arm, true = around.geometry(component.quantity, component.axis)
                directions[rows, column], arms[rows, column] = direction, arm
                constants[rows, column, names[component.error_name("bias")]] = -1.0
                if component.quantity in SCALED:
                    constants[rows, column, names[component.error_name("scale_factor")]] = -true
                if sensor.has_lever_arm:
                    first = names[f"{sensor.name}_lever_arm_x"]
                    constants[rows, column, first : first + 3] = around.of_lever_arm(component.quantity, direction)
        offset += len(sensor.components)
    order = np.lexsort((numbers, times))
    rows_of = np.zeros((total, most, 9))
    spin = np.array([0.0, 0.0, truth.earth.rotation_rate])
    _fill_rows(kinds[order], directions[order], arms[order], spin, sizes[order], rows_of)
    return Measurements(
        times[order], numbers[order], sizes[order], components[order], kinds[order], directions[order], arms[order],
        constants[order], places[order], rows_of, forward[order],
    )  # fmt: skip


@dataclass(frozen=True)
class _Surroundings:
    """The truth at the instants of a sensor, u of them, in inertial axes.

    Attributes
    ----------
    position, velocity : ndarray, shape (u, 3)
        Velocity over the earth.
    level, body, instruments : ndarray, shape (u, 3, 3)
        Axes, by columns.
    turning : ndarray, shape (u, 3)
        Rate of the body over the earth, in the body's axes.
    """

    sensor: Sensor
    position: Array
    velocity: Array
    altitude: Array
    radii: Array
    latitude: Array
    level: Array
    body: Array
    instruments: Array
    turning: Array

    @classmethod
    def at(cls, truth: Truth, platform: Platform, start: float, sensor: Sensor) -> _Surroundings:
        earth, times = truth.earth, sensor.times
        spin = np.array([0.0, 0.0, earth.rotation_rate])
        body = truth.states(times, "strapdown", start)
        instruments = body.axes if platform == "strapdown" else truth.states(times, platform, start).axes
        latitude, longitude, altitude = truth.geodetic(times).T
        level = earth.turned(times - truth.times[0]) @ local_axes(latitude, longitude)
        turning = body.rate - np.einsum("nji,j->ni", body.axes, spin)
        velocity = body.velocity - np.cross(spin, body.position)
        radii = np.stack(earth.curvature_radii(latitude)) + altitude
        return cls(sensor, body.position, velocity, altitude, radii, latitude, level, body.axes, instruments, turning)

    @property
    def forward(self) -> Array:
        """North, east and the body's forward axis, shape (u, 3, 3), by rows."""
        return np.stack([self.level[:, :, 0], self.level[:, :, 1], self.body[:, :, 0]], axis=1)

    def geometry(self, quantity: Quantity, axis: int) -> tuple[Array, Array, Array]:
        """Return direction, arm and true value of a component, shapes (u, 3), (u, 3), (u,)."""
        none = np.zeros(len(self.altitude))
        nothing = np.zeros_like(self.position)
        if quantity == "position":
            return self.level[:, :, axis], self.body @ self.sensor.lever_arm, none
        if quantity == "velocity":
            turned = np.cross(self.turning, self.sensor.lever_arm)
            return self.level[:, :, axis], np.einsum("nij,nj->ni", self.body, turned), none
        if quantity == "altitude":
            return self.level[:, :, 2], nothing, self.altitude
        if quantity == "attitude":
            return self.instruments[:, :, axis], nothing, none
        if quantity == "body_velocity":
            direction = self.body[:, :, axis]
            return direction, self.velocity, np.einsum("ni,ni->n", direction, self.velocity)
        return (*self._heading(), none)

    def _heading(self) -> tuple[Array, Array]:
        """Return the responses of the heading to psi and to x.

        It changes by ``phi_d - f_d (f_n phi_n + f_e phi_e) / (f_n^2 + f_e^2)`` with the forward axis f and the attitude
        error ``phi = psi - t`` in n, t being the turn of `mcnav.physics.ins.covariance.output_map`.
        """
        forward = np.einsum("nji,nj->ni", self.level, self.body[:, :, 0])
        share = -forward[:, 2] / (forward[:, 0] ** 2 + forward[:, 1] ** 2)
        to_attitude = np.stack([share * forward[:, 0], share * forward[:, 1], np.ones(len(share))], axis=-1)
        meridian, prime = self.radii
        # t = (p_e / (N + h), -p_n / (M + h), -p_e tan(phi) / (N + h))
        north = to_attitude[:, 1] / meridian
        east = -(to_attitude[:, 0] - to_attitude[:, 2] * np.tan(self.latitude)) / prime
        to_position = np.stack([north, east, np.zeros(len(share))], axis=-1)
        return (
            np.einsum("nij,nj->ni", self.level, to_attitude),
            np.einsum("nij,nj->ni", self.level, to_position),
        )

    def of_lever_arm(self, quantity: Quantity, direction: Array) -> Array:
        """Return the responses of a component's innovation to errors of the lever arm, shape (u, 3)."""
        along = np.einsum("nj,nji->ni", direction, self.body)
        return along if quantity == "position" else np.cross(along, self.turning)


@uncontracted
def fill_row(kind: int, direction: Array, arm: Array, spin: float, out: Array) -> None:
    """Compute the response of an innovation to psi, v, x of a navigator whose attitude is the truth."""
    out[:] = 0.0
    dx, dy, dz = direction[0], direction[1], direction[2]
    ax, ay, az = arm[0], arm[1], arm[2]
    if kind in (POSITION, VELOCITY):
        out[0], out[1], out[2] = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
    if kind == POSITION:
        out[6], out[7], out[8] = dx, dy, dz
    elif kind == VELOCITY:
        out[3], out[4], out[5] = dx, dy, dz
        out[6], out[7] = -spin * dy, spin * dx
    elif kind == ALTITUDE:
        out[6], out[7], out[8] = -dx, -dy, -dz
    elif kind == ATTITUDE:
        out[0], out[1], out[2] = dx, dy, dz
    elif kind == BODY_VELOCITY:
        out[0], out[1], out[2] = dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax
        out[3], out[4], out[5] = dx, dy, dz
        out[6], out[7] = -spin * dy, spin * dx
    else:
        out[0], out[1], out[2] = dx, dy, dz
        out[6], out[7], out[8] = ax, ay, az


@compiled
def _fill_rows(kinds: IndexArray, directions: Array, arms: Array, spin: Array, sizes: IndexArray, rows: Array) -> None:
    for u in range(len(sizes)):
        for c in range(sizes[u]):
            fill_row(kinds[u, c], directions[u, c], arms[u, c], spin[2], rows[u, c])
