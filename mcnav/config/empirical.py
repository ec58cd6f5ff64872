"""Entries of ``[errors]`` whose distribution is scipy's, or a table's."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.errors import Problem, suggestion
from mcnav.files import read_whole
from mcnav.sampling.scipy_and_tables import (
    EmpiricalDistribution,
    ScipyDistribution,
    continuous_distributions,
    shape_names,
)
from mcnav.scenarios.protocol import Source
from mcnav.store.parts import table_from
from mcnav.store.run_folder import TABLES
from mcnav.units import UnitError, quantity

SCIPY: Final = "scipy."
"""What the name of a distribution of scipy.stats begins with."""

TABLE: Final = "table"
LARGEST_TABLE: Final = 100_000_000
"""Bytes."""


def read_scipy(
    table: Mapping[str, Any], source: Source, file: str, key: str, problems: list[Problem]
) -> ScipyDistribution | None:
    """``{ distribution = "scipy.laplace", scale = "1 km" }``: shape parameters as scipy names them, loc and scale."""
    name = str(table["distribution"]).removeprefix(SCIPY)
    if name not in continuous_distributions():
        known = [f"{SCIPY}{each}" for each in continuous_distributions()]
        close = suggestion(f"{SCIPY}{name}", known)
        told = f"{close.partition('?')[0]}?" if "did you mean" in close else ""
        message = f"got {table['distribution']!r}; scipy.stats has no continuous distribution of that name{told}"
        problems.append(Problem(file, f"{key}.distribution", message))
        return None
    units = {**dict.fromkeys(shape_names(name), "1"), "loc": source.unit, "scale": source.unit}
    before = len(problems)
    for extra in table.keys() - units.keys() - {"distribution"}:
        message = f"unknown key of {SCIPY}{name}{suggestion(extra, list(units))}"
        problems.append(Problem(file, f"{key}.{extra}", message))
    values: dict[str, float] = {"loc": 0.0}
    for entry, unit in units.items():
        if entry not in table:
            if entry != "loc":
                needs = " and ".join(each for each in units if each != "loc")
                problems.append(Problem(file, f"{key}.{entry}", f"is missing; {SCIPY}{name} needs {needs}"))
            continue
        try:
            values[entry] = quantity(table[entry], unit)
        except UnitError as wrong:
            problems.append(Problem(file, f"{key}.{entry}", str(wrong)))
    if len(problems) > before:
        return None
    shapes = tuple((entry, values[entry]) for entry in shape_names(name))
    try:
        return ScipyDistribution(name, shapes, values["loc"], values["scale"])
    except ValueError as wrong:
        problems.append(Problem(file, key, str(wrong)))
        return None


def read_table(
    table: Mapping[str, Any], source: Source, file: str, key: str, problems: list[Problem]
) -> EmpiricalDistribution | None:
    """``{ distribution = "table", file = "gyro.csv", column = "drift", unit = "deg/h" }``: a column of CSV or parquet.

    The path is relative to the campaign file. ``sha256``, which a run folder's own campaign file has, must be that of
    the values.
    """
    before = len(problems)
    keys = ["file", "column", "unit", "sha256"]
    for extra in table.keys() - {*keys, "distribution"}:
        message = f"unknown key of a table{suggestion(extra, keys)}"
        problems.append(Problem(file, f"{key}.{extra}", message))
    for name in keys[:3]:
        if not isinstance(table.get(name), str):
            message = "is missing; a table needs file and column and unit"
            if name in table:
                message = f"got {table[name]!r}; expected text in quotes"
            problems.append(Problem(file, f"{key}.{name}", message))
    if len(problems) > before:
        return None
    try:
        factor = quantity(f"1 {table['unit']}", source.unit)
    except UnitError as wrong:
        problems.append(Problem(file, f"{key}.unit", str(wrong)))
        return None
    path = Path(file).parent / table["file"]
    try:
        found = EmpiricalDistribution(_column(path, table["column"]) * factor)
    except _TableError as wrong:
        problems.append(Problem(file, f"{key}.{wrong.key}", str(wrong)))
        return None
    except ValueError as wrong:
        problems.append(Problem(file, f"{key}.column", f"{path}, {table['column']!r}: {wrong}"))
        return None
    if table.get("sha256", found.digest) != found.digest:
        problems.append(Problem(file, f"{key}.sha256", f"{path} does not hold the values that it did"))
        return None
    return found


class _TableError(Exception):
    """What is wrong with a table, and the key that would have to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


def _column(path: Path, name: str) -> NDArray[np.float64]:
    """A column of numbers."""
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
        raise _TableError("file", f"{path}: is no table: {str(failure).splitlines()[0]}") from None
    if name not in frame.columns:
        names = [str(column) for column in frame.columns]
        raise _TableError("column", f"{path} has no column {name!r}{suggestion(name, names[:20])}")
    try:
        return np.asarray(frame[name].to_numpy(dtype=float))
    except (TypeError, ValueError):
        raise _TableError("column", f"{path}, {name!r}: holds something that is no number") from None


def resolved_table(source: Source, values: EmpiricalDistribution) -> tuple[dict[str, str], str, bytes]:
    """How a run folder keeps a table: the entry that reads it again, its path there, and its content."""
    path = f"{TABLES}/{source.name}.csv"
    entry = {"distribution": TABLE, "file": path, "column": "value", "unit": source.unit, "sha256": values.digest}
    lines = "".join(f"{float(value)!r}\n" for value in values.values)
    return entry, path, f"value\n{lines}".encode()
