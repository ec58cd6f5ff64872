"""Tables of many rows that are computed where they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray

KEPT: Final = 8_192
"""Rows up to which a whole table is kept."""


class Rows:
    """A table whose rows are computed when a slice of them is asked for; a short one is computed once.

    Parameters
    ----------
    shape : tuple of int
        Of the whole table.
    make : callable
        From the first and past the last row to those.

    Examples
    --------
    >>> table = Rows((3, 1), lambda first, last: np.arange(first, last)[:, None] ** 2.0)
    >>> table[1:].tolist(), table.shape
    ([[1.0], [4.0]], (3, 1))
    """

    def __init__(self, shape: tuple[int, ...], make: Callable[[int, int], Array]) -> None:
        self.shape, self._make = shape, make

    @cached_property
    def _whole(self) -> Array:
        return self._make(0, self.shape[0])

    def __getitem__(self, rows: slice | int) -> Array:
        """Return the rows of a slice, or one by its number."""
        if not isinstance(rows, slice):
            return np.asarray(self[rows : rows + 1][0])
        first, last, _ = rows.indices(self.shape[0])
        return self._whole[first:last] if self.shape[0] <= KEPT else self._make(first, max(first, last))


Table = Array | Rows
"""A table that is held, or whose rows are computed; both give the rows of a slice, or one by its number."""


def rows_at(table: Table, numbers: IndexArray) -> Array:
    """Return rows by their numbers, in any order."""
    if not isinstance(table, Rows):
        return np.asarray(table[numbers])
    none = np.zeros((0, *table.shape[1:]))
    return np.concatenate([none, *(table[number : number + 1] for number in numbers.tolist())])
