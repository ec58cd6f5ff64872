"""Samples of a loop whose noise is given what it adds to the linear outcomes of some outputs, and is random otherwise.

The noise of a sample is a vector z of independent standard normals, numbers of its streams in the order in which they
are drawn, and adds ``N z`` to the linear outcomes at an instant; conditions are those of `mcnav.systems.conditions`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, SENSORS, Noise
from mcnav.systems.closed_loop.plan import Plan
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.sizes import Sizes


def noise_partials(
    plan: Plan, maps: Maps, true: Sizes, readout: Readout, outputs: tuple[int, ...], end: int
) -> dict[int, Array]:
    """Compute N of some outputs at an instant by number, by stream, shape (m, numbers), backwards along the plan."""
    last = plan.instants[end]
    time = plan.end_time if end == plan.end else last.instant.time
    response = readout.partials(last.nominal, plan.steps, time)[list(outputs)]
    parts: dict[int, list[Array]] = {}
    impulses: dict[int, Array] = {}
    for number in range(end, -1, -1):
        planned = plan.instants[number]
        for update in reversed(planned.updates):
            if update.kind == "measure":
                sizes = true.measurements[update.number]
                parts.setdefault(SENSORS + update.number, []).append(response @ update.inputs * sizes)
            elif update.kind == "correct":
                sizes = true.corrections[update.number]
                parts.setdefault(CORRECTIONS + update.number, []).append(response @ update.inputs * sizes)
            response = response @ update.state
        if plan.begin is not None and number == plan.begin.number:
            response = response @ plan.begin.state
        for step in reversed(planned.steps):
            parts.setdefault(PROCESSES, []).append(response @ step.inputs * true.modes)
            for correction, inputs in step.corrections.items():
                added = response @ inputs * true.corrections[correction]
                impulses[correction] = impulses.get(correction, 0.0) + added
            response = response @ step.state
    if maps.structure.markov.size:
        parts.setdefault(PROCESSES, []).append(response[:, maps.structure.markov.whole] * true.markov)
    partials = {stream: np.concatenate(blocks[::-1], axis=1) for stream, blocks in parts.items()}
    return partials | {CORRECTIONS + number: impulse for number, impulse in impulses.items()}


def rows_of(partials: Sequence[Mapping[int, Array]]) -> tuple[Array, dict[int, int]]:
    """Put N of several instants below each other, shape (m, Z); return also the numbers of each stream.

    Of an earlier instant it is shorter, since what is drawn later adds nothing.
    """
    counts: dict[int, int] = {}
    for partial in partials:
        for stream, part in partial.items():
            counts[stream] = max(counts.get(stream, 0), part.shape[1])
    rows = []
    for partial in partials:
        number = len(next(iter(partial.values()))) if partial else 0
        padded = [np.zeros((number, count)) for count in counts.values()]
        for place, stream in zip(padded, counts, strict=True):
            if stream in partial:
                place[:, : partial[stream].shape[1]] = partial[stream]
        rows.append(np.concatenate(padded, axis=1) if padded else np.zeros((number, 0)))
    return np.concatenate(rows), counts


class ConditionalDraws(Noise):
    """Noise of samples under conditions: normals w, shape (n, r), along directions by stream, (r, numbers)."""

    def __init__(self, seed: int, index: IndexArray, directions: Mapping[int, Array], wanted: Array) -> None:
        super().__init__(seed, index)
        random, missing = Noise(seed, index), wanted.copy()
        for stream, direction in directions.items():
            missing -= np.einsum("kn,rk->nr", random.draw(stream, direction.shape[1]), direction)
        self._moved, self._directions = missing, directions
        self._place: dict[int, int] = {}

    def draw(self, stream: int, count: int) -> Array:
        """Draw the next numbers of a stream, as `Noise`."""
        drawn, begin = super().draw(stream, count), self._place.get(stream, 0)
        self._place[stream] = begin + count
        directions = self._directions.get(stream)
        if directions is None or begin >= directions.shape[1]:
            return drawn
        chosen = directions[:, begin : begin + count]
        drawn = drawn.copy()
        drawn[: chosen.shape[1]] += np.einsum("rk,nr->kn", chosen, self._moved)
        return drawn
