"""Innovations beyond the first order in errors of sensors, and a filter's responses to them at its sample's own state.

The first order, along the truth, is in the tables of the linear closed loop, whose errors are added up beside the
samples: in the constant errors of the sensors and in the responses to the filter's states. Here is what a sample has
besides: of errors of `mcnav.systems.ins.sensors.quantity.OFFSETS`, of scale factors, and of delays and jitter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import THREE
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import Vector, load, store
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.sensors.innovation import NavigatorErrors, change_by_turn


class OffsetTables(NamedTuple):
    """Tables of the errors o of a sensor's `mcnav.systems.ins.sensors.quantity.OFFSETS` in U updates.

    Attributes
    ----------
    errors, states : ndarray of int, shape (U, 3)
        Number of the sensors' constant error that is not zero, and of the filter's state, of each axis; -1 for none.
    present : ndarray of bool, shape (U,)
        Whether an update's sensor has any.
    axes : ndarray, shape (U, 3, 3)
        Inertial axes, by columns.
    rows : ndarray, shape (U, M, 3)
        Responses of the innovations to them.
    """

    errors: IndexArray
    states: IndexArray
    present: NDArray[np.bool_]
    axes: Array
    rows: Array


class DelayTables(NamedTuple):
    """Tables of how what is measured changes, for states that are the delay and the jitter of a sensor, in U updates.

    Attributes
    ----------
    present : ndarray of bool, shape (U,)
        Whether an update's sensor has such states.
    states : ndarray of int, shape (U, 2)
        Their numbers, -1 for none.
    motion : ndarray, shape (U, M, 9)
        How psi, v and x of the truth change, as `mcnav.systems.ins.sensors.delay.motion_along_truth` has it.
    along : ndarray, shape (U, M)
        The responses along the truth times that.
    force : ndarray, shape (U, 3)
        Specific force in inertial axes.
    rates : ndarray, shape (U,)
        One over the duration of the step before, 1/s; zero at the start.
    """

    present: NDArray[np.bool_]
    states: IndexArray
    motion: Array
    along: Array
    force: Array
    rates: Array


@allocation_free_part
def find_offset(u: int, tables: OffsetTables, aiding: Array, estimate: Array, known: Array, offset: Array) -> None:
    """Compute what errors of a sensor's offset are left after the filter's estimates."""
    for j in range(THREE):
        left = 0.0 * load(known, j)
        if tables.errors[u, j] >= 0:
            left += load(aiding, tables.errors[u, j])
        if tables.states[u, j] >= 0:
            left -= load(estimate, tables.states[u, j])
        store(known, j, left)
    a, b, c = load(known, 0), load(known, 1), load(known, 2)
    for i in range(THREE):
        store(offset, i, tables.axes[u, i, 0] * a + tables.axes[u, i, 1] * b + tables.axes[u, i, 2] * c)


@allocation_free_part
def scale_responses(c: int, s: int, change: Vector, factor: Vector, rows: Array, of_offset: Array) -> None:
    """Multiply the responses of a component by 1 + k, and complete that to the scale factor k, state s.

    Parameters
    ----------
    change : Vector
        What is predicted less what is true: the response along the truth has the true value.
    """
    for r in range(NAVIGATION):
        store(rows, (c, r), load(rows, (c, r)) + factor * load(rows, (c, r)))
    for j in range(THREE):
        store(of_offset, j, load(of_offset, j) + factor * load(of_offset, j))
    store(rows, (c, NAVIGATION + s), load(rows, (c, NAVIGATION + s)) - change)


@allocation_free_part
def respond_to_offset(u: int, c: int, tables: OffsetTables, of_offset: Array, rows: Array) -> None:
    """Write the responses of a component to those of the filter's states that are errors of the sensor's offset."""
    x, y, z = load(of_offset, 0), load(of_offset, 1), load(of_offset, 2)
    for j in range(THREE):
        if tables.states[u, j] >= 0:
            response = tables.axes[u, 0, j] * x + tables.axes[u, 1, j] * y + tables.axes[u, 2, j] * z
            store(rows, (c, NAVIGATION + tables.states[u, j]), response)


@allocation_free_part
def change_late(
    u: int, c: int, tables: DelayTables, errors: NavigatorErrors, response: Array, rows: Array, estimate: Array
) -> Vector:
    """Return what estimates of delays change in an innovation besides h' along the truth, and complete the responses.

    By its responses to psi, v and x a navigator has ``h' = h_psi R p + h_v (a + R (f + e) - f) + h_x (u + v)``. Here p,
    a and u are how the truth changes; e is what is left of the accelerometers' error, a mean over the step before.
    The errors of the gyros and of gravity, and the turn of local axes, are left out.

    Parameters
    ----------
    response : ndarray, shape (9, LANES)
        As `mcnav.systems.ins.ensemble.steps.Deviations` has it.
    """
    motion, force, turned = tables.motion, tables.force, errors.turned
    x, y, z = change_by_turn(turned, motion[u, c, 0], motion[u, c, 1], motion[u, c, 2])
    beyond = load(rows, (c, 0)) * (motion[u, c, 0] + x) + load(rows, (c, 1)) * (motion[u, c, 1] + y)
    beyond += load(rows, (c, 2)) * (motion[u, c, 2] + z)
    rate = tables.rates[u]
    ex, ey, ez = rate * load(response, 3), rate * load(response, 4), rate * load(response, 5)
    x, y, z = change_by_turn(turned, force[u, 0] + ex, force[u, 1] + ey, force[u, 2] + ez)
    x, y, z = ex + x, ey + y, ez + z
    beyond += load(rows, (c, 3)) * (motion[u, c, 3] + x) + load(rows, (c, 4)) * (motion[u, c, 4] + y)
    beyond += load(rows, (c, 5)) * (motion[u, c, 5] + z)
    beyond += load(rows, (c, 6)) * (motion[u, c, 6] + errors.vx) + load(rows, (c, 7)) * (motion[u, c, 7] + errors.vy)
    beyond += load(rows, (c, 8)) * (motion[u, c, 8] + errors.vz) - tables.along[u, c]
    change = 0.0 * beyond
    for j in range(tables.states.shape[1]):
        s = tables.states[u, j]
        if s >= 0:
            store(rows, (c, NAVIGATION + s), load(rows, (c, NAVIGATION + s)) + beyond)
            change += beyond * load(estimate, s)
    return change
