"""Errors that a gate leaves when it rejects good measurements.

Where a filter believes the truth and estimates all that it believes in, the error s after an update is independent of
the innovation ``n = L w`` (S = L L^T, w of covariance one). Rejected, the measurement leaves the error ``s + V w`` with
V = K L, and the filter the covariance P + D with ``D = V V^T``. With J = L^-1 H and the gains of a filter that accepts
all, D goes on by ::

    over a step     D' = F D F^T
    accepted        D+ = (1 - V J) (1 + D J^T J)^-1 D (1 - V J)^T
    rejected        D+ = D + V V^T

(differences of two solutions of one Riccati equation). The outputs at a later time have the excess of variance
``C + A (1 + D B)^-1 D A^T`` and respond to the error by ``A (1 + D B)^-1``, where A, B and C run backwards::

    over a step     A F                     F^T B F
    accepted        A (1 - V J)             J^T J + (1 - V J)^T B (1 - V J)
    rejected        A - E (B V)^T           B - B V G (B V)^T                C + E V^T A^T

with ``G = (1 + V^T B V)^-1`` and ``E = A V G``. A first rejection has D = V V^T: the response E to w, and the excess
``C + E V^T A^T``. One pass therefore has the first rejections at all updates, each with the gains of its own filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_subroutine, compiled
from mcnav.contract.gates import RejectedErrors
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.filter_system import Steps, filter_system


@dataclass(frozen=True)
class WhitenedFilter:
    """A filter's linear system with whitened innovations, over K steps and U updates.

    Attributes
    ----------
    steps : Steps
        F of its own states.
    first : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    rows, gains : ndarray, shapes (U, M, 9 + q), (U, 9 + q, M)
        ``J = L^-1 H`` and ``V = K L``, zero beyond the components of an update.
    """

    steps: Steps
    first: IndexArray
    rows: Array
    gains: Array

    @classmethod
    def of(cls, loop: ClosedLoop) -> WhitenedFilter:
        """Whiten a loop's filter."""
        (steps, _), updates = filter_system(loop)
        most, designed = updates.rows.shape[1], loop.designed()
        unused = np.arange(most) >= updates.sizes[:, None]
        # a root of one where there is no component, whose rows and gains are zero
        roots = np.where(unused[:, :, None] | unused[:, None, :], np.eye(most), designed.roots)
        rows = np.where(unused[:, :, None], 0.0, updates.rows)
        return cls(steps, updates.first, np.linalg.solve(roots, rows), designed.gains @ roots)


def rejected_errors(
    whitened: WhitenedFilter, updates: IndexArray, never: NDArray[np.bool_], last: int, output_map: Array
) -> RejectedErrors:
    """Compute the errors of the outputs after the updates at a time, of flights whose first rejection is at an update.

    Parameters
    ----------
    updates : ndarray of int, shape (u,)
        Numbers of the updates of the first rejections, all of them up to the time.
    never : ndarray of bool, shape (U,)
        Updates that are rejected after the first rejection as well.
    last : int
        Number of the time.
    output_map : ndarray, shape (9, 9)
        From psi, v, x to the outputs.
    """
    number, states, most = whitened.gains.shape
    responses = np.zeros((NAVIGATION, states))
    responses[:, :NAVIGATION] = output_map
    excess, of_updates = np.zeros((number, NAVIGATION)), np.zeros((number, NAVIGATION, most))
    _run_rejections(whitened.steps, whitened.first, whitened.rows, whitened.gains, never, last, responses, excess,
                    of_updates)  # fmt: skip
    return RejectedErrors(excess[updates], of_updates[updates])


def next_correlations(loop: ClosedLoop, whitened: WhitenedFilter, updates: IndexArray) -> Array:
    """Compute the canonical correlations of innovations with the next of the same sensor after a rejection.

    The next innovation, whitened by the S of the filter that accepts all, responds to w by ``A = J T`` where T is
    carried on from V. With Y, the sum of what the measurements between say of w, it is ``A (1 + Y)^-1 w`` plus what is
    independent of w, and the filter that rejected believes in the covariance ``1 + A (1 + Y)^-1 A^T``.

    Parameters
    ----------
    updates : ndarray of int, shape (u,)

    Returns
    -------
    ndarray, shape (u, M)
        The largest first; NaN where the sensor has no further measurement.
    """
    sensors, most = loop.measurements.sensors, whitened.gains.shape[2]
    following = np.full(len(sensors), -1, dtype=np.int64)
    for sensor in np.unique(sensors[updates]):
        rows = np.flatnonzero(sensors == sensor)
        following[rows[:-1]] = rows[1:]
    known = updates[following[updates] >= 0]
    seen, told = np.zeros((len(known), most, most)), np.zeros((len(known), most, most))
    _run_to_next(whitened.steps, whitened.first, loop.times_of(np.arange(len(sensors))), whitened.rows,
                 whitened.gains, known, following, seen, told)  # fmt: skip
    one = np.eye(most)
    left = np.linalg.solve(one + told, seen.swapaxes(1, 2)).swapaxes(1, 2)
    roots = np.linalg.cholesky(one + left @ seen.swapaxes(1, 2))
    correlations = np.full((len(updates), most), np.nan)
    correlations[following[updates] >= 0] = np.linalg.svd(np.linalg.solve(roots, left), compute_uv=False)
    return np.asarray(np.minimum(correlations, 1.0))


@compiled
def _run_rejections(
    steps: Steps, first: IndexArray, rows: Array, gains: Array, never: NDArray[np.bool_], last: int, a: Array,
    excess: Array, responses: Array,
) -> None:  # fmt: skip
    _, states, most = gains.shape
    b, turned, row = np.zeros((states, states)), np.zeros((states, states)), np.zeros(states)
    bv, product, av, c = np.zeros((states, most)), np.zeros((states, most)), np.zeros((len(a), most)), np.zeros(len(a))
    x, g, added = np.zeros((most, most)), np.zeros((most, most)), np.zeros((most, states))
    for k in range(last, -1, -1):
        if k < last:
            # A F; B F, and F^T B F = ((B F)^T F)^T
            _times_step(k, steps, a, row)
            _times_step(k, steps, b, row)
            _transpose(b, turned)
            _times_step(k, steps, turned, row)
            _transpose(turned, b)
        for u in range(first[k + 1] - 1, first[k] - 1, -1):
            _multiply(b, gains[u], bv)
            _multiply(a, gains[u], av)
            # X = V^T B V, G = (1 + X)^-1, E = A V G, and the excess C + E V^T A^T
            _multiply_transposed(gains[u], bv, x)
            _invert_with_one(x, g)
            _multiply(av, g, responses[u])
            for o in range(len(a)):
                excess[u, o] = c[o]
                for e in range(most):
                    excess[u, o] += responses[u, o, e] * av[o, e]
            if never[u]:
                # A - E (B V)^T, B - B V G (B V)^T
                c[:] = excess[u]
                for e in range(most):
                    for i in range(states):
                        added[e, i] = bv[i, e]
                _subtract_product(a, responses[u], added)
                _multiply(bv, g, product)
                _subtract_product(b, product, added)
            else:
                # A - A V J, B - B V J + J^T ((1 + X) J - (B V)^T)
                _subtract_product(a, av, rows[u])
                for e in range(most):
                    for i in range(states):
                        added[e, i] = bv[i, e] - rows[u, e, i]
                    for f in range(most):
                        for i in range(states):
                            added[e, i] -= x[e, f] * rows[u, f, i]
                _subtract_product(b, bv, rows[u])
                for e in range(most):
                    for i in range(states):
                        product[i, e] = rows[u, e, i]
                _subtract_product(b, product, added)


@allocation_free_subroutine
def _subtract_product(result: Array, left: Array, right: Array) -> None:
    """Subtract ``left right``."""
    for i in range(result.shape[0]):
        for c in range(left.shape[1]):
            weight = left[i, c]
            for j in range(result.shape[1]):
                result[i, j] -= weight * right[c, j]


@allocation_free_subroutine
def _transpose(matrix: Array, result: Array) -> None:
    for i in range(len(matrix)):
        for j in range(len(matrix)):
            result[j, i] = matrix[i, j]


@allocation_free_subroutine
def _multiply(left: Array, right: Array, result: Array) -> None:
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            total = 0.0
            for c in range(left.shape[1]):
                total += left[i, c] * right[c, j]
            result[i, j] = total


@allocation_free_subroutine
def _multiply_transposed(left: Array, right: Array, result: Array) -> None:
    """Compute ``left^T right``."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            total = 0.0
            for c in range(left.shape[0]):
                total += left[c, i] * right[c, j]
            result[i, j] = total


@allocation_free_subroutine
def _invert_with_one(x: Array, result: Array) -> None:
    """Compute ``(1 + X)^-1`` of a positive semidefinite X by Gauss and Jordan's method, which needs no pivots."""
    size = len(x)
    for i in range(size):
        for j in range(size):
            result[i, j] = x[i, j]
        result[i, i] += 1.0
    for p in range(size):
        pivot = 1.0 / result[p, p]
        result[p, p] = 1.0
        for j in range(size):
            result[p, j] *= pivot
        for i in range(size):
            if i != p:
                factor = result[i, p]
                result[i, p] = 0.0
                for j in range(size):
                    result[i, j] -= factor * result[p, j]


@allocation_free_subroutine
def _times_step(k: int, steps: Steps, matrix: Array, row: Array) -> None:
    """Replace a matrix X by ``X F``."""
    for o in range(len(matrix)):
        for j in range(len(row)):
            row[j] = 0.0
        for i in range(9):
            weight = matrix[o, i]
            for j in range(len(row)):
                row[j] += weight * steps.rows[k, i, j]
        for j in range(9):
            matrix[o, j] = row[j]
        for j in range(9, len(row)):
            matrix[o, j] = row[j] + steps.decay[k, j - 9] * matrix[o, j]


@compiled
def _run_to_next(
    steps: Steps, first: IndexArray, numbers: IndexArray, rows: Array, gains: Array, updates: IndexArray,
    following: IndexArray, seen: Array, told: Array,
) -> None:  # fmt: skip
    _, states, most = gains.shape
    t, moved, innovation = np.zeros((states, most)), np.zeros((9, most)), np.zeros((most, most))
    for place in range(len(updates)):
        u, end = updates[place], following[updates[place]]
        t[:] = gains[u]
        i = u + 1
        for k in range(numbers[u], numbers[end] + 1):
            if k > numbers[u]:
                _multiply(steps.rows[k - 1], t, moved)
                t[:9] = moved
                for s in range(9, states):
                    t[s] *= steps.decay[k - 1, s - 9]
            while i < end and i < first[k + 1]:
                # accepted: T - V J T, and what it says of w
                _multiply(rows[i], t, innovation)
                for c in range(states):
                    for e in range(most):
                        for f in range(most):
                            t[c, e] -= gains[i, c, f] * innovation[f, e]
                for e in range(most):
                    for f in range(most):
                        for c in range(most):
                            told[place, e, f] += innovation[c, e] * innovation[c, f]
                i += 1
        _multiply(rows[end], t, seen[place])
