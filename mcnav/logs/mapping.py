"""Mapping of a file's columns to quantities: as it is told, or suggested by names.

A mapping names columns by keys such as `gyro_x`; a minus sign before a name negates it. Units are given by the same
keys, or for all axes of a vector at once by `gyro`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcnav.arrays.types import Array
from mcnav.errors import suggestion
from mcnav.files.lines import place_of_row
from mcnav.logs.column_names import named, spelled_unit
from mcnav.logs.log_error import LogError, listed
from mcnav.logs.log_table import LogTable, Values
from mcnav.physics.units import UnitError, conversion, printable


@dataclass(frozen=True)
class Column:
    """A column of a file that holds a quantity.

    Attributes
    ----------
    name : str
        In the file.
    unit : str
        Its unit; empty where neither the file nor the mapping states one.
    sign : float
        -1 where the mapping negates it.
    """

    name: str
    unit: str
    sign: float = 1.0


def check_keys(path: Path, given: Mapping[str, str] | None, known: Sequence[str], table: str) -> None:
    """Raise `LogError` where a mapping has an unknown key, or an entry that is no text."""
    for key, entry in (given or {}).items():
        if key not in known:
            raise LogError(path, f"no such key{suggestion(key, known)}", f"{table}.{printable(key, 40)}")
        if not isinstance(entry, str) or not entry.strip():
            raise LogError(path, f"got {printable(repr(entry), 40)}; expected a text in quotes", f"{table}.{key}")


def mapped(table: LogTable, columns: Mapping[str, str], units: Mapping[str, str], key: str) -> Column:
    """Return the column that a mapping names, with its unit."""
    written = columns[key].strip()
    negated = written not in table.names and written.startswith("-")
    name = written[1:].strip() if negated else written
    if name not in table.names:
        # a name may be given without the unit that follows it
        same = [each for each in table.names if named(each).plain == named(name).plain]
        if len(same) != 1:
            raise LogError(
                table.path, f"has no column {printable(name, 40)!r}{suggestion(name, table.names)}", f"columns.{key}"
            )
        name = same[0]
    return Column(name, stated_unit(table, units, key, name), -1.0 if negated else 1.0)


def stated_unit(table: LogTable, units: Mapping[str, str], key: str, name: str) -> str:
    """Return the unit of a column: as the mapping, the format, or its name states it; empty for none."""
    vector = key.rpartition("_")[0]
    for each in (key, vector):
        if each in units:
            return units[each]
    return table.units.get(name, "") or named(name).unit


def factor_to(path: Path, unit: str, targets: Sequence[str], key: str) -> tuple[float, str]:
    """Return the factor from a unit to the first of some SI units that has its dimension, and that SI unit.

    Raises `LogError` where it has the dimension of none.
    """
    spelled = spelled_unit(unit) or unit
    for target in targets:
        try:
            return conversion(spelled, target), target
        except UnitError as wrong:
            reason = str(wrong)
    expected = " or ".join(f'"{target}"' for target in targets)
    raise LogError(path, f"{reason}; expected a unit such as {expected}", f"units.{key}")


def numbers(table: LogTable, values: Values, name: str) -> Array:
    """Return a column as floating-point numbers; `LogError` where it holds texts."""
    if values.dtype == object:
        row = next((row for row, value in enumerate(values) if value is not None), 0)
        raise LogError(
            table.path,
            f"got {printable(str(values[row]), 40)!r}; expected a number",
            f"{place_of_row(table.path, row)}, {name}",
        )
    with np.errstate(invalid="ignore"):  # of damaged numbers
        return np.asarray(values, dtype=float)


def cannot_tell(table: LogTable, what: str, template: str) -> LogError:
    """Say that columns cannot be told, with a mapping to paste."""
    have = f"{len(table.names)} columns without names" if table.headless else f"the columns {listed(table.names)}"
    return LogError(table.path, f"has {have}; {what}; say which is which: {template}")
