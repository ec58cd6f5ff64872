"""Errors of what sensors know of their own place or of others, a boresight or a map: their tables.

Innovations and responses are exact in them, as in the errors of the navigator. Their first order is in the linear
closed loop, whose errors are added up beside the samples: it is part of the constant errors and of the responses to the
filter's states.
"""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import IndexArray
from mcnav.systems.ins.ensemble.own_responses import OffsetTables
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.quantity import OFFSETS
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.sensors.surroundings import Surroundings


def offset_tables(loop: ClosedLoop, active: IndexArray) -> OffsetTables:
    """Tabulate the offsets of a loop's sensors; ``active`` are the numbers of the constant errors that are not zero."""
    measured, constants = loop.measurements, aiding_constants(loop.sensors)
    states = [state.name for state in loop.model.states]
    updates, most = measured.components.shape
    tables = OffsetTables(
        np.full((updates, 3), -1), np.full((updates, 3), -1), np.zeros(updates, dtype=np.bool_),
        np.zeros((updates, 3, 3)), np.zeros((updates, most, 3)),
    )  # fmt: skip
    for number, sensor in enumerate(loop.sensors):
        names = _names_of(sensor)
        here = np.flatnonzero(measured.sensors == number)
        if not names or not len(here):
            continue
        around = Surroundings.at(
            loop.truth, loop.platform, float(loop.times[0]), measured.times[here], sensor.lever_arm, sensor.arrangement
        )
        component = sensor.components[0]
        axes = QUANTITIES[component.quantity].geometry(around, component.axis).offset_axes
        if axes is None:
            raise ValueError(f"geometry of {component.quantity} lacks the axes of its offsets")
        columns = [constants.index(name) for name in names]
        places = {int(column): place for place, column in enumerate(active)}
        tables.present[here], tables.axes[here] = True, axes
        tables.rows[here] = measured.constants[here][:, :, columns]
        tables.errors[here] = [places.get(column, -1) for column in columns]
        tables.states[here] = [states.index(name) if name in states else -1 for name in names]
    return tables


def _names_of(sensor: Sensor) -> list[str]:
    """Return the names of a sensor's errors of an offset, of which it has one kind at most."""
    return [f"{sensor.name}_{offset}_{axis}" for offset in sensor.offsets for axis in OFFSETS[offset][0]]
