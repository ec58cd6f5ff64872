"""The catalogue of inertial measurement units: grades, and units whose data have a source.

Values are kept as their sources write them; `units_of_values` has the SI unit of each.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Final

from mcnav.entries.axes import units_of

INSTABILITY: Final = "bias_instability"

NAMES: Final = ("gyro", "accelerometer")
"""Instruments, by the tables of ``[imu]``."""

ALLAN_MINIMUM: Final = 0.61736
"""Allan deviation of a Gauss-Markov process at its maximum, over the process's sigma."""

Entry = str | dict[str, str]
"""A value of an instrument as ``[imu]`` has it: a quantity, or the quantities of a process."""


@cache
def units_of_values() -> dict[str, Mapping[str, str]]:
    """Return the SI unit of each value of an instrument, by its key in ``[imu.gyro]`` or ``[imu.accelerometer]``."""
    from mcnav.systems.ins.tables.instrument_tables import INSTRUMENTS  # models, which take a fortieth of a second

    return {instrument: units_of(table) for instrument, table in INSTRUMENTS.items()}


@dataclass(frozen=True)
class DataSheetValue:
    """A value with its source.

    Attributes
    ----------
    instrument : str
        ``gyro`` or ``accelerometer``.
    key : str
        Such as ``bias`` or ``bias_instability.sigma``.
    text : str
        Quantity as written.
    source : str
    """

    instrument: str
    key: str
    text: str
    source: str

    @property
    def unit(self) -> str:
        """SI unit."""
        return units_of_values()[self.instrument][self.key]


@dataclass(frozen=True)
class CatalogueUnit:
    """A grade, or a unit that can be bought."""

    name: str
    title: str
    values: tuple[DataSheetValue, ...]

    @property
    def table(self) -> dict[str, dict[str, Entry]]:
        """The values as the tables ``[imu.gyro]`` and ``[imu.accelerometer]`` of a campaign."""
        tables: dict[str, dict[str, Entry]] = {instrument: {} for instrument in NAMES}
        for value in self.values:
            table, (first, _, second) = tables[value.instrument], value.key.partition(".")
            inside = table.get(first, {})
            table[first] = {**inside, second: value.text} if second and isinstance(inside, dict) else value.text
        return tables


@cache
def catalogue_units() -> tuple[CatalogueUnit, ...]:
    """Read the catalogue in its order: grades first."""
    text = files("mcnav.systems.ins.tables").joinpath("imu_catalogue.toml").read_text(encoding="utf-8")
    content = tomllib.loads(text)
    return tuple(
        CatalogueUnit(unit["name"], unit["title"], tuple(_values(unit, content["sources"]))) for unit in content["unit"]
    )


def _values(unit: Mapping[str, Any], sources: Mapping[str, str]) -> Iterator[DataSheetValue]:
    for instrument in NAMES:
        for key, entry in unit.get(instrument, {}).items():
            named = {f"{key}.{each}": pair for each, pair in entry.items()} if isinstance(entry, dict) else {key: entry}
            yield from (DataSheetValue(instrument, name, text, sources[cited]) for name, (text, cited) in named.items())


def catalogue() -> dict[str, dict[str, dict[str, Entry]]]:
    """Return the tables of ``[imu]`` by the name of grade or unit.

    >>> catalogue()["HG9900"]["accelerometer"]
    {'bias': '25 ug', 'scale_factor': '100 ppm'}
    """
    return {unit.name: unit.table for unit in catalogue_units()}
