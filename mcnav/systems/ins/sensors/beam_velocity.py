"""Velocity over the ground along beams fixed to the body, and velocimeters: Doppler radars and lidars.

With the velocity u over the earth, the body's rate w over it, the lever arm L and the deviations v and x, all in
inertial axes, the innovation along a beam of the direction d is ::

    R (d + b x d) . (u + v - W x x) - d . u + (b x d) . ((w + e) x L) + d . (e x L)

The navigator has the beam, the arm and the rate of its gyros in the body's axes, so that ``d . (w x L)`` itself is not
turned; e is the error of its rate over the earth (`mcnav.systems.ins.sensors.velocity`), and b are boresight errors
(`mcnav.systems.ins.sensors.beams`). The parameters are u, and w x L for boresight errors.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector, load
from mcnav.systems.ins.reference.axes import ATTITUDE, VELOCITY, cross_matrix
from mcnav.systems.ins.sensors.beams import FURTHER, read_beams, select
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import (
    MeasurementTables,
    NavigatorErrors,
    change_by_boresight,
    change_by_turn,
    change_by_turn_back,
    store_response,
    store_three,
)
from mcnav.systems.ins.sensors.quantity import BEAMS, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``d x u + W x (L x d)`` to psi, d to v, and that of ``-W x x`` to x.

    Those to boresight errors are ``b x (C^T u + w x L)``, and to errors of the arm ``b x w``, in the body's axes.
    """
    beam, spin = along.arrangement[axis, :3], along.spin
    direction = np.asarray(along.body @ beam)
    swinging = np.cross(along.turning, along.lever_arm)
    of_body = np.einsum("nji,nj->ni", along.body, along.velocity) + swinging
    moment, psi = np.cross(along.lever, direction), np.cross(direction, along.velocity)
    psi[:, 0] -= spin * moment[:, 1]
    psi[:, 1] += spin * moment[:, 0]
    return Geometry(
        direction,
        psi=psi,
        v=direction,
        x=np.stack([-spin * direction[:, 1], spin * direction[:, 0], np.zeros(len(direction))], axis=1),
        parameters=np.concatenate([along.velocity, np.einsum("nij,nj->ni", along.body, swinging)], axis=1),
        lever_arm=np.cross(beam, along.turning),
        offsets={"boresight": np.cross(beam, of_body)},
        offset_axes=along.body,
        true=np.einsum("ni,ni->n", direction, along.velocity) + swinging @ beam,
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``R (d + b x d) . (u + v - W x x) - d . u + (b x d) . ((w + e) x L) + d . (e x L)``.

    The responses are those of the navigator's own velocity and beam.
    """
    spin = tables.earth[3]
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    ax, ay, az = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    bx, by, bz = change_by_boresight(errors.offset, dx, dy, dz)
    zero = 0.0 * errors.x
    wx, wy, wz = zero + tables.parameters[u, c, 3], zero + tables.parameters[u, c, 4], zero + tables.parameters[u, c, 5]
    if tables.swinging[u]:  # d . (e x L) of the gyros' own errors is in the value already
        wx, wy, wz = wx + load(errors.swing, 0), wy + load(errors.swing, 1), wz + load(errors.swing, 2)
        value += dx * load(errors.corrected, 0) + dy * load(errors.corrected, 1) + dz * load(errors.corrected, 2)
    value += bx * wx + by * wy + bz * wz
    ex, ey, ez = change_by_turn(errors.turned, dx + bx, dy + by, dz + bz)
    ex, ey, ez = bx + ex, by + ey, bz + ez
    value += ex * ax + ey * ay + ez * az
    ex, ey, ez = dx + ex, dy + ey, dz + ez
    value += ex * errors.vx + ey * errors.vy + ez * errors.vz
    if wanted:
        ux, uy, uz = ax + errors.vx, ay + errors.vy, az + errors.vz  # the navigator's own velocity over the earth
        px, py, pz = ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux
        # d x (R^T u + w x L), to boresight errors
        tx, ty, tz = change_by_turn_back(errors.turned, ux, uy, uz)
        tx, ty, tz = ux + tx + wx, uy + ty + wy, uz + tz + wz
        store_response(errors, dy * tz - dz * ty, dz * tx - dx * tz, dx * ty - dy * tx)
        if tables.swinging[u]:
            # W x R (L x (d + b x d))
            fx, fy, fz = tables.levers[u, 0], tables.levers[u, 1], tables.levers[u, 2]
            bx, by, bz = dx + bx, dy + by, dz + bz
            mx, my, mz = fy * bz - fz * by, fz * bx - fx * bz, fx * by - fy * bx
            qx, qy, _ = change_by_turn(errors.turned, mx, my, mz)
            px, py = px - spin * (my + qy), py + spin * (mx + qx)
        store_three(rows, c, 0, px, py, pz)
        store_three(rows, c, 3, ex, ey, ez)
        store_three(rows, c, 6, -spin * ey, spin * ex, 0.0 * errors.x)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``(b + b' x b) . (C~^T v~ + w~ x l~) - b . (C^T v + w x l)`` with C from the body's axes.

    The rate w~ over the earth is the navigator's own: that of its gyros less the earth's along its axes.
    """
    true, indicated = at.true, at.indicated
    beams, to_body = at.arrangement[:, :3], (indicated.axes @ at.mounting).T
    used = beams + np.cross(at.offsets["boresight"], beams)
    of_earth = np.array([0.0, 0.0, at.rotation_rate])
    rate = at.mounting.T @ (indicated.reading[:3] + at.gimbals) - to_body @ of_earth
    velocity = to_body @ indicated.velocity + np.cross(rate, at.arm)
    of_body = (true.axes @ true.mounting).T @ true.velocity + np.cross(true.turning, true.lever_arm)
    true_velocity, arm = beams @ of_body, cross_matrix(at.arm)
    navigation = responses(len(beams))
    navigation[:, VELOCITY] = used @ to_body
    navigation[:, ATTITUDE] = used @ (
        to_body @ cross_matrix(indicated.velocity) + arm @ to_body @ cross_matrix(of_earth)
    )
    others = np.cross(beams, velocity) @ at.offset_states["boresight"]
    others = others + used @ (cross_matrix(rate) @ at.arm_states - arm @ at.mounting.T @ at.gyro_states)
    return Difference(used @ velocity - true_velocity, navigation, others, true=true_velocity)


QUANTITY: Final = QuantityDefinition(
    name="beam_velocity",
    axes=BEAMS,
    unit="m/s",
    shown_in="m/s",
    usual=0.1,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    scaled=True,
    swings=True,
    by_beam=True,
)

SENSOR: Final = SensorType(
    name="velocimeter",
    words="Velocity over the ground, and distance to it, along beams fixed to the body.",
    quantities={"velocity": "beam_velocity", "range": "beam_range"},
    interval=1.0,
    lever_arm=True,
    offsets=("boresight",),
    estimated=("boresight",),
    bounds_attitude=True,
    further=FURTHER,
    arrange=read_beams,
    select=select,
    template="""\
# directions of the beams, each forward, right, down
beams = [[0.38, 0, 0.92], [-0.19, 0.33, 0.92], [-0.19, -0.33, 0.92]]
velocity = "2 cm/s"  # sigma of white noise along each beam, m/s
range = "0.5 m"  # the same of the distance, m; leave it out if not measured
boresight_error = "1 mrad"  # sigma of a constant error of the directions, rad
# velocity_scale_factor = "0.1 %"  # sigma of a constant error in proportion to the velocity
# reach = "5 km"  # longest distance at which it measures, m
# lever_arm = ["1 m", "0 m", "0.5 m"]  # from the unit to the sensor: forward, right, down, m
# lever_arm_error = "1 cm"  # sigma of its error along each axis, m
# ground = "400 m"  # altitude of what the beams meet, m; 0 unless given
""",
)
