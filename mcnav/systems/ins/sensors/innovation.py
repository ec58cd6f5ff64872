"""Arguments of a quantity's innovation in the ensemble, and the choice of the innovation of its kind.

These are kernels: a `Vector` is one number of many samples (`mcnav/docs/KERNELS.md`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, inlined, uncontracted_subroutine
from mcnav.compiled.lanes import angle_of_half
from mcnav.compiled.vectors import Vector, load, store, where

Innovation: TypeAlias = Callable[..., Vector]
"""Compiled function of a quantity; `mcnav.systems.ins.sensors.quantity.QuantityDefinition` describes it."""


class MeasurementTables(NamedTuple):
    """Tables that samples share of U updates with at most M components, in inertial axes.

    Attributes
    ----------
    directions : ndarray, shape (U, M, 3)
        The direction d of each component.
    parameters : ndarray, shape (U, M, P)
        Of each component, as the quantity's geometry has them.
    places : ndarray, shape (U, 3)
        True positions, m.
    levers : ndarray, shape (U, 3)
        Lever arms of those updates that need the rate of the body, m.
    swinging : ndarray of bool, shape (U,)
        Which these are.
    earth : ndarray
        As `mcnav.systems.ins.earth.Earth.constants` has them; the rotation rate is number 3.
    """

    directions: Array
    parameters: Array
    places: Array
    levers: Array
    swinging: NDArray[np.bool_]
    earth: Array


class NavigatorErrors(NamedTuple):
    """Deviations of LANES navigators from the truth at an update, in inertial axes.

    Attributes
    ----------
    x, y, z : Vector
        Of position, m.
    vx, vy, vz : Vector
        Of velocity over the earth, m/s.
    turn : ndarray, shape (4, LANES)
        R, the rotation from true to indicated axes, as a quaternion.
    turned : ndarray, shape (9, LANES)
        R - I.
    rotation : ndarray, shape (3, LANES)
        Room for a rotation vector.
    swing, corrected : ndarray, shape (3, LANES)
        Velocity of the antenna by the error of the navigator's rate, and what of it is not the gyros' own errors, m/s.
    offset : ndarray, shape (3, LANES)
        Errors of a sensor's `mcnav.systems.ins.sensors.quantity.OFFSETS`, less what the filter has estimated of them.
    of_offset : ndarray, shape (3, LANES)
        Room for the responses of one component to them.
    """

    x: Vector
    y: Vector
    z: Vector
    vx: Vector
    vy: Vector
    vz: Vector
    turn: Array
    turned: Array
    rotation: Array
    swing: Array
    corrected: Array
    offset: Array
    of_offset: Array


@inlined
def change_by_boresight(offset: Array, x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    """Compute by how much boresight errors b change a direction as the navigator knows it: ``b x d``."""
    a, b, c = load(offset, 0), load(offset, 1), load(offset, 2)
    return b * z - c * y, c * x - a * z, a * y - b * x


@inlined
def seen_from(errors: NavigatorErrors, x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    """Compute ``s - x + m``: from a navigator's own place to where its map has the landmark that is at s."""
    return (
        x - errors.x + load(errors.offset, 0), y - errors.y + load(errors.offset, 1),
        z - errors.z + load(errors.offset, 2),
    )  # fmt: skip


@inlined
def change_by_turn(turned: Array, x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    """Compute by how much rotations change a vector, with R - I."""
    return (
        load(turned, 0) * x + load(turned, 1) * y + load(turned, 2) * z,
        load(turned, 3) * x + load(turned, 4) * y + load(turned, 5) * z,
        load(turned, 6) * x + load(turned, 7) * y + load(turned, 8) * z,
    )


@inlined
def change_by_turn_back(turned: Array, x: Vector, y: Vector, z: Vector) -> tuple[Vector, Vector, Vector]:
    """Compute by how much the opposite rotations change vectors, with ``(R - I)^T``."""
    return (
        load(turned, 0) * x + load(turned, 3) * y + load(turned, 6) * z,
        load(turned, 1) * x + load(turned, 4) * y + load(turned, 7) * z,
        load(turned, 2) * x + load(turned, 5) * y + load(turned, 8) * z,
    )


@inlined
def store_response(errors: NavigatorErrors, x: Vector, y: Vector, z: Vector) -> None:
    """Write the responses of one component to errors of the sensor's offset."""
    store(errors.of_offset, 0, x)
    store(errors.of_offset, 1, y)
    store(errors.of_offset, 2, z)


@inlined
def store_three(out: Array, c: int, at: int, x: Vector, y: Vector, z: Vector) -> None:
    """Write three responses of component c, from column ``at`` on: 0 is psi, 3 is v, 6 is x."""
    store(out, (c, at), x)
    store(out, (c, at + 1), y)
    store(out, (c, at + 2), z)


@uncontracted_subroutine
def rotation_vectors(turn: Array, out: Array) -> None:
    """Compute the rotation vectors, shape (3, LANES), of quaternions."""
    w, b, c, e = load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3)
    sine = np.sqrt(b * b + c * c + e * e)
    further = np.abs(w) + np.sqrt(w * w + sine * sine)  # the tangent of a quarter of the angle is sine / further
    factor = where(sine > 0.0, 2.0 * angle_of_half(sine / further) / sine, 2.0)
    factor = where(w < 0.0, -factor, factor)
    store(out, 0, factor * b)
    store(out, 1, factor * c)
    store(out, 2, factor * e)


@allocation_free_part
def _refuse(
    kind: int, value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array,
    wanted: bool,
) -> Vector:  # fmt: skip
    """Return no number: a kind without equations ends its samples."""
    return value * np.nan


def choose_by_kind(innovations: Sequence[Innovation]) -> Innovation:
    """Return a compiled function that begins with a kind, and calls the innovation with that number."""
    choice: Innovation = _refuse
    for kind, innovation in reversed(list(enumerate(innovations))):
        choice = _link(kind, innovation, choice)
    return choice


def _link(number: int, innovation: Any, others: Any) -> Innovation:
    @allocation_free_part
    def choose(
        kind: int, value: Vector, u: int, c: int, tables: MeasurementTables, errors: NavigatorErrors, rows: Array,
        wanted: bool,
    ) -> Vector:  # fmt: skip
        if kind == number:
            return innovation(value, u, c, tables, errors, rows, wanted)
        return others(kind, value, u, c, tables, errors, rows, wanted)

    return choose
