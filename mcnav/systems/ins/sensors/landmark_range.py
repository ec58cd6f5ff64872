"""Distance to a landmark: ``|s - x + m| - |s|`` is the innovation, with s from the vehicle to it.

Its parameters are s; `mcnav.systems.ins.sensors.landmark_direction` has the sensor, and the map's error.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.reference.axes import POSITION
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import (
    MeasurementTables,
    NavigatorErrors,
    seen_from,
    store_response,
    store_three,
)
from mcnav.systems.ins.sensors.landmark_direction import landmark_axes
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the response ``-s / |s|`` to x, and its opposite to the map's error."""
    away = along.earth @ along.arrangement[0] - along.position
    distance = np.linalg.norm(away, axis=1)
    unit = away / distance[:, None]
    of_map = np.einsum("ni,nij->nj", unit, landmark_axes(along))
    return Geometry(
        unit, x=-unit, parameters=away, offsets={"map": of_map}, offset_axes=landmark_axes(along), true=distance
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``|s - x + m| - |s|``."""
    sx, sy, sz = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    px, py, pz = seen_from(errors, sx, sy, sz)
    distance = np.sqrt(px * px + py * py + pz * pz)
    value += distance - np.sqrt(sx * sx + sy * sy + sz * sz)
    if wanted:
        share = 1.0 / distance
        store_three(rows, c, 6, -share * px, -share * py, -share * pz)
        store_response(errors, share * px, share * py, share * pz)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``|l~ - r~| - |l - r|`` with the place l~ as the map has it."""
    axes = at.arrangement[1:4]
    away = at.arrangement[0] + axes @ at.offsets["map"] - at.indicated.position
    distance, true = np.linalg.norm(away), np.linalg.norm(at.arrangement[0] - at.true.position)
    navigation = responses(1)
    navigation[0, POSITION] = -away / distance
    others = (away / distance) @ axes @ at.offset_states["map"]
    return Difference(np.array([distance - true]), navigation, others[None], true=np.array([true]))


QUANTITY: Final = QuantityDefinition(
    name="landmark_range",
    axes=("",),
    unit="m",
    shown_in="m",
    usual=10.0,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    scaled=True,
)
