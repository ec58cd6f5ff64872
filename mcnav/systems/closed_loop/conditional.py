"""Samples of a loop whose noise is given what it adds to the linear outcomes of some outputs, and is random otherwise.

The noise of a sample is a vector z of independent standard normals, numbers of its streams in the order in which they
are drawn, and adds ``N z`` to the linear outcomes at the end. With random z,

    z' = z + N^T (N N^T)^+ (y - N z)

has the distribution of z under the condition ``N z = y`` (Journel and Huijbregts, *Mining Geostatistics*, 1978, of
conditional simulation).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.noise import CORRECTIONS, PROCESSES, SENSORS, Noise
from mcnav.systems.closed_loop.plan import Plan
from mcnav.systems.closed_loop.readout import Readout
from mcnav.systems.closed_loop.sizes import Sizes


def noise_partials(plan: Plan, maps: Maps, true: Sizes, readout: Readout, outputs: tuple[int, ...]) -> dict[int, Array]:
    """Compute N of some outputs by stream, shape (m, numbers of the stream), backwards along the plan."""
    last = plan.instants[plan.end]
    response = readout.partials(last.nominal, plan.steps, plan.end_time)[list(outputs)]
    parts: dict[int, list[Array]] = {}
    impulses: dict[int, Array] = {}
    for number in range(plan.end, -1, -1):
        planned = plan.instants[number]
        for each in reversed(planned.updates):
            if each.kind == "measure":
                sizes = true.measurements[each.number]
                parts.setdefault(SENSORS + each.number, []).append(response @ each.inputs * sizes)
            elif each.kind == "correct":
                sizes = true.corrections[each.number]
                parts.setdefault(CORRECTIONS + each.number, []).append(response @ each.inputs * sizes)
            response = response @ each.state
        if plan.begin is not None and number == plan.begin.number:
            response = response @ plan.begin.state
        for each in reversed(planned.steps):
            parts.setdefault(PROCESSES, []).append(response @ each.inputs * true.modes)
            for correction, inputs in each.corrections.items():
                added = response @ inputs * true.corrections[correction]
                impulses[correction] = impulses.get(correction, 0.0) + added
            response = response @ each.state
    if maps.structure.markov.size:
        parts.setdefault(PROCESSES, []).append(response[:, maps.structure.markov.whole] * true.markov)
    partials = {stream: np.concatenate(blocks[::-1], axis=1) for stream, blocks in parts.items()}
    return partials | {CORRECTIONS + number: each for number, each in impulses.items()}


def noise_covariance(partials: Mapping[int, Array], outputs: int) -> Array:
    """Return ``N N^T``, shape (outputs, outputs)."""
    return sum((np.einsum("is,js->ij", each, each) for each in partials.values()), np.zeros((outputs, outputs)))


class ConditionalDraws(Noise):
    """Noise of samples that adds a wanted amount to the linear outcomes of some outputs, shape (n, m)."""

    def __init__(self, seed: int, index: IndexArray, partials: Mapping[int, Array], wanted: Array) -> None:
        super().__init__(seed, index)
        random, missing = Noise(seed, index), wanted.copy()
        for stream, each in partials.items():
            missing -= np.einsum("kn,mk->nm", random.draw(stream, each.shape[1]), each)
        covariance = noise_covariance(partials, wanted.shape[1])
        scale = np.sqrt(np.diag(covariance))
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
        weights = inverse[:, None] * np.linalg.pinv(inverse[:, None] * covariance * inverse, rcond=1e-12) * inverse
        self._moved, self._partials = np.einsum("nm,mk->nk", missing, weights), partials
        self._place: dict[int, int] = {}

    def draw(self, stream: int, count: int) -> Array:
        """Draw the next numbers of a stream, as `Noise`."""
        drawn, begin = super().draw(stream, count), self._place.get(stream, 0)
        self._place[stream] = begin + count
        partials = self._partials.get(stream)
        if partials is None or begin >= partials.shape[1]:
            return drawn
        chosen = partials[:, begin : begin + count]
        drawn = drawn.copy()
        drawn[: chosen.shape[1]] += np.einsum("mk,nm->kn", chosen, self._moved)
        return drawn
