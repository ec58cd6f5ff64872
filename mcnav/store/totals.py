"""Totals over all chunks of a run, by one pass over their files, whose metadata are most of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow.parquet as pq

from mcnav.arrays.types import Array
from mcnav.caches.recent import Recent
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.power_sums import PowerSums
from mcnav.statistics.filter_sums import FilterSums
from mcnav.store.chunk_files import ChunkFile
from mcnav.store.filters import SMOOTHER_MARK, filter_sums_in
from mcnav.store.histories import (
    FIRST_MARK,
    FIRST_SMOOTHED_MARK,
    SMOOTHED_MARK,
    first_histories_in,
    power_sums_in,
)


@dataclass(frozen=True)
class Totals:
    """Totals of chunks.

    Attributes
    ----------
    power_sums : PowerSums or None
    filter_sums : FilterSums or None
    smoothed_sums, smoother_sums : PowerSums or None, FilterSums or None
        Of a smoother.
    first, first_smoothed : ndarray, shape (n, m, outputs), or None
        Histories of the first samples, and behind a smoother; none unless all of their chunks have them.
    """

    power_sums: PowerSums | None
    filter_sums: FilterSums | None
    first: Array | None
    smoothed_sums: PowerSums | None = None
    smoother_sums: FilterSums | None = None
    first_smoothed: Array | None = None


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
    _KNOWN.get((key, False), lambda: replace(totals, first=None, first_smoothed=None))
    return totals


def _add_up(
    pivot: Array, schema: FilterSchema | None, smoother: FilterSchema | None, folder: Path,
    chunks: Sequence[ChunkFile], histories: bool,
) -> Totals:  # fmt: skip
    """Read the files of chunks for `read_totals`."""
    power, filters = None, None
    smoothed, smoothers = None, None
    first, first_smoothed = _First(FIRST_MARK, pivot.shape), _First(FIRST_SMOOTHED_MARK, pivot.shape)
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
        if histories:
            first.read(marks, chunk)
            first_smoothed.read(marks, chunk)
    return Totals(power, filters, first.whole, smoothed, smoothers, first_smoothed.whole)


@dataclass
class _First:
    """Histories of the first samples, of one kind, put together from chunks; ``shape`` has epochs and outputs."""

    mark: str
    shape: tuple[int, ...]
    known: bool = True
    parts: list[Array] = field(default_factory=list)

    def read(self, marks: Mapping[bytes, bytes], chunk: ChunkFile) -> None:
        """Append those of a chunk; where one has none, none are known."""
        histories = first_histories_in(marks, chunk, self.shape, self.mark) if self.known else None
        self.known = histories is not None
        self.parts += [] if histories is None else [histories]

    @property
    def whole(self) -> Array | None:
        """All of them, shape (n, m, outputs); none unless all chunks have theirs."""
        return np.concatenate(self.parts) if self.known and self.parts else None
