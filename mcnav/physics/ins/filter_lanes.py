"""Covariances of the filters of LANES aided samples: propagation and updates.

Each filter's transition is that of the step's tables, turned to the attitude and the force that its sample indicates.
Rows and columns are those of its 9 + q states; of the covariances the lower triangles count.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.jit import allocation_free, inlined
from mcnav.physics.vectors import Rooms, Vector, load, room, store, where

SIX: Final = 6
"""Components of the largest measurement."""

SOUND, BEYOND, INDEFINITE = 0, 1, 2
"""Outcomes of a sample: good; beyond the validity of the scheme; a covariance that is not positive definite."""


class FilterSteps(NamedTuple):
    """Tables that the filters share over K steps, as `mcnav.physics.ins.filter_tables.FilterTables` has it.

    Attributes
    ----------
    turning, moving, shaken : ndarray of int
        Other states that psi responds to, that v and x respond to, and whose noise is correlated with that of psi, v
        and x.
    """

    coupling: Array
    decay: Array
    noise: Array
    corrected: Array
    turning: IndexArray
    moving: IndexArray
    shaken: IndexArray


class Covariances(NamedTuple):
    """Covariances of LANES filters, and room for a step and an update of them; the last axis is the lanes.

    Attributes
    ----------
    p : ndarray, shape (9 + q, 9 + q, LANES)
    transition, coupled, added : ndarray, shapes (6, 3, LANES), (9, q, LANES), (9 + q, 9, LANES)
        The step's tables as turned: responses of v, x to psi; of psi, v, x to the other states; noise.
    product : ndarray, shape (9, 9 + q, LANES)
    rows : ndarray, shape (SIX, 9, LANES)
        Responses of the innovations to psi, v, x.
    cross, white, gain : ndarray, shape (9 + q, SIX, LANES)
        ``P H^T``; that with the innovations whitened, ``P H^T L^-T``; gains.
    root, inverse : ndarray, shapes (SIX, SIX, LANES), (SIX, LANES)
        Cholesky factor L of the innovations' covariance, and its diagonal inverted.
    left : ndarray, shape (9 + q, 9 + q, LANES)
    """

    p: Array
    transition: Array
    coupled: Array
    added: Array
    product: Array
    rows: Array
    cross: Array
    white: Array
    gain: Array
    root: Array
    inverse: Array
    left: Array


def covariances_of(states: int, own: bool = True, keep: Rooms = room) -> Covariances:
    """Return room for filters with a number of states besides those of navigation.

    Parameters
    ----------
    own : bool
        Whether each filter has gains of its own; otherwise there are no rows.
    keep : callable
        Makes the rooms that outlast a step.
    """
    size = 9 + states
    return Covariances(
        keep(size, size), room(6, 3), room(9, states), room(size, 9), room(9, size), room(SIX if own else 0, 9),
        room(size, SIX), room(size, SIX), room(size, SIX), room(SIX, SIX), room(SIX), room(size, size),
    )  # fmt: skip


@inlined
def _turn_block(turned: Array, table: Array, k: int, row: int, column: int, out: Array, at: int, to: int) -> None:
    """Compute ``R B R^T`` of a block of a table, shape (3, 3), with R - I of each lane."""
    for r in range(3):
        x, y, z = load(turned, 3 * r), load(turned, 3 * r + 1), load(turned, 3 * r + 2)
        a = table[k, row + r, column] + (
            x * table[k, row, column] + y * table[k, row + 1, column] + z * table[k, row + 2, column]
        )
        b = table[k, row + r, column + 1] + (
            x * table[k, row, column + 1] + y * table[k, row + 1, column + 1] + z * table[k, row + 2, column + 1]
        )
        c = table[k, row + r, column + 2] + (
            x * table[k, row, column + 2] + y * table[k, row + 1, column + 2] + z * table[k, row + 2, column + 2]
        )
        store(out, (at + r, to), a + (a * load(turned, 0) + b * load(turned, 1) + c * load(turned, 2)))
        store(out, (at + r, to + 1), b + (a * load(turned, 3) + b * load(turned, 4) + c * load(turned, 5)))
        store(out, (at + r, to + 2), c + (a * load(turned, 6) + b * load(turned, 7) + c * load(turned, 8)))


@inlined
def _turn_column(turned: Array, table: Array, k: int, row: int, column: int) -> tuple[Vector, Vector, Vector]:
    """Compute R times a column of three numbers of a table, with R - I of each lane."""
    x, y, z = table[k, row, column], table[k, row + 1, column], table[k, row + 2, column]
    return (
        x + (load(turned, 0) * x + load(turned, 1) * y + load(turned, 2) * z),
        y + (load(turned, 3) * x + load(turned, 4) * y + load(turned, 5) * z),
        z + (load(turned, 6) * x + load(turned, 7) * y + load(turned, 8) * z),
    )


@allocation_free
def turn_tables(
    k: int, motion: Array, thrust: Array, tables: FilterSteps, response: Array, turned: Array, filters: Covariances
) -> None:
    """Turn a step's tables to the attitude and the force that each sample indicates.

    Parameters
    ----------
    response : ndarray, shape (9, LANES)
        Of psi, v, x to the errors of the instruments that are left.
    turned : ndarray, shape (9, LANES)
        R - I.
    """
    transition, coupled, added = filters.transition, filters.coupled, filters.added
    ax, ay, az = load(response, 0), load(response, 1), load(response, 2)
    for half in range(2):
        at = 3 * half
        _turn_block(turned, motion, k, at, 0, transition, at, 0)
        fx, fy, fz = thrust[k, at], thrust[k, at + 1], thrust[k, at + 2]
        share = 0.5 if half == 0 else 1.0 / 3.0
        ux = load(response, 3 + at) - share * (ay * fz - az * fy)
        uy = load(response, 4 + at) - share * (az * fx - ax * fz)
        uz = load(response, 5 + at) - share * (ax * fy - ay * fx)
        store(transition, (at, 1), load(transition, (at, 1)) + uz)
        store(transition, (at, 2), load(transition, (at, 2)) - uy)
        store(transition, (at + 1, 0), load(transition, (at + 1, 0)) - uz)
        store(transition, (at + 1, 2), load(transition, (at + 1, 2)) + ux)
        store(transition, (at + 2, 0), load(transition, (at + 2, 0)) + uy)
        store(transition, (at + 2, 1), load(transition, (at + 2, 1)) - ux)
    for row in range(0, 9, 3):
        for column in range(0, row + 3, 3):
            _turn_block(turned, tables.noise, k, row, column, added, row, column)
        for s in tables.moving if row > 0 else tables.turning:
            x, y, z = _turn_column(turned, tables.coupling, k, row, s)
            store(coupled, (row, s), x)
            store(coupled, (row + 1, s), y)
            store(coupled, (row + 2, s), z)
        for s in tables.shaken:
            x, y, z = _turn_column(turned, tables.noise, k, row, 9 + s)
            store(added, (9 + s, row), x)
            store(added, (9 + s, row + 1), y)
            store(added, (9 + s, row + 2), z)


@inlined
def _at(row: int, column: int) -> tuple[int, int]:
    """Return the place of an entry of a covariance in its lower triangle."""
    return max(row, column), min(row, column)


@allocation_free
def propagate_covariances(k: int, motion: Array, tables: FilterSteps, filters: Covariances) -> None:
    """Take the filters' covariances over a step: ``P' = Phi P Phi^T + Q``."""
    p, transition, coupled, added, product = (
        filters.p, filters.transition, filters.coupled, filters.added, filters.product,
    )  # fmt: skip
    size, turning, moving = len(p), tables.turning, tables.moving
    for j in range(size):
        a, b, c = load(p, _at(0, j)), load(p, _at(1, j)), load(p, _at(2, j))
        x, y, z = a, b, c
        for s in turning:
            e = load(p, _at(9 + s, j))
            x += load(coupled, (0, s)) * e
            y += load(coupled, (1, s)) * e
            z += load(coupled, (2, s)) * e
        store(product, (0, j), x)
        store(product, (1, j), y)
        store(product, (2, j), z)
        for r in range(0, 6, 3):
            x = load(transition, (r, 0)) * a + load(transition, (r, 1)) * b + load(transition, (r, 2)) * c
            y = load(transition, (r + 1, 0)) * a + load(transition, (r + 1, 1)) * b + load(transition, (r + 1, 2)) * c
            z = load(transition, (r + 2, 0)) * a + load(transition, (r + 2, 1)) * b + load(transition, (r + 2, 2)) * c
            for i in range(3, 9):
                e = load(p, _at(i, j))
                x += motion[k, r, i] * e
                y += motion[k, r + 1, i] * e
                z += motion[k, r + 2, i] * e
            for s in moving:
                e = load(p, _at(9 + s, j))
                x += load(coupled, (3 + r, s)) * e
                y += load(coupled, (4 + r, s)) * e
                z += load(coupled, (5 + r, s)) * e
            store(product, (3 + r, j), x)
            store(product, (4 + r, j), y)
            store(product, (5 + r, j), z)
    for r in range(9):
        for j in range(min(r, 2) + 1):
            x = load(added, (r, j)) + load(product, (r, j))
            for s in turning:
                x += load(product, (r, 9 + s)) * load(coupled, (j, s))
            store(p, (r, j), x)
        a, b, c = load(product, (r, 0)), load(product, (r, 1)), load(product, (r, 2))
        for j in range(3, r + 1):
            x = load(added, (r, j)) + (
                load(transition, (j - 3, 0)) * a + load(transition, (j - 3, 1)) * b + load(transition, (j - 3, 2)) * c
            )
            for i in range(3, 9):
                x += motion[k, j - 3, i] * load(product, (r, i))
            for s in moving:
                x += load(product, (r, 9 + s)) * load(coupled, (j, s))
            store(p, (r, j), x)
        for s in range(size - 9):
            x = tables.decay[k, s] * load(product, (r, 9 + s)) + load(added, (9 + s, r))
            store(p, (9 + s, r), x)
    for s in range(size - 9):
        for e in range(s + 1):
            x = tables.decay[k, s] * tables.decay[k, e] * load(p, (9 + s, 9 + e)) + tables.noise[k, 9 + s, 9 + e]
            store(p, (9 + s, 9 + e), x)


@inlined
def _project(
    p: Array, r: int, c: int, rows: Array, begin: int, end: int, state_rows: Array, u: int, linked: IndexArray
) -> Vector:
    """Compute a row of a matrix times the response of a component of update u, which is zero but from begin to end."""
    x = load(p, (r, begin)) * load(rows, (c, begin))
    for j in range(begin + 1, end):
        x += load(p, (r, j)) * load(rows, (c, j))
    for s in linked:
        x += load(p, (r, 9 + s)) * state_rows[u, c, s]
    return x


@inlined
def _project_covariance(
    p: Array, r: int, c: int, rows: Array, begin: int, end: int, state_rows: Array, u: int, linked: IndexArray
) -> Vector:
    """Compute the same of a covariance's lower triangle."""
    x = load(p, _at(r, begin)) * load(rows, (c, begin))
    for j in range(begin + 1, end):
        x += load(p, _at(r, j)) * load(rows, (c, j))
    for s in linked:
        x += load(p, _at(r, 9 + s)) * state_rows[u, c, s]
    return x


@allocation_free
def project_along_truth(
    u: int, m: int, rows: Array, bounds: IndexArray, state_rows: Array, linked: IndexArray, filters: Covariances
) -> None:
    """Compute ``P H^T`` and ``H P H^T`` of update u, whose responses H are those along the truth.

    Components are handled in threes, so that an entry of the covariance is read once for three of them.

    Parameters
    ----------
    m : int
        Components.
    rows : ndarray, shape (U, M, 9)
        Responses to psi, v, x, which are zero but from the first to the second of their bounds.
    linked : ndarray of int
        Other states that any innovation responds to.
    """
    p, cross = filters.p, filters.cross
    for c in range(0, m, 3):
        d, e = min(c + 1, m - 1), min(c + 2, m - 1)
        begin = min(bounds[u, c, 0], bounds[u, d, 0], bounds[u, e, 0])
        end = max(bounds[u, c, 1], bounds[u, d, 1], bounds[u, e, 1])
        for r in range(len(p)):
            entry = load(p, _at(r, begin))
            x, y, z = rows[u, c, begin] * entry, rows[u, d, begin] * entry, rows[u, e, begin] * entry
            for j in range(begin + 1, end):
                entry = load(p, _at(r, j))
                x += rows[u, c, j] * entry
                y += rows[u, d, j] * entry
                z += rows[u, e, j] * entry
            for s in linked:
                entry = load(p, _at(r, 9 + s))
                x += state_rows[u, c, s] * entry
                y += state_rows[u, d, s] * entry
                z += state_rows[u, e, s] * entry
            store(cross, (r, c), x)
            store(cross, (r, d), y)
            store(cross, (r, e), z)
    for c in range(m):
        for e in range(c + 1):
            x = 0.0 * load(cross, (0, e))
            for j in range(bounds[u, c, 0], bounds[u, c, 1]):
                x += rows[u, c, j] * load(cross, (j, e))
            for s in linked:
                x += state_rows[u, c, s] * load(cross, (9 + s, e))
            store(filters.root, (c, e), x)


@allocation_free
def project_along_samples(
    u: int, m: int, bounds: IndexArray, state_rows: Array, linked: IndexArray, filters: Covariances
) -> None:
    """Compute the same where each sample has responses of its own, ``filters.rows``."""
    rows, cross = filters.rows, filters.cross
    for c in range(m):
        begin, end = bounds[u, c, 0], bounds[u, c, 1]
        for r in range(len(filters.p)):
            store(cross, (r, c), _project_covariance(filters.p, r, c, rows, begin, end, state_rows, u, linked))
    for c in range(m):
        for e in range(c + 1):
            x = 0.0 * load(cross, (0, e))
            for j in range(bounds[u, c, 0], bounds[u, c, 1]):
                x += load(rows, (c, j)) * load(cross, (j, e))
            for s in linked:
                x += state_rows[u, c, s] * load(cross, (9 + s, e))
            store(filters.root, (c, e), x)


@allocation_free
def factor_innovations(u: int, m: int, variances: Array, sound: Array, cause: Array, filters: Covariances) -> None:
    """Compute the Cholesky factor of the innovations' covariance, ``H P H^T`` as projected and the measurements'.

    Parameters
    ----------
    variances : ndarray, shape (U, M)
        Of the measurements.
    sound, cause : ndarray, shape (1, LANES)
        Whether a sample is good as yet, and why it is not: what came first, as each brings about the other.
    """
    root, inverse = filters.root, filters.inverse
    for c in range(m):
        for e in range(c + 1):
            x = load(root, (c, e))
            for j in range(e):
                x -= load(root, (c, j)) * load(root, (e, j))
            if e < c:
                store(root, (c, e), x * load(inverse, e))
            else:
                x += variances[u, c]
                good = x > 0.0
                why = where(load(sound, 0) > 0.0, float(INDEFINITE), float(BEYOND))
                fresh = load(cause, 0) <= float(SOUND)
                store(cause, 0, where(good, load(cause, 0), where(fresh, why, load(cause, 0))))
                x = np.sqrt(where(good, x, 1.0))
                store(root, (c, c), x)
                store(inverse, c, 1.0 / x)


@allocation_free
def whiten(m: int, accepted: Array, filters: Covariances) -> None:
    """Compute ``P H^T L^-T``, zero where a measurement is rejected; columns up to a multiple of three are zero."""
    cross, white, root, inverse = filters.cross, filters.white, filters.root, filters.inverse
    share, threes = load(accepted, 0), m - m % 3
    for r in range(len(filters.p)):
        for c in range(0, threes, 3):
            x, y, z = share * load(cross, (r, c)), share * load(cross, (r, c + 1)), share * load(cross, (r, c + 2))
            for e in range(c):
                known = load(white, (r, e))
                x -= known * load(root, (c, e))
                y -= known * load(root, (c + 1, e))
                z -= known * load(root, (c + 2, e))
            x *= load(inverse, c)
            y = (y - x * load(root, (c + 1, c))) * load(inverse, c + 1)
            z = (z - x * load(root, (c + 2, c)) - y * load(root, (c + 2, c + 1))) * load(inverse, c + 2)
            store(white, (r, c), x)
            store(white, (r, c + 1), y)
            store(white, (r, c + 2), z)
        for c in range(threes, m):
            x = share * load(cross, (r, c))
            for e in range(c):
                x -= load(white, (r, e)) * load(root, (c, e))
            store(white, (r, c), x * load(inverse, c))
        for c in range(m, 3 if m <= 3 else SIX):
            store(white, (r, c), 0.0 * share)


@allocation_free
def reduce_covariances(m: int, corrected: Array, filters: Covariances) -> None:
    """Compute the covariance after an update: ``P - W W^T`` with ``W = P H^T L^-T``.

    The covariance of two considered states stays as it is.
    """
    p, white = filters.p, filters.white
    for r in range(len(p)):
        a, b, c = load(white, (r, 0)), load(white, (r, 1)), load(white, (r, 2))
        if m <= 3:
            for j in range(r + 1):
                if corrected[r] + corrected[j] > 0.0:
                    x = load(p, (r, j))
                    x = x - a * load(white, (j, 0)) - b * load(white, (j, 1)) - c * load(white, (j, 2))
                    store(p, (r, j), x)
        else:
            d, e, f = load(white, (r, 3)), load(white, (r, 4)), load(white, (r, 5))
            for j in range(r + 1):
                if corrected[r] + corrected[j] > 0.0:
                    x = load(p, (r, j))
                    x = x - a * load(white, (j, 0)) - b * load(white, (j, 1)) - c * load(white, (j, 2))
                    x = x - d * load(white, (j, 3)) - e * load(white, (j, 4)) - f * load(white, (j, 5))
                    store(p, (r, j), x)


@allocation_free
def reduce_by_joseph(
    u: int, m: int, corrected: Array, bounds: IndexArray, state_rows: Array, linked: IndexArray, variances: Array,
    filters: Covariances,
) -> None:  # fmt: skip
    """Compute the covariance after an update in Joseph's form, ``(I - K H) P (I - K H)^T + K R K^T``.

    It keeps the digits of an update that takes nearly all of a variance away.
    """
    p, cross, white, gain, left, root = (
        filters.p, filters.cross, filters.white, filters.gain, filters.left, filters.root,
    )  # fmt: skip
    for r in range(len(p)):
        for c in range(m - 1, -1, -1):
            x = corrected[r] * load(white, (r, c))
            for e in range(c + 1, m):
                x -= load(gain, (r, e)) * load(root, (e, c))
            store(gain, (r, c), x * load(filters.inverse, c))
    for r in range(len(p)):
        for j in range(len(p)):
            x = load(p, _at(r, j))
            for c in range(m):
                x -= load(gain, (r, c)) * load(cross, (j, c))
            store(left, (r, j), x)
    for c in range(m):
        begin, end = bounds[u, c, 0], bounds[u, c, 1]
        for r in range(len(p)):
            x = _project(left, r, c, filters.rows, begin, end, state_rows, u, linked)
            store(white, (r, c), x - variances[u, c] * load(gain, (r, c)))
    for r in range(len(p)):
        for j in range(r + 1):
            x = load(left, (r, j))
            for c in range(m):
                x -= load(white, (r, c)) * load(gain, (j, c))
            store(p, (r, j), x)
