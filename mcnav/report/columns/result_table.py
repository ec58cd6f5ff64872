"""A table of results, and its columns: each is defined once, for pages, terminals, data frames, CSV and JSON.

A `ResultColumn` has a name and a value for data, and `mcnav.report.document.Column` where people read it. One renderer
a medium shows them: ``templates/parts.html`` on pages, `mcnav.report.document.terminal_parts.fitted` in terminals,
`ResultTable.frame` in notebooks, `mcnav.report.exports.export` as CSV and JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcnav.physics.units import conversion
from mcnav.report.document.table import Column, Table

if TYPE_CHECKING:
    import pandas as pd

Units = Literal["shown", "SI"]
"""Units of a table's numbers: those that reports show, or SI."""

Row = dict[str, Any]


Entry = TypeVar("Entry")
"""Content of which a row of a table is made."""

Interval = Sequence[float | None] | NDArray[Any] | None


@dataclass(frozen=True)
class ResultColumn(Generic[Entry]):
    """A column of a table.

    Attributes
    ----------
    name : str
        In data.
    value : function
        Of an entry; in data, in the unit of its row.
    shown : tuple of Column
        What people read of it, on pages and in terminals; a column without any is in data alone.
    ends : function, optional
        Interval of the value: in data the columns ``NAME_from`` and ``NAME_to``.
    """

    name: str
    value: Callable[[Entry], Any]
    shown: tuple[Column[Entry], ...] = ()
    ends: Callable[[Entry], Interval] | None = None

    def cells(self, entry: Entry) -> Row:
        """Return the cells of an entry, in data."""
        return {self.name: self.value(entry), **({} if self.ends is None else between(self.name, self.ends(entry)))}


def between(name: str, ends: Interval) -> Row:
    """Return the columns of an interval, in data."""
    low, high = (None, None) if ends is None else ends
    return {f"{name}_from": low, f"{name}_to": high}


def row_of(columns: Sequence[ResultColumn[Entry]], entry: Entry) -> Row:
    """Return the row of an entry, in data."""
    return {key: cell for column in columns for key, cell in column.cells(entry).items()}


@dataclass(frozen=True, eq=False)
class ResultTable:
    """A table of results.

    Numbers with a dimension are in the unit that the heading of their column has in brackets, or else in that of the
    column ``unit`` of their row. Ratios, shares and probabilities have none.

    Attributes
    ----------
    name : str
        Name of its file.
    title : str
        Contents in a few words.
    keys : int
        The first columns, which identify a row.
    columns : mapping of str to sequence
        Of one length.
    read : Table
        The columns that people read; without any they read the data.
    """

    name: str
    title: str
    keys: int
    columns: Mapping[str, Sequence[Any] | NDArray[Any]]
    read: Table[Any] = field(default_factory=lambda: Table("", (), ()))

    @classmethod
    def of_rows(cls, name: str, title: str, keys: int, rows: Sequence[Mapping[str, Any]]) -> ResultTable:
        """Build a table from rows; a cell that a row does not have is none."""
        names = dict.fromkeys(key for row in rows for key in row)
        return cls(name, title, keys, {key: [row.get(key) for row in rows] for key in names})

    @classmethod
    def of_entries(
        cls,
        name: str,
        title: str,
        keys: int,
        columns: Sequence[ResultColumn[Entry]],
        entries: Sequence[Entry],
        caption: str = "",
    ) -> ResultTable:
        """Build a table from what its rows are made of; ``caption`` is that of a page."""
        shown = [each for column in columns for each in column.shown]
        table = cls.of_rows(name, title, keys, [row_of(columns, entry) for entry in entries])
        return replace(table, read=Table(caption, shown, entries, title, keys))

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    @property
    def rows(self) -> list[Row]:
        """The rows, by the names of the columns."""
        columns = [values.tolist() if isinstance(values, np.ndarray) else values for values in self.columns.values()]
        return [dict(zip(self.columns, row, strict=True)) for row in zip(*columns, strict=True)]

    def frame(self, indexed: bool = False) -> pd.DataFrame:
        """Return the table in pandas; if ``indexed``, the columns that identify a row are its index."""
        import pandas as pd

        frame = pd.DataFrame({name: _plain(values) for name, values in self.columns.items()})
        return frame.set_index(list(self.columns)[: self.keys]) if indexed and len(self) else frame


def _plain(values: Sequence[Any] | NDArray[Any]) -> Sequence[Any] | NDArray[Any]:
    """Convert a list of numbers with gaps to an array with NaN in them; others stay."""
    numeric = not isinstance(values, np.ndarray) and any(isinstance(value, float) for value in values)
    if numeric and all(value is None or isinstance(value, (int, float)) for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return values


def in_units(unit: str, shown_in: str, units: Units) -> tuple[float, str]:
    """Return the factor from SI to the chosen units, and the unit.

    >>> in_units("m", "km", "shown"), in_units("m", "km", "SI")
    ((0.001, 'km'), (1.0, 'm'))
    """
    return (conversion(unit, shown_in), shown_in) if units == "shown" else (1.0, unit)
