"""Beliefs of a filter in the sizes of errors, as shares of their variances."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.filter import FilterStates
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.sizes import LoopSizes


def believed_shares(maps: Maps, states: FilterStates, sizes: LoopSizes) -> dict[str, float]:
    """Return believed over true variance of sources and processes that have a size; zero of what is neglected."""
    structure, true, believed = maps.structure, sizes.true, sizes.believed
    known = {*states.counterparts.tolist(), *states.considered.tolist()}
    shares = {}
    for number, source in enumerate(structure.sources):
        variance = true.start[number, number]
        if source.of == "truth" and not source.name.startswith("true_") and not known & set(source.moves):
            shares[source.name] = 0.0
        elif variance > 0.0:
            shares[source.name] = float(believed.start[number, number] / variance)
    for quantity, place in structure.white.places():
        shares[quantity.name] = _share(believed.white[place], true.white[place])
    for quantity, place in structure.markov.places():
        local = slice(place.start - structure.markov.begin, place.stop - structure.markov.begin)
        followed = known.issuperset(range(place.start, place.stop))
        shares[quantity.name] = _share(believed.markov[local], true.markov[local]) if followed else 0.0
    for sensor, own, size in zip(maps.sensors, believed.measurements, true.measurements, strict=True):
        shares[sensor.declared.name] = _share(own, size)
    for quantity, own, size in zip(
        structure.corrections.quantities, believed.corrections, true.corrections, strict=True
    ):  # fmt: skip
        shares[quantity.name] = _share(own, size)
    return shares


def _share(believed: Array, true: Array) -> float:
    total = float(np.sum(true**2))
    return float(np.sum(believed**2)) / total if total > 0.0 else 1.0
