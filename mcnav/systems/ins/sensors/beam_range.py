"""Distance to the ground along beams fixed to the body.

From the place r along the direction d the ground, of normal m, is at the distance s, the root ``q / (sqrt(h^2 - g q) -
h)`` of ``q + 2 h s + g s^2 = 0`` (`mcnav.systems.ins.sensors.beams`). With the lever arm L and boresight errors b the
innovation is ``s(r + x + R L, R (d + b x d)) - s(r + L, d)``; its parameters are the scales 1 / A and 1 / B of the
ground, and L. An error of the place changes s by ``-m . x / m . d``, and a turn by ``-m . (psi x (L + s d)) / m . d``.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, uncontracted_subroutine
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION
from mcnav.systems.ins.sensors.beams import beam_range, ground_scales
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
from mcnav.systems.ins.sensors.quantity import BEAMS, Geometry, QuantityDefinition
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``-(L + s d) x m / m . d`` to psi and ``-m / m . d`` to x, and those to other errors."""
    beam, scales = along.arrangement[axis, :3], ground_scales(along.globe, along.arrangement[axis, 3])
    direction, lever = np.asarray(along.body @ beam), along.lever
    distance, normal = beam_range(scales, along.position + lever, direction)
    x = -normal / np.sum(normal * direction, axis=1, keepdims=True)
    of_direction = distance[:, None] * x
    of_body = np.einsum("nji,nj->ni", along.body, of_direction)
    same = np.ones_like(distance)
    return Geometry(
        direction,
        psi=np.cross(direction, of_direction) + np.cross(lever, x),
        x=x,
        parameters=np.column_stack([scales[0] * same, scales[2] * same, lever]),
        lever_arm=np.einsum("nji,nj->ni", along.body, x),
        offsets={"boresight": np.cross(beam, of_body)},
        offset_axes=along.body,
        true=distance,
    )


@uncontracted_subroutine
def _distance(
    level: float, polar: float, q: Vector, x: Vector, y: Vector, z: Vector, ex: Vector, ey: Vector, ez: Vector
) -> Vector:
    """Compute the distance to the ground from places along directions e, with ``q = |S r|^2 - 1``."""
    ax, ay, az = level * ex, level * ey, polar * ez
    h, g = level * x * ax + level * y * ay + polar * z * az, ax * ax + ay * ay + az * az
    return q / (np.sqrt(h * h - g * q) - h)


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``s(r + x + R L, R (d + b x d)) - s(r + L, d)``."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    level, polar, zero = tables.parameters[u, c, 0], tables.parameters[u, c, 1], 0.0 * errors.x
    lx, ly, lz = tables.parameters[u, c, 2], tables.parameters[u, c, 3], tables.parameters[u, c, 4]
    rx, ry, rz = tables.places[u, 0] + lx, tables.places[u, 1] + ly, tables.places[u, 2] + lz
    q = zero + ((level * rx) ** 2 + (level * ry) ** 2 + (polar * rz) ** 2 - 1.0)
    here = _distance(level, polar, q, zero + rx, zero + ry, zero + rz, zero + dx, zero + dy, zero + dz)
    bx, by, bz = change_by_boresight(errors.offset, dx, dy, dz)
    bx, by, bz = dx + bx, dy + by, dz + bz
    ex, ey, ez = change_by_turn(errors.turned, bx, by, bz)
    ex, ey, ez = bx + ex, by + ey, bz + ez
    tx, ty, tz = change_by_turn(errors.turned, lx, ly, lz)
    px, py, pz = errors.x + tx, errors.y + ty, errors.z + tz
    # the change of q by the place's, without the rounding of places of a planet's radius
    q += level * level * (px * (2.0 * rx + px) + py * (2.0 * ry + py)) + polar * polar * pz * (2.0 * rz + pz)
    px, py, pz = rx + px, ry + py, rz + pz
    distance = _distance(level, polar, q, px, py, pz, ex, ey, ez)
    value += distance - here
    if wanted:
        nx, ny, nz = (
            level * level * (px + distance * ex), level * level * (py + distance * ey),
            polar * polar * (pz + distance * ez),
        )  # fmt: skip
        share = -1.0 / (nx * ex + ny * ey + nz * ez)
        nx, ny, nz = share * nx, share * ny, share * nz
        store_three(rows, c, 6, nx, ny, nz)
        # from the unit to where the beam meets the ground
        ex, ey, ez = lx + tx + distance * ex, ly + ty + distance * ey, lz + tz + distance * ez
        store_three(rows, c, 0, ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx)
        # d x R^T s n, to boresight errors
        tx, ty, tz = change_by_turn_back(errors.turned, nx, ny, nz)
        nx, ny, nz = distance * (nx + tx), distance * (ny + ty), distance * (nz + tz)
        store_response(errors, dy * nz - dz * ny, dz * nx - dx * nz, dx * ny - dy * nx)
    return value


def compare(at: Comparison) -> Difference:
    """Return the distances along ``C~ (b + e x b)`` from ``r~ + C~ l~`` less the true ones along ``C b``."""
    true, indicated, beams = at.true, at.indicated, at.arrangement
    body, true_body = indicated.axes @ at.mounting, true.axes @ true.mounting
    antenna, true_place = body @ at.arm, true.position + true_body @ true.lever_arm
    used = beams[:, :3] + np.cross(at.offsets["boresight"], beams[:, :3])
    value, true_values, navigation = np.empty(len(beams)), np.empty(len(beams)), responses(len(beams))
    others = np.empty((len(beams), at.arm_states.shape[1]))
    for row, beam in enumerate(beams):
        scales = ground_scales(at.globe, beam[3])
        direction = body @ used[row]
        distance, normal = beam_range(scales, indicated.position + antenna, direction)
        true_values[row] = beam_range(scales, true_place, true_body @ beam[:3])[0]
        of_place = -normal / (normal @ direction)
        value[row] = distance - true_values[row]
        navigation[row, POSITION] = of_place
        navigation[row, ATTITUDE] = np.cross(antenna + distance * direction, of_place)
        others[row] = np.cross(beam[:3], body.T @ (distance * of_place)) @ at.offset_states["boresight"]
        others[row] += (of_place @ body) @ at.arm_states
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
