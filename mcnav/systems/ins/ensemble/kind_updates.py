"""Updates of LANES aided samples by other filters than the error-state EKF: iterated, left- and right-invariant.

Each is compiled by itself, where a campaign has it, and called by its address: the loop of samples contains none of
them. Where numba has no addresses, the loop contains all of them and chooses one by its number.

The equations are those of the reference engine (`mcnav.systems.ins.reference.nonlinear_updates`,
`mcnav.systems.ins.reference.error_definitions`), in inertial axes: with the earth's rate W, velocities over the earth
are ``v - W x r``, and errors of them ``dv - W x dr``.

**Invariant.** A correction (a, b, d) of psi, dv, dr, over the earth, is by the group's exponential, and P is about the
corrected estimate. With R = exp(-a x) and J = J(-a)::

    b <- J b        d <- J d
    left-invariant     psi <- R psi    dv <- R dv                dr <- R dr
    right-invariant                    dv <- dv + b x psi        dr <- dr + d x psi

**Iterated.** Each sample has a correction c, at first none. Innovation y and response H are taken at the corrected
sample, until c no longer changes: ``c <- K (y(c) + H(c) c)``. A sample whose correction has settled is computed again
with the same numbers as long as others of its lanes have not, so that its bits do not depend on theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numba import typeof

from mcnav.arrays.types import Array
from mcnav.compiled.blocks import (
    ENTRIES,
    THREE,
    Block,
    add_product,
    load_block,
    load_symmetric,
    multiply,
    store_block,
    store_symmetric,
    transpose,
)
from mcnav.compiled.jit import allocation_free_by_address, allocation_free_part, inlined
from mcnav.compiled.lanes import half_turn_of_square
from mcnav.compiled.numba_private import ADDRESSES, address_of, call_by_address, has
from mcnav.compiled.vectors import (
    LANES,
    PARTS,
    Rooms,
    Vector,
    load,
    load_part,
    parts_of,
    room,
    room_of_parts,
    store,
    store_part,
    where,
)
from mcnav.systems.ins.ensemble.filters import (
    SIX,
    Covariances,
    FilterSteps,
    factor_innovations,
    project_along_samples,
    project_along_truth,
    update_covariances,
    whiten_projected,
)
from mcnav.systems.ins.ensemble.kept_samples import KeptSamples, keep_samples, kept_samples, take_back_samples
from mcnav.systems.ins.ensemble.sigma_points import PointRooms, point_rooms
from mcnav.systems.ins.ensemble.steps import Deviations, rotation_less_one
from mcnav.systems.ins.ensemble.unscented_updates import update_by_points
from mcnav.systems.ins.ensemble.updates import (
    Estimates,
    UpdateTables,
    feed_back_own,
    innovate,
    judge,
    whiten_by_own,
)
from mcnav.systems.ins.filter.model import EKF, ITERATED, ITERATIONS, LEFT, NAVIGATION, RIGHT, SETTLED, UKF


class KindRooms(NamedTuple):
    """Room for an update; the last axis is the lanes, or those of a part.

    Attributes
    ----------
    kept : KeptSamples
        Samples before an update that moves them on trial.
    reached : ndarray, shape (9 + q, LANES)
        Correction at which innovations are taken.
    sigmas : ndarray, shape (9 + q, LANES)
        Before the update.
    sigma_parts : ndarray, shape (9 + q, PARTS, PART)
        The same memory, by parts.
    apart : ndarray, shape (1, LANES)
        1 for samples whose correction still changes, else 0.
    carried : ndarray, shape (4, 9, PART)
        What psi, v and x of an invariant error have of themselves as they are carried over; what v has of psi, v of x
        and x of psi.
    points : PointRooms
    """

    kept: KeptSamples
    reached: Array
    sigmas: Array
    sigma_parts: Array
    apart: Array
    carried: Array
    points: PointRooms


def kind_rooms(states: int, kind: str, most: int = SIX, keep: Rooms = room) -> KindRooms:
    """Return room for a kind of filter with a number of states besides those of navigation.

    Parameters
    ----------
    most : int
        Components of the largest measurement.
    keep : callable
        Makes the rooms that outlast a step.
    """
    iterated = kind == ITERATED
    rows = NAVIGATION + states if iterated else 0
    sigmas = room(rows)
    return KindRooms(
        kept_samples(states, kind in (ITERATED, UKF)), room(rows), sigmas, parts_of(sigmas), room(int(iterated)),
        room_of_parts(4 * (kind in (LEFT, RIGHT)), ENTRIES), point_rooms(states, most, kind == UKF, keep),
    )  # fmt: skip


@allocation_free_part
def _project(u: int, m: int, updates: UpdateTables, samples: Deviations, cause: Array, filters: Covariances) -> None:
    """Compute ``P H^T``, and the Cholesky factor of the innovations' covariance."""
    if updates.of_filter.along_truth[u]:
        project_along_truth(u, m, updates.of_filter, filters)
    else:
        project_along_samples(u, m, updates.of_filter, filters)
    factor_innovations(u, m, updates.of_filter.variances, samples.sound, cause, filters)


@inlined
def _third_quotient(square: Vector) -> Vector:
    """Compute (a - sin a) / a^3 from the angle's square up to 9, by its Taylor series."""
    z = square
    return 1 / 6 + z * (-1 / 120 + z * (1 / 5040 + z * (-1 / 362880 + z * (1 / 39916800 + z * (
        -1 / 6227020800 + z * (1 / 1307674368000 + z * (-1 / 355687428096000 + z * (
            1 / 121645100408832000 + z * (-1 / 51090942171709440000 + z * (1 / 25852016738884976640000)))))))))
    )  # fmt: skip


@inlined
def _along_group(
    x: Vector, y: Vector, z: Vector, second: Vector, third: Vector, p: Vector, q: Vector, r: Vector
) -> tuple[Vector, Vector, Vector]:
    """Compute ``J(-a) (p, q, r)`` with a = (x, y, z), ``J(-a) b = b - second a x b + third a x (a x b)``."""
    ux, uy, uz = y * r - z * q, z * p - x * r, x * q - y * p
    wx, wy, wz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    return p - second * ux + third * wx, q - second * uy + third * wy, r - second * uz + third * wz


@inlined
def _cross(x: Vector, y: Vector, z: Vector) -> Block:
    """Return the matrix of a cross product."""
    zero = 0.0 * x
    return zero, -z, y, z, zero, -x, -y, x, zero


@allocation_free_part
def retract(t: int, left: bool, spin: float, filters: Covariances, rooms: KindRooms) -> None:
    """Let the corrections of part t be by the group's exponential, and find how covariances are carried over."""
    correction, carried = filters.correction_parts, rooms.carried
    x, y, z = load_part(correction, (0, t)), load_part(correction, (1, t)), load_part(correction, (2, t))
    dx, dy, dz = load_part(correction, (6, t)), load_part(correction, (7, t)), load_part(correction, (8, t))
    # over the earth: b - W x d
    bx, by = load_part(correction, (3, t)) + spin * dy, load_part(correction, (4, t)) - spin * dx
    bz = load_part(correction, (5, t))
    square = x * x + y * y + z * z
    sine, cosine = half_turn_of_square(square)
    second, third = 2.0 * sine * sine, _third_quotient(square)
    bx, by, bz = _along_group(x, y, z, second, third, bx, by, bz)
    dx, dy, dz = _along_group(x, y, z, second, third, dx, dy, dz)
    store_part(correction, (3, t), bx - spin * dy)
    store_part(correction, (4, t), by + spin * dx)
    store_part(correction, (5, t), bz)
    store_part(correction, (6, t), dx)
    store_part(correction, (7, t), dy)
    store_part(correction, (8, t), dz)
    zero = 0.0 * x
    one = zero + 1.0
    same, nothing = (one, zero, zero, zero, one, zero, zero, zero, one), _cross(zero, zero, zero)
    if left:
        r = rotation_less_one(cosine, -sine * x, -sine * y, -sine * z)
        store_block(carried, 0, (r[0] + 1.0, r[1], r[2], r[3], r[4] + 1.0, r[5], r[6], r[7], r[8] + 1.0))
        store_block(carried, 1, nothing)
        # v over the earth turns: W x (R dr) - R (W x dr)
        store_block(carried, 2, (
            -spin * (r[3] + r[1]), spin * (r[0] - r[4]), -spin * r[5],
            spin * (r[0] - r[4]), spin * (r[1] + r[3]), spin * r[2],
            -spin * r[7], spin * r[6], zero,
        ))  # fmt: skip
        store_block(carried, 3, nothing)
    else:
        store_block(carried, 0, same)
        e = _cross(dx, dy, dz)
        b = _cross(bx, by, bz)
        # b x psi + W x (d x psi)
        store_block(carried, 1, (
            b[0] - spin * e[3], b[1] - spin * e[4], b[2] - spin * e[5],
            b[3] + spin * e[0], b[4] + spin * e[1], b[5] + spin * e[2], b[6], b[7], b[8],
        ))  # fmt: skip
        store_block(carried, 2, nothing)
        store_block(carried, 3, e)


@allocation_free_part
def carry_over(t: int, filters: Covariances, rooms: KindRooms) -> None:
    """Compute ``D P D^T`` of part t, with psi <- R psi, v <- R v + B psi + E x, x <- R x + C psi."""
    p, product, carried, n = filters.p, filters.product, rooms.carried, filters.p.shape[1]
    for j in range(n):
        psi, v, x = load_symmetric(p, t, 0, j), load_symmetric(p, t, 1, j), load_symmetric(p, t, 2, j)
        turn = load_block(carried, 0)
        store_block(product, (0, j), multiply(turn, psi))
        moved = add_product(multiply(turn, v), load_block(carried, 1), psi)
        store_block(product, (1, j), add_product(moved, load_block(carried, 2), x))
        store_block(product, (2, j), add_product(multiply(turn, x), load_block(carried, 3), psi))
    for r in range(THREE):
        turn = transpose(load_block(carried, 0))
        psi, v, x = load_block(product, (r, 0)), load_block(product, (r, 1)), load_block(product, (r, 2))
        store_symmetric(p, t, r, 0, multiply(psi, turn))
        if r > 0:
            moved = add_product(multiply(v, turn), psi, transpose(load_block(carried, 1)))
            store_symmetric(p, t, r, 1, add_product(moved, x, transpose(load_block(carried, 2))))
        if r > 1:
            store_symmetric(p, t, r, 2, add_product(multiply(x, turn), psi, transpose(load_block(carried, 3))))
        for s in range(THREE, n):
            store_block(p, (t, s, r), transpose(load_block(product, (r, s))))


@allocation_free_part
def _update_invariant(
    left: bool, u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, rooms: KindRooms,
) -> None:  # fmt: skip
    innovate(u, m, constants, updates, samples, filters.rows, own)
    _project(u, m, updates, samples, cause, filters)
    whiten_by_own(m, filters.root, filters.inverse, own)
    judge(m, updates.limits[u], updates.lags[u], updates.sensors[u], own)
    update_covariances(u, m, accepted, whitened, of_filter, updates.of_filter, filters)
    for t in range(PARTS):
        retract(t, left, constants[3], filters, rooms)
        carry_over(t, filters, rooms)
    feed_back_own(filters.correction, of_filter.corrected, samples, own)


def update_left(
    u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, rooms: KindRooms,
) -> int:  # fmt: skip
    """Update samples with a left-invariant error, and return u."""
    _update_invariant(
        True, u, m, constants, of_filter, updates, samples, own, filters, accepted, whitened, cause, rooms
    )
    return u


def update_right(
    u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, rooms: KindRooms,
) -> int:  # fmt: skip
    """Update samples with a right-invariant error, and return u."""
    _update_invariant(
        False, u, m, constants, of_filter, updates, samples, own, filters, accepted, whitened, cause, rooms
    )
    return u


@allocation_free_part
def _keep(samples: Deviations, own: Estimates, filters: Covariances, rooms: KindRooms) -> None:
    """Keep the samples before an update, and their filters' sigmas."""
    keep_samples(samples, own, rooms.kept)
    for r in range(len(rooms.sigmas)):
        for t in range(PARTS):
            block, at = r // THREE, r % THREE
            store_part(rooms.sigma_parts, (r, t), load_part(filters.p, (t, block, block, (THREE + 1) * at)))
        variance = load(rooms.sigmas, r)
        store(rooms.sigmas, r, np.sqrt(where(variance > 0.0, variance, 0.0)))
        store(rooms.reached, r, 0.0 * variance)


@allocation_free_part
def _add_response(u: int, m: int, updates: UpdateTables, filters: Covariances, own: Estimates, reached: Array) -> None:
    """Add ``H c`` to the innovations."""
    for c in range(m):
        value = load(own.innovation, c)
        for r in range(NAVIGATION):
            value += load(filters.rows, (c, r)) * load(reached, r)
        for s in updates.of_filter.linked:
            if not updates.of_filter.responding[u, s]:
                continue
            for r in range(NAVIGATION + THREE * s, min(NAVIGATION + THREE * (s + 1), len(reached))):
                value += load(filters.rows, (c, r)) * load(reached, r)
        store(own.innovation, c, value)


@allocation_free_part
def _settle(correction: Array, rooms: KindRooms) -> bool:
    """Note which corrections still change, take these on, and return whether there are any."""
    apart = 0.0 * load(correction, 0)
    for r in range(len(rooms.sigmas)):
        change = np.abs(load(correction, r) - load(rooms.reached, r))
        apart = where(change <= SETTLED * load(rooms.sigmas, r), apart, 1.0)
    store(rooms.apart, 0, apart)
    changing = False
    for i in range(LANES):
        changing = changing or rooms.apart[0, i] > 0.0
    return changing


def update_iterated(
    u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, rooms: KindRooms,
) -> int:  # fmt: skip
    """Update samples at the most likely state, and return u; a response along the truth is that of every state."""
    most = 1 if updates.of_filter.along_truth[u] else ITERATIONS
    _keep(samples, own, filters, rooms)
    for number in range(most):
        if number > 0:
            feed_back_own(rooms.reached, of_filter.corrected, samples, own)
        innovate(u, m, constants, updates, samples, filters.rows, own)
        if number > 0:
            _add_response(u, m, updates, filters, own, rooms.reached)
            take_back_samples(samples, own, rooms.kept)
        _project(u, m, updates, samples, cause, filters)
        whiten_by_own(m, filters.root, filters.inverse, own)
        if number == 0:
            judge(m, updates.limits[u], updates.lags[u], updates.sensors[u], own)
        for t in range(PARTS):
            whiten_projected(m, t, accepted, whitened, filters)
        if number == most - 1 or not _settle(filters.correction, rooms):
            break
        for r in range(len(rooms.reached)):
            correction = where(load(rooms.apart, 0) > 0.0, load(filters.correction, r), load(rooms.reached, r))
            store(rooms.reached, r, correction)
    update_covariances(u, m, accepted, whitened, of_filter, updates.of_filter, filters)
    feed_back_own(filters.correction, of_filter.corrected, samples, own)
    return u


def update_unscented(
    u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, rooms: KindRooms,
) -> int:  # fmt: skip
    """Update samples by what their sigma points predict, and return u."""
    given = (u, m, constants, of_filter, updates, samples, own, filters, accepted, whitened, cause)
    update_by_points(*given, rooms.kept, rooms.points)
    return u


_OF_KINDS: Final[Mapping[str, Any]] = {
    ITERATED: update_iterated, LEFT: update_left, RIGHT: update_right, UKF: update_unscented
}  # fmt: skip


def choose_by_number() -> Any:
    """Return a compiled function that begins with the number of a kind, and calls its update."""
    iterated, left, right, unscented = (allocation_free_part(function) for function in _OF_KINDS.values())

    @allocation_free_part
    def choose(
        number: int, u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables,
        samples: Deviations, own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array,
        rooms: KindRooms,
    ) -> int:  # fmt: skip
        given = (u, m, constants, of_filter, updates, samples, own, filters, accepted, whitened, cause, rooms)
        if number == 1:
            iterated(*given)
        elif number == 2:
            left(*given)
        elif number == 3:
            right(*given)
        else:
            unscented(*given)
        return u

    return choose


UPDATE: Final[Any] = call_by_address() if has(ADDRESSES) else choose_by_number()
"""The update that `number_of` stands for, called with that number and its own arguments."""


def number_of(kind: str, given: tuple[Any, ...]) -> int:
    """Return what tells `UPDATE`, in this process, the update of a kind; zero for the EKF.

    Parameters
    ----------
    given : tuple
        Arguments of the update.
    """
    if kind == EKF:
        return 0
    if not has(ADDRESSES):
        return 1 + list(_OF_KINDS).index(kind)
    return _address_of(kind, tuple(map(typeof, given)))


@cache
def _address_of(kind: str, arguments: tuple[Any, ...]) -> int:
    return address_of(_compiled(kind), arguments)


@cache
def _compiled(kind: str) -> Any:
    """Return the compiled update, which must last as long as its address is used."""
    return allocation_free_by_address(_OF_KINDS[kind])
