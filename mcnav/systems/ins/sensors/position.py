"""Position of the antenna, along north, east and down at the geodetic position; and fixes of position.

With the lever arm L, the rotation R from true to indicated axes and the deviation x of position, all inertial, the
innovation along a direction d is ``d . [x + (R - I) L]``; its parameters are L.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import LEVEL_AXES, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``L x d`` to psi and d to x, and those to errors of the lever arm."""
    direction, lever = along.level[:, :, axis], along.lever
    return Geometry(
        direction,
        psi=np.cross(lever, direction),
        x=direction,
        parameters=lever,
        lever_arm=np.einsum("nj,nji->ni", direction, along.body),
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``d . x``, and with a lever arm ``d . (R - I) L``; the responses to psi are ``R L x d``."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    ax, ay, az = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    value += dx * errors.x + dy * errors.y + dz * errors.z
    if wanted:
        zero = 0.0 * errors.x
        store_three(rows, c, 6, zero + dx, zero + dy, zero + dz)
    if ax != 0.0 or ay != 0.0 or az != 0.0:
        lx, ly, lz = change_by_turn(errors.turned, ax, ay, az)
        value += dx * lx + dy * ly + dz * lz
        if wanted:
            lx, ly, lz = ax + lx, ay + ly, az + lz
            store_three(rows, c, 0, ly * dz - lz * dy, lz * dx - lx * dz, lx * dy - ly * dx)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``n . [r~ + C~ l~ - (r + C l)]`` with the lever arms l along the body's axes."""
    true, indicated = at.true, at.indicated
    body = indicated.axes @ at.mounting
    antenna, true_antenna = body @ at.arm, true.axes @ true.mounting @ true.lever_arm
    difference = (indicated.position - true.position) + (antenna - true_antenna)
    to_level, navigation = indicated.frame.axes.T, responses(3)
    navigation[:, POSITION], navigation[:, ATTITUDE] = to_level, -to_level @ cross_matrix(antenna)
    return Difference(to_level @ difference, navigation, to_level @ body @ at.arm_states)


QUANTITY: Final = QuantityDefinition(
    name="position",
    axes=LEVEL_AXES,
    unit="m",
    shown_in="m",
    usual=1.0,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    fixed_row=True,
)

SENSOR: Final = SensorType(
    name="position-fix",
    words="Position.",
    quantities={"position": "position"},
    interval=120.0,
    template="""\
position = { north = "20 m", east = "20 m" }  # sigma of white noise, m; axes without one are not measured
# bias = { north = "5 m" }  # sigma of a constant error, m
# correlated = { sigma = { east = "10 m" }, correlation_time = { east = "5 min" } }  # Gauss-Markov error, m and s
""",
)
