"""Catalogue of inertial measurement units for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.physics.units import quantity
from mcnav.report.document.table import Column, Table

LISTED: Final = {
    "gyro bias": ("gyro bias",),
    "in run": ("gyro bias_instability.sigma", "gyro bias_instability.allan_minimum"),
    "angle random walk": ("gyro angle_random_walk",),
    "accelerometer bias": ("accelerometer bias",),
    "in run ": ("accelerometer bias_instability.sigma", "accelerometer bias_instability.allan_minimum"),
    "velocity random walk": ("accelerometer velocity_random_walk",),
}
"""Columns of the list, and the values that stand in them."""


@dataclass(frozen=True)
class ValueRow:
    """A value of a unit as written and in its SI unit, as CSV and JSON have it."""

    unit: str
    instrument: str
    key: str
    value: str
    si_value: float
    si_unit: str
    source: str


def value_row(unit: str, instrument: str, key: str, text: str, si: str, source: str) -> ValueRow:
    """Tabulate a value as written and in its SI unit."""
    return ValueRow(unit, instrument, key, text, quantity(text, si), si, source)


def catalogue(titles: Mapping[str, str], rows: Sequence[ValueRow]) -> Table[str]:
    """Tabulate the main values of all units, one line each."""
    written = {(row.unit, f"{row.instrument} {row.key}"): row.value for row in rows}

    def listed(heading: str, keys: Sequence[str]) -> Column[str]:
        return Column(heading, lambda name: next((written[name, key] for key in keys if (name, key) in written), "–"))

    columns: list[Column[str]] = [
        Column("name", lambda name: name, kind="text"),
        *(listed(*each) for each in LISTED.items()),
        Column("what", lambda name: titles[name], kind="words"),
    ]
    return Table("", columns, list(titles), "Inertial measurement units")


def values(title: str, rows: Sequence[ValueRow]) -> Table[ValueRow]:
    """Tabulate the values of one unit with their sources."""
    columns: list[Column[ValueRow]] = [
        Column("key", lambda row: f"{row.instrument}.{row.key}", kind="text"),
        Column("value", lambda row: row.value),
        Column("SI", lambda row: row.si_value),
        Column("SI unit", lambda row: row.si_unit, kind="text"),
        Column("source", lambda row: row.source, kind="words"),
    ]
    return Table("", columns, rows, title)
