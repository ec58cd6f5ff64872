"""Velocity over the earth along forward, right and down of the body: odometers, Doppler radars.

With the velocity u over the earth and the deviations v and x, all in inertial axes, the innovation along an axis d of
the body is ``R d . (u + v - W x x) - d . u``; its parameters are u.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.reference.axes import ATTITUDE, VELOCITY, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``d x u`` to psi, d to v, and that of ``-W x x`` to x."""
    direction, spin = along.body[:, :, axis], along.spin
    return Geometry(
        direction,
        psi=np.cross(direction, along.velocity),
        v=direction,
        x=np.stack([-spin * direction[:, 1], spin * direction[:, 0], np.zeros(len(direction))], axis=1),
        parameters=along.velocity,
        true=np.einsum("ni,ni->n", direction, along.velocity),
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``(R - I) d . u + R d . (v - W x x)``; the responses are those of the navigator's own velocity."""
    spin = tables.earth[3]
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    ax, ay, az = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    ex, ey, ez = change_by_turn(errors.turned, dx, dy, dz)
    value += ex * ax + ey * ay + ez * az
    ex, ey, ez = dx + ex, dy + ey, dz + ez
    value += ex * errors.vx + ey * errors.vy + ez * errors.vz
    if wanted:
        ux, uy, uz = ax + errors.vx, ay + errors.vy, az + errors.vz  # the navigator's own velocity over the earth
        store_three(rows, c, 0, ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux)
        store_three(rows, c, 3, ex, ey, ez)
        store_three(rows, c, 6, -spin * ey, spin * ex, 0.0 * errors.x)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``C~^T v~ - C^T v`` with C from the body's axes."""
    true, indicated = at.true, at.indicated
    to_body = (indicated.axes @ at.mounting).T
    true_velocity = np.asarray((true.axes @ true.mounting).T @ true.velocity)
    navigation = responses(3)
    navigation[:, VELOCITY] = to_body
    navigation[:, ATTITUDE] = to_body @ cross_matrix(indicated.velocity)
    return Difference(to_body @ indicated.velocity - true_velocity, navigation, true=true_velocity)


QUANTITY: Final = QuantityDefinition(
    name="body_velocity",
    axes=AXES,
    unit="m/s",
    shown_in="m/s",
    usual=0.1,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    scaled=True,
)

SENSOR: Final = SensorType(
    name="velocity",
    words="Velocity over the earth along the axes of the body: odometer, Doppler.",
    quantities={"velocity": "body_velocity"},
    interval=2.0,
    estimated=("scale_factor",),
    bounds_attitude=True,
    template="""\
velocity = "0.1 m/s"  # sigma of white noise forward, right and down, m/s
scale_factor = { x = "0.2 %" }  # sigma of a constant error in proportion to the velocity
# bias = "1 cm/s"  # sigma of a constant error, m/s
# correlated = { sigma = "5 cm/s", correlation_time = "1 min" }  # Gauss-Markov error, m/s and s
""",
)
