"""Errors of LANES aided samples normalized by the covariances of their filters: each by its own, or all by one.

The normalized estimation error squared (NEES) of a group of states is ``e^T P^-1 e``. A state whose variance the states
before it explain but for rounding counts nothing.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.products import ROUNDED, map_covariances
from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_subroutine, inlined
from mcnav.compiled.vectors import Vector, load, room, store, where
from mcnav.systems.ins.filter.model import NAVIGATION

GROUPS: Final = 6
"""All estimated states, navigation, position, velocity, attitude, and the other estimated states."""

SINGULAR: Final = 1e-14
"""Share of a variance below which what is left of it in Cholesky's method is rounding."""


class NormalizationRooms(NamedTuple):
    """Room for the normalization of LANES samples with 9 + q states; the last axis is the lanes.

    Attributes
    ----------
    errors : ndarray, shape (9 + q, LANES)
        Of all states.
    output_errors : ndarray, shape (9, LANES)
        Of the outputs, to first order.
    nees : ndarray, shape (GROUPS, LANES)
    mapped : ndarray, shape (9, 9, LANES)
        Covariance of the outputs, lower triangle.
    half, kept : ndarray, shapes (9, 9, LANES), (9, LANES)
        Of the states with the outputs; 0 for outputs whose variance is rounding, 1 for others.
    root, solved : ndarray, shapes (9 + q, 9 + q, LANES), (9 + q, LANES)
        Cholesky factor, and the errors divided by it.
    """

    errors: Array
    output_errors: Array
    nees: Array
    mapped: Array
    half: Array
    kept: Array
    root: Array
    solved: Array


def normalization_rooms(states: int, own: bool = True) -> NormalizationRooms:
    """Return room for filters with a number of states besides those of navigation.

    Parameters
    ----------
    own : bool
        Whether each filter has a covariance of its own; otherwise there is no room for any.
    """
    size, many = NAVIGATION + states, NAVIGATION if own else 0
    return NormalizationRooms(
        room(size), room(9), room(GROUPS), room(many, 9), room(many, 9), room(many), room(size if own else 0, size),
        room(size),
    )  # fmt: skip


@inlined
def _quadratic(
    matrix: Array, vector: Array, chosen: IndexArray, begin: int, end: int, root: Array, out: Array
) -> Vector:
    """Compute ``e^T P^-1 e`` of chosen states by Cholesky's method; ``out`` are the terms' roots."""
    total = 0.0 * load(vector, 0)
    for i in range(begin, end):
        # column i of the Cholesky factor, and of L y = e; the sum of the squares of y is e^T P^-1 e
        at = chosen[i]
        value, pivot = load(vector, at), load(matrix, (at, at))
        least = SINGULAR * pivot
        for c in range(begin, i):
            entry = load(root, (i, c))
            value -= entry * load(out, c)
            pivot -= entry * entry
        inverse = where(pivot > least, 1.0 / np.sqrt(pivot), 0.0)
        for j in range(i + 1, end):
            entry = load(matrix, (chosen[j], at))
            for c in range(begin, i):
                entry -= load(root, (j, c)) * load(root, (i, c))
            store(root, (j, i), entry * inverse)
        value *= inverse
        store(out, i, value)
        total += value * value
    return total


@inlined
def _map_errors(to_outputs: Array, rooms: NormalizationRooms) -> None:
    """Compute the errors of the outputs, to first order."""
    for r in range(9):
        error = 0.0 * load(rooms.errors, 0)
        for j in range(9):
            if to_outputs[r, j] != 0.0:
                error += to_outputs[r, j] * load(rooms.errors, j)
        store(rooms.output_errors, r, error)


@inlined
def _map_covariance(p: Array, to_outputs: Array, rooms: NormalizationRooms) -> None:
    """Compute the covariance of the outputs; rows and columns of variances that are rounding are zero."""
    mapped, half, kept = rooms.mapped, rooms.half, rooms.kept
    for r in range(9):
        # what the sigma would be without cancellation, row r of M P, and of M P M^T
        size = 0.0 * load(p, (0, 0))
        for j in range(9):
            if to_outputs[r, j] != 0.0:
                size += abs(to_outputs[r, j]) * np.sqrt(np.abs(load(p, (j, j))))
        for c in range(9):
            x = 0.0 * size
            for j in range(9):
                if to_outputs[r, j] != 0.0:
                    x += to_outputs[r, j] * load(p, (max(j, c), min(j, c)))
            store(half, (r, c), x)
        for c in range(r + 1):
            x = 0.0 * size
            for j in range(9):
                if to_outputs[c, j] != 0.0:
                    x += load(half, (r, j)) * to_outputs[c, j]
            store(mapped, (r, c), x)
        # a variance that is rounding counts nothing
        store(kept, r, where(load(mapped, (r, r)) > ROUNDED * size * size, 1.0, 0.0))
    for r in range(9):
        for c in range(r + 1):
            store(mapped, (r, c), load(mapped, (r, c)) * (load(kept, r) * load(kept, c)))


@allocation_free_subroutine
def normalize_by_own(p: Array, chosen: IndexArray, to_outputs: Array, rooms: NormalizationRooms) -> None:
    """Normalize the errors of samples by covariances of their own, and compute those of the outputs.

    Parameters
    ----------
    p : ndarray, shape (9 + q, 9 + q, LANES)
        Lower triangles.
    chosen : ndarray of int
        Numbers of the states that are estimated, the nine of navigation first.
    """
    errors, nees, mapped, root, solved = rooms.errors, rooms.nees, rooms.mapped, rooms.root, rooms.solved
    # all estimated states; the first nine terms are those of navigation
    store(nees, 0, _quadratic(p, errors, chosen, 0, len(chosen), root, solved))
    navigation = 0.0 * load(errors, 0)
    for i in range(9):
        navigation += load(solved, i) * load(solved, i)
    store(nees, 1, navigation)
    store(nees, 5, _quadratic(p, errors, chosen, 9, len(chosen), root, solved))
    _map_errors(to_outputs, rooms)
    _map_covariance(p, to_outputs, rooms)
    # position, velocity and attitude, as they are in the outputs
    for group in range(3):
        begin = 3 * group
        store(nees, 2 + group, _quadratic(mapped, rooms.output_errors, chosen, begin, begin + 3, root, solved))


class SharedCovariances(NamedTuple):
    """Covariances of filters at m epochs that all samples share.

    Attributes
    ----------
    whitening : ndarray, shape (m, e, e)
        Matrices that make the errors of the estimated states independent, of variance one; lower triangles.
    of_others : ndarray, shape (m, e - 9, e - 9)
        The same of those besides navigation.
    of_outputs : ndarray, shape (m, 3, 3, 3)
        The same of position, velocity and attitude as they are in the outputs.
    mapped : ndarray, shape (m, 45)
        Covariance of the outputs, lower triangle by rows.
    variances : ndarray, shape (m, q)
        Of the states besides navigation.
    """

    whitening: Array
    of_others: Array
    of_outputs: Array
    mapped: Array
    variances: Array


def share_covariances(covariances: Array, chosen: IndexArray, output_maps: Array) -> SharedCovariances:
    """Prepare covariances, shape (m, 9 + q, 9 + q), for all samples.

    Parameters
    ----------
    chosen : ndarray of int
        Numbers of the states that are estimated, the nine of navigation first.
    output_maps : ndarray, shape (m, 9, 9)
    """
    others = chosen[NAVIGATION:]
    mapped = map_covariances(output_maps, covariances[:, :NAVIGATION, :NAVIGATION])
    rows, columns = np.tril_indices(NAVIGATION)
    groups = [mapped[:, begin : begin + 3, begin : begin + 3] for begin in range(0, NAVIGATION, 3)]
    return SharedCovariances(
        np.ascontiguousarray(whitening_matrices(covariances[:, chosen[:, None], chosen])),
        np.ascontiguousarray(whitening_matrices(covariances[:, others[:, None], others])),
        np.ascontiguousarray(np.stack([whitening_matrices(group) for group in groups], axis=1)),
        np.ascontiguousarray(mapped[:, rows, columns]),
        np.diagonal(covariances, axis1=1, axis2=2)[:, NAVIGATION:].copy(),
    )


def whitening_matrices(covariances: Array) -> Array:
    """Invert the Cholesky factors of covariances, shape (m, n, n); rows of states that are singular are zero.

    >>> whitening_matrices(np.array([[[4.0, 2.0], [2.0, 1.0]]]))
    array([[[0.5, 0. ],
            [0. , 0. ]]])
    """
    matrices = np.zeros_like(covariances)
    for i in range(covariances.shape[1]):
        variance, before = covariances[:, i, i], matrices[:, :i, :i]
        entries = np.einsum("mjk,mk->mj", before, covariances[:, :i, i])
        pivot = variance - np.einsum("mj,mj->m", entries, entries)
        regular = pivot > SINGULAR * variance
        inverse = np.where(regular, 1.0 / np.sqrt(np.where(regular, pivot, 1.0)), 0.0)
        matrices[:, i, :i] -= inverse[:, None] * np.einsum("mj,mjk->mk", entries, before)
        matrices[:, i, i] = inverse
    return matrices


@inlined
def _whitened_square(whitening: Array, i: int, errors: Array, chosen: IndexArray, first: int) -> Vector:
    """Compute the square of one whitened error."""
    x = whitening[i, 0] * load(errors, chosen[first])
    for j in range(1, i + 1):
        x += whitening[i, j] * load(errors, chosen[first + j])
    return x * x


@allocation_free_subroutine
def normalize_by_shared(
    m: int, shared: SharedCovariances, chosen: IndexArray, to_outputs: Array, rooms: NormalizationRooms
) -> None:
    """Normalize the errors of samples by the covariances at epoch m."""
    errors, nees, nothing = rooms.errors, rooms.nees, 0.0 * load(rooms.errors, 0)
    total = nothing
    for i in range(len(chosen)):
        if i == 9:
            store(nees, 1, total)
        total += _whitened_square(shared.whitening[m], i, errors, chosen, 0)
    if len(chosen) == 9:
        store(nees, 1, total)
    store(nees, 0, total)
    total = nothing
    for i in range(len(chosen) - 9):
        total += _whitened_square(shared.of_others[m], i, errors, chosen, 9)
    store(nees, 5, total)
    _map_errors(to_outputs, rooms)
    for group in range(3):
        total = nothing
        for i in range(3):
            total += _whitened_square(shared.of_outputs[m, group], i, rooms.output_errors, chosen, 3 * group)
        store(nees, 2 + group, total)
