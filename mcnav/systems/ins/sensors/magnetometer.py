"""The earth's magnetic field along the axes of the body, and magnetometers strapped to it.

The field is that of a dipole at the earth's centre whose axis m points to the northern geomagnetic pole ::

    B(r) = B0 (a / r)^3 (m - 3 (m . r / r) r / r)

with B0 = 29,806 nT and a = 6371.2 km (the first three coefficients of the International Geomagnetic Reference Field of
2020). With the deviation x of position and the rotation R, the innovation along an axis d of the body is
``R d . B(r + x) - d . B(r)``; its parameters are the axis of the dipole in inertial axes and B(r). The navigator and
the truth have the same field: what the dipole lacks of the true one, some 20 %, is part of the sensor's errors.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, uncontracted_subroutine
from mcnav.compiled.vectors import Vector
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, cross_matrix
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors, change_by_turn, store_three
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Truth

STRENGTH: Final = 29_806e-9 * 6_371_200.0**3
"""B0 a^3, T m^3."""

LATITUDE, LONGITUDE = np.radians(80.65), np.radians(-72.68)
POLE: Final = np.array([np.cos(LATITUDE) * np.cos(LONGITUDE), np.cos(LATITUDE) * np.sin(LONGITUDE), np.sin(LATITUDE)])
"""The northern geomagnetic pole of 2020 in earth-fixed axes."""


def dipole_field(pole: Array, position: Array) -> Array:
    """Compute the field, T, with the axis of the dipole and positions in the same axes, shapes (..., 3)."""
    square = np.sum(position**2, axis=-1, keepdims=True)
    along = np.sum(pole * position, axis=-1, keepdims=True)
    return np.asarray(STRENGTH * square**-1.5 * (pole - 3.0 * along / square * position))


def field_gradient(pole: Array, position: Array) -> Array:
    """Compute the gradient of the field, T/m, which is symmetric: shape (..., 3, 3)."""
    square = np.sum(position**2, axis=-1)[..., None, None]
    along = np.sum(pole * position, axis=-1)[..., None, None]
    outer = pole[..., :, None] * position[..., None, :]
    radial = position[..., :, None] * position[..., None, :]
    terms = 5.0 * along / square * radial - outer - outer.swapaxes(-1, -2) - along * np.eye(3)
    return np.asarray(3.0 * STRENGTH * square**-2.5 * terms)


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``d x B`` to psi and ``(dB/dr) d`` to x."""
    direction, pole = along.body[:, :, axis], along.earth @ POLE
    field = dipole_field(pole, along.position)
    return Geometry(
        direction,
        psi=np.cross(direction, field),
        x=np.einsum("nij,nj->ni", field_gradient(pole, along.position), direction),
        parameters=np.concatenate([pole, field], axis=1),
    )


@uncontracted_subroutine
def _field_along(
    px: float, py: float, pz: float, x: Vector, y: Vector, z: Vector, ex: Vector, ey: Vector, ez: Vector
) -> Vector:
    """Compute the field at positions along directions e, with the axis p of the dipole."""
    square = x * x + y * y + z * z
    along = (px * x + py * y + pz * z) / square
    of_axis, of_place = px * ex + py * ey + pz * ez, x * ex + y * ey + z * ez
    return STRENGTH * (of_axis - 3.0 * along * of_place) / (square * np.sqrt(square))


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``(R - I) d . B(r) + R d . (B(r + x) - B(r))``."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    px, py, pz = tables.parameters[u, c, 0], tables.parameters[u, c, 1], tables.parameters[u, c, 2]
    bx, by, bz = tables.parameters[u, c, 3], tables.parameters[u, c, 4], tables.parameters[u, c, 5]
    rx, ry, rz = tables.places[u, 0], tables.places[u, 1], tables.places[u, 2]
    x, y, z = errors.x, errors.y, errors.z
    ex, ey, ez = change_by_turn(errors.turned, dx, dy, dz)
    value += ex * bx + ey * by + ez * bz
    ex, ey, ez = dx + ex, dy + ey, dz + ez
    here = _field_along(px, py, pz, 0.0 * x + rx, 0.0 * y + ry, 0.0 * z + rz, ex, ey, ez)
    value += _field_along(px, py, pz, rx + x, ry + y, rz + z, ex, ey, ez) - here
    if wanted:
        store_three(rows, c, 0, ey * bz - ez * by, ez * bx - ex * bz, ex * by - ey * bx)
        # (dB/dr) e = 3 B0 a^3 / r^5 [(5 (m . r) (r . e) / r^2 - m . e) r - (r . e) m - (m . r) e]
        square = rx * rx + ry * ry + rz * rz
        scale = 3.0 * STRENGTH / (square * square * np.sqrt(square))
        along = px * rx + py * ry + pz * rz
        of_place = rx * ex + ry * ey + rz * ez
        of_axis = px * ex + py * ey + pz * ez
        radial = 5.0 * along / square * of_place - of_axis
        store_three(
            rows, c, 6, scale * (radial * rx - of_place * px - along * ex),
            scale * (radial * ry - of_place * py - along * ey), scale * (radial * rz - of_place * pz - along * ez),
        )  # fmt: skip
    return value


def compare(at: Comparison) -> Difference:
    """Return ``C~^T B(r~) - C^T B(r)`` with C from the body's axes."""
    true, indicated = at.true, at.indicated
    to_body = (indicated.axes @ at.mounting).T
    field = dipole_field(POLE, indicated.position)
    navigation = responses(3)
    navigation[:, ATTITUDE] = to_body @ cross_matrix(field)
    navigation[:, POSITION] = to_body @ field_gradient(POLE, indicated.position)
    true_field = (true.axes @ true.mounting).T @ dipole_field(POLE, true.position)
    return Difference(to_body @ field - true_field, navigation)


QUANTITY: Final = QuantityDefinition(
    name="magnetic_field",
    axes=AXES,
    unit="T",
    shown_in="nT",
    usual=100e-9,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
)


def limit(truth: Truth, times: Array) -> str | None:
    """Say when the field is not there."""
    body = truth.earth.body
    return None if body == "earth" else f"measures the magnetic field of the earth, and the scenario is on {body}"


SENSOR: Final = SensorType(
    name="magnetometer",
    words="Magnetic field of the earth, a dipole, along the axes of the body.",
    quantities={"field": "magnetic_field"},
    interval=1.0,
    estimated=("bias",),
    limit=limit,
    template="""\
field = "100 nT"  # sigma of white noise forward, right and down, T
bias = "200 nT"  # sigma of a constant error of the calibration, T
# correlated = { sigma = "50 nT", correlation_time = "10 min" }  # Gauss-Markov error, T and s
""",
)
