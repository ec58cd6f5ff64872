"""Linear errors at the last epoch as a sum over all that drives them.

The linear system along the truth, with a filter or without one, is run backwards once: from the outputs' errors at the
last epoch to what each step and each measurement before adds. A sample's linear errors are then a sum of products of
what it draws, and no linear state needs to be propagated beside its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part, compiled
from mcnav.compiled.vectors import load, store
from mcnav.systems.ins.filter.model import NAVIGATION

if TYPE_CHECKING:
    from mcnav.systems.ins.linear.closed_loop import ClosedLoop


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
    steps = len(motion)
    transition = np.zeros((steps, NAVIGATION, NAVIGATION))
    transition[:, :3, :3] = np.eye(3)
    transition[:, 3:] = motion
    none = np.zeros((0, 0, NAVIGATION))
    return _adjoint(
        transition, np.zeros((steps, NAVIGATION, 0)), np.ones((steps, 0)), none, np.zeros((0, 0, 0)),
        np.zeros((0, NAVIGATION, 0)), np.zeros(steps + 2, dtype=np.int64), last, output_map,
    )  # fmt: skip


def adjoint_of_closed(loop: ClosedLoop, last: int, output_map: Array) -> Adjoint:
    """Run an aided navigator's linear closed loop backwards; the parameters are those of `adjoint_of_free`."""
    return _adjoint(
        loop.transition, loop.filter.coupling, loop.filter.decay, loop.measurements.rows, loop.filter.rows, loop.gains,
        loop.first_updates, last, output_map,
    )  # fmt: skip


def _adjoint(
    transition: Array, coupling: Array, decay: Array, rows: Array, state_rows: Array, gains: Array, first: IndexArray,
    last: int, output_map: Array,
) -> Adjoint:  # fmt: skip
    steps, states = decay.shape
    start = np.zeros((NAVIGATION, NAVIGATION + states))
    start[:, :NAVIGATION] = output_map
    of_steps, of_updates = np.zeros((steps, NAVIGATION, NAVIGATION)), np.zeros((len(rows), NAVIGATION, rows.shape[1]))
    _run_backwards(transition, coupling, decay, rows, state_rows, gains, first, last, start, of_steps, of_updates)
    return Adjoint(start, of_steps, of_updates)


@compiled
def _run_backwards(
    transition: Array, coupling: Array, decay: Array, rows: Array, state_rows: Array, gains: Array, first: IndexArray,
    last: int, responses: Array, steps: Array, updates: Array,
) -> None:  # fmt: skip
    """Take the outputs' responses, shape (9, 9 + q), from after the updates at the last epoch to the start.

    With responses (Y, E) to psi, v, x and to the estimates afterwards, ``M = E K_e - Y K_y`` are those to innovations
    ``H y - S e - d``. Those before are ``Y + M H`` and ``E - M S``, and over a step ``Y Phi`` and ``E D - Y C``.
    """
    states, most = decay.shape[1], rows.shape[1]
    before = np.zeros(9)
    for k in range(last, -1, -1):
        if k < last:
            for o in range(9):
                for i in range(9):
                    steps[k, o, i] = responses[o, i]
                for s in range(states):
                    value = decay[k, s] * responses[o, 9 + s]
                    for i in range(9):
                        value -= responses[o, i] * coupling[k, i, s]
                    responses[o, 9 + s] = value
                for j in range(9):
                    before[j] = 0.0
                    for i in range(9):
                        before[j] += responses[o, i] * transition[k, i, j]
                for j in range(9):
                    responses[o, j] = before[j]
        for u in range(first[k + 1] - 1, first[k] - 1, -1):
            for o in range(9):
                for c in range(most):
                    value = 0.0
                    for s in range(states):
                        value += responses[o, 9 + s] * gains[u, 9 + s, c]
                    for i in range(9):
                        value -= responses[o, i] * gains[u, i, c]
                    updates[u, o, c] = -value
                for c in range(most):
                    for i in range(9):
                        responses[o, i] -= updates[u, o, c] * rows[u, c, i]
                    for s in range(states):
                        responses[o, 9 + s] += updates[u, o, c] * state_rows[u, c, s]


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
