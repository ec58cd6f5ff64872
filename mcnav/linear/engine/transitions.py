"""Transitions of a timeline in blocks, with updates closed by gains.

With gains an update is a transition like any other: ``A = I - M K H``, ``B = -M K D``, and the noise of process j is
``-M K v_j``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Steps, Timeline, add_up_noise
from mcnav.linear.engine.noise import Noise

BLOCK: Final = 256
"""Transitions that are expanded at the same time."""

TOGETHER: Final = "all processes"
"""Name of all processes added up."""


@dataclass(frozen=True)
class Block:
    """Transitions from one position to another, k of them.

    Attributes
    ----------
    transitions, inputs : ndarray, shapes (k, n, n), (k, n, s + 1)
        A and B.
    noise : mapping of str to tuple of Noise
        By process: of steps, and of updates.
    """

    transitions: Array
    inputs: Array
    noise: Mapping[str, tuple[Noise, ...]]


def bounds(first: int, last: int) -> list[tuple[int, int]]:
    """Divide positions into blocks, in order.

    >>> bounds(0, 600)
    [(0, 256), (256, 512), (512, 600)]
    """
    return [(begin, min(begin + BLOCK, last)) for begin in range(first, last, BLOCK)]


def expand(
    timeline: Timeline, gains: Table | None, first: int, last: int, constants: Array | None = None,
    together: bool = False,
) -> Block:  # fmt: skip
    """Expand the transitions between two positions.

    Parameters
    ----------
    gains : ndarray or Rows, shape (U, f, M), optional
        K; none where there are no updates in between.
    constants : ndarray, shape (s + 1, s + 1), optional
        E, by which B is multiplied.
    together : bool
        All processes are one, `TOGETHER`.
    """
    states, sources = timeline.states, timeline.sources
    is_update = timeline.is_update[first:last]
    transitions = np.empty((last - first, states, states))
    inputs = np.empty((last - first, states, sources + 1))
    noise: dict[str, tuple[Noise, ...]] = {}
    places = np.flatnonzero(~is_update)
    if len(places):
        steps = timeline.steps(*timeline.steps_before[[first, last]].tolist())
        transitions[places], inputs[places] = steps.transitions, steps.inputs
        if together:
            total = add_up_noise(steps.noise, timeline.sizes, len(places), states)
            noise = {TOGETHER: (Noise(places, np.arange(states), total, None),)}
        else:
            noise = noise_of_steps(timeline, steps, places)
    if is_update.any():
        _expand_updates(timeline, gains, together, first, last, transitions, inputs, noise)
    return Block(transitions, inputs if constants is None else inputs @ constants, noise)


def noise_of_steps(timeline: Timeline, steps: Steps, places: IndexArray) -> dict[str, tuple[Noise, ...]]:
    """Return the noise of steps by process, at their places in a block."""
    return {
        name: (Noise(places, of.rows, of.covariance, of.factor, timeline.sizes.get(name, 1.0)),)
        for name, of in steps.noise.items()
    }


def _expand_updates(
    timeline: Timeline, gains: Table | None, together: bool, first: int, last: int, transitions: Array, inputs: Array,
    noise: dict[str, tuple[Noise, ...]],
) -> None:  # fmt: skip
    """Write the updates between two positions into a block."""
    updates, place = timeline.updates, timeline.filter
    if gains is None or updates is None or place is None:
        raise ValueError("gains: got none, expected those of the updates of the timeline")
    places = np.flatnonzero(timeline.is_update[first:last])
    numbers = slice(*timeline.updates_before[[first, last]].tolist())
    corrections = -(place.place @ gains[numbers])
    transitions[places] = np.eye(timeline.states) + corrections @ updates.responses[numbers]
    inputs[places] = corrections @ updates.disturbances[numbers]
    rows = np.flatnonzero(place.place.any(axis=1))
    by_process = {name: table[numbers] for name, table in updates.variances.items()}
    if together and by_process:
        by_process = {TOGETHER: np.add.reduce(list(by_process.values()))}
    for name, variances in by_process.items():
        u, c = np.nonzero(variances)
        if len(u):
            factor = corrections[u, :, c][:, rows] * np.sqrt(variances[u, c])[:, None]
            noise[name] = (*noise.get(name, ()), Noise(places[u], rows, None, factor[:, :, None]))
