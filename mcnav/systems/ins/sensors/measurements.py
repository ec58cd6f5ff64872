"""Measurements of aiding sensors along the truth: their geometry, and the innovations of a navigator that has errors.

The innovation of a component is what the navigator predicts less what is measured. With the direction d of the
component, R the rotation from true to indicated axes, v and x the deviations of velocity and position, W the earth's
rate, all in inertial axes, it is without the measurement's own errors::

    position        d . [x + (R - I) L]                          L the lever arm
    velocity        d . [v - W x x + R ((w + e) x L) - w x L]    w the body's rate over the earth
    altitude        h(r + x) - h(r)
    attitude        d . psi                                      psi the rotation vector of R
    body velocity   R d . (u + v - W x x) - d . u                u the velocity over the earth
    heading         of R C less that of C

and its response to errors is the derivative of these.

The navigator computes the antenna's velocity with the rate that its gyros measure, whose error is in true axes
``e = C g - (R^T - I) W``. C are the instruments' axes, and g is what is left of the gyros' constant errors, bias
instability and rate random walk after the filter's estimates are subtracted. The noise of the readings (angle random
walk, quantization) is not in it, as it depends on how long a navigator averages them: it is part of the measurement's.
On a stabilised platform the gyros measure the platform's rate, and the body's rate about the platform is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import compiled, uncontracted
from mcnav.systems.ins.earth import local_axes
from mcnav.systems.ins.imu.instruments import AXES, CROSS_AXES, GYRO
from mcnav.systems.ins.sensors.aiding import SCALED, Quantity, Sensor, aiding_constants, check_quantities
from mcnav.systems.ins.truth.trajectory import Platform, Truth

POSITION, VELOCITY, ALTITUDE, ATTITUDE, BODY_VELOCITY, HEADING = range(6)

KINDS: Final[dict[Quantity, int]] = {
    "position": POSITION,
    "velocity": VELOCITY,
    "altitude": ALTITUDE,
    "attitude": ATTITUDE,
    "body_velocity": BODY_VELOCITY,
    "heading": HEADING,
}
"""Kinds by quantity."""

ROWS: Final = (POSITION, VELOCITY, ALTITUDE, ATTITUDE, BODY_VELOCITY, HEADING)
"""Kinds that `fill_row` has the responses of."""


def check_kinds(kinds: IndexArray, sizes: IndexArray, known: tuple[int, ...], where: str) -> None:
    """Raise ValueError unless all measured components are of kinds that a function computes.

    Parameters
    ----------
    kinds, sizes : ndarray of int, shapes (U, M), (U,)
        As `Measurements` has them.
    where : str
        Name of the function.
    """
    used = np.arange(kinds.shape[1]) < sizes[:, None]
    unknown = set(kinds[used].tolist()) - set(known)
    if unknown:
        names = {number: quantity for quantity, number in KINDS.items()}
        quantities = ", ".join(str(names.get(number, f"kind {number}")) for number in sorted(unknown))
        raise ValueError(f"{where} has no equations for measurements of {quantities}; add them there")


def rate_error(name: str) -> int:
    """Return the number in `GYRO` of the constant error as which an error enters a navigator's rate, -1 for none.

    >>> rate_error("gyro_rate_random_walk_y"), rate_error("gyro_angle_random_walk_y")
    (1, -1)
    """
    for process in ("_bias_instability_", "_rate_random_walk_"):
        name = name.replace(process, "_bias_")
    return GYRO.index(name) if name in GYRO else -1


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
    levers : ndarray, shape (U, 3)
        The lever arm L of updates that measure an antenna's velocity, zero for others.
    rates : ndarray, shape (U, 3, G)
        Responses of the navigator's rate there to the constant errors of the gyros, in the order of `GYRO`. G is 0
        where no update measures an antenna's velocity.
    swings : ndarray, shape (U, M, G)
        Responses of the innovations to them.
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
    levers: Array
    rates: Array
    swings: Array

    @property
    def swinging(self) -> NDArray[np.bool_]:
        """Which updates measure an antenna's velocity on a lever arm, shape (U,)."""
        return np.asarray(self.levers.any(axis=1), dtype=np.bool_)


def measure(truth: Truth, platform: Platform, start: float, sensors: Sequence[Sensor]) -> Measurements:
    """Tabulate the measurements of sensors: in order of time, and of the sensors at one instant.

    Raises
    ------
    ValueError
        When a sensor measures a quantity without equations.
    """
    for sensor in sensors:
        check_quantities(sensor, tuple(KINDS), "mcnav.systems.ins.sensors.measurements")
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
    levers, gyros = np.zeros((total, 3)), len(GYRO) if any(swings(sensor) for sensor in sensors) else 0
    rates, swung = np.zeros((total, 3, gyros)), np.zeros((total, most, gyros))
    offset = 0
    for number, sensor in enumerate(sensors):
        rows = np.flatnonzero(numbers == number)
        sizes[rows] = len(sensor.components)
        if len(rows):
            around = _Surroundings.at(truth, platform, start, sensor)
            places[rows], forward[rows] = around.position, around.forward
            if swings(sensor):
                levers[rows], rates[rows] = around.body @ sensor.lever_arm, around.rate_responses()
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
                if swings(sensor) and component.quantity == "velocity":
                    # d . (e x L) = (L x d) . e
                    swung[rows, column] = np.einsum("ni,nij->nj", np.cross(levers[rows], direction), rates[rows])
        offset += len(sensor.components)
    order = np.lexsort((numbers, times))
    rows_of = np.zeros((total, most, 9))
    spin = np.array([0.0, 0.0, truth.earth.rotation_rate])
    check_kinds(kinds, sizes, ROWS, "mcnav.systems.ins.sensors.measurements.fill_row")
    _fill_rows(kinds[order], directions[order], arms[order], levers[order], spin, sizes[order], rows_of)
    return Measurements(
        times[order], numbers[order], sizes[order], components[order], kinds[order], directions[order], arms[order],
        constants[order], places[order], rows_of, forward[order], levers[order], rates[order], swung[order],
    )  # fmt: skip


def swings(sensor: Sensor) -> bool:
    """Return whether a sensor measures the velocity of an antenna on a lever arm, which needs the body's rate."""
    return any(component.quantity == "velocity" for component in sensor.components) and bool(sensor.lever_arm.any())


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
    rate, force : ndarray, shape (u, 3)
        Inertial rate and specific force in the instruments' axes.
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
    rate: Array
    force: Array

    @classmethod
    def at(cls, truth: Truth, platform: Platform, start: float, sensor: Sensor) -> _Surroundings:
        earth, times = truth.earth, sensor.times
        spin = np.array([0.0, 0.0, earth.rotation_rate])
        body = truth.states(times, "strapdown", start)
        instruments = body if platform == "strapdown" else truth.states(times, platform, start)
        latitude, longitude, altitude = truth.geodetic(times).T
        level = earth.turned(times - truth.times[0]) @ local_axes(latitude, longitude)
        turning = body.rate - np.einsum("nji,j->ni", body.axes, spin)
        velocity = body.velocity - np.cross(spin, body.position)
        radii = np.stack(earth.curvature_radii(latitude)) + altitude
        return cls(
            sensor, body.position, velocity, altitude, radii, latitude, level, body.axes, instruments.axes, turning,
            instruments.rate, instruments.force,
        )  # fmt: skip

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
        if quantity == "heading":
            return (*self._heading(), none)
        raise ValueError(f"mcnav.systems.ins.sensors.measurements has no geometry of {quantity}; add it there")

    def _heading(self) -> tuple[Array, Array]:
        """Return the responses of the heading to psi and to x.

        It changes by ``phi_d - f_d (f_n phi_n + f_e phi_e) / (f_n^2 + f_e^2)`` with the forward axis f and the attitude
        error ``phi = psi - t`` in n, t being the turn of `mcnav.systems.ins.linear.covariance.output_map`.
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
        along = np.asarray(np.einsum("nj,nji->ni", direction, self.body))
        if quantity == "position":
            return along
        return np.asarray(np.cross(along, self.turning) if quantity == "velocity" else np.zeros_like(along))

    def rate_responses(self) -> Array:
        """Return the responses of the inertial rate to the constant errors of the gyros, shape (u, 3, 15)."""
        axes, inputs = self.instruments, [np.ones_like(self.rate), self.rate]
        rate_responses = [axes * each[:, None, :] for each in inputs]
        reads = [AXES.index(pair[0]) for pair in CROSS_AXES]
        along = [AXES.index(pair[1]) for pair in CROSS_AXES]
        rate_responses += [axes[:, :, reads] * self.rate[:, None, along], axes * self.force[:, None, :]]
        return np.concatenate(rate_responses, axis=2)


@uncontracted
def fill_row(kind: int, direction: Array, arm: Array, lever: Array, spin: float, out: Array) -> None:
    """Compute the response of an innovation to psi, v, x of a navigator whose attitude is the truth.

    That of an antenna's velocity to psi is ``(w x L) x d + W x (L x d)``.
    """
    out[:] = 0.0
    dx, dy, dz = direction[0], direction[1], direction[2]
    ax, ay, az = arm[0], arm[1], arm[2]
    if kind in (POSITION, VELOCITY):
        out[0], out[1], out[2] = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
    if kind == POSITION:
        out[6], out[7], out[8] = dx, dy, dz
    elif kind == VELOCITY:
        out[0] -= spin * (lever[2] * dx - lever[0] * dz)
        out[1] += spin * (lever[1] * dz - lever[2] * dy)
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
    elif kind == HEADING:
        out[0], out[1], out[2] = dx, dy, dz
        out[6], out[7], out[8] = ax, ay, az


@compiled
def _fill_rows(
    kinds: IndexArray, directions: Array, arms: Array, levers: Array, spin: Array, sizes: IndexArray, rows: Array
) -> None:
    for u in range(len(sizes)):
        for c in range(sizes[u]):
            fill_row(kinds[u, c], directions[u, c], arms[u, c], levers[u], spin[2], rows[u, c])
