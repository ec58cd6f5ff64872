"""Attitude: the rotation vector of the measured relative to the true attitude, along the instruments' axes.

The innovation along an axis d is ``d . psi``, with the rotation vector psi from true to indicated axes.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector, load
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.reference.axes import ATTITUDE
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.innovation import (
    MeasurementTables,
    NavigatorErrors,
    change_by_turn,
    rotation_vectors,
    store_three,
)
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the response d to psi; a flexure adds ``d . C q``."""
    direction = along.instruments[:, :, axis]
    of_angles = np.einsum("nj,nji->ni", direction, along.body)
    return Geometry(direction, psi=direction, flexure=np.concatenate([of_angles, np.zeros_like(of_angles)], axis=1))


@allocation_free_part
def innovation(
    value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array, wanted: bool
) -> Vector:
    """Add ``d . psi``; the response to psi is the indicated axis, which differs from the exact one by half the turn."""
    dx, dy, dz = tables.directions[u, c, 0], tables.directions[u, c, 1], tables.directions[u, c, 2]
    rotation = errors.rotation
    rotation_vectors(errors.turn, rotation)
    value += dx * load(rotation, 0) + dy * load(rotation, 1) + dz * load(rotation, 2)
    if wanted:
        ex, ey, ez = change_by_turn(errors.turned, dx, dy, dz)
        store_three(rows, c, 0, dx + ex, dy + ey, dz + ez)
    return value


def compare(at: Comparison) -> Difference:
    """Return the rotation vector of ``C^T C~``.

    The product of the star tracker's and the navigator's errors, two small angles, is neglected.
    """
    from scipy.spatial.transform import Rotation

    navigation = responses(3)
    navigation[:, ATTITUDE] = at.indicated.axes.T
    value = Rotation.from_matrix((at.turned @ at.true.axes).T @ at.indicated.axes).as_rotvec()
    if not at.flexes:
        return Difference(value, navigation)
    flexure = np.concatenate([at.true.mounting, np.zeros((3, 3))], axis=1)  # the same for the truth and the navigator
    return Difference(value, navigation, flexure=flexure, true_flexure=flexure)


QUANTITY: Final = QuantityDefinition(
    name="attitude",
    axes=AXES,
    unit="rad",
    shown_in="arcsec",
    usual=5e-5,
    geometry=geometry,
    innovation=innovation,
    compare=compare,
    reference="stars",
    of_instruments=True,
)

SENSOR: Final = SensorType(
    name="star-tracker",
    words="Attitude, as a rotation vector along the axes of the instruments.",
    quantities={"attitude": "attitude"},
    interval=60.0,
    estimated=("bias",),
    bounds_attitude=True,
    template="""\
attitude = "10 arcsec"  # sigma of white noise along x, y and z, rad
bias = "5 arcsec"  # sigma of a constant error of the boresight, rad
# correlated = { sigma = "3 arcsec", correlation_time = "10 min" }  # Gauss-Markov error, rad and s
""",
)
