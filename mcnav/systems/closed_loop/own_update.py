"""Update of the user's own in place of a filter, with memory, and the covariance that it states."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.quantities import as_seen, spread
from mcnav.systems.closed_loop.rotations import to_matrix
from mcnav.systems.user.returned import real_numbers

UPDATE: Final = ("time", "name", "measured", "innovation", "estimate", "memory")
"""Arguments that ``update`` may name."""

COVARIANCE: Final = ("time", "estimate", "memory")
"""Arguments that ``covariance`` may name."""

SYMMETRIC: Final = 1e-6
"""Difference of a covariance and its transpose, as a share of its largest element, up to which it is one."""


def updated(maps: Maps, number: int, x: Array, time: Array, noise: Array) -> Array:
    """Return X after ``update`` has used a measurement with its noise, shape (size of the measurement, n)."""
    return maps.by_phase(partial(_updated, maps, number), x, time, noise)


def _updated(maps: Maps, number: int, x: Array, time: Array, noise: Array) -> Array:
    assert maps.update is not None
    structure, sensor, count = maps.structure, maps.sensors[number], x.shape[1]
    innovation = maps.innovation(number, x, time) + noise

    def measured() -> Any:
        true = real_numbers(sensor.truth(maps.truth_frame(x, time)), "a measurement's truth")
        if sensor.attitude:
            return true @ to_matrix(noise)
        return true + as_seen(noise, true.ndim == 2)

    frame = dict(maps.navigator_frame(x, time, None))
    frame |= {
        "name": lambda: sensor.declared.name,
        "measured": measured,
        "innovation": lambda: as_seen(innovation.copy(), sensor.size > 1),
    }
    returned = maps.update(frame)
    if not isinstance(returned, dict):
        raise ValueError(f"update must return a mapping of names to values; got {type(returned).__name__}")
    result = x.copy()
    of_memory = {name: value for name, value in returned.items() if name in structure.memory.names}
    of_estimate = {name: value for name, value in returned.items() if name not in of_memory}
    for block, values in ((structure.estimate, of_estimate), (structure.memory, of_memory)):
        result[block.whole] = spread(block, values, count, "update", x[block.whole])
    return result


def stated_covariance(maps: Maps, x: Array, time: Array) -> Array:
    """Return the covariance of the navigation errors that ``covariance`` states, shape (k, k, n).

    Raises `ValueError` when its shape is wrong, or it is not symmetric.
    """
    return maps.by_phase(partial(_stated_covariance, maps), x, time)


def _stated_covariance(maps: Maps, x: Array, time: Array) -> Array:
    assert maps.covariance is not None
    size, count = maps.structure.estimate.size, x.shape[1]
    returned = real_numbers(maps.covariance(maps.navigator_frame(x, time, None)), "covariance")
    if returned.shape not in ((count, size, size), (size, size)):
        wanted = f"({count}, {size}, {size}), for {count} samples"
        raise ValueError(f"covariance must have shape {wanted}; got {returned.shape}")
    gaps, largest = np.abs(returned - np.swapaxes(returned, -1, -2)), np.abs(returned).max(axis=(-2, -1), keepdims=True)
    if np.any(gaps > SYMMETRIC * largest):
        raise ValueError("covariance must return symmetric matrices; an element and its mirror image differ")
    return np.ascontiguousarray(np.broadcast_to(returned, (count, size, size)).transpose(1, 2, 0))
