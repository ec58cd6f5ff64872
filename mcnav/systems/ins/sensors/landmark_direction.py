"""Direction to a landmark along the axes of the body, and landmarks: points whose place is known from a map.

With the place l of the landmark, s = l - r and the unit vector e(s), the innovation along an axis d of the body is
``R d . e(s - x + m) - d . e(s)``; its parameters are s. The map's error m, that of the place which the navigator takes
less the true one, is constant, and the same for all measurements of the landmark.

A filter cannot tell a shift of the vehicle from the same shift of the map: its responses to m are the opposite of
those to x, both at the place that the navigator takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector
from mcnav.entries.context import FileContext
from mcnav.systems.ins.earth import local_axes
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import (
    MeasurementTables,
    NavigatorErrors,
    change_by_turn,
    seen_from,
    store_response,
    store_three,
)
from mcnav.systems.ins.sensors.quantity import FurtherKey, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth


def landmark_axes(along: Surroundings) -> Array:
    """Return north, east and down at the landmark in inertial axes, by columns, shape (u, 3, 3)."""
    return np.asarray(along.earth @ along.arrangement[1:4])


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``d x e`` to psi, ``-(d - (d . e) e) / |s|`` to x, and its opposite to the map's error."""
    direction = along.body[:, :, axis]
    away = along.earth @ along.arrangement[0] - along.position
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    unit = away / distance
    of_place = -(direction - np.sum(direction * unit, axis=1, keepdims=True) * unit) / distance
    return Geometry(
        direction,
        psi=np.cross(direction, unit),
        x=of_place,
        parameters=away,
        offsets={"map": -np.einsum("ni,nij->nj", of_place, landmark_axes(along))},
        offset_axes=landmark_axes(along),
    )


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``(R - I) d . e(s) + R d . (e(s - x + m) - e(s))``."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    sx, sy, sz = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    inverse = 1.0 / np.sqrt(sx * sx + sy * sy + sz * sz)
    ux, uy, uz = sx * inverse, sy * inverse, sz * inverse
    ex, ey, ez = change_by_turn(errors.turned, dx, dy, dz)
    value += ex * ux + ey * uy + ez * uz
    ex, ey, ez = dx + ex, dy + ey, dz + ez
    px, py, pz = seen_from(errors, sx, sy, sz)
    nearer = 1.0 / np.sqrt(px * px + py * py + pz * pz)
    px, py, pz = px * nearer, py * nearer, pz * nearer
    value += ex * (px - ux) + ey * (py - uy) + ez * (pz - uz)
    if wanted:
        store_three(rows, c, 0, ey * pz - ez * py, ez * px - ex * pz, ex * py - ey * px)
        along = ex * px + ey * py + ez * pz
        ex, ey, ez = nearer * (ex - along * px), nearer * (ey - along * py), nearer * (ez - along * pz)
        store_three(rows, c, 6, -ex, -ey, -ez)
        store_response(errors, ex, ey, ez)
    return value


def compare(at: Comparison) -> Difference:
    """Return ``C~^T e(l~ - r~) - C^T e(l - r)`` with C from the body's axes and the place l~ as the map has it."""
    true, indicated = at.true, at.indicated
    landmark, axes = at.arrangement[0], at.arrangement[1:4]
    to_body = (indicated.axes @ at.mounting).T
    away = landmark + axes @ at.offsets["map"] - indicated.position
    distance = np.linalg.norm(away)
    unit = away / distance
    across = to_body @ (np.eye(3) - np.outer(unit, unit)) / distance
    navigation = responses(3)
    navigation[:, ATTITUDE] = to_body @ cross_matrix(unit)
    navigation[:, POSITION] = -across
    true_away = landmark - true.position
    true_unit = (true.axes @ true.mounting).T @ true_away / np.linalg.norm(true_away)
    return Difference(to_body @ unit - true_unit, navigation, across @ axes @ at.offset_states["map"])


def read_landmark(entry: Mapping[str, Any], truth: Truth, key: str, context: FileContext) -> Array:
    """Return the place of a landmark, earth-fixed, m, and the local axes there by columns: shape (4, 3)."""
    place = []
    for name, unit in (("latitude", "rad"), ("longitude", "rad"), ("altitude", "m")):
        if name not in entry and name != "altitude":
            context.problem(f"{key}.{name}", "is missing; expected the place of the landmark")
        size = context.quantity(entry[name], unit, f"{key}.{name}") if name in entry else 0.0
        place.append(0.0 if size is None else size)
    latitude, longitude, altitude = np.array(place)
    if not abs(latitude) < np.pi / 2.0:
        context.problem(f"{key}.latitude", f"got {entry['latitude']!r}; expected an angle within 90 deg")
    position = truth.earth.from_geodetic(latitude, longitude, altitude)
    return np.concatenate([position[None], local_axes(latitude, longitude)])


def select(entry: Mapping[str, Any], times: Array, truth: Truth, key: str, context: FileContext) -> Array:
    """Leave out the instants at which the landmark is below the horizon of its place, or out of reach."""
    reach = context.quantity(entry["reach"], "m", f"{key}.reach") if "reach" in entry else np.inf
    silent = FileContext(context.file, context.folder)
    landmark = read_landmark(entry, truth, key, silent)
    if reach is None or not len(times) or silent.problems:
        return times
    away = truth.earth_fixed(times)[0] - landmark[0]
    distance, above = np.linalg.norm(away, axis=1), -away @ landmark[1:4, 2]
    seen = (distance <= reach) & (above > 0.0)
    if seen.any():
        return np.asarray(times[seen])
    if not np.any(above > 0.0):
        context.problem(key, "the vehicle is below the landmark's horizon at all instants of the sensor")
    else:
        nearest = f"the nearest distance above its horizon is {distance[above > 0.0].min():.6g} m"
        context.problem(f"{key}.reach", f"got {entry.get('reach')!r}; {nearest}")
    return times


QUANTITY: Final = QuantityDefinition(
    name="landmark_direction",
    axes=AXES,
    unit="rad",
    shown_in="mrad",
    usual=1e-3,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
)

SENSOR: Final = SensorType(
    name="landmark",
    words="Direction to a landmark along the axes of the body, and distance to it.",
    quantities={"direction": "landmark_direction", "range": "landmark_range"},
    interval=10.0,
    offsets=("map",),
    estimated=("map",),
    further={
        "latitude": FurtherKey("Geodetic latitude of the landmark.", "rad"),
        "longitude": FurtherKey("Longitude of the landmark.", "rad"),
        "altitude": FurtherKey("Altitude of the landmark above the ellipsoid; 0 unless given.", "m"),
        "reach": FurtherKey("Longest distance at which the landmark is seen.", "m"),
    },
    arrange=read_landmark,
    select=select,
    template="""\
latitude = "47.05 deg"  # of the landmark, rad
longitude = "9.1 deg"
altitude = "400 m"  # above the ellipsoid, m
direction = "1 mrad"  # sigma of white noise of the unit vector along x, y and z, rad
range = "10 m"  # the same of the distance, m; leave it out if not measured
map_error = "5 m"  # sigma of the map's error along north, east and down, m
# direction_bias = "0.5 mrad"  # sigma of a constant error, rad
# reach = "100 km"  # longest distance at which it is seen, m
""",
)
