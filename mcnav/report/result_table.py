"""A table of results as columns: what frames, CSV files, JSON and the terminal are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.units import conversion

if TYPE_CHECKING:
    import pandas as pd

Units = Literal["shown", "SI"]
"""Units of a table's numbers: those that reports show, or SI."""

Row = dict[str, Any]


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
    """

    name: str
    title: str
    keys: int
    columns: Mapping[str, Sequence[Any] | NDArray[Any]]

    @classmethod
    def of_rows(cls, name: str, title: str, keys: int, rows: Sequence[Mapping[str, Any]]) -> ResultTable:
        """Build a table from rows; a cell that a row does not have is none."""
        names = dict.fromkeys(key for row in rows for key in row)
        return cls(name, title, keys, {key: [row.get(key) for row in rows] for key in names})

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
    numeric = not isinstance(values, np.ndarray) and any(isinstance(each, float) for each in values)
    if numeric and all(each is None or isinstance(each, (int, float)) for each in values):
        return np.array([np.nan if each is None else each for each in values], dtype=float)
    return values


def in_units(unit: str, shown_in: str, units: Units) -> tuple[float, str]:
    """Return the factor from SI to the chosen units, and the unit.

    >>> in_units("m", "km", "shown"), in_units("m", "km", "SI")
    ((0.001, 'km'), (1.0, 'm'))
    """
    return (conversion(unit, shown_in), shown_in) if units == "shown" else (1.0, unit)
