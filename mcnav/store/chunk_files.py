"""Files of samples: one chunk each, in parquet, verified by its content."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import Field

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.failure import OK, Failure
from mcnav.files.parquet import arrow_array, arrow_texts, numbers_in, parquet_bytes, repeated_text
from mcnav.files.parquet_reading import LARGEST_TABLE, read_table, table_from
from mcnav.files.whole import read_whole, write_whole

_TEXT: Final = ("status",)
STATUS: Final = 1
"""Number of the column of texts."""

MOST_TRACEBACKS: Final = 500_000
"""Characters of tracebacks that a file has; beyond it a failed sample has its reason, and can be replayed."""

MOST_SAMPLES: Final = 1_000_000_000_000

CHECKSUM: Final = "mcnav.checksum"
"""Entry of a file's metadata: the checksum of the others, which no checksum of parquet covers."""

Words = Annotated[str, Field(max_length=2_000)]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=0, le=MOST_SAMPLES)]


@dataclass(frozen=True)
class ChunkFile:
    """A file of samples [begin, end), as the manifest lists it; annotations are checked where a manifest is read."""

    file: Annotated[str, Field(pattern=r"^part-[0-9]{5,9}\.parquet$")]
    begin: Count
    end: Count
    failed: Count
    fallback_count: Annotated[Count, Field(alias="handed_over")]
    sha256: Digest


@dataclass(frozen=True)
class Samples:
    """All samples of a run.

    Attributes
    ----------
    index : ndarray of int, shape (n,)
    status : list of str
        ``ok``, or why the sample failed.
    errors : ndarray, shape (n, sources)
        SI.
    outputs : ndarray, shape (n, outputs)
        SI; NaN in the row of a sample that failed.
    linear : ndarray, shape (n, outputs) or (n, 0)
        Outputs by the linear system with the same noise, SI; no columns where samples have no noise.
    filter : ndarray, shape (n, outputs + 1) or (n, 0)
        Sigmas of the outputs that the sample's filter states at the end, SI, and the NEES; no columns without a filter.
    """

    index: IndexArray
    status: list[str]
    errors: Array
    outputs: Array
    linear: Array
    filter: Array


@dataclass(frozen=True)
class SampleSchema:
    """Columns of the sample files.

    ``error NAME [unit]``, ``output NAME [unit]``; with noise ``linear NAME [unit]``; with a filter ``filter NAME
    [unit]``, its sigma, and ``nees``.
    """

    errors: tuple[str, ...]
    outputs: tuple[str, ...]
    linear: tuple[str, ...] = ()
    filter: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, sources: Sequence[Any], outputs: Sequence[Any], noise: bool = False, filtered: bool = False
    ) -> SampleSchema:
        """Derive the columns from sources and outputs that have names and units."""
        return cls(
            tuple(f"error {source.name} [{source.unit}]" for source in sources),
            tuple(f"output {output.name} [{output.unit}]" for output in outputs),
            tuple(f"linear {output.name} [{output.unit}]" for output in outputs) if noise else (),
            (*(f"filter {output.name} [{output.unit}]" for output in outputs), "nees") if filtered else (),
        )


def chunk_name(number: int) -> str:
    """Return the file name of a chunk by its number."""
    return f"part-{number:05d}.parquet"


@dataclass(frozen=True)
class ChunkTotals:
    """Totals of all samples of a chunk, also of those without rows; ``tracebacks`` by row."""

    samples: int
    failed: int
    fallback_count: int
    tracebacks: Mapping[int, str]


def write_chunk(
    folder: Path,
    number: int,
    begin: int,
    identity: str,
    layout: SampleSchema,
    errors: Array,
    outputs: Array,
    failures: Mapping[int, Failure],
    totals: ChunkTotals,
    marks: Mapping[str, str],
    linear: Array | None = None,
    filters: Array | None = None,
) -> ChunkFile:
    """Write one chunk of samples as a file that is either there whole or not there.

    Parameters
    ----------
    begin : int
        Index of the first sample.
    identity : str
        Digest of the run.
    errors, outputs : ndarray, shapes (n, sources) and (n, outputs)
    failures : mapping of int to Failure
        Failures by row.
    marks : mapping of str to str
        Further entries of the file's metadata.
    linear : ndarray, shape (n, outputs), optional
        Outputs by the linear system with the same noise, where the schema has columns for them.
    filters : ndarray, shape (n, outputs + 1), optional
        Final sigmas of the samples' filters and the NEES, where the schema has columns for them.
    """
    count = len(errors)
    failed = np.zeros(count, dtype=bool)
    failed[list(failures)] = True
    columns = {"index": arrow_array(np.arange(begin, begin + count)), "status": _status_of(failures, count)}
    columns |= {name: arrow_array(values) for name, values in zip(layout.errors, errors.T, strict=True)}
    columns |= {name: arrow_array(values, failed) for name, values in zip(layout.outputs, outputs.T, strict=True)}
    if layout.linear and linear is not None:
        columns |= {name: arrow_array(values) for name, values in zip(layout.linear, linear.T, strict=True)}
    if layout.filter and filters is not None:
        columns |= {name: arrow_array(values, failed) for name, values in zip(layout.filter, filters.T, strict=True)}
    metadata = {"mcnav.identity": identity, "mcnav.handed_over": str(totals.fallback_count), **marks}
    if totals.tracebacks:
        metadata["mcnav.tracebacks"] = _packed({begin + row: text for row, text in totals.tracebacks.items()})
    table = pa.Table.from_arrays(list(columns.values()), names=list(columns))
    metadata[CHECKSUM] = _checksum_of(metadata)
    content = parquet_bytes(table.replace_schema_metadata(metadata), _TEXT)
    write_whole(folder / chunk_name(number), content)
    return _described(number, begin, totals.samples, totals.failed, totals.fallback_count, content)


def _status_of(failures: Mapping[int, Failure], count: int) -> pa.Array:
    """Return the status of each row as text."""
    if not failures:
        return repeated_text(OK, count)
    return arrow_texts([failures[row].status if row in failures else OK for row in range(count)])


def _checksum_of(marks: Mapping[str, str]) -> str:
    """SHA-256 of metadata, but for their own checksum."""
    digest = hashlib.sha256()
    for key in sorted(marks.keys() - {CHECKSUM}):
        digest.update(f"{key}\0{marks[key]}\0".encode())
    return digest.hexdigest()


def _is_as_written(content: bytes, table: pa.Table, marks: Mapping[str, str]) -> bool:
    """Return whether a file is what its table gives; files of earlier versions have their metadata twice instead."""
    if CHECKSUM in marks:
        return marks[CHECKSUM] == _checksum_of(marks) and parquet_bytes(table, _TEXT) == content
    return parquet_bytes(table, _TEXT, described_twice=True) == content


def _packed(tracebacks: Mapping[int, str]) -> str:
    """Tracebacks by index as text, each wording once, as many as there is room for."""
    texts: dict[str, list[int]] = {}
    room = MOST_TRACEBACKS
    for index, text in tracebacks.items():
        if text not in texts:
            room -= len(text)
            if room < 0:
                break
        texts.setdefault(text, []).append(index)
    return json.dumps([[text, indices] for text, indices in texts.items()])


def tracebacks_in(table: pa.Table) -> dict[int, str]:
    """Tracebacks of failed samples by index, as far as the file has them."""
    try:
        packed = json.loads((table.schema.metadata or {}).get(b"mcnav.tracebacks", b"[]"))
        return {int(index): str(text) for text, indices in packed for index in indices}
    except (ValueError, TypeError, RecursionError):
        return {}


def verify_chunk(folder: Path, number: int, identity: str, stored_rows: int | None = None) -> ChunkFile | None:
    """Return a chunk's file when it is undamaged and of this run.

    Besides the checksums of its pages, the file must be what writing its content again gives: so that a bit that has
    flipped anywhere is noticed, also where no checksum covers it. The file of a summary has the rows of samples below
    ``stored_rows``, and states in its metadata which samples it summarizes and how many of them failed.
    """
    try:
        content = read_whole(folder / chunk_name(number), LARGEST_TABLE)
        table = table_from(content, text=STATUS)
        marks = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
        whole = _is_as_written(content, table, marks)
        index, status = numbers_in(table.column("index")), table.column("status").to_pylist()
        fallback_count = int(marks["mcnav.handed_over"])
        if stored_rows is None:
            begin, count, rows = int(index[0]), len(index), len(index)
            failed = sum(entry != OK for entry in status)
        else:
            begin, count, failed = (int(marks[f"mcnav.{key}"]) for key in ("begin", "samples", "failed"))
            rows = min(max(stored_rows - begin, 0), count)
    except (OSError, pa.ArrowException, ValueError, KeyError, IndexError, TypeError):
        return None
    in_place = np.array_equal(index, np.arange(begin, begin + rows))
    if not whole or marks.get("mcnav.identity") != identity or not in_place:
        return None
    return _described(number, begin, count, failed, fallback_count, content)


def identities_in(folder: Path) -> set[str]:
    """Collect the identities of the chunks in a folder that can be read."""
    known = map(identity_in, sorted(folder.glob("part-*.parquet")))
    return {identity for identity in known if identity is not None}


def identity_in(path: Path) -> str | None:
    """Read the digest of the run that a chunk's file is of, unverified; none where it cannot be read."""
    with suppress(OSError, pa.ArrowException, ValueError, KeyError):
        marks = pq.read_schema(io.BytesIO(read_whole(path, LARGEST_TABLE))).metadata or {}
        return str(marks[b"mcnav.identity"], "utf-8")
    return None


def rewrite_marks(folder: Path, file: ChunkFile, change: Callable[[dict[str, str]], dict[str, str]]) -> ChunkFile:
    """Write a verified chunk again with other metadata, whole or not at all; its rows stay as they are."""
    table = read_table(folder / file.file, text=STATUS)
    marks = change({key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()})
    marks[CHECKSUM] = _checksum_of(marks)
    content = parquet_bytes(table.replace_schema_metadata(marks), _TEXT)
    write_whole(folder / file.file, content)
    return replace(file, sha256=hashlib.sha256(content).hexdigest())


def _described(number: int, begin: int, count: int, failed: int, fallback_count: int, content: bytes) -> ChunkFile:
    digest = hashlib.sha256(content).hexdigest()
    return ChunkFile(chunk_name(number), begin, begin + count, failed, fallback_count, digest)


def samples_from(table: pa.Table, layout: SampleSchema) -> Samples:
    """Convert a table to arrays of samples."""
    samples = room_for(len(table), layout)
    put(table, layout, samples, 0)
    return samples


def room_for(count: int, layout: SampleSchema) -> Samples:
    """Allocate arrays for samples; those of errors and outputs have their columns contiguous."""
    blocks = (
        np.empty((len(names), count)).T for names in (layout.errors, layout.outputs, layout.linear, layout.filter)
    )
    return Samples(np.empty(count, dtype=np.int64), [OK] * count, *blocks)


def put(table: pa.Table, layout: SampleSchema, samples: Samples, row: int) -> bool:
    """Put the samples of a table among others, from a row on.

    Returns whether they are in order of index from that number on, each with a status.
    """
    index, status = table.column("index"), table.column("status")
    whole = pa.types.is_integer(index.type) and pa.types.is_string(status.type) and status.null_count == 0
    first, rows = row, slice(row, row + len(table))
    samples.index[rows] = numbers_in(index)
    blocks = (
        (samples.errors, layout.errors),
        (samples.outputs, layout.outputs),
        (samples.linear, layout.linear),
        (samples.filter, layout.filter),
    )
    for array, names in blocks:
        for column, name in zip(array.T, names, strict=True):
            column[rows] = numbers_in(table.column(name))
    for chunk in status.chunks:
        if not chunk.equals(repeated_text(OK, len(chunk))):
            samples.status[row : row + len(chunk)] = chunk.to_pylist()
        row += len(chunk)
    return whole and np.array_equal(samples.index[rows], np.arange(first, first + len(table)))
