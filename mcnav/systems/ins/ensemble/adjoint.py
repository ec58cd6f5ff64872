"""Linear errors at the last epoch as a sum over all that drives them.

The linear system along the truth, with a filter or without one, is run backwards once: from the outputs' errors at the
last epoch to what each step and each measurement before adds. A sample's linear errors are then a sum of products of
what it draws, and no linear state needs to be propagated beside its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.compiled.shapes import check_numbers, check_shapes
from mcnav.compiled.vectors import load, store
from mcnav.systems.ins.ensemble.filter_system import Steps, Updates
from mcnav.systems.ins.ensemble.gains import ReadingTimes, check_tables
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.linear.response_blocks import BLOCK


@dataclass(frozen=True)
class Adjoint:
    """Responses of the outputs' linear errors at the last epoch.

    Attributes
    ----------
    start : ndarray, shape (9, 9 + q)
        To psi, v, x and the filter's q other states at the start.
    steps : ndarray, shape (K, 9, 9)
        To what the errors of the instruments add to psi, v, x in each step.
    updates : ndarray, shape (U, 9, M)
        To the errors of each measurement.
    """

    start: Array
    steps: Array
    updates: Array


def adjoint_of_free(motion: Array, last: int, output_map: Array) -> Adjoint:
    """Run an unaided navigator's linear system backwards.

    Parameters
    ----------
    motion : ndarray, shape (K, 6, 9)
        Responses of v and x to psi, v and x.
    last : int
        Number of the step that begins at the last epoch.
    output_map : ndarray, shape (9, 9)
        From psi, v, x to the outputs there.
    """
    count = len(motion)
    transition = np.zeros((count, NAVIGATION, NAVIGATION))
    transition[:, :3, :3] = np.eye(3)
    transition[:, 3:] = motion
    updates = Updates(np.zeros(count + 2, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 0, NAVIGATION)))
    return Adjoint(
        *run_backwards(Steps(transition, np.ones((count, 0))), updates, np.zeros((0, NAVIGATION, 0)), last, output_map)
    )


def adjoint_of_closed(loop: ClosedLoop, gains: Array, last: int, output_map: Array) -> Adjoint:
    """Run an aided navigator's linear closed loop backwards; the parameters are those of `adjoint_of_free`.

    Parameters
    ----------
    gains : ndarray, shape (U, 9 + q, M)
        Of the filter.
    """
    tables, measured, first = loop.filter, loop.measurements, loop.first_updates
    start = np.zeros((NAVIGATION, NAVIGATION + len(tables.states)))
    start[:, :NAVIGATION] = output_map
    of_steps = np.zeros((len(loop.times) - 1, NAVIGATION, NAVIGATION))
    of_updates = np.zeros((len(measured.sizes), NAVIGATION, gains.shape[2]))
    reached = first[last + 1]  # updates from here on are after the last time, or belong to the block that follows
    for begin in range(last // BLOCK * BLOCK, -1, -BLOCK):
        end = min(begin + BLOCK, last)
        steps, updates = slice(begin, end), slice(first[begin], reached)
        numbers = np.append(first[begin : end + 1], reached) - first[begin]
        (over, decay), true_gains = tables.between(begin, end), gains[updates].copy()
        responses = -tables.rows[updates]
        over[:, :, NAVIGATION:] *= -1.0
        true_gains[:, NAVIGATION:] *= -1.0
        responses = np.concatenate([measured.rows[updates], responses], axis=2)
        start, of_steps[steps], of_updates[updates] = run_backwards(
            Steps(over, decay), Updates(numbers, measured.sizes[updates], responses), true_gains,
            end - begin, start,
        )  # fmt: skip
        reached = first[begin]
    return Adjoint(start, of_steps, of_updates)


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
    count, states, number, most = check_tables(steps, updates, nothing)
    check_shapes((("gains", gains, (number, states, most)), ("end", end, (9, states))))
    check_numbers("last", np.array(last), count + 1)
    start, of_steps, of_updates = end.copy(), np.zeros((count, 9, 9)), np.zeros((number, 9, most))
    _run_backwards(steps, updates, gains, last, np.zeros(9), start, of_steps, of_updates)
    return start, of_steps, of_updates


@allocation_free_part
def add_linear(adjoint: Array, k: int, count: int, added: Array, linear: Array) -> None:
    """Add to linear errors what a step or an update contributes.

    Parameters
    ----------
    adjoint : ndarray, shape (K, 9, count) or with more columns
    added : ndarray, shape (count, LANES)
    linear : ndarray, shape (9, LANES)
    """
    for o in range(0, 9, 3):
        x, y, z = load(linear, o), load(linear, o + 1), load(linear, o + 2)
        for c in range(count):
            value = load(added, c)
            x += adjoint[k, o, c] * value
            y += adjoint[k, o + 1, c] * value
            z += adjoint[k, o + 2, c] * value
        store(linear, o, x)
        store(linear, o + 1, y)
        store(linear, o + 2, z)


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
