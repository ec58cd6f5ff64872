"""Values of an error source in a table: CSV or parquet."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.contract.quantities import Source
from mcnav.entries.context import FileContext
from mcnav.entries.files import OUTSIDE
from mcnav.errors import reason_of, suggestion
from mcnav.files.parquet_reading import table_from
from mcnav.files.whole import TextError, read_whole, text_of
from mcnav.physics.units import UnitError, quantity
from mcnav.sampler.scipy_and_tables import EmpiricalDistribution
from mcnav.store.run_files import TABLES

TABLE: Final = "table"
LARGEST_TABLE: Final = 100_000_000
"""Bytes."""


class ValuesError(Exception):
    """Mistake in a table of values, with the key of the entry to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


def read_values(
    file: str, column: str, unit: str, sha256: str | None, source: Source, context: FileContext
) -> EmpiricalDistribution:
    """Read the values of a column.

    Parameters
    ----------
    file : str
        CSV or parquet, relative to the campaign file.
    unit : str
        One unit of the column, such as ``1 deg/h``.
    sha256 : str, optional
        Digest that the values must have, which the campaign file in a run folder contains.
    source : Source
        Whose values are read, in its unit.

    Raises
    ------
    ValuesError
        Names the key that is wrong.
    """
    if context.leaves(file):
        raise ValuesError("file", f"got {file!r}; in a run folder {OUTSIDE}")
    path = context.folder / file
    try:
        factor = quantity(unit, source.unit, source.shares)
    except UnitError as wrong:
        raise ValuesError("unit", str(wrong)) from None
    try:
        distribution = EmpiricalDistribution(_column(path, column) * factor)
    except ValueError as wrong:
        raise ValuesError("column", f"{path}, {column!r}: {wrong}") from None
    if sha256 not in (None, distribution.digest):
        raise ValuesError("sha256", f"the values in {path} have changed since the run; restore the file")
    return distribution


def _column(path: Path, name: str) -> NDArray[np.float64]:
    """Read a column of numbers."""
    import pandas as pd

    readers: Mapping[str, Callable[[bytes], pd.DataFrame]] = {
        ".csv": lambda content: pd.read_csv(io.StringIO(text_of(content))),
        ".parquet": lambda content: table_from(content).to_pandas(),
    }
    if path.suffix not in readers:
        raise ValuesError("file", f"got {str(path)!r}; expected a file that ends in .csv or .parquet")
    try:
        frame = readers[path.suffix](read_whole(path, LARGEST_TABLE))
    except FileNotFoundError:
        raise ValuesError("file", f"{path}: no such file; paths are relative to the campaign file") from None
    except OSError as failure:
        raise ValuesError("file", f"{path}: cannot be read: {failure.strerror or failure}") from None
    except TextError as wrong:
        raise ValuesError("file", f"{path}: {wrong}") from None
    except ValueError as failure:
        raise ValuesError("file", f"{path}: is not a table: {reason_of(failure)}") from None
    if name not in frame.columns:
        names = [str(column) for column in frame.columns]
        raise ValuesError("column", f"{path} has no column {name!r}{suggestion(name, names[:20])}")
    try:
        return np.asarray(frame[name].to_numpy(dtype=float))
    except (TypeError, ValueError):
        raise ValuesError("column", f"{path}, {name!r}: contains an entry that is not a number") from None


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
