"""Totals over all chunks of a run, by one pass over their files, whose metadata are most of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow.parquet as pq

from mcnav._recent import Recent
from mcnav._types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.power_sums import PowerSums
from mcnav.statistics.filter_sums import FilterSums
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.filters import filter_sums_in
from mcnav.store.histories import first_histories_in, power_sums_in


@dataclass(frozen=True)
class Totals:
    """Totals of chunks.

    Attributes
    ----------
    power_sums : PowerSums or None
    filter_sums : FilterSums or None
    first : ndarray, shape (n, m, outputs), or None
        Histories of the first samples; none unless all of their chunks have them.
    """

    power_sums: PowerSums | None
    filter_sums: FilterSums | None
    first: Array | None


_KNOWN: Final = Recent[Totals](most=2)
"""The last totals: a run adds them up for its tables over time, and its analysis needs them again."""


def read_totals(
    pivot: Array, schema: FilterSchema | None, folder: Path, chunks: Sequence[ChunkFile], histories: bool = False
) -> Totals:
    """Add up the sums of chunks in order of index; see `Totals`.

    Parameters
    ----------
    pivot : ndarray, shape (m, outputs)
        Of the power sums.
    schema : FilterSchema or None
        None where samples have no filter.
    histories : bool
        Whether to read the histories of the first samples.

    Raises
    ------
    OSError, ValueError, OverflowError, pyarrow.ArrowException, zlib.error
        When a file cannot be read.
    """
    key = folder, tuple(chunk.sha256 for chunk in chunks), pivot.shape, pivot.tobytes(), repr(schema)
    if not histories:
        return _KNOWN.get((key, False), lambda: _add_up(pivot, schema, folder, chunks, False))
    totals = _add_up(pivot, schema, folder, chunks, True)
    _KNOWN.get((key, False), lambda: replace(totals, first=None))
    return totals


def _add_up(
    pivot: Array, schema: FilterSchema | None, folder: Path, chunks: Sequence[ChunkFile], histories: bool
) -> Totals:
    """Read the files of chunks for `read_totals`."""
    power, filters, first, known = None, None, list[Array](), histories
    for chunk in chunks:
        marks = pq.read_metadata(folder / chunk.file).metadata or {}
        if (power_sums := power_sums_in(marks, pivot)) is not None:
            power = power_sums if power is None else power + power_sums
        if schema is not None and (filter_sums := filter_sums_in(marks, schema)) is not None:
            filters = filter_sums if filters is None else filters + filter_sums
        if known:
            first_histories = first_histories_in(marks, chunk, pivot.shape)
            known = first_histories is not None
            first += [] if first_histories is None else [first_histories]
    return Totals(power, filters, np.concatenate(first) if known and first else None)
