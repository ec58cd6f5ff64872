"""Results over the flight by name: each column is defined once, for tables, data frames and data sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.report.columns.result_table import ResultTable

Subject = TypeVar("Subject")
"""Values from which the columns of a table are computed."""


@dataclass(frozen=True)
class TimeColumn(Generic[Subject]):
    """A column of a table over time.

    Attributes
    ----------
    name : str
        In tables.
    value : callable
        Returns the values, shape (epochs, names); none where they are not known, and then there is no column.
    ends : callable, optional
        Returns intervals, shape (epochs, names, 2): the columns ``NAME_from`` and ``NAME_to``.
    scaled : bool
        Whether values are in SI, and are shown in the unit of their row.
    variable : str
        In a data set, where another table has a column of that name.
    """

    name: str
    value: Callable[[Subject], Array | None]
    ends: Callable[[Subject], Array] | None = None
    scaled: bool = False
    variable: str = ""

    def columns(self, subject: Subject, scale: Array) -> Iterator[tuple[str, str, Array]]:
        """Yield name, name in a data set, and values of the column and of those of its interval."""
        values, variable = self.value(subject), self.variable or self.name
        if values is None:
            return
        yield self.name, variable, values * scale if self.scaled else values
        if self.ends is not None:
            ends = self.ends(subject)
            for k, end in enumerate(("from", "to")):
                yield f"{self.name}_{end}", f"{variable}_{end}", ends[:, :, k] * scale if self.scaled else ends[:, :, k]


@dataclass(frozen=True, eq=False)
class OverTime:
    """Results over time, by one or two kinds of names.

    Attributes
    ----------
    label : str
        Of the times.
    names : mapping of str to sequence of str
        By kind, such as ``output``.
    fixed : mapping of str to sequence
        What does not change over time, such as ``unit``, one entry for each name of the first kind.
    columns : mapping of str to ndarray
        Shape (epochs, names) or (epochs, names of the first kind, names of the second kind).
    variables : mapping of str to str
        Columns by their names in a data set; empty where it has none of them.
    """

    name: str
    title: str
    label: str
    times: Array
    names: Mapping[str, Sequence[str]]
    fixed: Mapping[str, Sequence[Any]]
    columns: Mapping[str, Array]
    variables: Mapping[str, str]

    @classmethod
    def of_columns(
        cls,
        name: str,
        title: str,
        times: tuple[str, Array],
        names: Mapping[str, Sequence[str]],
        fixed: Mapping[str, Sequence[Any]],
        *parts: tuple[Sequence[TimeColumn[Any]], Any],
        scale: Array | float = 1.0,
        prefix: str = "",
    ) -> OverTime:
        """Compute columns from their definitions.

        Parameters
        ----------
        times : (str, ndarray)
            Their label, and the times.
        parts : (sequence of TimeColumn, object)
            Definitions, and what they are computed from.
        scale : ndarray, shape (names,)
            Factors from SI to the units of the rows.
        prefix : str
            What precedes the names of the columns in a data set.
        """
        columns, variables = dict[str, Array](), dict[str, str]()
        for definitions, subject in parts:
            for definition in definitions:
                for column, variable, values in definition.columns(subject, np.asarray(scale)):
                    columns[column], variables[f"{prefix}{variable}"] = values, column
        return cls(name, title, *times, names, fixed, columns, variables)

    @property
    def table(self) -> ResultTable:
        """A row for each epoch and name."""
        shape = (len(self.times), *map(len, self.names.values()))

        def spread(values: Sequence[Any] | NDArray[Any], axis: int) -> NDArray[Any]:
            column = np.array(values, dtype=object if isinstance(values[0], str) else None) if len(values) else values
            along = np.reshape(column, [-1 if k == axis else 1 for k in range(len(shape))])
            return np.broadcast_to(along, shape).ravel()

        columns = {self.label: spread(self.times, 0)}
        columns |= {kind: spread(names, axis) for axis, (kind, names) in enumerate(self.names.items(), start=1)}
        columns |= {name: spread(values, 1) for name, values in self.fixed.items()}
        columns |= {name: np.asarray(values).ravel() for name, values in self.columns.items()}
        return ResultTable(self.name, self.title, len(shape), columns)
