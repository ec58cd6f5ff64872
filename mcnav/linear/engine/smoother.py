"""Linear covariance of a smoother behind a filter: what it computes, and its true errors.

The smoother is the expectation, by the filter's own model, of the errors z of the filter's states at a position, given
all innovations n up to an end (Bryson and Ho 1975, *Applied Optimal Control*, section 13.2; Bierman 1973, *Fixed
interval smoothing with discrete measurements*). With the filter's F, H, K, S and P, backwards from the end::

    lambda- = H' S^-1 n + (I - K H)' lambda+        lambda+ (before) = F' lambda-        z - P lambda

is what is left of the errors. By the filter's model lambda has the covariance Lambda, and the smoother computes
``P - P Lambda P``. In truth lambda is linear in X, in later noise and in constants: ``lambda = L X + J c + (later
noise)``. With the timeline's A, B, H_t, D and M::

    N  = H' S^-1 - (I - K H)' L+ M K                of an innovation
    L- = N H_t + (I - K H)' L+                      L+ (before) = F' L- A
    J- = N D + (I - K H)' J+                        J+ (before) = F' (J- + L- B)

and later noise of process j has the covariance ``sum_k Z_k Q_jk Z_k'``, where Z is L after a step, or N of an update,
multiplied by the filter's products back to the position.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Timeline, TimelineFilter, Updates
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_positions
from mcnav.linear.engine.design import Design, filter_of
from mcnav.linear.engine.noise import Noise
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.transitions import bounds, noise_of_steps

SAME_INSTANT: Final = 1e-6
"""Times that differ by no more, s, are the same: a lag is written to fewer digits."""


@dataclass(frozen=True)
class Smoothed:
    """Errors z of the filter's states behind a smoother at some positions, r of them.

    Attributes
    ----------
    claimed : ndarray, shape (r, f, f)
        The smoother's own covariance.
    partials : ndarray, shape (r, f, s + 1)
    covariances : ndarray, shape (r, processes, f, f)
        By process of noise.
    """

    claimed: Array
    partials: Array
    covariances: Array


def ends_of_lag(timeline: Timeline, positions: IndexArray, lag: float) -> IndexArray:
    """Return the last positions whose measurements count at positions, given those up to a lag later, s."""
    times = np.array([timeline.time_at(position) for position in positions.tolist()])
    last = np.searchsorted(timeline.instants.times, times + lag + SAME_INSTANT, side="right") - 1
    return np.asarray(np.maximum(timeline.instants.after[last], positions), dtype=np.int64)


def smooth(timeline: Timeline, designed: Design, positions: ArrayLike, lag: float = np.inf) -> Smoothed:
    """Compute the errors behind a smoother at positions, in any order.

    Parameters
    ----------
    designed : Design
        Gains of all updates, and the filter's covariance at the positions, in the same order.
    lag : float
        s; infinite where all measurements up to the end are given.

    Raises
    ------
    ValueError
        With considered states, of which the covariance that a smoother computes may be negative; of a negative lag.
    """
    wanted = check_positions(timeline, positions)
    filtered = filter_of(timeline)
    if not filtered.corrected.all():
        raise ValueError("smoother: expected a filter without considered states, whose own covariance may be negative")
    if not lag >= 0.0:
        raise ValueError(f"lag: got {lag:g} s, expected none that is negative")
    if not np.array_equal(designed.positions, wanted):
        raise ValueError("designed: expected the filter's covariance at the positions of the smoother")
    states = np.eye(timeline.states)
    forward = propagate(timeline, designed.gains, wanted, maps=lambda _: states)
    size, names = len(filtered.covariance), timeline.processes
    claimed, partials = np.empty((len(wanted), size, size)), np.empty((len(wanted), size, timeline.sources + 1))
    covariances = np.empty((len(wanted), len(names), size, size))
    ends = ends_of_lag(timeline, wanted, lag)
    with one_thread():
        for end in np.unique(ends).tolist():
            of_end = np.flatnonzero(ends == end)
            for position, back in _run_back(timeline, filtered, designed, np.unique(wanted[of_end]), end):
                of_state, of_constants = filtered.true_errors(position)
                for place in of_end[wanted[of_end] == position].tolist():
                    covariance = designed.covariances[place]
                    left = of_state - covariance @ back.state
                    claimed[place] = covariance - transform(covariance, back.own)
                    partials[place] = left @ forward.partials[place] + of_constants - covariance @ back.constants
                    covariances[place] = transform(left, forward.covariances[place])
                    covariances[place] += transform(covariance, back.noise)
    return Smoothed(claimed, partials, covariances)


@dataclass
class _Back:
    """The backward recursion.

    Attributes
    ----------
    own : ndarray, shape (f, f)
        Lambda.
    state, constants : ndarray, shapes (f, n), (f, s + 1)
        L and J.
    noise : ndarray, shape (processes, f, f)
        Covariance by later noise.
    """

    own: Array
    state: Array
    constants: Array
    noise: Array


def _run_back(
    timeline: Timeline, filtered: TimelineFilter, designed: Design, positions: IndexArray, end: int
) -> Iterator[tuple[int, _Back]]:
    """Run back from an end to rising positions, and yield the recursion at each, the last first."""
    size, names = len(filtered.covariance), timeline.processes
    back = _Back(
        np.zeros((size, size)), np.zeros((size, timeline.states)), np.zeros((size, timeline.sources + 1)),
        np.zeros((len(names), size, size)),
    )  # fmt: skip
    left = positions.tolist()
    if left[-1] == end:
        yield left.pop(), back
    for first, last in reversed(bounds(left[0] if left else end, end)):
        inner = [position for position in left if first < position < last]
        cuts = [first, *inner, last]
        stretches = _Stretches(timeline, filtered, designed, first, last)
        for low, high in reversed(list(pairwise(cuts))):
            stretches.take_back(back, low, high)
            if left and left[-1] == low:
                yield left.pop(), back


class _Stretches:
    """Transitions from one position to another, over which the recursion is taken back."""

    def __init__(self, timeline: Timeline, filtered: TimelineFilter, designed: Design, first: int, last: int) -> None:
        self.timeline, self.filtered, self.first = timeline, filtered, first
        numbers = timeline.steps_before[[first, last]].tolist()
        self.steps, self.own_steps = timeline.steps(*numbers), filtered.steps(*numbers)
        self.places = np.flatnonzero(~timeline.is_update[first:last])
        self.noise = noise_of_steps(timeline, self.steps, self.places)
        self.first_update, end = timeline.updates_before[[first, last]].tolist()
        every = Updates.none(timeline.states, timeline.sources) if timeline.updates is None else timeline.updates
        self.updates = every.between(self.first_update, end)
        self.true, self.disturbances = self.updates.responses[:], self.updates.disturbances[:]
        self.responses, self.gains, self.roots = (
            table[self.first_update : end] for table in (filtered.responses, designed.gains, designed.roots)
        )

    def take_back(self, back: _Back, low: int, high: int) -> None:
        """Take the recursion back from one position to an earlier one."""
        timeline, count, size = self.timeline, high - low, len(back.own)
        products, before = np.eye(size), int(timeline.steps_before[self.first])
        own, weights = np.empty((count, size, size)), np.empty((count, *back.state.shape))
        innovations = np.zeros((count, size, self.updates.responses.shape[1]))
        for k in range(count - 1, -1, -1):
            position = low + k
            if timeline.is_update[position]:
                u = int(timeline.updates_before[position]) - self.first_update
                own[k] = self._over_update(back, u, innovations[k])
                weights[k] = 0.0
                continue
            step = int(timeline.steps_before[position]) - before
            own[k] = over = self.own_steps.transitions[step].T
            weights[k] = over @ back.state
            back.constants = over @ (back.constants + back.state @ self.steps.inputs[step])
            back.state = weights[k] @ self.steps.transitions[step]
            back.own = transform(over, back.own)
        # the filter's products from the low position on, by which noise comes back to it
        for k in range(count):
            weights[k], innovations[k] = products @ weights[k], products @ innovations[k]
            products = products @ own[k]
        back.noise = transform(products, back.noise)
        for number, name in enumerate(timeline.processes):
            for of in self.noise.get(name, ()):
                back.noise[number] += of.between(low - self.first, high - self.first).through(weights)
            if name in self.updates.variances:
                back.noise[number] += self._of_updates(name, low, high).through(innovations)

    def _over_update(self, back: _Back, u: int, innovation: Array) -> Array:
        """Take the recursion back over one of the updates; write N, and return ``(I - K H)'``."""
        m = int(self.updates.sizes[u])
        response, gain, root = self.responses[u, :m], self.gains[u, :, :m], self.roots[u, :m, :m]
        left = -(gain @ response).T
        left.flat[:: len(left) + 1] += 1.0
        whitened = np.linalg.solve(root, response)
        weight = np.linalg.solve(root.T, whitened).T  # H' S^-1
        innovation[:, :m] = of_innovation = weight - left @ (back.state @ (self.filtered.place @ gain))
        back.own = whitened.T @ whitened + transform(left, back.own)
        back.constants = of_innovation @ self.disturbances[u, :m] + left @ back.constants
        back.state = of_innovation @ self.true[u, :m] + left @ back.state
        return left

    def _of_updates(self, name: str, low: int, high: int) -> Noise:
        """Return the noise of a process in the measurements between two positions."""
        places = np.flatnonzero(self.timeline.is_update[low:high])
        begin, end = (self.timeline.updates_before[[low, high]] - self.first_update).tolist()
        variances = self.updates.variances[name][begin:end]
        components = np.flatnonzero(variances.any(axis=0))
        roots = np.sqrt(variances[:, components])
        return Noise(places, components, None, roots[:, :, None] * np.eye(len(components)))
