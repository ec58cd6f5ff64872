"""Outputs at the end of a timeline for navigators that start at many positions.

Without a filter one backward recursion has all starts, with L the rows of `adjoint`, and U and E of each start::

    P = L U + (sum_k L_(k+1) B_k) E            noise = L N_j L' + sum_k L_(k+1) Q_jk L_(k+1)'

With a filter each start has gains of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.adjoint import take_back
from mcnav.linear.engine.checks import check_outputs, check_positions
from mcnav.linear.engine.design import design
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.transitions import bounds, expand


def start_times(
    timeline: Timeline, end: int, outputs: Array, positions: ArrayLike, begin: Callable[[int], Start] | None = None
) -> Propagated:
    """Compute outputs at the end for a navigator that starts at each of the positions, in any order.

    Parameters
    ----------
    end : int
        Position of the outputs, not before any start.
    outputs : ndarray, shape (o, n)
        C.
    begin : callable, optional
        From a position to the start there; by default that of the timeline.

    Raises
    ------
    ValueError
        Where no start but the timeline's own is known, or one is after the end.
    """
    begin = timeline.begin if begin is None else begin
    if begin is None:
        raise ValueError("begin: got none, and the timeline has none; its navigator cannot start later")
    check_positions(timeline, [end])
    starts, names = check_positions(timeline, positions, last=end), timeline.processes
    size = len(check_outputs(timeline, outputs))
    if not len(starts):
        return Propagated(np.zeros((0, size, timeline.sources + 1)), np.zeros((0, len(names), size, size)))
    if timeline.is_update[:end].any():
        return _with_filter(timeline, end, outputs, starts, begin)
    return _without_filter(timeline, end, outputs, starts, begin)


def _with_filter(
    timeline: Timeline, end: int, outputs: Array, positions: IndexArray, begin: Callable[[int], Start]
) -> Propagated:
    """Design and propagate from each position."""
    read = []
    for position in positions.tolist():
        start = begin(position)
        gains = design(timeline, (), position, start).gains
        read.append(propagate(timeline, gains, (end,), begin=position, start=start, maps=lambda _: outputs))
    return Propagated(
        np.concatenate([each.partials for each in read]), np.concatenate([each.covariances for each in read])
    )


def _without_filter(
    timeline: Timeline, end: int, outputs: Array, positions: IndexArray, begin: Callable[[int], Start]
) -> Propagated:
    """Run back once from the end to the first start."""
    names, size = timeline.processes, len(outputs)
    ordered, inverse = np.unique(positions, return_inverse=True)
    constants, noise = np.zeros((size, timeline.sources + 1)), np.zeros((len(names), size, size))
    partials, covariances = np.empty((len(ordered), *constants.shape)), np.empty((len(ordered), *noise.shape))

    def read_out(place: int, rows: Array) -> None:
        start = begin(int(ordered[place]))
        started = timeline.sized(start.noise)
        turned = constants if start.constants is None else constants @ start.constants
        partials[place] = rows @ start.partials + turned
        covariances[place] = noise
        for number, name in enumerate(names):
            if name in started:
                covariances[place, number] += transform(rows, started[name])

    place, rows = len(ordered) - 1, outputs
    with one_thread():
        while place >= 0 and ordered[place] == end:
            read_out(place, rows)
            place -= 1
        for first, last in reversed(bounds(int(ordered[0]), end)):
            block = expand(timeline, None, first, last)
            table = np.empty((last - first + 1, *rows.shape))
            table[-1] = rows
            take_back(block, table)
            inner = ordered[(ordered > first) & (ordered < last)].tolist()
            cuts = [first, *inner, last]
            for low, high in reversed(list(pairwise(cuts))):
                later = table[low - first + 1 : high - first + 1]
                constants = constants + np.einsum("kon,kns->os", later, block.inputs[low - first : high - first])
                for number, name in enumerate(names):
                    for of in block.noise.get(name, ()):
                        noise[number] += of.between(low - first, high - first).through(later)
                if place >= 0 and ordered[place] == low:
                    read_out(place, table[low - first])
                    place -= 1
            rows = table[0]
    return Propagated(partials[inverse], covariances[inverse])
