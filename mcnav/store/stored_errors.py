"""What a run folder holds of errors over time: sums of filters, and the histories of its first samples."""

from __future__ import annotations

import zlib
from collections.abc import Set
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from mcnav.arrays.types import Array
from mcnav.errors import RunFolderError
from mcnav.store.histories import STORED, origin_in
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import HISTORIES, SMOOTHED
from mcnav.store.run_folder import RunFolder
from mcnav.store.totals import Totals, read_totals


@dataclass(frozen=True)
class StoredHistories:
    """Errors of a run's first samples at m epochs, shapes (m,) and (n, m, outputs), and what they are measured from."""

    times: Array
    errors: Array
    origin: Array | None


def read_filter_totals(folder: RunFolder, manifest: Manifest) -> Totals | None:
    """Read the sums of filters and smoothers; none without a filter, `RunFolderError` where they are damaged."""
    outputs, record, smoother = manifest.model.outputs, manifest.model.filter, manifest.model.smoother
    if record is None:
        return None
    behind = None if smoother is None else smoother.claims.columns
    try:
        pivot = np.zeros((len(record.times), len(outputs)))
        totals = read_totals(pivot, record.columns, folder.chunk_folder, manifest.chunks, smoother=behind)
        sums = totals.filter_sums
        if sums is not None and len(sums.counts) != len(record.times) + 1:
            raise ValueError(f"{len(sums.counts) - 1} epochs in place of {len(record.times)}")
    except (OSError, ValueError, OverflowError, pa.ArrowException, zlib.error) as failure:
        raise RunFolderError(f"{folder.chunk_folder}: sums of filters are damaged ({failure})") from None
    return totals


def read_histories(
    folder: RunFolder, manifest: Manifest, asked: Set[bool]
) -> tuple[StoredHistories | None, StoredHistories | None]:
    """Read the histories of a run's first samples, and those behind its smoother; none where the run has none.

    ``asked`` has False for the first, True for the second; others are not read.
    """
    names = [f"{output.name} [{output.unit}]" for output in manifest.model.outputs]
    tables = [
        folder.histories(STORED, names, file) if behind in asked else None
        for behind, file in enumerate((HISTORIES, SMOOTHED))
    ]
    moments = folder.epochs() if any(table is not None for table in tables) else None
    origin = None if moments is None else origin_in(moments[0], names)
    plain, smoothed = (
        None
        if table is None
        else StoredHistories(table[1], np.stack([table[2][name] for name in names], axis=2)[: manifest.samples], origin)
        for table in tables
    )
    return plain, smoothed
