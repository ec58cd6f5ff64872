"""The three recursions of a linear system of psi, v, x and other states, in compiled code.

Over a step and in an update, states s with covariance P obey, with F of a step, H of a measurement and any gain K::

    s' = F s + inputs                    P' = F P F^T + Q
    n  = H s + disturbances              S  = H P H^T + R
    s+ = s - K n                         P+ = (I - K H) P (I - K H)^T + K R K^T        (Joseph's form)

Responses A of a later state are run backwards, to ``A F`` and to ``A - A K H``.

`design_gains` has the filter's states as it believes them: its gains ``K = P H^T S^-1`` and its own covariance. It is
compared with steady states of textbooks, the filters of samples, that of the reference engine, and a dense covariance.

`run_covariance` has the true deviations y, the filter's estimates e^ and biases b, with the gains of the design: of one
process, or of all causes at once. A filter that believes the truth has the same covariance as `design_gains` gives it,
although its states are others; a dense covariance is compared with both.

`run_responses` has y and e^: what each constant error makes of them, and their mean. `run_backwards` has them too: the
linear errors of samples are sums of what it gives. The two are compared with each other, and with samples.

A row of n states is in parts of eight, which the processor's vectors hold; what fills the last one up is zero.
Responses that are zero are skipped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.compiled.shapes import check_numbers, check_shapes
from mcnav.compiled.vectors import PART, Vector, load_part, room_of_parts, store_part


class Steps(NamedTuple):
    """F over K steps, of psi, v, x and q other states, which decay and respond to nothing.

    Attributes
    ----------
    rows : ndarray, shape (K, 9, 9 + q)
        Of psi, v, x.
    decay : ndarray, shape (K, q)
        What is left of the other states.
    """

    rows: Array
    decay: Array


class StepNoise(NamedTuple):
    """Q over K steps; different ones of the other states are independent, but for pairs of neighbours.

    Attributes
    ----------
    white : ndarray, shape (K, 9, 9)
        Of psi, v, x.
    cross : ndarray, shape (K, 9, q)
        Of these with the other states.
    driven : ndarray, shape (K, q)
        Variances of the other states.
    paired : ndarray, shape (K, q)
        Covariance of each with the one before it.
    """

    white: Array
    cross: Array
    driven: Array
    paired: Array


class Updates(NamedTuple):
    """H of U updates with at most M components.

    Attributes
    ----------
    first : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    sizes : ndarray of int, shape (U,)
        Components of each.
    rows : ndarray, shape (U, M, 9 + q)
    """

    first: IndexArray
    sizes: IndexArray
    rows: Array


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


def _check(steps: Steps, updates: Updates, readings: ReadingTimes) -> tuple[int, int, int, int]:
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
) -> tuple[Array, Array, Array]:  # fmt: skip
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
    """
    of = _check(steps, updates, readings)
    _check_noise(noise, variances, start, of)
    _, states, number, most = of
    check_shapes((("corrected", corrected, (states,)),))
    gains, roots = np.zeros((number, states, most)), np.zeros((number, most, most))
    covariances = np.zeros((len(readings.numbers), states, states))
    _design_gains(steps, noise, updates, variances, corrected, _rooms(start, most), readings, gains, roots, covariances)
    return gains, roots, covariances


def run_covariance(
    steps: Steps, noise: StepNoise, updates: Updates, variances: Array, gains: Array, start: Array,
    readings: ReadingTimes, size: int,
) -> Array:  # fmt: skip
    """Run a covariance through a loop whose gains are given.

    Parameters
    ----------
    variances, start : ndarray
        As for `design_gains`.
    gains : ndarray, shape (U, g, M)
        K of the first g states; that of the others is zero.
    size : int
        States whose covariance is read out, the first of all.

    Returns
    -------
    ndarray, shape (m, size, size)
    """
    of = _check(steps, updates, readings)
    _check_noise(noise, variances, start, of)
    _, states, number, most = of
    check_shapes((("gains", gains, (number, gains.shape[1], most)),))
    check_numbers("gains, number of states", np.array(gains.shape[1]), states + 1)
    check_numbers("size", np.array(size), states + 1)
    covariances = np.zeros((len(readings.numbers), size, size))
    _run_covariance(steps, noise, updates, variances, gains, _rooms(start, most), readings, covariances)
    return covariances


def run_responses(
    steps: Steps, inputs: Array, updates: Updates, disturbances: Array, gains: Array, start: Array,
    readings: ReadingTimes,
) -> Array:  # fmt: skip
    """Run the responses to r errors through a loop whose gains are given.

    Parameters
    ----------
    inputs : ndarray, shape (K, 9, r)
        What the errors add to psi, v, x in each step.
    disturbances : ndarray, shape (U, M, r)
        What they add to innovations.
    gains : ndarray, shape (U, 9 + q, M)
    start : ndarray, shape (9 + q, r)

    Returns
    -------
    ndarray, shape (m, 9 + q, r)
    """
    count, states, number, most = _check(steps, updates, readings)
    errors = start.shape[1]
    check_shapes((
        ("inputs", inputs, (count, 9, errors)),
        ("disturbances", disturbances, (number, most, errors)),
        ("gains", gains, (number, states, most)),
        ("start", start, (states, errors)),
    ))  # fmt: skip
    responses = np.zeros((len(readings.numbers), states, errors))
    _run_responses(
        steps, inputs, updates, disturbances, gains, start.copy(), np.zeros((9, errors)), np.zeros((most, errors)),
        readings, responses,
    )  # fmt: skip
    return responses


def run_backwards(steps: Steps, updates: Updates, gains: Array, last: int, end: Array) -> tuple[Array, Array, Array]:
    """Run responses backwards, from after the updates at a time to the start.

    Parameters
    ----------
    gains : ndarray, shape (U, 9 + q, M)
    last : int
        Number of the time.
    end : ndarray, shape (9, 9 + q)
        Responses to the states there.

    Returns
    -------
    start : ndarray, shape (9, 9 + q)
        To the states at the start.
    of_steps, of_updates : ndarray, shapes (K, 9, 9), (U, 9, M)
        To what each step adds to psi, v, x, and to what each measurement's error is.
    """
    nothing = ReadingTimes(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))
    count, states, number, most = _check(steps, updates, nothing)
    check_shapes((("gains", gains, (number, states, most)), ("end", end, (9, states))))
    check_numbers("last", np.array(last), count + 1)
    start, of_steps, of_updates = end.copy(), np.zeros((count, 9, 9)), np.zeros((number, 9, most))
    _run_backwards(steps, updates, gains, last, np.zeros(9), start, of_steps, of_updates)
    return start, of_steps, of_updates


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


@compiled
def _run_covariance(
    steps: Steps, noise: StepNoise, updates: Updates, variances: Array, gains: Array, rooms: _Rooms,
    readings: ReadingTimes, covariances: Array,
) -> None:  # fmt: skip
    reached = 0
    for k in range(len(updates.first) - 1):
        reached = _read(k, False, reached, readings, rooms.p.numbers, covariances)
        for u in range(updates.first[k], updates.first[k + 1]):
            _project(u, updates, rooms)
            for i in range(gains.shape[1]):
                for c in range(updates.sizes[u]):
                    rooms.gain.numbers[c, i] = gains[u, i, c]
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


@compiled
def _run_responses(
    steps: Steps, inputs: Array, updates: Updates, disturbances: Array, gains: Array, state: Array, following: Array,
    innovation: Array, readings: ReadingTimes, responses: Array,
) -> None:  # fmt: skip
    states, errors = state.shape
    reached = 0
    for k in range(len(updates.first) - 1):
        reached = _read(k, False, reached, readings, state, responses)
        for u in range(updates.first[k], updates.first[k + 1]):
            # n = H s + disturbances
            for c in range(updates.sizes[u]):
                for j in range(errors):
                    innovation[c, j] = 0.0
                for i in range(states):
                    _add_row(innovation, c, updates.rows[u, c, i], state, i)
                for j in range(errors):
                    innovation[c, j] += disturbances[u, c, j]
            # s+ = s - K n
            for c in range(updates.sizes[u]):
                for i in range(states):
                    _add_row(state, i, -gains[u, i, c], innovation, c)
        reached = _read(k, True, reached, readings, state, responses)
        if k == len(steps.decay):
            break
        # s' = F s + inputs
        for i in range(9):
            for j in range(errors):
                following[i, j] = 0.0
            for c in range(states):
                _add_row(following, i, steps.rows[k, i, c], state, c)
            for j in range(errors):
                following[i, j] += inputs[k, i, j]
        for i in range(9):
            for j in range(errors):
                state[i, j] = following[i, j]
        for i in range(9, states):
            for j in range(errors):
                state[i, j] *= steps.decay[k, i - 9]


@allocation_free_part
def _add_row(rows: Array, i: int, weight: float, others: Array, j: int) -> None:
    """Add to row i a multiple of another matrix's row j."""
    if weight != 0.0:
        for e in range(rows.shape[1]):
            rows[i, e] += weight * others[j, e]


@compiled
def _run_backwards(
    steps: Steps, updates: Updates, gains: Array, last: int, before: Array, a: Array, of_steps: Array,
    of_updates: Array,
) -> None:  # fmt: skip
    states, most = a.shape[1], gains.shape[2]
    for k in range(last, -1, -1):
        if k < last:
            for o in range(9):
                for i in range(9):
                    of_steps[k, o, i] = a[o, i]
                # A F, columns of the other states, then of psi, v, x
                for s in range(9, states):
                    value = steps.decay[k, s - 9] * a[o, s]
                    for i in range(9):
                        value += a[o, i] * steps.rows[k, i, s]
                    a[o, s] = value
                for j in range(9):
                    before[j] = 0.0
                    for i in range(9):
                        before[j] += a[o, i] * steps.rows[k, i, j]
                for j in range(9):
                    a[o, j] = before[j]
        for u in range(updates.first[k + 1] - 1, updates.first[k] - 1, -1):
            for o in range(9):
                # A K: an error of the measurement takes as much from the innovation
                for c in range(most):
                    value = 0.0
                    for s in range(9, states):
                        value += a[o, s] * gains[u, s, c]
                    for i in range(9):
                        value += a[o, i] * gains[u, i, c]
                    of_updates[u, o, c] = value
                # A - A K H
                for c in range(most):
                    for i in range(states):
                        a[o, i] -= of_updates[u, o, c] * updates.rows[u, c, i]
