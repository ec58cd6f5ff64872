"""Rows of outputs backwards along a timeline: what each state, step and measurement before adds to them."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array
from mcnav.contract.timeline import Timeline
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_gains, check_outputs, check_positions
from mcnav.linear.engine.transitions import Block, bounds, expand


def adjoint(timeline: Timeline, gains: Table | None, end: int, outputs: Array) -> Array:
    """Compute the rows ``L_T = C``, ``L_k = L_(k+1) A_k`` of outputs at every position up to their own.

    Parameters
    ----------
    gains : ndarray or Rows, shape (U, f, M), optional
        K; none where there are no updates.
    end : int
        Position of the outputs.
    outputs : ndarray, shape (o, n)
        C.

    Returns
    -------
    ndarray, shape (end + 1, o, n)
        Of the outputs to X at each position.

    Raises
    ------
    ValueError
        Where the end, C or gains are not of the timeline.
    """
    check_positions(timeline, [end])
    check_gains(timeline, gains)
    rows = np.empty((end + 1, *check_outputs(timeline, outputs).shape))
    rows[end] = outputs
    with one_thread():
        for first, last in reversed(bounds(0, end)):
            take_back(expand(timeline, gains, first, last), rows[first : last + 1])
    return rows


def take_back(block: Block, rows: Array) -> None:
    """Take rows back over a block, whose last ones are known, shape (k + 1, o, n)."""
    for k in range(len(block.transitions) - 1, -1, -1):
        np.matmul(rows[k + 1], block.transitions[k], out=rows[k])
