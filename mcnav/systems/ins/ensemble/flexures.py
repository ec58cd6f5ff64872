"""Flexures of samples: what they add to measurements, and the values of the filters' states that are flexures.

A flexure is not part of the navigator's deviation: it depends on nothing else, so that its values at all measurements
and epochs are drawn before a sample is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.ins.filter.model import FilterState
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.sensors.flexure import Flexure

FLEXURE_STREAM: Final = 1 << 21
"""Number of the counter's highest word; those of other noise are lower."""


@dataclass(frozen=True)
class SensorFlexure:
    """Flexure of one sensor of a closed loop.

    Attributes
    ----------
    number : int
        Of the sensor.
    flexure : Flexure
    instants : ndarray, shape (i,)
        The start, measurements and epochs, since the start, s.
    updates, measured : ndarray of int, shape (u,)
        Numbers of the sensor's updates, and of their instants.
    epochs : ndarray of int, shape (m,)
        Numbers of the epochs' instants.
    states : tuple of (int, FilterState)
        Angles among the filter's states, with their places.
    """

    number: int
    flexure: Flexure
    instants: Array
    updates: IndexArray
    measured: IndexArray
    epochs: IndexArray
    states: tuple[tuple[int, FilterState], ...]


def sensor_flexures(loop: ClosedLoop, epochs: IndexArray) -> tuple[SensorFlexure, ...]:
    """Return the flexures of a closed loop with epochs at numbers of its times."""
    found = []
    for number, sensor in enumerate(loop.sensors):
        if sensor.flexure is None:
            continue
        updates = np.flatnonzero(loop.measurements.sensors == number)
        places = np.searchsorted(loop.times, loop.measurements.times[updates] - 1e-9)
        used, numbers = np.unique(np.concatenate([[0], places, epochs]), return_inverse=True)
        states = tuple(
            (place, state)
            for place, state in enumerate(loop.model.states)
            if state.flexure is not None and state.flexure.sensor == sensor.name and not state.flexure.rate
        )
        found.append(
            SensorFlexure(
                number, sensor.flexure, loop.times[used] - loop.times[0], updates, numbers[1 : 1 + len(places)],
                numbers[1 + len(places) :], states,
            )
        )  # fmt: skip
    return tuple(found)


def draw_flexures(
    flexures: tuple[SensorFlexure, ...], loop: ClosedLoop, seed: int, samples: IndexArray
) -> tuple[Array, Array]:
    """Draw flexures from the counter-based generators keyed by seed and sample.

    Returns
    -------
    added : ndarray, shape (n, U, M)
        What they add to the measurements.
    values : ndarray, shape (n, m, q)
        Values of the filter's states that are flexures at the epochs, zero of others.
    """
    count = len(samples)
    added = np.zeros((count, *loop.measurements.components.shape))
    values = np.zeros((count, len(flexures[0].epochs) if flexures else 1, len(loop.filter.constants)))
    for each in flexures:
        variates = np.empty((len(each.instants), count, 3, 2))
        for row, index in enumerate(samples.tolist()):
            counter = np.array([0, 0, each.number, FLEXURE_STREAM], dtype=np.uint64)
            generator = np.random.Philox(counter=counter, key=np.array([seed, index], dtype=np.uint64))
            variates[:, row] = np.random.Generator(generator).standard_normal((len(each.instants), 3, 2))
        drawn = each.flexure.draw(each.instants, variates)
        responses = loop.measurements.flexure[each.updates].reshape(len(each.updates), -1, 2, 3)
        added[:, each.updates] = np.einsum("ucra,unar->nuc", responses, drawn[each.measured])
        for place, state in each.states:
            if state.flexure is not None:
                natural = state.flexure.flexure.natural(each.instants[each.epochs])
                of_axis = np.linalg.solve(natural[:, None], drawn[each.epochs, :, state.flexure.axis, :, None])
                values[:, :, place : place + 2] = of_axis[..., 0].swapaxes(0, 1)
    return added, values
