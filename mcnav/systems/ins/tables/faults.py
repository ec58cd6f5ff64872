"""``[[faults]]``: what measurements of the sensors have for some time that no filter believes in, and outages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, TypeAdapter

from mcnav.arrays.types import Array
from mcnav.contract.questions import UNMEASURED
from mcnav.entries.context import FileContext
from mcnav.entries.quantities import Duration, Table, Written
from mcnav.entries.unions import ByType
from mcnav.entries.validation import validate_entry
from mcnav.errors import suggestion
from mcnav.systems.description import FurtherTable
from mcnav.systems.faults import Fault
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.tables.instants import same_times, within

MOST_FAULTS: Final = 20
"""Largest number of faults: each adds epochs."""

LARGEST: Final = 1e9
"""Largest size of a fault, SI."""

OfSensor = Annotated[str, Field(description="Name of the sensor.", examples=["gnss"])]
OfComponent = Annotated[
    str | None,
    Field(description="What is wrong; not needed where a sensor measures one thing.", examples=["position_north"]),
]
Size = Annotated[Written, Field(description="Size of the error, in a unit of what is measured.", examples=["30 m"])]
Begin = Annotated[Duration, Field(description="Begin, in the trajectory's time.", examples=["600 s"])]
End = Annotated[Duration, Field(description="End, in the trajectory's time.", examples=["660 s"])]


class SpikeTable(Table):
    """One wrong measurement: the first one at or after the begin."""

    called: ClassVar[str] = "a spike"
    kind: Annotated[Literal["spike"], Field(description="One wrong measurement.")]
    sensor: OfSensor
    component: OfComponent = None
    begin: Begin
    size: Size


class RampTable(Table):
    """An error that grows from zero at the begin to its size at the end."""

    called: ClassVar[str] = "a ramp"
    kind: Annotated[Literal["ramp"], Field(description="An error that grows from zero to its size at the end.")]
    sensor: OfSensor
    component: OfComponent = None
    begin: Begin
    end: End
    size: Size


class BiasTable(Table):
    """A constant error from the begin to the end, both included."""

    called: ClassVar[str] = "a bias"
    kind: Annotated[Literal["bias"], Field(description="A constant error.")]
    sensor: OfSensor
    component: OfComponent = None
    begin: Begin
    end: End
    size: Size


class OutageTable(Table):
    """No measurements from the begin, included, to the end."""

    called: ClassVar[str] = "an outage"
    kind: Annotated[Literal["outage"], Field(description="No measurements.")]
    sensor: OfSensor
    begin: Begin
    end: End


WrongError = Annotated[
    SpikeTable | RampTable | BiasTable,
    ByType("kind"),
    Field(description="A fault of a sensor, which its filter does not believe in."),
]
"""A fault other than an outage."""

AnyFault: Final[Any] = Annotated[
    SpikeTable | RampTable | BiasTable | OutageTable,
    ByType("kind"),
    Field(description="A fault of a sensor, which its filter does not believe in."),
]
FORM: Final = TypeAdapter[SpikeTable | RampTable | BiasTable | OutageTable](AnyFault)

NO_AIDING: Final = f'{UNMEASURED}: this scenario has no sensors, which those of type "ins" can have'
"""Why a campaign has no tables of sensors, of their faults and of a filter."""

FAULTS: Final = FurtherTable(
    Annotated[list[AnyFault], Field(max_length=MOST_FAULTS)],
    "Faults of the sensors that aid the navigation; needs [[aiding]].",
    NO_AIDING,
    "aiding",
    f"{UNMEASURED}; needs [[aiding]], the sensors that fail",
)
"""The table of the campaign file."""


def read_faults(
    entries: object, sensors: tuple[Sensor, ...], navigation: Navigation, context: FileContext
) -> tuple[Sensor, ...]:
    """Return sensors with their faults; mistakes are added to the context."""
    if not isinstance(entries, list) or len(entries) > MOST_FAULTS:
        context.problem("faults", f"expected at most {MOST_FAULTS} tables [[faults]]")
        return sensors
    by_name = {sensor.name: sensor for sensor in sensors}
    for number, entry in enumerate(entries, start=1):
        key = f"faults #{number}"
        table = validate_entry(FORM, entry, context, key)
        if table is None:
            continue
        sensor = by_name.get(table.sensor)
        if sensor is None:
            known = suggestion(table.sensor, list(by_name))
            context.problem(f"{key}.sensor", f"got {table.sensor!r}; no sensor has this name{known}")
            continue
        if isinstance(table, OutageTable):
            if _ends_later(table, entry, key, context):
                by_name[sensor.name] = _without(sensor, table.begin, table.end, navigation, key, context)
            continue
        measured = {component.name: QUANTITIES[component.quantity].unit for component in sensor.components}
        fault = read_error(table, entry, measured, sensor.times, key, context)
        if fault is not None:
            by_name[sensor.name] = replace(sensor, faults=(*sensor.faults, fault))
    return tuple(by_name[sensor.name] for sensor in sensors)


def _ends_later(
    table: RampTable | BiasTable | OutageTable, entry: Mapping[str, Any], key: str, context: FileContext
) -> bool:
    if table.end <= table.begin:
        message = f"got {entry['end']!r}; expected a time after the begin of {table.begin:g} s"
        context.problem(f"{key}.end", message)
    return table.end > table.begin


def read_error(
    table: SpikeTable | RampTable | BiasTable, entry: Mapping[str, Any], measured: Mapping[str, str], times: Array,
    key: str, context: FileContext,
) -> Fault | None:  # fmt: skip
    """Return a fault of a sensor; mistakes are added to the context, and none is returned.

    Parameters
    ----------
    entry : mapping
        The fault as it is written.
    measured : mapping of str to str
        SI units by what the sensor measures.
    times : ndarray
        Of its measurements, s.
    """
    begin, end = table.begin, table.begin if isinstance(table, SpikeTable) else table.end
    if not isinstance(table, SpikeTable) and not _ends_later(table, entry, key, context):
        return None
    component = _component(table.component, list(measured), table.sensor, key, context)
    if component is None:
        return None
    size = _size(table.size, list(measured.values())[component], key, context)
    if size is None:
        return None
    fault = Fault(table.kind, component, begin, end, size)
    if not np.any(fault.errors(times) != 0.0):
        context.problem(f"{key}.begin", f"got {entry['begin']!r}; {table.sensor} has no measurement then")
    return fault


def _without(
    sensor: Sensor, begin: float, end: float, navigation: Navigation, key: str, context: FileContext
) -> Sensor:
    """Return a sensor without the measurements of an outage."""
    if sensor.log is not None or any(component.noise_at is not None for component in sensor.components):
        context.problem(f"{key}.sensor", f"got {sensor.name!r}; outages of a recorded sensor are those of its log")
        return sensor
    silent = within(sensor.times, begin, end, same_times(navigation))
    if not silent.any():
        context.problem(f"{key}.begin", f"{sensor.name} has no measurement from {begin:g} s to {end:g} s")
    return replace(sensor, times=sensor.times[~silent], outages=tuple(sorted((*sensor.outages, (begin, end)))))


def _component(name: str | None, names: list[str], sensor: str, key: str, context: FileContext) -> int | None:
    """Return the number of what is wrong."""
    if name is None and len(names) == 1:
        return 0
    if name in names:
        return names.index(name)
    if name is None:
        context.problem(f"{key}.component", f"is missing; it is one of {', '.join(names)}")
    else:
        context.problem(f"{key}.component", f"got {name!r}; {sensor} measures {', '.join(names)}")
    return None


def _size(written: object, unit: str, key: str, context: FileContext) -> float | None:
    """Return the size of a fault, SI."""
    size = context.quantity(written, unit, f"{key}.size")
    if size is not None and not 0.0 < abs(size) <= LARGEST:
        context.problem(f"{key}.size", f"got {written!r}; expected a size other than zero, up to {LARGEST:g}")
        return None
    return size
