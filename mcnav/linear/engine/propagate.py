"""Partial derivatives of outputs to the error sources, and their covariance by process of noise, along a timeline.

Between readings a and b, with ``Psi_k`` the product of all A after transition k, and ``Phi = Psi_a A_a``::

    S(b)   = Phi S(a) + sum_k Psi_k B_k
    P_j(b) = Phi P_j(a) Phi' + sum_k Psi_k Q_jk Psi_k'

The sums are large products. Step by step the same takes 20 times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.products import map_covariances, transform
from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_gains, check_outputs, check_positions, check_start
from mcnav.linear.engine.transitions import TOGETHER, Block, bounds, expand

Maps = Callable[[int], Array]
"""From a position to C, shape (o, n)."""


@dataclass(frozen=True)
class Propagated:
    """Outputs at some positions, r of them.

    Attributes
    ----------
    partials : ndarray, shape (r, o, s + 1)
        To the error sources, and what is deterministic.
    covariances : ndarray, shape (r, processes, o, o)
        By process of noise; one for all processes together where they were added up.
    """

    partials: Array
    covariances: Array


def readout_maps(timeline: Timeline) -> Maps:
    """Return the outputs of a timeline by position."""
    return lambda position: timeline.readout(position, timeline.time_at(position))


def propagate(
    timeline: Timeline, gains: Table | None, positions: ArrayLike, by_cause: bool = True, begin: int = 0,
    start: Start | None = None, maps: Maps | None = None,
) -> Propagated:  # fmt: skip
    """Propagate to positions, in any order, none before the begin.

    Parameters
    ----------
    gains : ndarray or Rows, shape (U, f, M), optional
        K; none where there are no updates.
    by_cause : bool
        Each process by itself; else all together, which takes less time.
    begin : int
        Position of the start.
    start : Start, optional
        The start there, where it is not that of the timeline.
    maps : callable, optional
        From a position to what is read there, shape (o, n), always as many; by default the outputs.
    """
    wanted = check_positions(timeline, positions, begin)
    start, maps = timeline.start if start is None else start, readout_maps(timeline) if maps is None else maps
    check_start(timeline, start)
    check_gains(timeline, gains)
    ordered, inverse = np.unique(wanted, return_inverse=True)
    state = _State.at(timeline, start, by_cause)
    read: list[tuple[Array, Array]] = []

    def read_out(position: int) -> None:
        if len(read) < len(ordered) and ordered[len(read)] == position:
            read.append(state.mapped(check_outputs(timeline, maps(position))))

    with one_thread():
        read_out(begin)
        for first, last in bounds(begin, int(ordered[-1]) if len(ordered) else begin):
            block = expand(timeline, gains, first, last, start.constants, not by_cause)
            inner = ordered[(ordered > first) & (ordered < last)].tolist()
            for low, high in zip([first, *inner], [*inner, last], strict=True):
                state.advance(block, low - first, high - first)
                read_out(high)
    if not read:  # none, of as many outputs as are read elsewhere
        outputs = len(maps(begin))
        none = np.zeros((0, outputs, timeline.sources + 1)), np.zeros((0, len(state.names), outputs, outputs))
        return Propagated(*none)
    partials, covariances = (np.stack(tables)[inverse] for tables in zip(*read, strict=True))
    return Propagated(partials, covariances)


@dataclass
class _State:
    """What is propagated.

    Attributes
    ----------
    names : tuple of str
        Processes.
    kept : ndarray of int, shape (p, m)
        States of each covariance; n for room that is not used.
    partials, covariances : ndarray, shapes (n, s + 1), (p, m, m)
    """

    names: tuple[str, ...]
    kept: IndexArray
    partials: Array
    covariances: Array

    @classmethod
    def at(cls, timeline: Timeline, start: Start, by_cause: bool) -> _State:
        """Begin at a start."""
        states, names, biases = timeline.states, timeline.processes, timeline.biases
        if not by_cause:
            names, biases = (TOGETHER,)[: len(names)], {}
        owned = np.concatenate([np.zeros(0, dtype=np.int64), *biases.values()])
        core = np.setdiff1d(np.arange(states), owned)
        most = max((len(of) for of in biases.values()), default=0)
        kept = np.full((len(names), len(core) + most), states)
        kept[:, : len(core)] = core
        for row, name in zip(kept, names, strict=True):
            own = biases.get(name, owned[:0])
            row[len(core) : len(core) + len(own)] = own
        started = timeline.sized(start.noise)
        if not by_cause:
            started = {TOGETHER: sum(started.values(), np.zeros((states, states)))}
        covariances = np.zeros((*kept.shape, kept.shape[1]))
        for place, (name, row) in enumerate(zip(names, kept, strict=True)):
            if name in started:
                covariances[place] = np.pad(started[name], ((0, 1), (0, 1)))[np.ix_(row, row)]
        return cls(names, kept, start.partials, covariances)

    def advance(self, block: Block, first: int, last: int) -> None:
        """Advance over transitions of a block, by their numbers in it."""
        transitions = block.transitions[first:last]
        states = len(self.partials)
        beside = np.empty((states, len(transitions), states))  # Psi, beside each other
        later = beside.transpose(1, 0, 2)
        later[-1] = np.eye(states)
        for k in range(len(later) - 1, 0, -1):
            np.matmul(later[k], transitions[k], out=later[k - 1])
        whole = later[0] @ transitions[0]
        inputs = block.inputs[first:last]
        self.partials = whole @ self.partials + beside.reshape(states, -1) @ inputs.reshape(-1, inputs.shape[2])
        if not len(self.names):
            return
        padded = np.pad(whole, ((0, 1), (0, 1)))
        self.covariances = transform(padded[self.kept[:, :, None], self.kept[:, None, :]], self.covariances)
        for place, name in enumerate(self.names):
            used = self.kept[place] < len(whole)
            rows, columns = np.ix_(self.kept[place][used], self.kept[place][used])
            for noise in block.noise.get(name, ()):
                within = noise.between(first, last)
                if len(within.places):
                    self.covariances[place][np.ix_(used, used)] += within.through(later)[rows, columns]

    def mapped(self, maps: Array) -> tuple[Array, Array]:
        """Return partial derivatives and covariances of what is read; variances that are rounding are zero."""
        padded = np.pad(maps, ((0, 0), (0, 1)))
        own = padded[:, self.kept].transpose(1, 0, 2)
        return maps @ self.partials, map_covariances(own, self.covariances)
