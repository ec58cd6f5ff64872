"""Linear errors at the last epoch as a sum over all that drives them.

The linear system along the truth, with a filter or without one, is run backwards once: from the outputs' errors at the
last epoch to what each step and each measurement before adds. A sample's linear errors are then a sum of products of
what it draws, and no linear state needs to be propagated beside its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import load, store
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, true_loop
from mcnav.systems.ins.linear.recursions import Steps, Updates, run_backwards


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


def adjoint_of_closed(loop: ClosedLoop, last: int, output_map: Array) -> Adjoint:
    """Run an aided navigator's linear closed loop backwards; the parameters are those of `adjoint_of_free`."""
    true = true_loop(loop)
    end = np.zeros((NAVIGATION, true.updates.rows.shape[2]))
    end[:, :NAVIGATION] = output_map
    return Adjoint(*run_backwards(true.steps, true.updates, true.gains, last, end))


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
