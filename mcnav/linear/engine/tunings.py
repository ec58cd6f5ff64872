"""Mean and covariance of X, and the filter's own covariance, for many tunings of one timeline in one pass.

Tunings share transitions and differ in sizes, hence in gains. Step by step, with a first axis of N tunings::

    step     C+ = A C A' + Q          S+ = A S + B                  P+ = F P F' + Q_f
    update   C+ by Joseph's form with M K      S+ = S - M K (H S + D)      K, P+ as in `design`

C is the covariance by noise, S the partial derivatives to the error sources. N products of small matrices cost little
more than one of them, so that this takes a fraction of `design` and `propagate` for each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import innovation_covariance, step, update
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import StepNoise, Timeline
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.design import filter_of, is_definite
from mcnav.linear.engine.transitions import bounds

TOGETHER: int = 48
"""Tunings of one pass."""


@dataclass(frozen=True)
class Tuned:
    """X of a tuning at some positions, r of them.

    Attributes
    ----------
    partials : ndarray, shape (r, n, used + 1)
        To the error sources that are used, and what is deterministic.
    covariances : ndarray, shape (r, n, n)
        By all processes of noise.
    own : ndarray, shape (r, f, f)
        As the filter computes it.
    """

    partials: Array
    covariances: Array
    own: Array


def propagate_tunings(timelines: Sequence[Timeline], positions: IndexArray, used: NDArray[np.bool_]) -> list[Tuned]:
    """Propagate tunings of one timeline, each with gains of its own, from its start to rising positions.

    Each has the bits that it has in any other company. All is NaN where the covariance of an innovation is not positive
    definite.

    Parameters
    ----------
    used : ndarray of bool, shape (s,)
        Error sources that are propagated.
    """
    tuned: list[Tuned] = []
    for first in range(0, len(timelines), TOGETHER):
        tuned += _Pass(timelines[first : first + TOGETHER], np.append(used, True)).run(positions)
    return tuned


class _Pass:
    """A pass along a timeline.

    Attributes
    ----------
    own, covariance, partials : ndarray, shapes (N, f, f), (N, n, n), (N, n, used + 1)
        P, C and S at present.
    """

    def __init__(self, timelines: Sequence[Timeline], used: NDArray[np.bool_]) -> None:
        filters = [filter_of(timeline) for timeline in timelines]
        self.timelines, self.filters, self.used, updates = timelines, filters, used, timelines[0].updates
        assert updates is not None
        self.updates, states = updates, timelines[0].states
        self.own = np.stack([filtered.covariance for filtered in filters])
        self.partials = np.stack([timeline.start.partials[:, used] for timeline in timelines])
        self.covariance = np.zeros((len(timelines), states, states))
        for total, timeline in zip(self.covariance, timelines, strict=True):
            for covariance in timeline.sized(timeline.start.noise).values():
                total += covariance
        self.definite = np.ones(len(timelines), dtype=np.bool_)

    def run(self, positions: IndexArray) -> list[Tuned]:
        """Run to the last position, and read out."""
        timeline = self.timelines[0]
        tables = self.partials, self.covariance, self.own
        read = tuple(np.zeros((len(positions), *table.shape)) for table in tables)
        reading, wanted = 0, [*positions.tolist(), -1]
        with one_thread():
            for first, last in bounds(0, int(positions[-1])):
                steps = self._steps(*timeline.steps_before[[first, last]].tolist())
                updates = _Updates.of(self, *timeline.updates_before[[first, last]].tolist())
                u = 0
                for position, is_update in enumerate(timeline.is_update[first:last].tolist(), first):
                    if position == wanted[reading]:
                        self._read(read, reading)
                        reading += 1
                    if is_update:
                        self._update(updates, u, int(updates.sizes[u]))
                        u += 1
                    else:
                        self._step(*next(steps))
                self.definite &= updates.definite
        self._read(read, -1)
        return [self._tuned(number, read) for number in range(len(self.timelines))]

    def _read(self, read: Sequence[Array], reading: int) -> None:
        for table, state in zip(read, (self.partials, self.covariance, self.own), strict=True):
            table[reading] = state

    def _tuned(self, number: int, read: Sequence[Array]) -> Tuned:
        """Return what was read of a tuning; NaN where one of its innovations has no definite covariance."""
        definite = self.definite[number]
        return Tuned(*(table[:, number] if definite else np.full_like(table[:, number], np.nan) for table in read))

    def _steps(self, first: int, last: int) -> Iterator[tuple[_Noise, _Noise, int, Array, Array, Array]]:
        """Yield Q and Q_f of each tuning with the number of a step, and its A, B and F."""
        steps, own = self.timelines[0].steps(first, last), self.filters[0].steps(first, last)
        noise = _Noise.of(last - first, steps.noise, [timeline.sizes for timeline in self.timelines])
        believed = _Noise.of(last - first, own.noise, [filtered.sizes for filtered in self.filters])
        inputs = steps.inputs[:, :, self.used]
        for number, tables in enumerate(zip(steps.transitions, inputs, own.transitions, strict=True)):
            yield noise, believed, number, *tables

    def _step(self, noise: _Noise, believed: _Noise, number: int, transition: Array, inputs: Array, own: Array) -> None:
        self.own = step(self.own, own, believed.covariances[:, number], believed.rows)
        self.covariance = step(self.covariance, transition, noise.covariances[:, number], noise.rows)
        self.partials = transition @ self.partials
        self.partials += inputs

    def _update(self, updates: _Updates, u: int, m: int) -> None:
        filtered, believed = self.filters[0], updates.believed[u, :, :m]
        own_response, response = updates.own_responses[u, :m], updates.responses[u, :m]
        cross, innovations = innovation_covariance(self.own, own_response)
        innovations.reshape(len(innovations), -1)[:, :: m + 1] += believed
        updates.innovations[u, :, :m, :m] = innovations
        gains = (np.linalg.inv(innovations) @ cross).swapaxes(1, 2) * filtered.corrected[:, None]
        self.own = update(self.own, cross, gains, own_response, believed)
        gains = filtered.place @ gains
        measured = updates.measured[u, :, :m]
        self.covariance = update(self.covariance, response @ self.covariance, gains, response, measured)
        self.partials -= gains @ (response @ self.partials + updates.disturbances[u, :m])


@dataclass(frozen=True)
class _Updates:
    """Some updates of a pass, u of them.

    Attributes
    ----------
    own_responses, responses, disturbances : ndarray, shapes (u, M, f), (u, M, n), (u, M, used + 1)
    believed, measured : ndarray, shape (u, N, M)
        Variances by update and component, of each tuning.
    innovations : ndarray, shape (u, N, M, M)
        Their covariances, as they become known.
    """

    sizes: IndexArray
    own_responses: Array
    responses: Array
    disturbances: Array
    believed: Array
    measured: Array
    innovations: Array

    @classmethod
    def of(cls, of: _Pass, first: int, last: int) -> _Updates:
        """Take the updates from the first to before the last."""
        all_updates, rows = [timeline.updates for timeline in of.timelines], slice(first, last)
        believed = np.stack([filtered.variances[rows] for filtered in of.filters], axis=1)
        measured = np.zeros_like(believed)
        for number, updates in enumerate(all_updates):
            assert updates is not None
            measured[:, number] = sum((table[rows] for table in updates.variances.values()), measured[:, number])
        return cls(
            of.updates.sizes[rows], of.filters[0].responses[rows], of.updates.responses[rows],
            of.updates.disturbances[rows][:, :, of.used], believed, measured,
            np.zeros((*believed.shape, believed.shape[2])),
        )  # fmt: skip

    @property
    def definite(self) -> NDArray[np.bool_]:
        """Tunings of which all innovations have a positive definite covariance, shape (N,)."""
        count, most = self.innovations.shape[1:3]
        if is_definite(self.innovations.reshape(-1, most, most), np.repeat(self.sizes, count)):
            return np.ones(count, dtype=np.bool_)
        return np.array([is_definite(each, self.sizes) for each in self.innovations.swapaxes(0, 1)], dtype=np.bool_)


@dataclass(frozen=True)
class _Noise:
    """Noise that all processes add in k steps, with the sizes of each of N tunings.

    Attributes
    ----------
    rows : slice
        States to which they add.
    covariances : ndarray, shape (N, k, r, r)
    """

    rows: slice
    covariances: Array

    @classmethod
    def of(cls, count: int, noise: Mapping[str, StepNoise], sizes: Sequence[Mapping[str, float]]) -> _Noise:
        """Add up processes of size one in so many steps."""
        every = np.concatenate([np.zeros(0, dtype=np.int64), *(added.rows for added in noise.values())])
        rows = slice(int(every.min()), int(every.max()) + 1) if len(every) else slice(0, 0)
        units = np.zeros((len(noise), count, rows.stop - rows.start, rows.stop - rows.start))
        for unit, added in zip(units, noise.values(), strict=True):
            places = added.rows - rows.start
            unit[:, places[:, None], places] = added.covariances
        total = np.empty((len(sizes), *units.shape[1:]))
        flat = units.reshape(len(units), total[:1].size)
        for sized, of in zip(total, sizes, strict=True):  # one by one: the bits of each are its own
            np.matmul(np.array([of.get(name, 1.0) for name in noise]), flat, out=sized.reshape(-1))
        return cls(rows, total)
