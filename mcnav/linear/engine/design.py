"""A filter's gains and its own covariance along a timeline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dposv

from mcnav.arrays.products import innovation_covariance, step, update
from mcnav.arrays.rows import Rows, Table
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline, TimelineFilter, add_up_noise
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_gains, check_positions
from mcnav.linear.engine.transitions import BLOCK, bounds

FLOAT: Final = 8
"""Bytes of a number."""

KEPT: Final = 32_000_000
"""Bytes of gains and roots that are kept; those of more updates are computed again from P at the begin of a block."""


@dataclass(frozen=True)
class Design:
    """A filter's gains for U updates, and its covariance at some positions, r of them.

    Attributes
    ----------
    gains, roots : ndarray or Rows, shapes (U, f, M), (U, M, M)
        K, and the Cholesky factor of S; zero before the start and after the last position.
    positions : ndarray of int, shape (r,)
    covariances : ndarray, shape (r, f, f)
        P there.
    """

    gains: Table
    roots: Table
    positions: IndexArray
    covariances: Array


def filter_of(timeline: Timeline) -> TimelineFilter:
    """Return the filter of a timeline; ValueError where there is none."""
    if timeline.filter is None:
        raise ValueError("timeline: has no filter")
    return timeline.filter


def design(
    timeline: Timeline, positions: ArrayLike = (), begin: int = 0, start: Start | None = None,
    gains: Table | None = None,
) -> Design:  # fmt: skip
    """Compute a filter's gains, and its covariance at positions, in any order.

    Parameters
    ----------
    begin : int
        Position of the start.
    start : Start, optional
        The start there, where it is not that of the timeline.
    gains : ndarray or Rows, shape (U, f, M), optional
        Gains that are held, whatever the filter's tuning; else they are computed.

    All are NaN from an update on whose innovation has no positive definite covariance.
    """
    wanted = check_positions(timeline, positions, begin)
    filtered = filter_of(timeline)
    check_gains(timeline, gains)
    count, most, size = filtered.responses.shape
    given = None if start is None else start.filter_covariance
    covariance = filtered.covariance if given is None else given
    covariances, blocks = np.zeros((len(wanted), size, size)), _Blocks(timeline, filtered, gains, begin)
    readings = {position: np.flatnonzero(wanted == position) for position in set(wanted.tolist())}
    kept = count * most * (size + most) * FLOAT <= KEPT
    tables = (np.zeros((count, size, most)), np.zeros((count, most, most))) if kept else None
    with one_thread():
        for first, last in bounds(begin, timeline.end):
            blocks.started.append(covariance)
            covariance, *of_block = blocks.design(covariance, first, last, readings, covariances)
            if tables is not None:
                for table, rows in zip(tables, of_block, strict=True):
                    table[slice(*timeline.updates_before[[first, last]].tolist())] = rows
    if timeline.end in readings:
        covariances[readings[timeline.end]] = covariance
    if tables is not None:
        return Design(*tables, wanted, covariances)
    return Design(
        Rows((count, size, most), partial(blocks.rows, 0)), Rows((count, most, most), partial(blocks.rows, 1)), wanted,
        covariances,
    )  # fmt: skip


@dataclass
class _Blocks:
    """A filter's gains in blocks of transitions from a position on.

    Attributes
    ----------
    held : ndarray or Rows, shape (U, f, M), optional
        Gains that are held.
    started : list of ndarray, shape (f, f)
        P at the begin of each block.
    """

    timeline: Timeline
    filtered: TimelineFilter
    held: Table | None
    begin: int
    started: list[Array] = field(default_factory=list)
    _latest: tuple[int, tuple[Array, Array]] | None = None

    def rows(self, which: int, first: int, last: int) -> Array:
        """Return gains (0) or roots (1) of updates by their numbers, computed from P at the begin of their blocks."""
        before, ends = self.timeline.updates_before, bounds(self.begin, self.timeline.end)
        size, most = len(self.filtered.covariance), self.filtered.responses.shape[1]
        rows = np.zeros((last - first, size if which == 0 else most, most))
        for number in range(*self._numbers(first, last)):
            begin, end = before[list(ends[number])].tolist()
            low, high = max(first, begin), min(last, end)
            if low < high:
                rows[low - first : high - first] = self._block(number, *ends[number])[which][low - begin : high - begin]
        return rows

    def _numbers(self, first: int, last: int) -> tuple[int, int]:
        """Return the first and past the last number of the blocks that may have updates from one to before another."""
        places = np.searchsorted(self.timeline.updates_before, [first + 1, last]) - 1  # positions before them
        low, high = np.maximum(places - self.begin, 0).tolist()
        return low // BLOCK, min(high // BLOCK + 1, len(self.started))

    def _block(self, number: int, first: int, last: int) -> tuple[Array, Array]:
        latest = self._latest
        if latest is None or latest[0] != number:
            with one_thread():
                _, *tables = self.design(self.started[number], first, last, {}, np.zeros(0))
            latest = self._latest = number, (tables[0], tables[1])
        return latest[1]

    def design(
        self, covariance: Array, first: int, last: int, readings: Mapping[int, IndexArray], covariances: Array
    ) -> tuple[Array, Array, Array]:
        """Design from one position to another: return P there, and the gains and roots of the updates between.

        P at the readings, by position, is written to covariances.
        """
        timeline, filtered = self.timeline, self.filtered
        begin, end = timeline.updates_before[[first, last]].tolist()
        steps = filtered.steps(*timeline.steps_before[[first, last]].tolist())
        noise = add_up_noise(steps.noise, filtered.sizes, len(steps.transitions), len(covariance))
        sizes = np.zeros(0, np.int64) if timeline.updates is None else timeline.updates.sizes[begin:end]
        responses, variances = filtered.responses[begin:end], filtered.variances[begin:end]
        most = variances.shape[1]
        gains = np.zeros((end - begin, len(covariance), most)) if self.held is None else self.held[begin:end]
        innovations, measured = np.zeros((end - begin, most, most)), variances[:, :, None] * np.eye(most)
        considers, u, number = not filtered.corrected.all(), 0, 0
        for position, is_update in enumerate(timeline.is_update[first:last].tolist(), first):
            if position in readings:
                covariances[readings[position]] = covariance
            if not is_update:
                covariance = step(covariance, steps.transitions[number], noise[number])
                number += 1
                continue
            m = int(sizes[u])
            response, gain = responses[u, :m], gains[u, :, :m]
            cross, innovation = innovation_covariance(covariance, response)
            innovation += measured[u, :m, :m]
            innovations[u, :m, :m] = innovation
            if self.held is None:
                _, solved, failed = dposv(innovation, cross, lower=1)
                gain[:] = np.nan if failed else solved.T
                if considers:
                    gain *= filtered.corrected[:, None]
            covariance = update(covariance, cross, gain, response, variances[u, :m])
            u += 1
        return covariance, gains, _roots(innovations, sizes)


def _roots(innovations: Array, sizes: IndexArray) -> Array:
    """Return the Cholesky factors of innovations' covariances, shape (U, M, M), zero beyond their sizes.

    They are NaN where a covariance is not positive definite.
    """
    beyond = np.arange(innovations.shape[1]) >= sizes[:, None]
    added = beyond[:, :, None] * np.eye(innovations.shape[1])
    try:
        return np.asarray(np.linalg.cholesky(innovations + added) - added)
    except np.linalg.LinAlgError:
        if len(innovations) == 1:
            return np.full(innovations.shape, np.nan)
        return np.concatenate([_roots(*one) for one in zip(innovations[:, None], sizes[:, None], strict=True)])


def is_definite(innovations: Array, sizes: IndexArray) -> bool:
    """Return whether all covariances of innovations, shape (U, M, M), are positive definite up to their sizes."""
    return bool(np.isfinite(_roots(innovations, sizes)).all())
