"""Entries of ``[errors]`` with a distribution of scipy.stats or the values of a table."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.files import OUTSIDE
from mcnav.errors import suggestion
from mcnav.files import read_whole
from mcnav.sampling.scipy_and_tables import (
    EmpiricalDistribution,
    ScipyDistribution,
    continuous_distributions,
    shape_names,
)
from mcnav.store.chunk_files import table_from
from mcnav.store.run_folder import TABLES
from mcnav.units import UnitError, quantity

SCIPY: Final = "scipy."
"""Prefix of the name of a scipy.stats distribution."""

TABLE: Final = "table"
LARGEST_TABLE: Final = 100_000_000
"""Bytes."""


def read_scipy(table: Mapping[str, Any], source: Source, key: str, context: FileContext) -> ScipyDistribution | None:
    """Read ``{ distribution = "scipy.laplace", scale = "1 km" }``: shape parameters as scipy names them, loc, scale."""
    full_name = str(table["distribution"])
    name = full_name.removeprefix(SCIPY)
    if name not in continuous_distributions():
        close = suggestion(full_name, [f"{SCIPY}{each}" for each in continuous_distributions()])
        meant = f"{close.partition('?')[0]}?" if "did you mean" in close else ""
        message = f"got {table['distribution']!r}; scipy.stats has no continuous distribution of that name{meant}"
        context.problem(f"{key}.distribution", message)
        return None
    units = {**dict.fromkeys(shape_names(name), "1"), "loc": source.unit, "scale": source.unit}
    before = len(context.problems)
    context.check_keys(table, list(units), key, full_name)
    values: dict[str, float] = {"loc": 0.0}
    for entry, unit in units.items():
        if entry in table:
            values[entry] = context.quantity(table[entry], unit, f"{key}.{entry}") or 0.0
        elif entry != "loc":
            needed = " and ".join(each for each in units if each != "loc")
            context.problem(f"{key}.{entry}", f"is missing; {full_name} needs {needed}")
    if len(context.problems) > before:
        return None
    try:
        shapes = tuple((entry, values[entry]) for entry in shape_names(name))
        return ScipyDistribution(name, shapes, values["loc"], values["scale"])
    except ValueError as wrong:
        context.problem(key, str(wrong))
        return None


def read_table(
    table: Mapping[str, Any], source: Source, key: str, context: FileContext
) -> EmpiricalDistribution | None:
    """Read ``{ distribution = "table", file = "gyro.csv", column = "drift", unit = "deg/h" }``: CSV or parquet.

    The path is relative to the campaign file. ``sha256``, which the campaign file in a run folder contains, must match
    the values.
    """
    before = len(context.problems)
    keys = ["file", "column", "unit", "sha256"]
    context.check_keys(table, keys, key, "a table")
    for name in keys[:3]:
        if name not in table:
            context.problem(f"{key}.{name}", "is missing; a table needs file and column and unit")
        elif not isinstance(table[name], str):
            context.problem(f"{key}.{name}", f"got {table[name]!r}; expected text in quotes")
    if len(context.problems) > before:
        return None
    if context.leaves(table["file"]):
        context.problem(f"{key}.file", f"got {table['file']!r}; in a run folder {OUTSIDE}")
        return None
    path = context.folder / table["file"]
    try:
        factor = quantity(f"1 {table['unit']}", source.unit)
        distribution = EmpiricalDistribution(_column(path, table["column"]) * factor)
    except UnitError as wrong:
        context.problem(f"{key}.unit", str(wrong))
    except _TableError as wrong:
        context.problem(f"{key}.{wrong.key}", str(wrong))
    except ValueError as wrong:
        context.problem(f"{key}.column", f"{path}, {table['column']!r}: {wrong}")
    else:
        if table.get("sha256", distribution.digest) == distribution.digest:
            return distribution
        context.problem(f"{key}.sha256", f"the values in {path} have changed since the run; restore the file")
    return None


class _TableError(Exception):
    """Mistake in a table, with the key to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


def _column(path: Path, name: str) -> NDArray[np.float64]:
    """Read a column of numbers."""
    import pandas as pd

    readers: Mapping[str, Callable[[bytes], pd.DataFrame]] = {
        ".csv": lambda content: pd.read_csv(io.BytesIO(content)),
        ".parquet": lambda content: table_from(content).to_pandas(),
    }
    if path.suffix not in readers:
        raise _TableError("file", f"got {str(path)!r}; expected a file that ends in .csv or .parquet")
    try:
        frame = readers[path.suffix](read_whole(path, LARGEST_TABLE))
    except FileNotFoundError:
        raise _TableError("file", f"{path}: no such file; paths are relative to the campaign file") from None
    except OSError as failure:
        raise _TableError("file", f"{path}: cannot be read: {failure.strerror or failure}") from None
    except ValueError as failure:
        raise _TableError("file", f"{path}: is not a table: {str(failure).splitlines()[0]}") from None
    if name not in frame.columns:
        names = [str(column) for column in frame.columns]
        raise _TableError("column", f"{path} has no column {name!r}{suggestion(name, names[:20])}")
    try:
        return np.asarray(frame[name].to_numpy(dtype=float))
    except (TypeError, ValueError):
        raise _TableError("column", f"{path}, {name!r}: contains an entry that is not a number") from None


class StoredTable(NamedTuple):
    """Copy of a table in a run folder: the entry of ``[errors]`` that reads it, its path there and its content."""

    entry: Mapping[str, str]
    path: str
    content: bytes


def stored_table(source: Source, values: EmpiricalDistribution) -> StoredTable:
    """Write the values of a source as a table for the run folder."""
    path = f"{TABLES}/{source.name}.csv"
    entry = {"distribution": TABLE, "file": path, "column": "value", "unit": source.unit, "sha256": values.digest}
    lines = "".join(f"{float(value)!r}\n" for value in values.values)
    return StoredTable(entry, path, f"value\n{lines}".encode())
