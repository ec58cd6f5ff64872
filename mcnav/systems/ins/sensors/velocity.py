"""Velocity of the antenna over the earth, along north, east and down; and updates of a vehicle at rest.

With the body's rate w over the earth, the lever arm L, the earth's rate W and the deviations v and x, all in inertial
axes, the innovation along a direction d is ::

    d . [v - W x x + R ((w + e) x L) - w x L]

and its parameters are w x L. The navigator computes the antenna's velocity with the rate that its gyros measure, whose
error is in true axes ``e = C g - (R^T - I) W``. C are the instruments' axes, and g is what is left of the gyros'
constant errors, bias instability and rate random walk after the filter's estimates are subtracted. The noise of the
readings (angle random walk, quantization) is not in it, as it depends on how long a navigator averages them: it is part
of the measurement's. On a stabilised platform the gyros measure the platform's rate, and the body's rate about the
platform is known.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector, load
from mcnav.systems.ins.reference.axes import ATTITUDE, VELOCITY, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import LEVEL_AXES, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth

MOST_SPEED: Final = 0.1
"""Largest speed of a vehicle that a sensor of type zero-velocity takes for one at rest, m/s."""


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``(w x L) x d + W x (L x d)`` to psi, d to v, and that of ``-W x x`` to x.

    A flexure q adds ``d . C (w x (q x L) + q' x L)`` to the measured velocity.
    """
    direction, spin = along.level[:, :, axis], along.spin
    swinging = np.einsum("nij,nj->ni", along.body, np.cross(along.turning, along.lever_arm))
    x, y, z = direction.T
    lx, ly, lz = along.lever.T
    psi = np.cross(swinging, direction)
    psi[:, 0] -= spin * (lz * x - lx * z)
    psi[:, 1] += spin * (ly * z - lz * y)
    of_body = np.einsum("nj,nji->ni", direction, along.body)
    of_angles = np.cross(along.lever_arm, np.cross(of_body, along.turning))
    return Geometry(
        direction,
        psi=psi,
        v=direction,
        x=np.stack([-spin * y, spin * x, np.zeros_like(z)], axis=1),
        parameters=swinging,
        lever_arm=np.cross(of_body, along.turning),
        flexure=np.concatenate([of_angles, np.cross(along.lever_arm, of_body)], axis=1),
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``d . [v - W x x]``, and with a lever arm ``d . [R ((w + e) x L) - w x L]``."""
    spin = tables.earth[3]
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    ax, ay, az = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    value += dx * errors.vx + dy * errors.vy + dz * errors.vz
    if wanted:
        zero = 0.0 * errors.x
        store_three(rows, c, 3, zero + dx, zero + dy, zero + dz)
        store_three(rows, c, 6, zero - spin * dy, zero + spin * dx, zero)
    if tables.swinging[u]:
        sx, sy, sz = ax + load(errors.swing, 0), ay + load(errors.swing, 1), az + load(errors.swing, 2)
        lx, ly, lz = change_by_turn(errors.turned, sx, sy, sz)
        ex, ey, ez = load(errors.corrected, 0), load(errors.corrected, 1), load(errors.corrected, 2)
        value += dx * (lx + ex) + dy * (ly + ey) + dz * (lz + ez)
        if wanted:
            lx, ly, lz = sx + lx, sy + ly, sz + lz
            # W x (R L x d)
            fx, fy, fz = tables.levers[u, 0], tables.levers[u, 1], tables.levers[u, 2]
            ex, ey, ez = change_by_turn(errors.turned, fx, fy, fz)
            ex, ey, ez = fx + ex, fy + ey, fz + ez
            ex, ey = -spin * (ez * dx - ex * dz), spin * (ey * dz - ez * dy)
            store_three(rows, c, 0, ly * dz - lz * dy + ex, lz * dx - lx * dz + ey, lx * dy - ly * dx)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``n . [v~ + (C~ w~ - W) x C~ l~ - (v + C (w x l))]``; the rate w~ is the navigator's own."""
    true, indicated = at.true, at.indicated
    body = indicated.axes @ at.mounting
    antenna, rate = body @ at.arm, indicated.axes @ (indicated.reading[:3] + at.gimbals)
    of_earth = cross_matrix(np.array([0.0, 0.0, at.rotation_rate]))
    turning = cross_matrix(rate) - of_earth
    true_antenna = true.axes @ true.mounting @ (cross_matrix(true.turning) @ true.lever_arm)
    difference = (indicated.velocity - at.turned @ true.velocity) + (turning @ antenna - at.turned @ true_antenna)
    to_level, navigation = indicated.frame.axes.T, responses(3)
    of_attitude = of_earth @ cross_matrix(antenna) - cross_matrix(cross_matrix(rate) @ antenna)
    navigation[:, VELOCITY], navigation[:, ATTITUDE] = to_level, to_level @ of_attitude
    to_gyros = -cross_matrix(antenna) @ indicated.axes @ at.gyro_states
    others = to_level @ (turning @ body @ at.arm_states + to_gyros)
    if not at.flexes:
        return Difference(to_level @ difference, navigation, others)
    bent, true_body = -cross_matrix(at.arm), true.axes @ true.mounting
    flexure = np.concatenate([to_level @ turning @ body @ bent, to_level @ body @ bent], axis=1)
    to_true_level, bent = true.level.T @ true_body, -cross_matrix(true.lever_arm)
    true_flexure = np.concatenate([to_true_level @ cross_matrix(true.turning) @ bent, to_true_level @ bent], axis=1)
    return Difference(to_level @ difference, navigation, others, flexure=flexure, true_flexure=true_flexure)


QUANTITY: Final = QuantityDefinition(
    name="velocity",
    axes=LEVEL_AXES,
    unit="m/s",
    shown_in="m/s",
    usual=0.1,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    swings=True,
    fixed_row=True,
    reference="local",
)


def limit(truth: Truth, times: Array) -> str | None:
    """Say when the vehicle moves at an instant at which it is to be at rest."""
    speeds = np.linalg.norm(truth.earth_fixed(times)[1], axis=1)
    fast = np.flatnonzero(speeds > MOST_SPEED)
    if not len(fast):
        return None
    message = f"the vehicle moves at {speeds[fast[0]]:.3g} m/s at {times[fast[0]]:.10g} s"
    return f"{message}; expected instants at rest, at most {MOST_SPEED} m/s"


SENSOR: Final = SensorType(
    name="zero-velocity",
    words="The velocity of a vehicle at rest.",
    quantities={"velocity": "velocity"},
    errors=False,
    delays=False,
    interval=None,
    bounds_attitude=True,
    limit=limit,
    template="""\
velocity = "1 cm/s"  # sigma of white noise along north, east and down, m/s
""",
)
