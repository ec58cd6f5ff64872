"""Timelines of textbook systems, of arbitrary systems, and what one large linear map makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import (
    FilterSteps,
    Instants,
    Start,
    StepNoise,
    Steps,
    Timeline,
    TimelineFilter,
    Updates,
)


def timeline_of(
    steps: Steps, start: Start, processes: Sequence[str], outputs: Array, updates: Updates | None = None,
    filtered: TimelineFilter | None = None, is_update: Array | None = None, **more: object,
) -> Timeline:  # fmt: skip
    """Return a timeline of tables, an instant a second; steps alone unless the order is given."""
    is_update = np.zeros(len(steps.transitions), dtype=bool) if is_update is None else is_update

    def some(first: int, last: int) -> Steps:
        noise = {
            name: StepNoise(
                of.rows,
                None if of.covariance is None else of.covariance[first:last],
                None if of.factor is None else of.factor[first:last],
            )
            for name, of in steps.noise.items()
        }
        return Steps(steps.transitions[first:last], steps.inputs[first:last], noise)

    # an instant at the start and after each step: before and after the updates that follow it
    places = np.concatenate([[0], np.flatnonzero(~is_update) + 1])
    after = np.append(places[1:] - 1, len(is_update))
    instants = Instants(np.arange(len(places), dtype=float), places, after)
    return Timeline(
        start, is_update, some, instants, lambda position, time: outputs, tuple(processes), updates=updates,
        filter=filtered, **more,
    )  # fmt: skip


def arbitrary(seed: int, count: int, knows_truth: bool = False) -> Timeline:
    """Return a system of 6 states and 2 sources: 4 states of all, of which 3 are filtered, and a bias by process.

    A filter that knows the truth has the first 4 states and both biases, and no source but its start's.
    """
    random = np.random.default_rng(seed)
    is_update = random.random(count) < 0.4
    steps, updates = int((~is_update).sum()), int(is_update.sum())
    transitions = np.eye(6) + 0.3 * random.normal(size=(steps, 6, 6))
    transitions *= 0.8
    transitions[:, 4:, :4] = transitions[:, 4, 5][:, None, None] = transitions[:, 5, 4][:, None, None] = 0.0
    transitions[:, 4, 5] = transitions[:, 5, 4] = 0.0
    root = random.normal(size=(steps, 3, 3))
    noise = {
        "one": StepNoise(np.array([0, 2, 4]), covariance=root @ root.swapaxes(1, 2)),
        "other": StepNoise(np.array([1, 5]), factor=random.normal(size=(steps, 2, 1))),
    }
    sizes = random.integers(1, 3, size=updates)
    within = (np.arange(2) < sizes[:, None]).astype(float)
    seen = random.normal(size=(updates, 2, 6)) * within[:, :, None]
    variances = {"one": within * [0.0, 0.4], "third": within * random.uniform(0.2, 1.0, size=(updates, 2))}
    sources = 0.0 if knows_truth else 1.0
    inputs = sources * random.normal(size=(steps, 6, 3))
    inputs[:, 4:] = 0.0
    disturbances = sources * random.normal(size=(updates, 2, 3)) * within[:, :, None]
    start_root = random.normal(size=(6, 3))
    started = {"one": np.diag([0.0, 0.0, 0.0, 0.0, 2.0, 0.0])}
    if knows_truth:
        started["other"] = np.diag([0.5, 1.0, 1.5, 2.0, 0.0, 1.0])
    start = Start(sources * start_root, started)
    f = 6 if knows_truth else 3
    processes = {"one": 2.0, "other": 0.3}
    total = sum(processes[name] * spread(of, 6) for name, of in noise.items())
    believed = sum(processes[name] * of for name, of in started.items()) if knows_truth else np.eye(3)
    filter_transitions = transitions[:, :f, :f] if knows_truth else transitions[:, :3, :3] * 0.9
    filtered = TimelineFilter(
        lambda first, last: FilterSteps.of(filter_transitions[first:last], total[first:last, :f, :f]), seen[:, :, :f],
        sum(variances.values()) if knows_truth else within * 0.7, believed, np.ones(f), np.eye(6, f),
        lambda position: (np.eye(f, 6), np.zeros((f, 3))),
    )  # fmt: skip
    biases = {"one": np.array([4]), "other": np.array([5])}
    if knows_truth:  # corrections move the biases' errors
        biases = {}
    return timeline_of(
        Steps(transitions, inputs, noise), start, ("one", "other", "third"), random.normal(size=(2, 6)),
        Updates(sizes, seen, disturbances, variances), filtered, is_update, biases=biases, sizes=processes,
    )  # fmt: skip


def spread(noise: StepNoise, states: int) -> Array:
    """Return the covariance of all states that noise adds in each step."""
    total = np.zeros((len(noise.covariances), states, states))
    total[:, noise.rows[:, None], noise.rows] = noise.covariances
    return total


@dataclass(frozen=True)
class OneMap:
    """X at every position and every innovation as one linear map of c and of independent standard normals.

    Attributes
    ----------
    states : list of ndarray, shape (n, N)
        At each position from the begin on.
    innovations : dict of int to ndarray, shape (m, N)
        By number of the update.
    process : ndarray of str, shape (N,)
        To which process each normal belongs; of c it is empty.
    """

    states: list[Array]
    innovations: dict[int, Array]
    process: Array

    @classmethod
    def of(cls, timeline: Timeline, gains: Array | None, begin: int = 0, start: Start | None = None) -> OneMap:
        """Take the system through all its transitions, step by step, with all that drives it apart."""
        start = timeline.start if start is None else start
        constants = np.eye(timeline.sources + 1) if start.constants is None else start.constants
        columns, process = [start.partials], [""] * (timeline.sources + 1)
        state, states, innovations = start.partials, [], {}

        def add(state: Array, driven: Array, name: str) -> Array:
            process.extend([name] * driven.shape[1])
            return np.concatenate([state, driven], axis=1)

        for name, covariance in timeline.sized(start.noise).items():
            values, vectors = np.linalg.eigh(covariance)
            state = add(state, vectors * np.sqrt(np.maximum(values, 0.0)), name)
        del columns
        states.append(state)
        for position in range(begin, timeline.end):
            if not timeline.is_update[position]:
                number = int(timeline.steps_before[position])
                step = timeline.steps(number, number + 1)
                state = step.transitions[0] @ state
                state[:, : timeline.sources + 1] += step.inputs[0] @ constants
                for name, of in step.noise.items():
                    factor = np.linalg.cholesky(of.covariance[0]) if of.factor is None else of.factor[0]
                    factor = np.sqrt(timeline.sizes.get(name, 1.0)) * factor
                    driven = np.zeros((timeline.states, factor.shape[1]))
                    driven[of.rows] = factor
                    state = add(state, driven, name)
            else:
                u = int(timeline.updates_before[position])
                m = int(timeline.updates.sizes[u])
                innovation = timeline.updates.responses[u, :m] @ state
                innovation[:, : timeline.sources + 1] += timeline.updates.disturbances[u, :m] @ constants
                for name, variances in timeline.updates.variances.items():
                    innovation = np.concatenate([innovation, np.diag(np.sqrt(variances[u, :m]))], axis=1)
                    state = add(state, np.zeros((timeline.states, m)), name)
                state = state - timeline.filter.place @ gains[u, :, :m] @ innovation
                innovations[u] = innovation
            states.append(state)
        return cls(states, innovations, np.array(process))

    def padded(self, rows: Array) -> Array:
        """Return rows of an earlier position with zeros for the normals of later ones."""
        return np.pad(rows, ((0, 0), (0, len(self.process) - rows.shape[1])))

    def covariance(self, rows: Array, name: str | None = None) -> Array:
        """Return the covariance of rows by a process, or by all."""
        of = self.process[: rows.shape[1]]
        own = rows[:, (of == name) if name is not None else (of != "")]
        return own @ own.T


def constant_velocity(
    count: int, interval: float, spectral: float, sigma: float, start: Array, believed: float | None = None
) -> Timeline:
    """Return position and velocity driven by white acceleration, with a position fix after each step.

    The errors are those of the estimate, so that the filter knows the truth, but for the sigma of the fixes where it
    believes another one.
    """
    transition = np.array([[1.0, interval], [0.0, 1.0]])
    noise = spectral * np.array([[interval**3 / 3.0, interval**2 / 2.0], [interval**2 / 2.0, interval]])
    transitions, covariances = np.tile(transition, (count, 1, 1)), np.tile(noise, (count, 1, 1))
    fixes = np.tile(np.array([[[1.0, 0.0]]]), (count, 1, 1))
    variances = np.full((count, 1), sigma**2)
    of_filter = variances if believed is None else np.full((count, 1), believed**2)
    filtered = TimelineFilter(
        lambda first, last: FilterSteps.of(transitions[first:last], covariances[first:last]), fixes, of_filter, start,
        np.ones(2), np.eye(2), lambda position: (np.eye(2), np.zeros((2, 1))),
    )  # fmt: skip
    return timeline_of(
        Steps(transitions, np.zeros((count, 2, 1)), {"acceleration": StepNoise(np.arange(2), covariances)}),
        Start(np.zeros((2, 1)), {"start": start}), ("start", "acceleration", "fix"), np.eye(2),
        Updates(np.ones(count, dtype=np.int64), fixes, np.zeros((count, 1, 1)), {"fix": variances}), filtered,
        np.tile([False, True], count),
    )  # fmt: skip


def started_anywhere(timeline: Timeline) -> Timeline:
    """Return a timeline whose navigator may start anywhere: with other partial derivatives, constants and noise."""
    turned = np.diag([1.0, -2.0, 1.0])[: timeline.sources + 1, : timeline.sources + 1]

    def begin(position: int) -> Start:
        scale = 1.0 + 0.1 * position
        noise = {name: scale * covariance for name, covariance in timeline.start.noise.items()}
        own = None if timeline.filter is None else scale * timeline.filter.covariance
        return Start(scale * timeline.start.partials, noise, turned, own)

    return replace(timeline, begin=begin)


def without_updates(timeline: Timeline) -> Timeline:
    """Return the steps of a timeline alone."""
    kept: IndexArray = np.arange(int(timeline.steps_before[-1]) + 1)
    instants = Instants(kept.astype(float), kept, kept)
    return replace(
        timeline, is_update=np.zeros(len(kept) - 1, dtype=bool), instants=instants, updates=None, filter=None
    )
