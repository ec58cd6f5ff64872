"""Errors throughout the flight: power sums in the chunks' files, their total, and the tables made of them.

The power sums of a chunk's samples are metadata of its file, under the file's checksum. Added up in order of index they
are the same, bit for bit, for any number of workers and interruptions.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mcnav.arrays.types import Array
from mcnav.contract.history import Epochs
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.files.parquet import arrow_table, numbers_in, parquet_bytes
from mcnav.files.parquet_reading import check_room
from mcnav.files.whole import check_regular
from mcnav.store.chunk_files import ChunkFile

MARK: Final = "mcnav.histories"
SMOOTHED_MARK: Final = "mcnav.smoothed"
FIRST_MARK: Final = "mcnav.first_histories"
FIRST_SMOOTHED_MARK: Final = "mcnav.first_smoothed"
PERCENTILES: Final = (1.0, 5.0, 50.0, 95.0, 99.0)
"""Percentiles of the samples whose histories are stored."""

ORIGIN: Final = "origin "
"""Beginning of the names of columns of what outputs are measured from."""

STORED: Final = 2_000
"""Samples whose histories are stored in full: the first of the campaign."""

LARGEST: Final = 900_000_000
"""Bytes of their histories: of the file, and of the table in it."""

MOST_EPOCHS: Final = 10_000
"""Epochs up to which as many samples are read as are asked for."""


def history_marks(power_sums: PowerSums | None, mark: str = MARK) -> dict[str, str]:
    """Encode power sums as metadata of a chunk's file."""
    if power_sums is None:
        return {}
    numbers = np.append(power_sums.sums.ravel(), float(power_sums.count)).astype("<f8")
    return {mark: base64.b64encode(numbers.tobytes()).decode()}


def power_sums_in(marks: Mapping[bytes, bytes], pivot: Array, mark: str = MARK) -> PowerSums | None:
    """Decode the power sums, about a pivot of shape (m, outputs), in the metadata of a chunk's file; none without."""
    text = marks.get(mark.encode())
    if text is None:
        return None
    numbers = np.frombuffer(base64.b64decode(text), dtype="<f8")
    return PowerSums(int(numbers[-1]), pivot, numbers[:-1].reshape(len(pivot), -1).astype(float))


def first_marks(histories: Array | None, mark: str = FIRST_MARK) -> dict[str, str]:
    """Encode histories of samples, shape (n, m, outputs), as metadata of a chunk's file."""
    if histories is None or not len(histories):
        return {}
    return {mark: base64.b64encode(histories.astype("<f8").tobytes()).decode()}


def first_histories_in(
    marks: Mapping[bytes, bytes], chunk: ChunkFile, shape: tuple[int, ...], mark: str = FIRST_MARK
) -> Array | None:
    """Decode the histories of a chunk's samples that are among the first, shape (n, m, outputs); none without them.

    Parameters
    ----------
    shape : tuple of int
        Epochs and outputs.
    """
    wanted = max(min(chunk.end, STORED) - chunk.begin, 0)
    numbers = np.empty(0)
    if wanted:
        numbers = np.frombuffer(base64.b64decode(marks.get(mark.encode(), b"")), dtype="<f8").astype(float)
    return numbers.reshape(wanted, *shape) if len(numbers) == wanted * math.prod(shape) else None


def histories_table(epochs: Epochs, outputs: Sequence[Output], histories: Array) -> bytes:
    """Tabulate histories of samples, shape (n, m, outputs): a row for each sample and epoch, NaN where unknown."""
    count, instants, _ = histories.shape
    columns = {"index": np.repeat(np.arange(count), instants), epochs.label: np.tile(epochs.times, count)}
    for number, output in enumerate(outputs):
        columns[f"{output.name} [{output.unit}]"] = histories[:, :, number].ravel()
    return parquet_bytes(arrow_table(columns))


def epochs_table(
    epochs: Epochs,
    outputs: Sequence[Output],
    sums: PowerSums,
    linear: tuple[Array, Array],
    histories: Array,
    further: Mapping[str, Array] | None = None,
    origin: Array | None = None,
) -> bytes:
    """Tabulate moments of all samples, linear moments and percentiles of the stored histories at every epoch.

    Columns, for each output: ``mean``, ``sigma``, ``third``, ``fourth`` (central moments), ``linear mean``, ``linear
    sigma`` and percentiles, and ``origin`` where it is measured from the nominal flight; for each pair ``covariance``.
    Units are in the names.

    Parameters
    ----------
    linear : (ndarray, ndarray), shapes (m, outputs) and (m, outputs, outputs)
        Linear mean and covariance.
    histories : ndarray, shape (n, m, outputs)
    further : mapping of str to ndarray, shape (m,), optional
        Further columns.
    origin : ndarray, shape (m, outputs), optional
        See `mcnav.contract.linear.LinearSystem`.
    """
    covariance, third, fourth = sums.covariance, sums.third, sums.fourth
    complete = histories[np.isfinite(histories).all(axis=(1, 2))]
    ranked = np.full((len(PERCENTILES), *third.shape), np.nan)
    if len(complete):
        ranked = np.percentile(complete, PERCENTILES, axis=0)
    columns = {epochs.label: epochs.times}
    for i, output in enumerate(outputs):
        name, unit = output.name, output.unit
        columns[f"mean {name} [{unit}]"] = sums.mean[:, i]
        columns[f"sigma {name} [{unit}]"] = np.sqrt(np.maximum(covariance[:, i, i], 0.0))
        columns[f"third {name} [({unit})^3]"] = third[:, i]
        columns[f"fourth {name} [({unit})^4]"] = fourth[:, i]
        columns[f"linear mean {name} [{unit}]"] = linear[0][:, i]
        columns[f"linear sigma {name} [{unit}]"] = np.sqrt(np.maximum(linear[1][:, i, i], 0.0))
        for level, values in zip(PERCENTILES, ranked, strict=True):
            columns[f"percentile {level:g} {name} [{unit}]"] = values[:, i]
        if origin is not None and origin[:, i].any():
            columns[f"{ORIGIN}{name} [{unit}]"] = origin[:, i]
    for i, one in enumerate(outputs):
        for j, other in enumerate(outputs[:i]):
            unit = f"({other.unit})({one.unit})"
            columns[f"covariance {other.name}, {one.name} [{unit}]"] = covariance[:, i, j]
    columns |= further or {}
    described = {"events": dict(epochs.events), "samples": sums.count, "stored": len(complete)}
    return parquet_bytes(arrow_table(columns).replace_schema_metadata({"mcnav.epochs": json.dumps(described)}))


def origin_in(columns: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    """Return what outputs are measured from, shape (m, outputs), by the columns of a table of epochs; none: zero.

    Parameters
    ----------
    names : sequence of str
        Of the outputs, as ``name [unit]``.
    """
    if not any(f"{ORIGIN}{name}" in columns for name in names):
        return None
    nothing = np.zeros(len(next(iter(columns.values()))))
    return np.column_stack([columns.get(f"{ORIGIN}{name}", nothing) for name in names])


def first_histories(
    path: Path, samples: int, expected: Sequence[str] | None = None
) -> tuple[str, Array, dict[str, Array]]:
    """Read the first samples of a table of histories: label and times of the epochs, errors of each output.

    Raises what pyarrow raises, or `ValueError`, when the file holds no such table, or not of the expected outputs.
    """
    check_regular(path, LARGEST)
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        if expected is not None and file.schema_arrow.names[2:] != list(expected):
            raise ValueError("it has other columns")
        check_room(file.metadata, path.stat().st_size, LARGEST)
        first = next(file.iter_batches(batch_size=samples * MOST_EPOCHS), None)
        if first is None:
            raise ValueError("it has no rows")
        index, label, *outputs = first.schema.names
        numbers = {name: numbers_in(pa.chunked_array([first.column(name)])) for name in first.schema.names}
    epochs = int(np.count_nonzero(numbers[index] == numbers[index][0]))
    known = min(len(numbers[index]) // epochs, samples)
    shaped = {name: numbers[name][: known * epochs].reshape(known, epochs).astype(float) for name in outputs}
    return label, numbers[label][:epochs].astype(float), shaped
