"""Catalogue of inertial measurement units for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich.console import RenderableType

from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.units import quantity

LISTED: Final = {
    "gyro bias": ("gyro bias",),
    "in run": ("gyro bias_instability.sigma", "gyro bias_instability.allan_minimum"),
    "angle random walk": ("gyro angle_random_walk",),
    "accelerometer bias": ("accelerometer bias",),
    "in run ": ("accelerometer bias_instability.sigma", "accelerometer bias_instability.allan_minimum"),
    "velocity random walk": ("accelerometer velocity_random_walk",),
}
"""Columns of the list, and the values that stand in them."""


def value_row(unit: str, instrument: str, key: str, text: str, si: str, source: str) -> dict[str, Any]:
    """Tabulate a value as written and in its SI unit."""
    row = {"unit": unit, "instrument": instrument, "key": key, "value": text}
    return row | {"si_value": quantity(text, si), "si_unit": si, "source": source}


def catalogue(titles: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> RenderableType:
    """Tabulate the main values of all units, one line each."""
    table = FittedTable("Inertial measurement units", [*texts("name"), *numbers(*LISTED), *texts("what")])
    for name, title in titles.items():
        result = {f"{row['instrument']} {row['key']}": row["value"] for row in rows if row["unit"] == name}
        cells = [next((result[key] for key in keys if key in result), "–") for keys in LISTED.values()]
        table.add(name, *cells, title)
    return table


def values(title: str, rows: Sequence[Mapping[str, Any]]) -> RenderableType:
    """Tabulate the values of one unit with their sources."""
    table = FittedTable(title, [*texts("key"), *numbers("value", "SI"), *texts("SI unit", "source")], keys=1)
    for row in rows:
        key, si = f"{row['instrument']}.{row['key']}", number(row["si_value"])
        table.add(key, row["value"], si, row["si_unit"], row["source"])
    return table
