"""Distance to the ground along beams fixed to the body.

From the place r along the direction d the ground, of normal m, is at the distance s, the root ``q / (sqrt(h^2 - g q) -
h)`` of ``q + 2 h s + g s^2 = 0`` (`mcnav.systems.ins.sensors.beams`). The innovation is ``s(r + x, R d) - s(r, d)``;
its parameters are the scales 1 / A and 1 / B of the ground. An error of the place changes s by ``-m . x / m . d``, and
a turn of the beam by ``-s m . (psi x d) / m . d``.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.compiled.jit import allocation_free_part, uncontracted_subroutine
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION
from mcnav.systems.ins.sensors.beams import beam_range, ground_scales
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import BEAMS, Geometry, QuantityDefinition
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``-s d x m / m . d`` to psi and ``-m / m . d`` to x, and that to boresight errors."""
    beam, scales = along.arrangement[axis, :3], ground_scales(along.globe, along.arrangement[axis, 3])
    direction = np.asarray(along.body @ beam)
    distance, normal = beam_range(scales, along.position, direction)
    x = -normal / np.sum(normal * direction, axis=1, keepdims=True)
    of_direction = distance[:, None] * x
    of_body = np.einsum("nji,nj->ni", along.body, of_direction)
    same = np.ones_like(distance)
    return Geometry(
        direction,
        psi=np.cross(direction, of_direction),
        x=x,
        parameters=np.stack([scales[0] * same, scales[2] * same], axis=1),
        offsets={"boresight": np.cross(beam, of_body)},
        true=distance,
    )


@uncontracted_subroutine
def _distance(
    level: float, polar: float, x: Vector, y: Vector, z: Vector, ex: Vector, ey: Vector, ez: Vector
) -> Vector:
    """Compute the distance to the ground from places along directions e."""
    sx, sy, sz = level * x, level * y, polar * z
    ax, ay, az = level * ex, level * ey, polar * ez
    q, h, g = sx * sx + sy * sy + sz * sz - 1.0, sx * ax + sy * ay + sz * az, ax * ax + ay * ay + az * az
    return q / (np.sqrt(h * h - g * q) - h)


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``s(r + x, R d) - s(r, d)``."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    level, polar, zero = tables.parameters[u, c, 0], tables.parameters[u, c, 1], 0.0 * errors.x
    rx, ry, rz = tables.places[u, 0], tables.places[u, 1], tables.places[u, 2]
    here = _distance(level, polar, zero + rx, zero + ry, zero + rz, zero + dx, zero + dy, zero + dz)
    ex, ey, ez = change_by_turn(errors.turned, dx, dy, dz)
    ex, ey, ez = dx + ex, dy + ey, dz + ez
    px, py, pz = rx + errors.x, ry + errors.y, rz + errors.z
    distance = _distance(level, polar, px, py, pz, ex, ey, ez)
    value += distance - here
    if wanted:
        nx, ny, nz = (
            level * level * (px + distance * ex), level * level * (py + distance * ey),
            polar * polar * (pz + distance * ez),
        )  # fmt: skip
        share = -1.0 / (nx * ex + ny * ey + nz * ez)
        nx, ny, nz = share * nx, share * ny, share * nz
        store_three(rows, c, 6, nx, ny, nz)
        nx, ny, nz = distance * nx, distance * ny, distance * nz
        store_three(rows, c, 0, ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx)
    return value


def compare(at: Comparison) -> Difference:
    """Return the distances along ``C~ (b + e x b)`` from the indicated place less the true ones along ``C b``."""
    true, indicated, beams = at.true, at.indicated, at.arrangement
    body = indicated.axes @ true.mounting
    used = beams[:, :3] + np.cross(at.offsets["boresight"], beams[:, :3])
    value, true_values, navigation = np.empty(len(beams)), np.empty(len(beams)), responses(len(beams))
    others = np.empty((len(beams), at.arm_states.shape[1]))
    for row, beam in enumerate(beams):
        scales = ground_scales(at.globe, beam[3])
        direction = body @ used[row]
        distance, normal = beam_range(scales, indicated.position, direction)
        true_values[row] = beam_range(scales, true.position, true.axes @ true.mounting @ beam[:3])[0]
        of_place = -normal / (normal @ direction)
        value[row] = distance - true_values[row]
        navigation[row, POSITION] = of_place
        navigation[row, ATTITUDE] = np.cross(direction, distance * of_place)
        others[row] = np.cross(beam[:3], body.T @ (distance * of_place)) @ at.offset_states["boresight"]
    return Difference(value, navigation, others, true=true_values)


QUANTITY: Final = QuantityDefinition(
    name="beam_range",
    axes=BEAMS,
    unit="m",
    shown_in="m",
    usual=1.0,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    scaled=True,
    by_beam=True,
)
