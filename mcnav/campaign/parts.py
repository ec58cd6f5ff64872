"""Sample files: one chunk each, in parquet, believed by its content."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from mcnav.campaign.files import parquet_bytes, write_whole
from mcnav.scenarios.protocol import Outcomes

Array = NDArray[np.float64]

OK: Final = "ok"
_TEXT: Final = ("status",)


@dataclass(frozen=True)
class Part:
    """What the manifest says of one file of samples [begin, end)."""

    file: str
    begin: int
    end: int
    failed: int
    handed_over: int
    sha256: str


@dataclass(frozen=True)
class Samples:
    """All samples of a run.

    Attributes
    ----------
    index : ndarray of int, shape (n,)
    status : tuple of str
        ``ok``, or why the sample failed.
    errors : ndarray, shape (n, sources)
        SI.
    outputs : ndarray, shape (n, outputs)
        SI; NaN in the row of a sample that failed.
    """

    index: NDArray[np.int64]
    status: tuple[str, ...]
    errors: Array
    outputs: Array


@dataclass(frozen=True)
class Layout:
    """Columns of the sample files: ``error NAME [unit]`` and ``output NAME [unit]``."""

    errors: tuple[str, ...]
    outputs: tuple[str, ...]

    @classmethod
    def of(cls, sources: Sequence[Any], outputs: Sequence[Any]) -> Layout:
        """The layout for the sources and outputs of a scenario."""
        return cls(
            tuple(f"error {source.name} [{source.unit}]" for source in sources),
            tuple(f"output {output.name} [{output.unit}]" for output in outputs),
        )


def part_name(number: int) -> str:
    """File name of a part by its number."""
    return f"part-{number:05d}.parquet"


def write_part(
    place: Path, number: int, begin: int, identity: str, layout: Layout, errors: Array, outcomes: Outcomes
) -> Part:
    """Store one chunk of samples in a folder, whole.

    Parameters
    ----------
    place : Path
        Folder of the parts.
    number, begin : int
        Of the part, and of its first sample.
    identity : str
        Digest of the run.
    layout : Layout
    errors, outcomes
        Of the chunk's samples.
    """
    count = len(errors)
    status = [f"failed: {outcomes.failures[row]}" if row in outcomes.failures else OK for row in range(count)]
    columns: dict[str, Any] = {"index": np.arange(begin, begin + count), "status": pa.array(status)}
    columns.update(zip(layout.errors, errors.T, strict=True))
    failed = np.isnan(outcomes.values).any(axis=1)
    for name, values in zip(layout.outputs, outcomes.values.T, strict=True):
        columns[name] = pa.array(np.ascontiguousarray(values), mask=failed)
    table = pa.table({name: pa.array(column) for name, column in columns.items()})
    marks = {"mcnav.identity": identity, "mcnav.handed_over": str(outcomes.handed_over)}
    content = parquet_bytes(table.replace_schema_metadata(marks), _TEXT)
    write_whole(place / part_name(number), content)
    return _described(number, begin, count, int(failed.sum()), outcomes.handed_over, content)


def verified_part(place: Path, number: int, begin: int, end: int, identity: str) -> Part | None:
    """The part for samples [begin, end), when a whole one of this very run is there.

    Besides the checksums of its pages, the file must be what writing its content again gives: so that a bit that has
    flipped anywhere is noticed, also where no checksum covers it.
    """
    try:
        content = (place / part_name(number)).read_bytes()
        table = pq.read_table(io.BytesIO(content), page_checksum_verification=True)
        marks = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
        whole = parquet_bytes(table, _TEXT) == content
        index, status = table.column("index").to_numpy(), table.column("status").to_pylist()
        handed_over = int(marks["mcnav.handed_over"])
    except (OSError, pa.ArrowException, ValueError, KeyError):
        return None
    if not whole or marks.get("mcnav.identity") != identity or not np.array_equal(index, np.arange(begin, end)):
        return None
    return _described(number, begin, end - begin, sum(entry != OK for entry in status), handed_over, content)


def _described(number: int, begin: int, count: int, failed: int, handed_over: int, content: bytes) -> Part:
    return Part(part_name(number), begin, begin + count, failed, handed_over, hashlib.sha256(content).hexdigest())


def samples_from(table: pa.Table, layout: Layout) -> Samples:
    """The samples of a table as arrays."""

    def block(names: Sequence[str]) -> Array:
        columns = [table.column(name).to_numpy(zero_copy_only=False) for name in names]
        return np.column_stack(columns).astype(float)

    index = np.asarray(table.column("index").to_numpy(), dtype=np.int64)
    return Samples(index, tuple(table.column("status").to_pylist()), block(layout.errors), block(layout.outputs))


def as_records(parts: Sequence[Part]) -> list[dict[str, Any]]:
    """Parts as the manifest lists them, in the order of their samples."""
    return [asdict(part) for part in sorted(parts, key=lambda part: part.begin)]
