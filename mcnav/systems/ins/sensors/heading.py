"""Heading of the body, ``of R C less that of C`` with the body's axes C.

Its direction d is the response to psi; its parameters are the response to x, and north, east and the forward axis.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, inlined
from mcnav.compiled.lanes import angle_of_half
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth

STEEPEST: Final = 89.0
"""Pitch of a body whose heading a sensor may measure, deg; errors of the attitude make 57 times as large ones of it."""


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses of the heading to psi and to x.

    It changes by ``phi_d - f_d (f_n phi_n + f_e phi_e) / (f_n^2 + f_e^2)`` with the forward axis f and the attitude
    error ``phi = psi - t`` in n, t being the turn of `mcnav.systems.ins.linear.covariance.output_map`.
    """
    forward = np.einsum("nji,nj->ni", along.level, along.body[:, :, 0])
    share = -forward[:, 2] / (forward[:, 0] ** 2 + forward[:, 1] ** 2)
    to_attitude = np.stack([share * forward[:, 0], share * forward[:, 1], np.ones(len(share))], axis=-1)
    meridian, prime = along.radii
    # t = (p_e / (N + h), -p_n / (M + h), -p_e tan(phi) / (N + h))
    north = to_attitude[:, 1] / meridian
    east = -(to_attitude[:, 0] - to_attitude[:, 2] * np.tan(along.latitude)) / prime
    to_position = np.stack([north, east, np.zeros(len(share))], axis=-1)
    psi = np.einsum("nij,nj->ni", along.level, to_attitude)
    x = np.einsum("nij,nj->ni", along.level, to_position)
    axes = (along.level[:, :, 0], along.level[:, :, 1], along.body[:, :, 0])
    return Geometry(psi, psi=psi, x=x, parameters=np.concatenate([x, *axes], axis=1))


@inlined
def _heading_change(u: int, c: int, axes: Array, turned: Array) -> Vector:
    """Compute the change of the heading by rotations; axes are parameters of a component."""
    dx, dy, dz = change_by_turn(turned, axes[u, c, 9], axes[u, c, 10], axes[u, c, 11])
    north = axes[u, c, 3] * axes[u, c, 9] + axes[u, c, 4] * axes[u, c, 10] + axes[u, c, 5] * axes[u, c, 11]
    east = axes[u, c, 6] * axes[u, c, 9] + axes[u, c, 7] * axes[u, c, 10] + axes[u, c, 8] * axes[u, c, 11]
    more_north = axes[u, c, 3] * dx + axes[u, c, 4] * dy + axes[u, c, 5] * dz
    more_east = axes[u, c, 6] * dx + axes[u, c, 7] * dy + axes[u, c, 8] * dz
    across = north * more_east - east * more_north
    along = north * (north + more_north) + east * (east + more_east)
    further = along + np.sqrt(along * along + across * across)  # the tangent of a half is across / further
    return 2.0 * angle_of_half(across / (further + np.sqrt(further * further + across * across)))


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add the change of the heading by the turn, and by the local axes at the navigator's own position.

    With the own forward axis f the response to psi is ``f x (f_n e - f_e n) / (f_n^2 + f_e^2)``.
    """
    ax, ay, az = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    turned = _heading_change(u, c, tables.parameters, errors.turned)
    value += turned + (ax * errors.x + ay * errors.y + az * errors.z)
    if wanted:
        zero, axes = 0.0 * errors.x, tables.parameters
        dx, dy, dz = change_by_turn(errors.turned, axes[u, c, 9], axes[u, c, 10], axes[u, c, 11])
        dx, dy, dz = axes[u, c, 9] + dx, axes[u, c, 10] + dy, axes[u, c, 11] + dz
        north = axes[u, c, 3] * dx + axes[u, c, 4] * dy + axes[u, c, 5] * dz
        east = axes[u, c, 6] * dx + axes[u, c, 7] * dy + axes[u, c, 8] * dz
        share = 1.0 / (north * north + east * east)
        north, east = share * north, share * east
        px, py = north * axes[u, c, 6] - east * axes[u, c, 3], north * axes[u, c, 7] - east * axes[u, c, 4]
        pz = north * axes[u, c, 8] - east * axes[u, c, 5]
        store_three(rows, c, 0, dy * pz - dz * py, dz * px - dx * pz, dx * py - dy * px)
        store_three(rows, c, 6, zero + ax, zero + ay, zero + az)
    return value


def compare(at: Comparison) -> Difference:
    """Return the angle between the forward axes in n, each seen from its own position."""
    true, indicated = at.true, at.indicated
    forward = indicated.frame.axes.T @ indicated.axes @ at.mounting[:, 0]
    true_forward = true.level.T @ true.axes @ true.mounting[:, 0]
    across = true_forward[0] * forward[1] - true_forward[1] * forward[0]
    difference = np.arctan2(across, true_forward[:2] @ forward[:2])
    # of f in n: by psi less the turn of the local axes
    slope = np.array([-forward[1], forward[0], 0.0]) / (forward[0] ** 2 + forward[1] ** 2)
    to_turn, navigation = -slope @ cross_matrix(forward), responses(1)
    navigation[0, ATTITUDE] = to_turn @ indicated.frame.axes.T
    navigation[0, POSITION] = -to_turn @ indicated.frame.turn @ indicated.frame.axes.T
    return Difference(np.array([difference]), navigation)


QUANTITY: Final = QuantityDefinition(
    name="heading",
    axes=("",),
    unit="rad",
    shown_in="mrad",
    usual=1e-2,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
)


def limit(truth: Truth, times: Array) -> str | None:
    """Say when the vehicle points up or down at an instant at which its heading is measured."""
    pitch = np.degrees(truth.angles(times)[:, 1])
    steep = np.flatnonzero(np.abs(pitch) > STEEPEST)
    if not len(steep):
        return None
    message = f"the pitch is {pitch[steep[0]]:.4g} deg at {times[steep[0]]:.10g} s"
    return f"{message}, where the heading is not defined; expected at most {STEEPEST:g} deg"


SENSOR: Final = SensorType(
    name="heading",
    words="Heading of the body.",
    quantities={"heading": "heading"},
    interval=10.0,
    estimated=("bias",),
    limit=limit,
    template="""\
heading = "0.5 deg"  # sigma of white noise, rad
bias = "0.5 deg"  # sigma of a constant error, rad
# correlated = { sigma = "0.5 deg", correlation_time = "5 min" }  # Gauss-Markov error, rad and s
""",
)
