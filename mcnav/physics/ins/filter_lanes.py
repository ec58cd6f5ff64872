"""Covariances of the filters of aided samples, LANES at a time: propagation, updates and normalized errors.

Each filter's transition is that of the step's tables, turned to the attitude and the force that its sample indicates.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.ensemble import LANES
from mcnav.physics.jit import compiled, uncontracted

SIX: Final = 6
"""Components of the largest measurement, and states that are added up together."""

SOUND, BEYOND, INDEFINITE = 0, 1, 2
"""Outcomes of a sample: good; beyond the validity of the scheme; a covariance that is not positive definite."""


@uncontracted
def _quadratic(matrix: Array, vector: Array, begin: int, end: int, root: Array, out: Array) -> float:
    """Compute ``e^T P^-1 e`` of a block by Cholesky's method; states without variance count nothing."""
    total = 0.0
    for i in range(begin, end):
        value = vector[i]
        for c in range(begin, i):
            value -= root[i, c] * out[c]
        pivot = matrix[i, i]
        for c in range(begin, i):
            pivot -= root[i, c] * root[i, c]
        if pivot <= 1e-14 * matrix[i, i]:
            out[i] = 0.0
            for j in range(i, end):
                root[j, i] = 0.0
            continue
        diagonal = np.sqrt(pivot)
        for j in range(i + 1, end):
            entry = matrix[j, i]
            for c in range(begin, i):
                entry -= root[j, c] * root[i, c]
            root[j, i] = entry / diagonal
        out[i] = value / diagonal
        total += out[i] * out[i]
    return total


@compiled
def _turn_block(over: Array, block: Array, half: Array, out: Array) -> None:
    """Compute ``R B R^T`` of a block, shape (3, 3), with R - I of each lane: shape (3, 3, LANES)."""
    for r in range(3):
        for c in range(3):
            x, y, z = block[0, c], block[1, c], block[2, c]
            for i in range(LANES):
                half[r, c, i] = block[r, c] + (over[3 * r, i] * x + over[3 * r + 1, i] * y + over[3 * r + 2, i] * z)
    for r in range(3):
        for c in range(3):
            for i in range(LANES):
                out[r, c, i] = half[r, c, i] + (
                    half[r, 0, i] * over[3 * c, i]
                    + half[r, 1, i] * over[3 * c + 1, i]
                    + half[r, 2, i] * over[3 * c + 2, i]
                )


@compiled
def turn_tables(
    k: int, motion: Array, thrust: Array, coupling: Array, noise: Array, local: Array, over: Array, transition: Array,
    coupled: Array, added: Array,
) -> None:  # fmt: skip
    """Turn a step's tables to the attitude and the force that each sample indicates."""
    states = coupling.shape[2]
    block = np.empty((3, 3, LANES))
    for half in range(2):
        _turn_block(over, motion[k, 3 * half : 3 * half + 3, :3], block, transition[3 * half : 3 * half + 3])
        fx, fy, fz = thrust[k, 3 * half], thrust[k, 3 * half + 1], thrust[k, 3 * half + 2]
        share = 0.5 if half == 0 else 1.0 / 3.0
        for i in range(LANES):
            ax, ay, az = local[0, i], local[1, i], local[2, i]
            ux = local[3 + 3 * half, i] - share * (ay * fz - az * fy)
            uy = local[4 + 3 * half, i] - share * (az * fx - ax * fz)
            uz = local[5 + 3 * half, i] - share * (ax * fy - ay * fx)
            transition[3 * half, 1, i] += uz
            transition[3 * half, 2, i] -= uy
            transition[3 * half + 1, 0, i] -= uz
            transition[3 * half + 1, 2, i] += ux
            transition[3 * half + 2, 0, i] += uy
            transition[3 * half + 2, 1, i] -= ux
    for row in range(3):
        for column in range(row + 1):
            _turn_block(
                over, noise[k, 3 * row : 3 * row + 3, 3 * column : 3 * column + 3], block,
                added[3 * row : 3 * row + 3, 3 * column : 3 * column + 3],
            )  # fmt: skip
    for s in range(states):
        for row in range(3):
            x, y, z = coupling[k, 3 * row, s], coupling[k, 3 * row + 1, s], coupling[k, 3 * row + 2, s]
            a, b, c = noise[k, 3 * row, 9 + s], noise[k, 3 * row + 1, 9 + s], noise[k, 3 * row + 2, 9 + s]
            for r in range(3):
                at = 3 * row + r
                one, other = coupling[k, at, s], noise[k, at, 9 + s]
                for i in range(LANES):
                    u, v, w = over[3 * r, i], over[3 * r + 1, i], over[3 * r + 2, i]
                    coupled[at, s, i] = one + (u * x + v * y + w * z)
                    added[9 + s, at, i] = other + (u * a + v * b + w * c)


@compiled
def propagate_covariances(
    k: int, motion: Array, decay: Array, noise: Array, transition: Array, coupled: Array, added: Array, p: Array,
    product: Array,
) -> None:  # fmt: skip
    """Take the filters' covariances over a step.

    The other states are padded to a multiple of six, with zeros: a loop over the lanes costs more than its products.
    """
    size = len(p)
    states, others = decay.shape[1], size - 9
    for r in range(9):
        for j in range(size):
            if r < 3:
                for i in range(LANES):
                    product[r, j, i] = p[r, j, i]
            else:
                a, b, c = motion[k, r - 3, 3], motion[k, r - 3, 4], motion[k, r - 3, 5]
                d, e, f = motion[k, r - 3, 6], motion[k, r - 3, 7], motion[k, r - 3, 8]
                for i in range(LANES):
                    product[r, j, i] = (
                        transition[r - 3, 0, i] * p[0, j, i]
                        + transition[r - 3, 1, i] * p[1, j, i]
                        + transition[r - 3, 2, i] * p[2, j, i]
                        + (a * p[3, j, i] + b * p[4, j, i] + c * p[5, j, i])
                        + (d * p[6, j, i] + e * p[7, j, i] + f * p[8, j, i])
                    )
            for s in range(0, others, SIX):
                for i in range(LANES):
                    product[r, j, i] += (
                        coupled[r, s, i] * p[9 + s, j, i]
                        + coupled[r, s + 1, i] * p[10 + s, j, i]
                        + coupled[r, s + 2, i] * p[11 + s, j, i]
                    ) + (
                        coupled[r, s + 3, i] * p[12 + s, j, i]
                        + coupled[r, s + 4, i] * p[13 + s, j, i]
                        + coupled[r, s + 5, i] * p[14 + s, j, i]
                    )
    for r in range(9):
        for j in range(r + 1):
            if j < 3:
                for i in range(LANES):
                    p[r, j, i] = added[r, j, i] + product[r, j, i]
            else:
                a, b, c = motion[k, j - 3, 3], motion[k, j - 3, 4], motion[k, j - 3, 5]
                d, e, f = motion[k, j - 3, 6], motion[k, j - 3, 7], motion[k, j - 3, 8]
                for i in range(LANES):
                    p[r, j, i] = (
                        added[r, j, i]
                        + (
                            product[r, 0, i] * transition[j - 3, 0, i]
                            + product[r, 1, i] * transition[j - 3, 1, i]
                            + product[r, 2, i] * transition[j - 3, 2, i]
                        )
                        + (a * product[r, 3, i] + b * product[r, 4, i] + c * product[r, 5, i])
                        + (d * product[r, 6, i] + e * product[r, 7, i] + f * product[r, 8, i])
                    )
            for s in range(0, others, SIX):
                for i in range(LANES):
                    p[r, j, i] += (
                        product[r, 9 + s, i] * coupled[j, s, i]
                        + product[r, 10 + s, i] * coupled[j, s + 1, i]
                        + product[r, 11 + s, i] * coupled[j, s + 2, i]
                    ) + (
                        product[r, 12 + s, i] * coupled[j, s + 3, i]
                        + product[r, 13 + s, i] * coupled[j, s + 4, i]
                        + product[r, 14 + s, i] * coupled[j, s + 5, i]
                    )
            for i in range(LANES):
                p[j, r, i] = p[r, j, i]
        for s in range(states):
            weight = decay[k, s]
            for i in range(LANES):
                p[9 + s, r, i] = p[r, 9 + s, i] = weight * product[r, 9 + s, i] + added[9 + s, r, i]
    for s in range(states):
        for e in range(s + 1):
            weight, more = decay[k, s] * decay[k, e], noise[k, 9 + s, 9 + e]
            for i in range(LANES):
                p[9 + s, 9 + e, i] = p[9 + e, 9 + s, i] = weight * p[9 + s, 9 + e, i] + more


@compiled
def _project(p: Array, full: Array, bounds: IndexArray, state_rows: Array, m: int, cross: Array) -> None:
    """Add ``P H^T`` to ``cross``, shape (size, M, LANES); rows of H are in blocks of three."""
    for r in range(len(p)):
        for c in range(m):
            for j in range(bounds[c, 0], bounds[c, 1], 3):
                for i in range(LANES):
                    cross[r, c, i] += (
                        p[r, j, i] * full[c, j, i]
                        + p[r, j + 1, i] * full[c, j + 1, i]
                        + p[r, j + 2, i] * full[c, j + 2, i]
                    )
            for s in range(state_rows.shape[1]):
                weight = state_rows[c, s]
                if weight != 0.0:
                    for i in range(LANES):
                        cross[r, c, i] += p[r, 9 + s, i] * weight


@compiled
def factor_innovations(
    p: Array, full: Array, bounds: IndexArray, state_rows: Array, variances: Array, m: int, cross: Array, root: Array,
    inverse: Array, outcome: IndexArray,
) -> None:  # fmt: skip
    """Compute ``P H^T`` and the Cholesky factor of the innovations' covariance, with its diagonal inverted."""
    for r in range(len(p)):
        for c in range(cross.shape[1]):
            for i in range(LANES):
                cross[r, c, i] = 0.0
    _project(p, full, bounds, state_rows, m, cross)
    for c in range(m):
        for e in range(c + 1):
            for i in range(LANES):
                root[c, e, i] = variances[c] if c == e else 0.0
            for j in range(bounds[c, 0], bounds[c, 1], 3):
                for i in range(LANES):
                    root[c, e, i] += (
                        full[c, j, i] * cross[j, e, i]
                        + full[c, j + 1, i] * cross[j + 1, e, i]
                        + full[c, j + 2, i] * cross[j + 2, e, i]
                    )
            for s in range(state_rows.shape[1]):
                weight = state_rows[c, s]
                if weight != 0.0:
                    for i in range(LANES):
                        root[c, e, i] += weight * cross[9 + s, e, i]
            for j in range(e):
                for i in range(LANES):
                    root[c, e, i] -= root[c, j, i] * root[e, j, i]
            if c > e:
                for i in range(LANES):
                    root[c, e, i] *= inverse[e, i]
        for i in range(LANES):
            if not root[c, c, i] > 0.0:
                outcome[i] = INDEFINITE
                root[c, c, i] = 1.0
            root[c, c, i] = np.sqrt(root[c, c, i])
            inverse[c, i] = 1.0 / root[c, c, i]


@compiled
def invert_innovations(root: Array, inverse: Array, m: int, low: Array, s: Array) -> None:
    """Invert ``L L^T``, shape (m, m, LANES), given the inverted diagonal of L; s is padded with zeros."""
    s[:] = 0.0
    for c in range(m):
        for i in range(LANES):
            low[c, c, i] = inverse[c, i]
        for r in range(c + 1, m):
            for i in range(LANES):
                low[r, c, i] = 0.0
            for j in range(c, r):
                for i in range(LANES):
                    low[r, c, i] -= root[r, j, i] * low[j, c, i]
            for i in range(LANES):
                low[r, c, i] *= inverse[r, i]
    for r in range(m):
        for c in range(r + 1):
            for j in range(r, m):
                for i in range(LANES):
                    s[r, c, i] += low[j, r, i] * low[j, c, i]
            for i in range(LANES):
                s[c, r, i] = s[r, c, i]


@compiled
def correct_covariances(
    p: Array, full: Array, bounds: IndexArray, state_rows: Array, variances: Array, m: int, corrected: Array,
    accepted: Array, cross: Array, s: Array, gain: Array, left: Array,
) -> None:  # fmt: skip
    """Compute the gains and the covariance after an update, in Joseph's form, with the inverse s of the innovations'.

    Components are padded to six, which is the most that a sensor has, with zeros.
    """
    size = len(p)
    for r in range(size):
        share = corrected[r]
        for c in range(SIX):
            for i in range(LANES):
                gain[r, c, i] = (share * accepted[i]) * (
                    (cross[r, 0, i] * s[0, c, i] + cross[r, 1, i] * s[1, c, i] + cross[r, 2, i] * s[2, c, i])
                    + (cross[r, 3, i] * s[3, c, i] + cross[r, 4, i] * s[4, c, i] + cross[r, 5, i] * s[5, c, i])
                )
    for r in range(size):
        for j in range(size):
            for i in range(LANES):
                left[r, j, i] = p[r, j, i] - (
                    (gain[r, 0, i] * cross[j, 0, i] + gain[r, 1, i] * cross[j, 1, i] + gain[r, 2, i] * cross[j, 2, i])
                    + (gain[r, 3, i] * cross[j, 3, i] + gain[r, 4, i] * cross[j, 4, i] + gain[r, 5, i] * cross[j, 5, i])
                )
    for r in range(size):
        for c in range(m):
            weight = -variances[c]
            for i in range(LANES):
                cross[r, c, i] = weight * gain[r, c, i]
    _project(left, full, bounds, state_rows, m, cross)
    for r in range(size):
        for j in range(r + 1):
            for i in range(LANES):
                p[r, j, i] = p[j, r, i] = left[r, j, i] - (
                    (cross[r, 0, i] * gain[j, 0, i] + cross[r, 1, i] * gain[j, 1, i] + cross[r, 2, i] * gain[j, 2, i])
                    + (cross[r, 3, i] * gain[j, 3, i] + cross[r, 4, i] * gain[j, 4, i] + cross[r, 5, i] * gain[j, 5, i])
                )


@compiled
def record_consistency(
    matrix: Array, vector: Array, corrected: Array, to_outputs: Array, nees: Array, covariance: Array,
) -> None:  # fmt: skip
    """Record the covariance of the outputs and the normalized errors squared of one sample at an epoch.

    Parameters
    ----------
    matrix : ndarray, shape (9 + q, 9 + q)
    vector : ndarray, shape (9 + q,)
        Errors of all states.
    """
    size = len(vector)
    estimated, low, solved = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
    mapped, half, errors, kept_errors = np.zeros((9, 9)), np.zeros((9, 9)), np.zeros(9), vector.copy()
    kept = 0
    for r in range(size):
        if r < 9 or corrected[r] > 0.0:
            other = 0
            for c in range(r + 1):
                if c < 9 or corrected[c] > 0.0:
                    estimated[kept, other] = matrix[r, c]
                    other += 1
            kept_errors[kept] = vector[r]
            kept += 1
    nees[0] = _quadratic(estimated, kept_errors, 0, kept, low, solved)
    nees[1] = _quadratic(estimated, kept_errors, 0, 9, low, solved)
    nees[5] = _quadratic(estimated, kept_errors, 9, kept, low, solved)
    for r in range(9):
        for c in range(9):
            value = 0.0
            for j in range(9):
                value += to_outputs[r, j] * matrix[j, c]
            half[r, c] = value
            errors[r] += to_outputs[r, c] * vector[c]
    place = 0
    for r in range(9):
        for c in range(r + 1):
            value = 0.0
            for j in range(9):
                value += half[r, j] * to_outputs[c, j]
            mapped[r, c] = covariance[place] = value
            place += 1
    for group in range(3):
        nees[2 + group] = _quadratic(mapped, errors, 3 * group, 3 * group + 3, low, solved)
