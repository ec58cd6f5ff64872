"""Clocks of sensors that run fast or slow: errors of a record that no campaign has.

Stamps of a clock that runs fast by r are late by a delay that grows, d = r t with t since the start of the record. What
it does to a measurement is what a constant delay does, times t::

    -h' d = -h' r t

so that a record with delays has the responses already.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.contract.recorded import FilteredRecord, Offset, Stage

CLOCK_RATE: Final = "clock_rate"
"""Last words of the names of these errors."""


def with_clock_rates(record: FilteredRecord, delays: Mapping[str, int]) -> FilteredRecord:
    """Return a record with a clock rate of each sensor as its last errors, of no size.

    Parameters
    ----------
    delays : mapping of str to int
        Places of the delays among the errors s, by sensor.
    """
    size, count = len(record.mean), len(delays)
    names = [sensor.name for sensor in record.sensors]
    columns = {names.index(name): size + place for place, name in enumerate(delays)}
    sources = {names.index(name): place for name, place in delays.items()}

    def extended(stage: Stage) -> Stage:
        response = np.pad(stage.response, ((0, 0), (0, count)))
        if stage.sensor in columns:
            response[:, columns[stage.sensor]] = stage.time * response[:, sources[stage.sensor]]
        transition = stage.transition
        if transition is not None:
            transition = np.pad(transition, (0, count))
            transition[range(size, size + count), range(size, size + count)] = 1.0
        return replace(stage, response=response, transition=transition)

    to_states = np.pad(record.to_states, (0, count))
    to_states[range(size, size + count), range(size, size + count)] = 1.0
    offsets = tuple(
        Offset(f"{name}_{CLOCK_RATE}", ("",), np.array([size + place], dtype=np.int64), "1", "ppm", "")
        for place, name in enumerate(delays)
    )
    return replace(
        record, stages=tuple(extended(stage) for stage in record.stages), offsets=(*record.offsets, *offsets),
        mean=np.pad(record.mean, (0, count)), initial=np.pad(record.initial, (0, count)),
        initial_causes=np.pad(record.initial_causes, (0, count), constant_values=-1), to_states=to_states,
    )  # fmt: skip
