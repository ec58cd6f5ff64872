"""A recorded table whose columns are read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from numpy.typing import NDArray

Values: TypeAlias = NDArray[Any]
"""A column, shape (n,): integers, floating-point numbers with NaN where they are missing, or objects."""


@dataclass(frozen=True)
class LogTable:
    """Columns of a recorded file.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Names of the columns, in order, as they are written; "1", "2", ... without a header.
    read : callable
        ``read(names)``: these columns by their names; `LogError` when one cannot be read.
    headless : bool
        Whether the file does not name its columns.
    units : mapping of str to str
        Units that the format, not the names, gives to columns.
    notes : tuple of str
        What was noticed, one line each.
    """

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], Mapping[str, Values]]
    headless: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def table_of(
    path: Path, columns: Mapping[str, Values], units: Mapping[str, str] | None = None, notes: Sequence[str] = ()
) -> LogTable:
    """Make a table of columns that are in memory."""
    return LogTable(
        path, tuple(columns), lambda names: {name: columns[name] for name in names},
        units=dict(units or {}), notes=tuple(notes),
    )  # fmt: skip
