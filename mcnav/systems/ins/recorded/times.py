"""Errors of a sensor's time stamps in a record: a constant delay, and jitter.

What is stamped t was measured at t - delay, so that an innovation, predicted less measured, is larger by the rate of
what is predicted times the delay. Jitter is one draw for all components of a measurement: a covariance of rank one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import Cause, FilteredRecord, Offset, Part

JITTER: Final = 0.01
"""Sigma from which jitter is looked for, s."""


def with_times(record: FilteredRecord, rates: Sequence[Array]) -> FilteredRecord:
    """Add a delay of each sensor as an error of no size, and its jitter as a process that the campaign lacks.

    Parameters
    ----------
    rates : sequence of ndarray, shape (c,)
        Of what is predicted for the measurement of each stage, a second.
    """
    count, size = len(record.sensors), len(record.mean)
    causes = [
        Cause(f"{sensor.name}_jitter", JITTER, "s", "ms", f"[[aiding]] {sensor.name}: jitter", absent=True)
        for sensor in record.sensors
    ]
    offsets = [
        Offset(f"{sensor.name}_delay", ("",), np.array([size + n]), "s", "ms", f"[[aiding]] {sensor.name}: delay")
        for n, sensor in enumerate(record.sensors)
    ]
    stages = []
    for stage, rate in zip(record.stages, rates, strict=True):
        response = np.zeros((len(rate), size + count))
        response[:, :size] = stage.response
        response[:, size + stage.sensor] = rate
        transition = None if stage.transition is None else _padded(stage.transition, count, 1.0)
        jitter = Part(len(record.causes) + stage.sensor, np.arange(len(rate)), JITTER**2 * np.outer(rate, rate))
        stages.append(replace(stage, transition=transition, response=response, noise=(*stage.noise, jitter)))
    return replace(
        record, stages=tuple(stages), causes=(*record.causes, *causes), offsets=(*offsets, *record.offsets),
        mean=np.concatenate([record.mean, np.zeros(count)]), initial=_padded(record.initial, count, 0.0),
        initial_causes=np.concatenate([record.initial_causes, np.full(count, -1)]),
        to_states=_padded(record.to_states, count, 1.0),
    )  # fmt: skip


def _padded(matrix: Array, count: int, diagonal: float) -> Array:
    """Add rows and columns of zeros, with a diagonal."""
    size = len(matrix)
    result = np.zeros((size + count, size + count))
    result[:size, :size] = matrix
    result[range(size, size + count), range(size, size + count)] = diagonal
    return result
