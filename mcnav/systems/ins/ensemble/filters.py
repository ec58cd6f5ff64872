"""Covariances of the filters of LANES aided samples: their tables, and updates.

Covariances are matrices of blocks (`mcnav.compiled.blocks`): three of psi, v, x, and as many as hold the q other
states; of theirs the lower triangles count. The filters of a part of the lanes are handled together, so that what is at
work stays in registers and in the first level of cache.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import (
    ENTRIES,
    THREE,
    Block,
    add_product,
    blocks_of,
    choose,
    count_threes,
    load_block,
    load_numbers,
    load_symmetric,
    multiply,
    scale,
    scale_rows,
    store_block,
    store_symmetric,
    subtract,
    subtract_product,
    transpose,
)
from mcnav.compiled.jit import allocation_free_part, allocation_free_subroutine
from mcnav.compiled.vectors import (
    PARTS,
    Rooms,
    load,
    load_part,
    parts_of,
    room,
    room_of_parts,
    store,
    store_part,
    where,
)
from mcnav.systems.ins.ensemble.steps import SHORT
from mcnav.systems.ins.filter.model import NAVIGATION

SIX: Final = 6
"""Components of a measurement for which there is room at least."""

EVEN: Final = 1e-6
"""Position that other states may add to short steps besides that of an even growth of the velocity, in sigma."""

SOUND, BEYOND, INDEFINITE = 0, 1, 2
"""Outcomes of a sample: good; beyond the validity of the scheme; a covariance that is not positive definite."""


class FilterSteps(NamedTuple):
    """Tables of the filters over K steps as blocks, of `mcnav.systems.ins.filter.tables.FilterTables`; n blocks a row.

    Attributes
    ----------
    motion : ndarray, shape (K, 2, 3, 9)
        Responses of v, x to psi, v, x.
    thrust : ndarray, shape (K, 6)
    durations : ndarray, shape (K,)
    short : ndarray of bool, shape (K,)
        Whether a step takes at most `SHORT`.
    uneven : ndarray of bool, shape (K,)
        Whether other states add more to the position than half a step of what they add to the velocity, by `EVEN`.
    coupling : ndarray, shape (K, 3, n - 3, 9)
        Responses of psi, v, x to the other states; for short steps that of x has half a step of that of v less.
    decay : ndarray, shape (K, 3 (n - 3))
    noise : ndarray, shape (K, n, n, 9)
    corrected : ndarray, shape (3 n,)
        1 for estimated states, 0 for considered ones.
    changes : ndarray, shape (n, n, 9)
        1 where an update changes the covariance of two states, 0 where both are considered.
    all_change : ndarray of bool, shape (n, n)
        Whether it changes that of all states of two blocks.
    still : ndarray of bool, shape (n - 3, n - 3)
        Whether no step changes the covariance of other states of two blocks, as they are constants.
    turning, moving, fading, shaken : ndarray of int
        Blocks of other states that psi responds to, that v and x respond to, that are not constants, and whose noise is
        correlated with that of psi, v and x.
    """

    motion: Array
    thrust: Array
    durations: Array
    short: NDArray[np.bool_]
    uneven: NDArray[np.bool_]
    coupling: Array
    decay: Array
    noise: Array
    corrected: Array
    changes: Array
    all_change: NDArray[np.bool_]
    still: NDArray[np.bool_]
    turning: IndexArray
    moving: IndexArray
    fading: IndexArray
    shaken: IndexArray


def filter_steps(
    durations: Array, motion: Array, thrust: Array, coupling: Array, decay: Array, noises: Array, corrected: Array,
    largest: Array, position: float,
) -> FilterSteps:  # fmt: skip
    """Prepare the tables over K steps.

    Parameters
    ----------
    durations : ndarray, shape (K,)
    motion : ndarray, shape (K, 6, 9)
    thrust : ndarray, shape (K, 6)
    coupling, decay, corrected : ndarray
        As `mcnav.systems.ins.filter.tables.FilterTables` has them.
    noises : ndarray, shape (K, n, n, 9)
        Q as blocks.
    largest : ndarray, shape (q,)
        Largest sigmas of the other states, along the truth.
    position : float
        Smallest sigma of the position there.
    """
    threes = count_threes(decay.shape[1])
    filled, all_corrected = np.ones((len(decay), THREE * threes)), np.ones(NAVIGATION + THREE * threes)
    filled[:, : decay.shape[1]] = decay
    all_corrected[: len(corrected)] = corrected
    short = durations <= SHORT
    beyond = coupling.copy()
    beyond[short, 6:] -= (0.5 * durations[short])[:, None, None] * coupling[short, 3:6]
    uneven = ~short | np.any(np.abs(beyond[:, 6:]) @ largest > EVEN * position, axis=1)
    couplings = blocks_of(beyond)
    coupled, shaken = np.any(blocks_of(coupling), axis=(0, 3)), np.any(noises[:, THREE:, :THREE], axis=(0, 2, 3))
    constant = np.all((filled == 1.0).reshape(len(decay), threes, THREE), axis=(0, 2))
    still = np.outer(constant, constant) & ~np.any(noises[:, THREE:, THREE:], axis=(0, 3))
    changes = blocks_of(np.maximum(all_corrected[:, None], all_corrected))
    return FilterSteps(
        blocks_of(motion), thrust, durations, short, uneven, couplings, filled, noises, all_corrected, changes,
        np.all(changes, axis=2), still, np.flatnonzero(coupled[0]), np.flatnonzero(coupled[1] | coupled[2]),
        np.flatnonzero(~constant), np.flatnonzero(shaken),
    )  # fmt: skip


class FilterUpdates(NamedTuple):
    """Tables of the filters over U updates; those of components as C blocks.

    Attributes
    ----------
    rows, state_rows : ndarray, shapes (U, C, 3, 9), (U, C, n - 3, 9)
        Responses of the innovations to psi, v, x, along the truth, and to the other states.
    bounds : ndarray of int, shape (U, C, 2)
        First and last of the blocks of psi, v, x that a block of components responds to.
    linked : ndarray of int
        Blocks of other states that any innovation responds to.
    responding : ndarray of bool, shape (U, n - 3)
        Whether an update's innovations respond to these.
    variances : ndarray, shape (U, 3 C)
        Of the measurements.
    along_truth : ndarray of bool, shape (U,)
        Whether the responses of an update's innovations are those along the truth for all samples.
    careful : ndarray of bool, shape (U,)
        Whether an update takes nearly all of a variance away.
    """

    rows: Array
    state_rows: Array
    bounds: IndexArray
    linked: IndexArray
    responding: NDArray[np.bool_]
    variances: Array
    along_truth: NDArray[np.bool_]
    careful: NDArray[np.bool_]


def filter_updates(
    rows: Array, state_rows: Array, bounds: IndexArray, variances: Array, along_truth: NDArray[np.bool_],
    careful: NDArray[np.bool_], own: IndexArray,
) -> FilterUpdates:  # fmt: skip
    """Prepare the tables over U updates.

    Parameters
    ----------
    rows, state_rows : ndarray, shapes (U, M, 9), (U, M, q)
    bounds : ndarray of int, shape (U, M, 2)
        First and last of the navigation states that a component depends on, in threes.
    own : ndarray of int, shape (U, k)
        Other states to which samples respond even where the truth does not, -1 for none.
    """
    updates, most = variances.shape
    threes = count_threes(most)
    used = np.full((updates, THREE * threes, 2), (NAVIGATION, 0))
    used[:, :most] = np.where(bounds[..., :1] < bounds[..., 1:], bounds, (NAVIGATION, 0))
    grouped = used.reshape(updates, threes, THREE, 2) // THREE
    first = np.minimum(grouped[..., 0].min(axis=2), THREE - 1)
    others, filled = blocks_of(state_rows), np.zeros(used.shape[:2])
    filled[:, :most] = variances
    responding = np.any(others, axis=(1, 3))
    rows_of_own, places = np.nonzero(own >= 0)
    responding[rows_of_own, own[rows_of_own, places] // THREE] = True
    return FilterUpdates(
        blocks_of(rows), others, np.stack([first, np.maximum(grouped[..., 1].max(axis=2), first + 1)], axis=-1),
        np.flatnonzero(np.any(responding, axis=0)), responding, filled, along_truth, careful,
    )  # fmt: skip


class Covariances(NamedTuple):
    """Covariances of LANES filters with n blocks a row, and room for a step and an update of them.

    Attributes
    ----------
    p : ndarray, shape (PARTS, n, n, 9, PART)
    cross : ndarray, shape (PARTS, n, C, 9, PART)
        ``P H^T``, with C blocks of components.
    transition, coupled : ndarray, shapes (2, 9, PART), (3, n - 3, 9, PART)
        The step's tables as turned: responses of v, x to psi; of psi, v, x to the other states.
    force : ndarray, shape (2, 3, PART)
        Integral of the force as samples indicate it, and what that integral's has beyond half a step of it.
    product, left : ndarray, shapes (3, n, 9, PART), (n, n, 9, PART)
    white, gain : ndarray, shape (n, C, 9, PART)
        ``P H^T`` with the innovations whitened, ``P H^T L^-T``; gains.
    rows : ndarray, shape (3 C, 3 n, LANES)
        Responses of the innovations to all states, of each sample.
    root, inverse : ndarray, shapes (3 C, 3 C, LANES), (3 C, LANES)
        Cholesky factor L of the innovations' covariance, and its diagonal inverted.
    correction : ndarray, shape (9 + q, LANES)
        What an update adds to the estimates of all states, or more rows.
    rows_parts, root_parts, inverse_parts, correction_parts : ndarray, shape (..., PARTS, PART)
        The same memory, by parts.
    """

    p: Array
    cross: Array
    transition: Array
    coupled: Array
    force: Array
    product: Array
    left: Array
    white: Array
    gain: Array
    rows: Array
    root: Array
    inverse: Array
    correction: Array
    rows_parts: Array
    root_parts: Array
    inverse_parts: Array
    correction_parts: Array


def room_for(most: int) -> int:
    """Return for how many components there is room where the largest measurement has so many: whole threes.

    >>> room_for(1), room_for(7)
    (6, 9)
    """
    return max(SIX, THREE * count_threes(most))


def covariances_of(states: int, own: bool = True, keep: Rooms = room, most: int = SIX) -> Covariances:
    """Return room for filters with a number of states besides those of navigation.

    Parameters
    ----------
    own : bool
        Whether each filter has gains of its own; otherwise there are no rows.
    keep : callable
        Makes the rooms that outlast a step.
    most : int
        Components of the largest measurement.
    """
    others, size = count_threes(states), room_for(most)
    n, blocks = THREE + others, size // THREE
    rows, root, inverse, correction = (
        room(size if own else 0, THREE * n),
        room(size, size),
        room(size),
        room(THREE * n),
    )
    return Covariances(
        parts_first(keep(n * n * ENTRIES), n, n, ENTRIES), room_of_parts(PARTS, n, blocks, ENTRIES),
        room_of_parts(2, ENTRIES), room_of_parts(THREE, others, ENTRIES), room_of_parts(2, THREE),
        room_of_parts(THREE, n, ENTRIES), room_of_parts(n, n, ENTRIES), room_of_parts(n, blocks, ENTRIES),
        room_of_parts(n, blocks, ENTRIES), rows, root, inverse, correction, parts_of(rows), parts_of(root),
        parts_of(inverse), parts_of(correction),
    )  # fmt: skip


def parts_first(lanes: Array, *shape: int) -> Array:
    """Return memory of lanes as that of parts one after the other, shape (PARTS, ..., PART)."""
    return lanes.reshape(PARTS, *shape, lanes.size // (PARTS * int(np.prod(shape))))


@allocation_free_part
def _nine_of(rows: Array, t: int, c: int, j: int) -> Block:
    """Return three rows and three columns of the samples of a part: responses of components to states, or a root's."""
    a, b, d = THREE * c, THREE * c + 1, THREE * c + 2
    e, f, g = THREE * j, THREE * j + 1, THREE * j + 2
    return (
        load_part(rows, (a, e, t)), load_part(rows, (a, f, t)), load_part(rows, (a, g, t)), load_part(rows, (b, e, t)),
        load_part(rows, (b, f, t)), load_part(rows, (b, g, t)), load_part(rows, (d, e, t)), load_part(rows, (d, f, t)),
        load_part(rows, (d, g, t)),
    )  # fmt: skip


@allocation_free_part
def store_root(root: Array, t: int, c: int, e: int, x: Block) -> None:
    """Write a block of the innovations' covariance to where its Cholesky factor will be."""
    for i in range(THREE):
        for j in range(THREE):
            store_part(root, (THREE * c + i, THREE * e + j, t), x[THREE * i + j])


@allocation_free_part
def project_along_truth(u: int, m: int, tables: FilterUpdates, filters: Covariances) -> None:
    """Compute ``P H^T`` and ``H P H^T`` of update u, whose responses H are those along the truth.

    Parameters
    ----------
    m : int
        Components.
    """
    p, cross, rows, states = filters.p, filters.cross, tables.rows, tables.state_rows
    for t in range(PARTS):
        for c in range((m + 2) // THREE):
            begin, end = tables.bounds[u, c, 0], tables.bounds[u, c, 1]
            for r in range(p.shape[1]):
                # P H^T: three states r by three components c; H along the truth, its columns begin to end alone
                x = multiply(load_symmetric(p, t, r, begin), transpose(load_numbers(rows, (u, c, begin))))
                for j in range(begin + 1, end):
                    x = add_product(x, load_symmetric(p, t, r, j), transpose(load_numbers(rows, (u, c, j))))
                for s in tables.linked:
                    if tables.responding[u, s]:
                        to_state = transpose(load_numbers(states, (u, c, s)))
                        x = add_product(x, load_symmetric(p, t, r, THREE + s), to_state)
                store_block(cross, (t, r, c), x)
            for e in range(c + 1):
                # H P H^T: components c by e
                x = multiply(load_numbers(rows, (u, c, begin)), load_block(cross, (t, begin, e)))
                for j in range(begin + 1, end):
                    x = add_product(x, load_numbers(rows, (u, c, j)), load_block(cross, (t, j, e)))
                for s in tables.linked:
                    if tables.responding[u, s]:
                        x = add_product(x, load_numbers(states, (u, c, s)), load_block(cross, (t, THREE + s, e)))
                store_root(filters.root_parts, t, c, e, x)


@allocation_free_subroutine
def project_along_samples(u: int, m: int, tables: FilterUpdates, filters: Covariances) -> None:
    """Compute the same where each sample has responses of its own, ``filters.rows``."""
    p, cross, rows = filters.p, filters.cross, filters.rows_parts
    for t in range(PARTS):
        for c in range((m + 2) // THREE):
            begin, end = tables.bounds[u, c, 0], tables.bounds[u, c, 1]
            for r in range(p.shape[1]):
                # P H^T, with each sample's own H
                x = multiply(load_symmetric(p, t, r, begin), transpose(_nine_of(rows, t, c, begin)))
                for j in range(begin + 1, end):
                    x = add_product(x, load_symmetric(p, t, r, j), transpose(_nine_of(rows, t, c, j)))
                for s in tables.linked:
                    if tables.responding[u, s]:
                        to_state = transpose(_nine_of(rows, t, c, THREE + s))
                        x = add_product(x, load_symmetric(p, t, r, THREE + s), to_state)
                store_block(cross, (t, r, c), x)
            for e in range(c + 1):
                # H P H^T
                x = multiply(_nine_of(rows, t, c, begin), load_block(cross, (t, begin, e)))
                for j in range(begin + 1, end):
                    x = add_product(x, _nine_of(rows, t, c, j), load_block(cross, (t, j, e)))
                for s in tables.linked:
                    if tables.responding[u, s]:
                        x = add_product(x, _nine_of(rows, t, c, THREE + s), load_block(cross, (t, THREE + s, e)))
                store_root(filters.root_parts, t, c, e, x)


@allocation_free_part
def factor_innovations(u: int, m: int, variances: Array, sound: Array, cause: Array, filters: Covariances) -> None:
    """Compute the Cholesky factor of the innovations' covariance, ``H P H^T`` as projected and the measurements'.

    The inverse of what fills a block of components up is zero, as the responses are.

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
            # L_ce = (S_ce - sum of L_cj L_ej) / L_ee, where S = H P H^T + R
            x = load(root, (c, e))
            for j in range(e):
                x -= load(root, (c, j)) * load(root, (e, j))
            if e < c:
                store(root, (c, e), x * load(inverse, e))
            else:
                x += variances[u, c]
                # a pivot that is not positive: the sample is not sound any more, and goes on with 1
                good = x > 0.0
                why = where(load(sound, 0) > 0.0, float(INDEFINITE), float(BEYOND))
                fresh = load(cause, 0) <= float(SOUND)
                store(cause, 0, where(good, load(cause, 0), where(fresh, why, load(cause, 0))))
                x = np.sqrt(where(good, x, 1.0))
                store(root, (c, c), x)
                store(inverse, c, 1.0 / x)
    for c in range(m, THREE * ((m + 2) // THREE)):
        store(inverse, c, 0.0)


@allocation_free_part
def _divide_by_root(x: Block, root: Array, inverse: Array, t: int, c: int) -> Block:
    """Compute ``X L^-T`` with a diagonal block L of the innovations' Cholesky factor."""
    a = THREE * c
    first, second, third = load_part(inverse, (a, t)), load_part(inverse, (a + 1, t)), load_part(inverse, (a + 2, t))
    low, lowest = load_part(root, (a + 1, a, t)), load_part(root, (a + 2, a, t))
    last = load_part(root, (a + 2, a + 1, t))
    x0, x3, x6 = x[0] * first, x[3] * first, x[6] * first
    x1, x4, x7 = (x[1] - x0 * low) * second, (x[4] - x3 * low) * second, (x[7] - x6 * low) * second
    x2, x5 = (x[2] - x0 * lowest - x1 * last) * third, (x[5] - x3 * lowest - x4 * last) * third
    return x0, x1, x2, x3, x4, x5, x6, x7, (x[8] - x6 * lowest - x7 * last) * third


@allocation_free_part
def whiten_projected(m: int, t: int, accepted: Array, whitened: Array, filters: Covariances) -> None:
    """Compute ``W = P H^T L^-T`` of part t, zero where a measurement is rejected, and the corrections ``W u``."""
    cross, white, root, inverse = filters.cross, filters.white, filters.root_parts, filters.inverse_parts
    share, correction = load_part(accepted, (0, t)), filters.correction_parts
    for r in range(filters.p.shape[1]):
        a = b = d = 0.0 * share
        for c in range((m + 2) // THREE):
            # W_c = (P H^T_c - sum of W_e L_ce^T) L_cc^-T
            x = scale(load_block(cross, (t, r, c)), share)
            for e in range(c):
                x = subtract_product(x, load_block(white, (r, e)), transpose(_nine_of(root, t, c, e)))
            x = _divide_by_root(x, root, inverse, t, c)
            store_block(white, (r, c), x)
            # W u, with the whitened innovation u = L^-1 n: what the estimates of three states gain
            u, v, w = (
                load_part(whitened, (THREE * c, t)), load_part(whitened, (THREE * c + 1, t)),
                load_part(whitened, (THREE * c + 2, t)),
            )  # fmt: skip
            a += x[0] * u + x[1] * v + x[2] * w
            b += x[3] * u + x[4] * v + x[5] * w
            d += x[6] * u + x[7] * v + x[8] * w
        store_part(correction, (THREE * r, t), a)
        store_part(correction, (THREE * r + 1, t), b)
        store_part(correction, (THREE * r + 2, t), d)


@allocation_free_part
def reduce_projected(m: int, t: int, tables: FilterSteps, filters: Covariances) -> None:
    """Compute the covariances of part t after an update: ``P - W W^T`` with ``W = P H^T L^-T``.

    The covariance of two considered states stays as it is.
    """
    p, white = filters.p, filters.white
    for r in range(p.shape[1]):
        for j in range(r + 1):
            # P - W W^T
            x = load_block(p, (t, r, j))
            x = subtract_product(x, load_block(white, (r, 0)), transpose(load_block(white, (j, 0))))
            for c in range(1, (m + 2) // THREE):
                x = subtract_product(x, load_block(white, (r, c)), transpose(load_block(white, (j, c))))
            # not of two considered states
            if tables.all_change[r, j]:
                store_symmetric(p, t, r, j, x)
            else:
                store_symmetric(p, t, r, j, choose(load_numbers(tables.changes, (r, j)), x, load_block(p, (t, r, j))))


@allocation_free_part
def _divide_by_transposed_root(x: Block, root: Array, inverse: Array, t: int, c: int) -> Block:
    """Compute ``X L^-1`` with a diagonal block L of the innovations' Cholesky factor."""
    a = THREE * c
    first, second, third = load_part(inverse, (a, t)), load_part(inverse, (a + 1, t)), load_part(inverse, (a + 2, t))
    low, lowest = load_part(root, (a + 1, a, t)), load_part(root, (a + 2, a, t))
    last = load_part(root, (a + 2, a + 1, t))
    x2, x5, x8 = x[2] * third, x[5] * third, x[8] * third
    x1, x4, x7 = (x[1] - x2 * last) * second, (x[4] - x5 * last) * second, (x[7] - x8 * last) * second
    x0, x3 = (x[0] - x1 * low - x2 * lowest) * first, (x[3] - x4 * low - x5 * lowest) * first
    return x0, x1, x2, x3, x4, x5, (x[6] - x7 * low - x8 * lowest) * first, x7, x8


@allocation_free_subroutine
def _reduce_by_joseph(u: int, m: int, t: int, steps: FilterSteps, tables: FilterUpdates, filters: Covariances) -> None:
    """Compute the covariances of part t after an update in Joseph's form, ``(I - K H) P (I - K H)^T + K R K^T``.

    It keeps the digits of an update that takes nearly all of a variance away.
    """
    p, cross, white, gain, left = filters.p, filters.cross, filters.white, filters.gain, filters.left
    root, rows, n, blocks = filters.root_parts, filters.rows_parts, p.shape[1], (m + 2) // THREE
    # K = W L^-1, from the last component to the first; zero for considered states
    for r in range(n):
        for c in range(blocks - 1, -1, -1):
            x = scale_rows(load_block(white, (r, c)), steps.corrected, r)
            for e in range(c + 1, blocks):
                x = subtract_product(x, load_block(gain, (r, e)), _nine_of(root, t, e, c))
            store_block(gain, (r, c), _divide_by_transposed_root(x, root, filters.inverse_parts, t, c))
    # X = (I - K H) P
    for r in range(n):
        for j in range(n):
            x = load_symmetric(p, t, r, j)
            for c in range(blocks):
                x = subtract_product(x, load_block(gain, (r, c)), transpose(load_block(cross, (t, j, c))))
            store_block(left, (r, j), x)
    for c in range(blocks):
        # X H^T - K R
        begin, end = tables.bounds[u, c, 0], tables.bounds[u, c, 1]
        for r in range(n):
            x = multiply(load_block(left, (r, begin)), transpose(_nine_of(rows, t, c, begin)))
            for j in range(begin + 1, end):
                x = add_product(x, load_block(left, (r, j)), transpose(_nine_of(rows, t, c, j)))
            for s in tables.linked:
                if tables.responding[u, s]:
                    x = add_product(x, load_block(left, (r, THREE + s)), transpose(_nine_of(rows, t, c, THREE + s)))
            of_noise = transpose(scale_rows(transpose(load_block(gain, (r, c))), tables.variances[u], c))
            store_block(white, (r, c), subtract(x, of_noise))
    # P+ = X - (X H^T - K R) K^T
    for r in range(n):
        for j in range(r + 1):
            x = load_block(left, (r, j))
            for c in range(blocks):
                x = subtract_product(x, load_block(white, (r, c)), transpose(load_block(gain, (j, c))))
            store_symmetric(p, t, r, j, x)


@allocation_free_part
def update_covariances(
    u: int, m: int, accepted: Array, whitened: Array, steps: FilterSteps, tables: FilterUpdates, filters: Covariances
) -> None:  # fmt: skip
    """Compute the covariances after update u as projected and factored, and the corrections of the estimates.

    Parameters
    ----------
    accepted, whitened : ndarray, shapes (1, PARTS, PART), (3 C, PARTS, PART)
        Whether measurements are accepted, and the whitened innovations.
    """
    for t in range(PARTS):
        whiten_projected(m, t, accepted, whitened, filters)
        if tables.careful[u]:
            _reduce_by_joseph(u, m, t, steps, tables, filters)
        else:
            reduce_projected(m, t, steps, filters)


@allocation_free_subroutine
def begin_covariances(initial: Array, filters: Covariances) -> None:
    """Let all covariances be that at the start, shape (n, n, 9)."""
    for t in range(PARTS):
        for r in range(len(initial)):
            for c in range(r + 1):
                store_block(filters.p, (t, r, c), load_numbers(initial, (r, c)))


@allocation_free_subroutine
def covariances_in_lanes(filters: Covariances, out: Array) -> None:
    """Copy the covariances' lower triangles to rows of lanes, shape (9 + q, 9 + q, PARTS, PART)."""
    for t in range(PARTS):
        for r in range(len(out)):
            for c in range(r + 1):
                at = THREE * (r % THREE) + c % THREE
                store_part(out, (r, c, t), load_part(filters.p, (t, r // THREE, c // THREE, at)))
