"""Compiled algebra of a loop's samples, n of them side by side: matrices have shape (rows, columns, n).

A matrix that all samples share has n = 1. Kernels work on parts of eight samples (`mcnav.compiled.vectors`), gathered
from the arrays; each sample's sums have one order, whatever stands beside it.

Besides parts, everything that these functions contain is in this file: numba notices a change of it.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.compiled.shapes import check_shapes
from mcnav.compiled.vectors import Vector, load_part, store_part

BoolArray: TypeAlias = NDArray[np.bool_]

EIGHT: Final = 8
"""Samples of a part."""


@allocation_free_part
def _gather(matrices: Array, begin: int, room: Array) -> None:
    """Copy eight samples' matrices from a sample on to a room, shape (rows, columns, 8); the last fills the rest."""
    rows, columns, count = matrices.shape
    if begin + EIGHT <= count:
        for i in range(rows):
            for j in range(columns):
                for lane in range(EIGHT):
                    room[i, j, lane] = matrices[i, j, begin + lane]
    else:
        for i in range(rows):
            for j in range(columns):
                for lane in range(EIGHT):
                    room[i, j, lane] = matrices[i, j, min(begin + lane, count - 1)]


@allocation_free_part
def _scatter(room: Array, begin: int, matrices: Array) -> None:
    """Copy eight samples' matrices from a room to their place."""
    rows, columns, count = matrices.shape
    if begin + EIGHT <= count:
        for i in range(rows):
            for j in range(columns):
                for lane in range(EIGHT):
                    matrices[i, j, begin + lane] = room[i, j, lane]
    else:
        for i in range(rows):
            for j in range(columns):
                for lane in range(count - begin):
                    matrices[i, j, begin + lane] = room[i, j, lane]


@allocation_free_part
def _row_times_column(a: Array, i: int, b: Array, j: int) -> Vector:
    """Compute element (i, j) of A B."""
    total = load_part(a, (i, 0)) * load_part(b, (0, j))
    for k in range(1, a.shape[1]):
        total = total + load_part(a, (i, k)) * load_part(b, (k, j))
    return total


@allocation_free_part
def _row_times_row(a: Array, i: int, b: Array, j: int) -> Vector:
    """Compute element (i, j) of A B^T."""
    total = load_part(a, (i, 0)) * load_part(b, (j, 0))
    for k in range(1, a.shape[1]):
        total = total + load_part(a, (i, k)) * load_part(b, (j, k))
    return total


@allocation_free_part
def _congruent(f: Array, p: Array, room: Array, result: Array) -> None:
    """Set ``F P F^T`` for symmetric P in the upper triangle of the result."""
    size = p.shape[0]
    for i in range(size):  # F P
        for j in range(size):
            store_part(room, (i, j), _row_times_column(f, i, p, j))
    for i in range(size):  # (F P) F^T
        for j in range(i, size):
            store_part(result, (i, j), _row_times_row(room, i, f, j))


@allocation_free_part
def _mirror(result: Array) -> None:
    for i in range(result.shape[0]):
        for j in range(i):
            store_part(result, (i, j), load_part(result, (j, i)))


@allocation_free_part
def _factor(matrices: Array, lower: Array) -> None:
    """Set Cholesky's factor, lower; NaN where a matrix is not positive definite."""
    for j in range(matrices.shape[0]):
        total = load_part(matrices, (j, j))
        for k in range(j):
            total = total - load_part(lower, (j, k)) * load_part(lower, (j, k))
        pivot = np.sqrt(total)
        store_part(lower, (j, j), pivot)
        for i in range(j + 1, matrices.shape[0]):
            total = load_part(matrices, (i, j))
            for k in range(j):
                total = total - load_part(lower, (i, k)) * load_part(lower, (j, k))
            store_part(lower, (i, j), total / pivot)


@compiled
def _propagate(covariance: Array, f: Array, entering: Array, result: Array) -> None:
    states, inputs = covariance.shape[0], entering.shape[1]
    p, f_room, half = (
        np.empty((states, states, EIGHT)),
        np.empty((states, states, EIGHT)),
        np.empty((states, states, EIGHT)),
    )
    after, g_room = np.empty((states, states, EIGHT)), np.empty((states, inputs, EIGHT))
    _gather(f, 0, f_room)
    _gather(entering, 0, g_room)
    for begin in range(0, covariance.shape[2], EIGHT):
        _gather(covariance, begin, p)
        if f.shape[2] > 1:
            _gather(f, begin, f_room)
        if entering.shape[2] > 1:
            _gather(entering, begin, g_room)
        _congruent(f_room, p, half, after)
        if entering.shape[1]:
            for i in range(p.shape[0]):  # + G G^T
                for j in range(i, p.shape[0]):
                    store_part(after, (i, j), load_part(after, (i, j)) + _row_times_row(g_room, i, g_room, j))
        _mirror(after)
        _scatter(after, begin, result)


def propagate(covariance: Array, f: Array, entering: Array) -> Array:
    """Compute ``P+ = F P F^T + G G^T``, shape (k, k, n).

    Parameters
    ----------
    covariance : ndarray, shape (k, k, n)
    f : ndarray, shape (k, k, n) or (k, k, 1)
    entering : ndarray, shape (k, inputs, n) or (k, inputs, 1)
        G in believed sizes.
    """
    states, _, count = covariance.shape
    inputs = entering.shape[1]
    check_shapes(
        (
            ("covariance", covariance, (states, states, count)),
            ("f", f, (states, states, 1 if f.shape[2] == 1 else count)),
            ("entering", entering, (states, inputs, 1 if entering.shape[2] == 1 else count)),
        )
    )
    result = np.empty((states, states, count))
    if count and states:
        given = np.ascontiguousarray(covariance), np.ascontiguousarray(f), np.ascontiguousarray(entering)
        _propagate(*given, result)
    return result


@compiled
def _update(covariance: Array, h: Array, noise: Array, estimated: int, results: tuple[Array, Array, Array]) -> None:
    states, size = covariance.shape[0], h.shape[0]
    p, half, after = (
        np.empty((states, states, EIGHT)),
        np.empty((states, states, EIGHT)),
        np.empty((states, states, EIGHT)),
    )
    left, h_room = np.empty((states, states, EIGHT)), np.empty((size, states, EIGHT))
    across, gain = np.empty((states, size, EIGHT)), np.zeros((states, size, EIGHT))
    innovation, lower = np.empty((size, size, EIGHT)), np.zeros((size, size, EIGHT))
    _gather(h, 0, h_room)
    for begin in range(0, covariance.shape[2], EIGHT):
        _gather(covariance, begin, p)
        if h.shape[2] > 1:
            _gather(h, begin, h_room)
        for i in range(states):  # P H^T
            for m in range(size):
                store_part(across, (i, m), _row_times_row(p, i, h_room, m))
        for m in range(size):  # S = H P H^T + R
            for j in range(m + 1):
                total = _row_times_column(h_room, m, across, j)
                if j == m:
                    total = total + noise[m] * noise[m]
                store_part(innovation, (m, j), total)
        _factor(innovation, lower)
        for i in range(estimated):  # K S = P H^T, with S = L L^T; zero for states that are not corrected
            for m in range(size):
                total = load_part(across, (i, m))
                for k in range(m):
                    total = total - load_part(lower, (m, k)) * load_part(gain, (i, k))
                store_part(gain, (i, m), total / load_part(lower, (m, m)))
            for m in range(size - 1, -1, -1):
                total = load_part(gain, (i, m))
                for k in range(m + 1, size):
                    total = total - load_part(lower, (k, m)) * load_part(gain, (i, k))
                store_part(gain, (i, m), total / load_part(lower, (m, m)))
        for i in range(states):  # 1 - K H
            for j in range(states):
                store_part(left, (i, j), (1.0 if i == j else 0.0) - _row_times_column(gain, i, h_room, j))
        _congruent(left, p, half, after)
        for i in range(estimated):  # + K R K^T
            for j in range(i, estimated):
                total = load_part(after, (i, j))
                for m in range(size):
                    total = total + noise[m] * noise[m] * load_part(gain, (i, m)) * load_part(gain, (j, m))
                store_part(after, (i, j), total)
        _mirror(after)
        _scatter(gain, begin, results[0])
        _scatter(lower, begin, results[1])
        _scatter(after, begin, results[2])


def update(covariance: Array, h: Array, noise: Array, estimated: int) -> tuple[Array, Array, Array]:
    """Compute the gain ``K = P H^T S^-1``, Cholesky's factor of ``S = H P H^T + R``, and Joseph's covariance.

    Parameters
    ----------
    covariance : ndarray, shape (k, k, n)
    h : ndarray, shape (m, k, n) or (m, k, 1)
    noise : ndarray, shape (m,)
        Believed sigmas of the measurement's noise.
    estimated : int
        States that are corrected, the first ones.

    Returns
    -------
    gain : ndarray, shape (k, m, n)
    lower : ndarray, shape (m, m, n)
        NaN where S is not positive definite.
    after : ndarray, shape (k, k, n)
        ``(1 - K H) P (1 - K H)^T + K R K^T``.
    """
    states, _, count = covariance.shape
    size = len(noise)
    check_shapes(
        (
            ("covariance", covariance, (states, states, count)),
            ("h", h, (size, states, 1 if h.shape[2] == 1 else count)),
            ("noise", noise, (size,)),
        )
    )
    results = np.empty((states, size, count)), np.empty((size, size, count)), np.empty((states, states, count))
    if count:
        given = np.ascontiguousarray(covariance), np.ascontiguousarray(h), np.asarray(noise, dtype=float)
        _update(*given, min(estimated, states), results)
    return results


@compiled
def _factorize(matrices: Array, result: Array) -> None:
    size = matrices.shape[0]
    given, lower = np.empty((size, size, EIGHT)), np.zeros((size, size, EIGHT))
    for begin in range(0, matrices.shape[2], EIGHT):
        _gather(matrices, begin, given)
        _factor(given, lower)
        _scatter(lower, begin, result)


def factorize(matrices: Array) -> Array:
    """Compute Cholesky's factors, lower, shape (m, m, n); NaN where a matrix is not positive definite."""
    size, _, count = matrices.shape
    check_shapes((("matrices", matrices, (size, size, count)),))
    result = np.zeros((size, size, count))
    if size and count:
        _factorize(np.ascontiguousarray(matrices), result)
    return result


@compiled
def _whiten(lower: Array, values: Array, white: Array) -> None:
    size, count = values.shape
    step = 1 if lower.shape[2] > 1 else 0
    for i in range(size):
        for s in range(count):
            total = values[i, s]
            for k in range(i):
                total -= lower[i, k, s * step] * white[k, s]
            white[i, s] = total / lower[i, i, s * step]


def whiten(lower: Array, values: Array) -> Array:
    """Compute ``L^-1 y``, shape (m, n), of a factor, shape (m, m, n) or (m, m, 1), and values, shape (m, n)."""
    size, count = values.shape
    check_shapes((("lower", lower, (size, size, 1 if lower.shape[2] == 1 else count)),))
    white = np.empty((size, count))
    _whiten(np.ascontiguousarray(lower), np.ascontiguousarray(values), white)
    return white


@compiled
def _combine_own(matrices: Array, values: Array, result: Array) -> None:
    for i in range(matrices.shape[0]):
        row = result[i]
        for j in range(matrices.shape[1]):
            factors, column = matrices[i, j], values[j]
            for s in range(len(row)):
                row[s] += factors[s] * column[s]


@compiled
def _combine_shared(matrix: Array, values: Array, result: Array) -> None:
    for i in range(matrix.shape[0]):
        row = result[i]
        for j in range(matrix.shape[1]):
            shared = matrix[i, j]
            if shared != 0.0:
                column = values[j]
                for s in range(len(row)):
                    row[s] += shared * column[s]


def combine(matrices: Array, values: Array) -> Array:
    """Compute ``A x``, shape (rows, n), of matrices, shape (rows, columns, n) or (rows, columns), and x.

    Unlike the product of a library, a sample's has the same bits beside any others.
    """
    columns, count = values.shape
    result = np.zeros((len(matrices), count))
    given = np.ascontiguousarray(values)
    if matrices.ndim == 2:
        check_shapes((("matrices", matrices, (None, columns)),))
        _combine_shared(np.ascontiguousarray(matrices), given, result)
    else:
        check_shapes((("matrices", matrices, (None, columns, count)),))
        _combine_own(np.ascontiguousarray(matrices), given, result)
    return result


@compiled
def _departs(
    state: Array, inputs: Array, about: tuple[Array, Array, Array], shares: tuple[float, float],
    given: tuple[Array, Array, Array], departs: BoolArray,
) -> None:  # fmt: skip
    (origin, value, floor), (share, rounding), (x, entering, outcome) = about, shares, given
    rows, count = state.shape[0], departs.shape[0]
    x_room, entering_room = np.empty((x.shape[0], 1, EIGHT)), np.empty((entering.shape[0], 1, EIGHT))
    outcome_room, excess = np.empty((rows, 1, EIGHT)), np.empty((rows, 1, EIGHT))
    for begin in range(0, count, EIGHT):
        _gather(x, begin, x_room)
        _gather(entering, begin, entering_room)
        _gather(outcome, begin, outcome_room)
        for i in range(rows):
            there = load_part(outcome_room, (i, 0))
            total, size = 0.0 * there + value[i], 0.0 * there
            for j in range(state.shape[1]):  # + A (X - X_0)
                if state[i, j] != 0.0:
                    term = state[i, j] * (load_part(x_room, (j, 0)) - origin[j])
                    total, size = total + term, size + np.abs(term)
            for j in range(inputs.shape[1]):  # + G w
                if inputs[i, j] != 0.0:
                    term = inputs[i, j] * load_part(entering_room, (j, 0))
                    total, size = total + term, size + np.abs(term)
            limit = share * size + rounding * np.abs(there) + floor[i]
            store_part(excess, (i, 0), np.abs(there - total) - limit)
        for i in range(rows):
            for lane in range(min(EIGHT, count - begin)):
                if not excess[i, 0, lane] <= 0.0:  # nor NaN
                    departs[begin + lane] = True


def find_departures(
    state: Array, inputs: Array, about: tuple[Array, Array, Array], shares: tuple[float, float],
    given: tuple[Array, Array, Array],
) -> BoolArray:  # fmt: skip
    """Find the samples whose outcome departs from ``value + A (X - origin) + G w`` in any row, shape (n,).

    Parameters
    ----------
    state, inputs : ndarray, shapes (m, size) and (m, k)
        A and G.
    about : tuple of ndarray, shapes (size,), (m,) and (m,)
        Origin, value, and departures that are rounding.
    shares : tuple of float
        Departures that are allowed as shares of the sum of all terms' sizes, and of the outcome.
    given : tuple of ndarray, shapes (size, n), (k, n) and (m, n)
        X, w and the outcome.
    """
    (rows, size), (_, entered) = state.shape, inputs.shape
    count = given[0].shape[1]
    shapes = (size, count), (entered, count), (rows, count)
    check_shapes(
        (
            ("inputs", inputs, (rows, entered)),
            *zip(("origin", "value", "floor"), about, ((size,), (rows,), (rows,)), strict=True),
            *zip(("x", "entering", "outcome"), given, shapes, strict=True),
        )
    )
    departs = np.zeros(count, dtype=np.bool_)
    if count:
        x, entering, outcome = (np.ascontiguousarray(vector)[:, None] for vector in given)
        kept = np.ascontiguousarray(state), np.ascontiguousarray(inputs)
        _departs(*kept, about, shares, (x, entering, outcome), departs)
    return departs
