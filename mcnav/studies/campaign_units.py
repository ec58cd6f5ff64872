"""Units in which a campaign states its numbers: what is said of them is in the same."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final, TypeVar

from mcnav.config.read import Campaign
from mcnav.contract.recorded import Cause, FilteredRecord, Offset
from mcnav.physics.units import UnitError, conversion

WRITTEN: Final = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?\s*(.+?)\s*")
"""A number with its unit."""

Number = TypeVar("Number", Cause, Offset)


def in_campaign_units(record: FilteredRecord, campaign: Campaign) -> FilteredRecord:
    """Return a record whose causes and constant errors are shown in the units that the campaign writes for them."""
    return replace(
        record, causes=tuple(_shown(cause, campaign.resolved) for cause in record.causes),
        offsets=tuple(_shown(offset, campaign.resolved) for offset in record.offsets),
    )  # fmt: skip


def _shown(number: Number, resolved: Mapping[str, object]) -> Number:
    unit = written_unit(_entry(resolved, number.key))
    if not unit:
        return number
    try:
        conversion(number.unit, unit)
    except UnitError:
        return number
    return replace(number, shown_in=unit)


def _entry(resolved: Mapping[str, object], key: str) -> object:
    """Return what a campaign has under a key as `Cause` has it: "[imu.gyro] bias", "[[aiding]] gnss: position"."""
    place, _, name = key.partition("] ")
    table: object = resolved
    for part in place.strip("[]").split("."):
        table = table.get(part) if isinstance(table, Mapping) else None
    if isinstance(table, list):
        sensor, _, name = name.partition(": ")
        named = [each for each in table if isinstance(each, Mapping)]
        named = [each for each in named if str(each.get("name", each.get("type"))).replace("-", "_") == sensor]
        table = named[0] if named else None
    return table.get(name) if isinstance(table, Mapping) else None


def written_unit(entry: object) -> str:
    """Return the unit of an entry; of several, the first; empty where it has none.

    >>> written_unit("20 mrad"), written_unit({"sigma": "30 deg/h"}), written_unit(["1 m", "2 m"]), written_unit(3.0)
    ('mrad', 'deg/h', 'm', '')
    """
    if isinstance(entry, Mapping):
        return written_unit(entry.get("sigma", next(iter(entry.values()), None)))
    if isinstance(entry, list):
        return written_unit(entry[0]) if entry else ""
    match = WRITTEN.fullmatch(entry) if isinstance(entry, str) else None
    return match[1] if match else ""
