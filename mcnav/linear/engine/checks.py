"""What the linear engine is given: one line for each mistake, and an empty answer for an empty question."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.rows import Table
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline


def check_positions(timeline: Timeline, positions: ArrayLike, first: int = 0, last: int | None = None) -> IndexArray:
    """Return positions in any order, perhaps none, as numbers.

    Raises
    ------
    ValueError
        Where one is not whole, before the first, or after the last, which is by default the end.
    """
    last = timeline.end if last is None else last
    numbers = np.asarray(positions)
    whole = numbers.astype(np.int64)
    wrong = numbers[(numbers != whole) | (whole < first) | (whole > last)]
    if len(wrong):
        raise ValueError(f"positions: got {wrong[0]:g}, expected whole numbers from {first} to {last}")
    return whole


def check_updates(timeline: Timeline, updates: ArrayLike) -> IndexArray:
    """Return numbers of updates; ValueError where there is no such update."""
    count, numbers = int(timeline.updates_before[-1]), np.asarray(updates, dtype=np.int64)
    wrong = numbers[(numbers < 0) | (numbers >= count)]
    if len(wrong):
        raise ValueError(f"updates: got {wrong[0]}; the timeline has {count}, from 0 on")
    return numbers


def check_gains(timeline: Timeline, gains: Table | None) -> None:
    """Raise ValueError where gains do not have the shape (U, f, M) of the timeline's filter."""
    if gains is None or timeline.filter is None:
        return
    count, most, size = timeline.filter.responses.shape
    if gains.shape != (count, size, most):
        raise ValueError(f"gains: got shape {gains.shape}, expected {(count, size, most)}")


def check_start(timeline: Timeline, start: Start) -> None:
    """Raise ValueError where a start is not one of the timeline's states and sources."""
    states, sources = timeline.states, timeline.sources
    if start.partials.shape != (states, sources + 1):
        raise ValueError(f"start.partials: got shape {start.partials.shape}, expected {(states, sources + 1)}")
    for name, noise in start.noise.items():
        if noise.shape != (states, states):
            raise ValueError(f"start.noise of {name}: got shape {noise.shape}, expected {(states, states)}")


def check_outputs(timeline: Timeline, outputs: Array) -> Array:
    """Return C; ValueError where it is not of the timeline's states."""
    if outputs.ndim != 2 or outputs.shape[1] != timeline.states:
        raise ValueError(f"outputs: got shape {outputs.shape}, expected (outputs, {timeline.states})")
    return outputs
