"""Totals over all chunks of a run, by one pass over their files, whose metadata are most of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow.parquet as pq

from mcnav._dataclasses import dataclass
from mcnav._recent import Recent
from mcnav._types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.power_sums import PowerSums
from mcnav.statistics.filter_sums import FilterSums
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.filters import SMOOTHER_MARK, filter_sums_in
from mcnav.store.histories import SMOOTHED_MARK, first_histories_in, power_sums_in


@dataclass(frozen=True)
class Totals:
    """Totals of chunks.

    Attributes
    ----------
    power_sums : PowerSums or None
    filter_sums : FilterSums or None
    smoothed_sums, smoother_sums : PowerSums or None, FilterSums or None
        Of a smoother.
    first : ndarray, shape (n, m, outputs), or None
        Histories of the first samples; none unless all of their chunks have them.
    """

    power_sums: PowerSums | None
    filter_sums: FilterSums | None
    first: Array | None
    smoothed_sums: PowerSums | None = None
    smoother_sums: FilterSums | None = None


_KNOWN: Final = Recent[Totals](most=2)
"""The last totals: a run adds them up for its tables over time, and its analysis needs them again."""


def read_totals(
    pivot: Array, schema: FilterSchema | None, folder: Path, chunks: Sequence[ChunkFile], histories: bool = False,
    smoother: FilterSchema | None = None,
) -> Totals:  # fmt: skip
    """Add up the sums of chunks in order of index; see `Totals`.

    Parameters
    ----------
    pivot : ndarray, shape (m, outputs)
        Of the power sums.
    schema : FilterSchema or None
        None where samples have no filter.
    smoother : FilterSchema or None
        None where samples have no smoother.
    histories : bool
        Whether to read the histories of the first samples.

    Raises
    ------
    OSError, ValueError, OverflowError, pyarrow.ArrowException, zlib.error
        When a file cannot be read.
    """
    key = folder, tuple(chunk.sha256 for chunk in chunks), pivot.shape, pivot.tobytes(), repr((schema, smoother))
    if not histories:
        return _KNOWN.get((key, False), lambda: _add_up(pivot, schema, smoother, folder, chunks, False))
    totals = _add_up(pivot, schema, smoother, folder, chunks, True)
    _KNOWN.get((key, False), lambda: replace(totals, first=None))
    return totals


def _add_up(
    pivot: Array, schema: FilterSchema | None, smoother: FilterSchema | None, folder: Path,
    chunks: Sequence[ChunkFile], histories: bool,
) -> Totals:  # fmt: skip
    """Read the files of chunks for `read_totals`."""
    power, filters, first, known = None, None, list[Array](), histories
    smoothed, smoothers = None, None
    for chunk in chunks:
        marks = pq.read_metadata(folder / chunk.file).metadata or {}
        if (power_sums := power_sums_in(marks, pivot)) is not None:
            power = power_sums if power is None else power + power_sums
        if schema is not None and (filter_sums := filter_sums_in(marks, schema)) is not None:
            filters = filter_sums if filters is None else filters + filter_sums
        if smoother is not None:
            if (power_sums := power_sums_in(marks, np.zeros_like(pivot), SMOOTHED_MARK)) is not None:
                smoothed = power_sums if smoothed is None else smoothed + power_sums
            if (filter_sums := filter_sums_in(marks, smoother, SMOOTHER_MARK)) is not None:
                smoothers = filter_sums if smoothers is None else smoothers + filter_sums
        if known:
            first_histories = first_histories_in(marks, chunk, pivot.shape)
            known = first_histories is not None
            first += [] if first_histories is None else [first_histories]
    return Totals(power, filters, np.concatenate(first) if known and first else None, smoothed, smoothers)
