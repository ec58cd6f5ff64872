"""Gains of a filter along the truth, which samples share, in compiled code: the same bits on every processor.

Over a step and in an update the filter's covariance P obeys, with F of a step and H of a measurement::

    P' = F P F^T + Q         S = H P H^T + R        K = P H^T S^-1
    P+ = (I - K H) P (I - K H)^T + K R K^T          (Joseph's form)

The linear engine (`mcnav.linear.engine.design`) has the same to rounding, and answers what no sample depends on.

A row of n states is in parts of eight, which the processor's vectors hold; what fills the last one up is zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.compiled.shapes import check_numbers, check_shapes
from mcnav.compiled.vectors import PART, Vector, load_part, room_of_parts, store_part
from mcnav.systems.ins.ensemble.filter_system import Steps, Updates
from mcnav.systems.ins.filter.tables import StepNoise
from mcnav.systems.ins.linear.closed_loop import ClosedLoop


class ReadingTimes(NamedTuple):
    """Times at which a recursion is read out, in order.

    Attributes
    ----------
    numbers : ndarray of int, shape (m,)
    after : ndarray of bool, shape (m,)
        Whether after the updates at that time, or before.
    """

    numbers: IndexArray
    after: NDArray[np.bool_]


class _Rows(NamedTuple):
    """Rows of numbers, shape (r, n) or with more columns, and the same memory by parts, shape (r, parts, PART)."""

    numbers: Array
    parts: Array


class _Rooms(NamedTuple):
    """A covariance of n states, and room for an update with at most M components and a step.

    Attributes
    ----------
    p : _Rows
        P, n rows.
    cross, gain, noise : _Rows
        M rows: ``H P``; ``K^T``; ``R K^T - H X``.
    left : _Rows
        ``X = P (I - K H)^T``, n rows.
    root : ndarray, shape (M, M)
        Cholesky factor L of S.
    product : _Rows
        ``F P``, 9 rows of psi, v, x.
    """

    p: _Rows
    cross: _Rows
    gain: _Rows
    noise: _Rows
    left: _Rows
    root: Array
    product: _Rows


def _rows_of(rows: int, states: int) -> _Rows:
    parts = room_of_parts(rows, -(-states // PART))
    return _Rows(parts.reshape(rows, -1), parts)


def _rooms(start: Array, most: int) -> _Rooms:
    """Return rooms for a covariance that begins with one at the start."""
    n = len(start)
    p, root = _rows_of(n, n), np.zeros((most, most))
    p.numbers[:, :n] = start
    return _Rooms(p, _rows_of(most, n), _rows_of(most, n), _rows_of(most, n), _rows_of(n, n), root, _rows_of(9, n))


def check_tables(steps: Steps, updates: Updates, readings: ReadingTimes) -> tuple[int, int, int, int]:
    """Return the numbers of steps, states, updates and their components; ValueError where tables do not fit."""
    (count, others), (number, most) = steps.decay.shape, updates.rows.shape[:2]
    check_shapes((
        ("steps.rows", steps.rows, (count, 9, 9 + others)),
        ("updates.first", updates.first, (count + 2,)),
        ("updates.sizes", updates.sizes, (number,)),
        ("updates.rows", updates.rows, (number, most, 9 + others)),
        ("readings.after", readings.after, (len(readings.numbers),)),
    ))  # fmt: skip
    check_numbers("updates.first", updates.first, number + 1)
    check_numbers("updates.sizes", updates.sizes, most + 1)
    check_numbers("readings.numbers", readings.numbers, count + 1)
    return count, 9 + others, number, most


def _check_noise(noise: StepNoise, variances: Array, start: Array, of: tuple[int, int, int, int]) -> None:
    count, states, number, most = of
    check_shapes((
        ("noise.white", noise.white, (count, 9, 9)),
        ("noise.cross", noise.cross, (count, 9, states - 9)),
        ("noise.driven", noise.driven, (count, states - 9)),
        ("noise.paired", noise.paired, (count, states - 9)),
        ("variances", variances, (number, most)),
        ("start", start, (states, states)),
    ))  # fmt: skip


def design_gains(
    steps: Steps, noise: StepNoise, updates: Updates, variances: Array, corrected: Array, start: Array,
    readings: ReadingTimes,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Compute a filter's gains along the truth.

    Parameters
    ----------
    variances : ndarray, shape (U, M)
        Of the measurements: the diagonal of R.
    corrected : ndarray, shape (9 + q,)
        1 for estimated states, 0 for considered ones, whose rows of K are zero.
    start : ndarray, shape (9 + q, 9 + q)
        P at the start.

    Returns
    -------
    gains, roots : ndarray, shapes (U, 9 + q, M), (U, M, M)
        K, and the Cholesky factor of S.
    covariances : ndarray, shape (m, 9 + q, 9 + q)
        P at the readings.
    covariance : ndarray, shape (9 + q, 9 + q)
        P at the end.
    """
    of = check_tables(steps, updates, readings)
    _check_noise(noise, variances, start, of)
    _, states, number, most = of
    check_shapes((("corrected", corrected, (states,)),))
    gains, roots = np.zeros((number, states, most)), np.zeros((number, most, most))
    covariances = np.zeros((len(readings.numbers), states, states))
    rooms = _rooms(start, most)
    _design_gains(steps, noise, updates, variances, corrected, rooms, readings, gains, roots, covariances)
    return gains, roots, covariances, rooms.p.numbers[:, :states].copy()


@dataclass(frozen=True)
class SharedGains:
    """Gains of a filter along the truth, and its covariance at m times after their updates.

    Attributes
    ----------
    gains, roots : ndarray, shapes (U, 9 + q, M), (U, M, M)
        K, and the Cholesky factors of S.
    covariances : ndarray, shape (m, 9 + q, 9 + q)
    """

    gains: Array
    roots: Array
    covariances: Array

    @classmethod
    def along(cls, loop: ClosedLoop, readings: IndexArray) -> SharedGains:
        """Design the filter of a loop, block by block; readings are numbers of times, rising."""
        tables, first, measured = loop.filter, loop.first_updates, loop.measurements
        states, steps = len(tables.corrected), len(loop.times) - 1
        number, most = measured.components.shape
        gains, roots = np.zeros((number, states, most)), np.zeros((number, most, most))
        covariances, covariance = np.zeros((len(readings), states, states)), tables.initial
        for block, over in tables.blocks():
            # a block ends before the updates at its last time, but for the last one
            end = block.stop + (block.stop == steps)
            updates, numbers = slice(int(first[block.start]), int(first[end])), first[block.start : block.stop + 1]
            read = slice(*np.searchsorted(readings, [block.start, end]).tolist())
            of_block = Updates(
                np.append(numbers, first[end]) - first[block.start], measured.sizes[updates],
                np.concatenate([measured.rows[updates], tables.rows[updates]], axis=2),
            )  # fmt: skip
            after = ReadingTimes(readings[read] - block.start, np.ones(read.stop - read.start, dtype=np.bool_))
            gains[updates], roots[updates], covariances[read], covariance = design_gains(
                Steps(over.transitions, over.decay), over.noise, of_block, tables.variances[updates], tables.corrected,
                covariance, after,
            )  # fmt: skip
        return cls(gains, roots, covariances)


@compiled
def _design_gains(
    steps: Steps, noise: StepNoise, updates: Updates, variances: Array, corrected: Array, rooms: _Rooms,
    readings: ReadingTimes, gains: Array, roots: Array, covariances: Array,
) -> None:  # fmt: skip
    reached = 0
    for k in range(len(updates.first) - 1):
        reached = _read(k, False, reached, readings, rooms.p.numbers, covariances)
        for u in range(updates.first[k], updates.first[k + 1]):
            _project(u, updates, rooms)
            _factor(u, updates, variances, rooms)
            _solve(updates.sizes[u], rooms)
            _keep(updates.sizes[u], corrected, rooms, gains[u], roots[u])
            _join(u, updates, variances, rooms)
        reached = _read(k, True, reached, readings, rooms.p.numbers, covariances)
        if k < len(steps.decay):
            _advance(k, steps, noise, rooms)


@allocation_free_part
def _read(k: int, updated: bool, reached: int, readings: ReadingTimes, state: Array, out: Array) -> int:
    """Read out the first rows and columns at time k, before or after its updates; count all readings so far."""
    numbers = readings.numbers
    while reached < len(numbers) and numbers[reached] == k and (updated or not readings.after[reached]):
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[reached, i, j] = state[i, j]
        reached += 1
    return reached


@allocation_free_part
def _multiply_row(rows: Array, number: int, of: int, matrix: Array, b: int) -> Vector:
    """Compute part b of a row vector times a matrix; the row is that of a table, shape (..., rows, n)."""
    x = 0.0 * load_part(matrix, (0, b))
    for j in range(len(matrix)):
        weight = rows[number, of, j]
        if weight != 0.0:
            x += weight * load_part(matrix, (j, b))
    return x


@allocation_free_part
def _project(u: int, updates: Updates, rooms: _Rooms) -> None:
    """Compute ``H P``."""
    for c in range(updates.sizes[u]):
        for b in range(rooms.p.parts.shape[1]):
            store_part(rooms.cross.parts, (c, b), _multiply_row(updates.rows, u, c, rooms.p.parts, b))


@allocation_free_part
def _factor(u: int, updates: Updates, variances: Array, rooms: _Rooms) -> None:
    """Compute the Cholesky factor L of ``S = H P H^T + R``."""
    rows, cross, root = updates.rows, rooms.cross.numbers, rooms.root
    for c in range(updates.sizes[u]):
        for e in range(c + 1):
            total = 0.0
            for j in range(rows.shape[2]):
                total += rows[u, c, j] * cross[e, j]
            if c == e:
                total += variances[u, c]
            for j in range(e):
                total -= root[c, j] * root[e, j]
            root[c, e] = np.sqrt(total) if c == e else total / root[e, e]


@allocation_free_part
def _solve(m: int, rooms: _Rooms) -> None:
    """Compute ``K^T = S^-1 H P``: divide by L, then by L^T."""
    cross, root, gain = rooms.cross.parts, rooms.root, rooms.gain.parts
    for b in range(cross.shape[1]):
        # L Y = H P, from the first component to the last
        for c in range(m):
            x = load_part(cross, (c, b))
            for j in range(c):
                x -= load_part(gain, (j, b)) * root[c, j]
            store_part(gain, (c, b), x / root[c, c])
        # L^T K^T = Y, from the last to the first
        for c in range(m - 1, -1, -1):
            x = load_part(gain, (c, b))
            for j in range(c + 1, m):
                x -= load_part(gain, (j, b)) * root[j, c]
            store_part(gain, (c, b), x / root[c, c])


@allocation_free_part
def _keep(m: int, corrected: Array, rooms: _Rooms, gain: Array, root: Array) -> None:
    """Leave considered states uncorrected, and keep K and L of an update."""
    for c in range(m):
        for i in range(len(corrected)):
            rooms.gain.numbers[c, i] *= corrected[i]
            gain[i, c] = rooms.gain.numbers[c, i]
    for c in range(len(root)):
        for e in range(len(root)):
            root[c, e] = rooms.root[c, e]


@allocation_free_part
def _join(u: int, updates: Updates, variances: Array, rooms: _Rooms) -> None:
    """Compute the covariance after an update by Joseph's form."""
    m, states, parts = updates.sizes[u], len(rooms.p.parts), rooms.p.parts.shape[1]
    p, gain, noise, left = rooms.p.parts, rooms.gain.parts, rooms.noise.parts, rooms.left.parts
    # X = P (I - K H)^T
    for j in range(states):
        for b in range(parts):
            x = load_part(p, (j, b))
            for c in range(m):
                x -= load_part(gain, (c, b)) * rooms.cross.numbers[c, j]
            store_part(left, (j, b), x)
    # N = R K^T - H X
    for c in range(m):
        for b in range(parts):
            x = _multiply_row(updates.rows, u, c, left, b)
            store_part(noise, (c, b), variances[u, c] * load_part(gain, (c, b)) - x)
    # P+ = X + K N: its upper triangle, from which the lower one is copied
    for j in range(states):
        for b in range(j // PART, parts):
            x = load_part(left, (j, b))
            for c in range(m):
                x += load_part(noise, (c, b)) * rooms.gain.numbers[c, j]
            store_part(p, (j, b), x)
    for j in range(states):
        for i in range(j):
            rooms.p.numbers[j, i] = rooms.p.numbers[i, j]


@allocation_free_part
def _advance(k: int, steps: Steps, noise: StepNoise, rooms: _Rooms) -> None:
    """Compute ``P' = F P F^T + Q`` over step k."""
    rows, decay, p, product = steps.rows, steps.decay, rooms.p.numbers, rooms.product.numbers
    # F P, rows of psi, v, x
    for i in range(9):
        for b in range(rooms.p.parts.shape[1]):
            store_part(rooms.product.parts, (i, b), _multiply_row(rows, k, i, rooms.p.parts, b))
    # F P F^T + Q of psi, v, x
    for i in range(9):
        for j in range(i + 1):
            total = noise.white[k, i, j]
            for c in range(len(p)):
                total += product[i, c] * rows[k, j, c]
            p[i, j] = p[j, i] = total
    # of these with the other states, which decay, and of the other states
    for c in range(len(p) - 9):
        for i in range(9):
            p[i, 9 + c] = p[9 + c, i] = product[i, 9 + c] * decay[k, c] + noise.cross[k, i, c]
        for e in range(c):
            p[9 + c, 9 + e] = p[9 + e, 9 + c] = p[9 + c, 9 + e] * decay[k, c] * decay[k, e]
        if c > 0 and noise.paired[k, c] != 0.0:
            p[9 + c, 8 + c] = p[8 + c, 9 + c] = p[9 + c, 8 + c] + noise.paired[k, c]
        p[9 + c, 9 + c] = p[9 + c, 9 + c] * decay[k, c] * decay[k, c] + noise.driven[k, c]
